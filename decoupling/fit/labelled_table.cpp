#include "decoupling/fit/labelled_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "config/names.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/csv_time.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxSessions = 1000, kSessionsOfFewRows = 20;
constexpr std::size_t kMaxFaults = 10;  // lines of a message

// The first of several faults of one kind.
struct Repeated {
    std::string first;
    std::size_t count = 0;
    void add(const std::string& text) {
        if (count++ == 0) first = text;
    }
    void say(std::vector<std::string>& faults) const {
        if (count > 0)
            faults.push_back(count == 1 ? first : fmt::format("{}; also in {} rows after that", first, count - 1));
    }
};

// Looks for numbers that may have marks of thousands: "20,502" between tabs, "20.502" between semicolons. A mark is one of
// decimals if one number has it at another place, or one of its column reaches 1000 without a mark.
class Thousands {
public:
    explicit Thousands(std::size_t columns) : columns_(columns) {}
    void look(std::size_t column, std::string_view cell) {
        constexpr std::string_view kDigits = "0123456789";
        const std::string_view text = cell.substr(cell.starts_with('-') || cell.starts_with('+') ? 1 : 0);
        const std::size_t mark = std::min(text.find_first_not_of(kDigits), text.size());
        if (mark == text.size()) {
            columns_[column].is_large = columns_[column].is_large || mark > 3;
            return;
        }
        const std::string_view behind = text.substr(mark + 1);
        if ((text[mark] != '.' && text[mark] != ',') || behind.find_first_not_of("0123456789eE+-") != behind.npos) return;
        if (mark >= 1 && mark <= 3 && text[0] != '0' && behind.size() == 3 &&
            behind.find_first_not_of(kDigits) == behind.npos) {
            columns_[column].has_mark = true;
            if (first_.empty()) first_ = cell;
        } else {
            is_decimal_ = true;
        }
    }
    // Returns the first number in doubt; "" if there is none.
    [[nodiscard]] std::string doubt() const {
        const bool is_proved = is_decimal_ || std::any_of(columns_.begin(), columns_.end(),
                                                          [](const Seen& each) { return each.has_mark && each.is_large; });
        return is_proved ? "" : first_;
    }

private:
    struct Seen {
        bool has_mark = false, is_large = false;
    };
    std::vector<Seen> columns_;
    bool is_decimal_ = false;
    std::string first_;
};

class TableReader {
public:
    TableReader(const std::string& path, const Selection& selection)
        : selection_(selection),
          csv_(path, selection.columns),
          time_(csv_.columns()),
          cell_(csv_.columns().size()),
          thousands_(csv_.columns().size()) {}

    LabelledTable read() {
        table_.name = csv_.name();
        header_ = fmt::format("{}:{}: ", csv_.name(), csv_.line());
        std::vector<std::string> faults;
        std::vector<std::string> chosen = selection_.channels;
        for (std::string& name : chosen)
            if (const auto at = csv_.find(name)) name = csv_.columns()[*at];
        table_.columns = class_columns(csv_.columns(), chosen, selection_.known, faults);
        add_faults(faults);
        for (std::size_t k = 0; k < table_.columns.size(); ++k) table_.columns[k].has_name = csv_.has_name(k);
        for (std::size_t k = 0; k < table_.columns.size(); ++k)
            if (table_.columns[k].kind == ColumnKind::session && table_.columns[k].is_used) session_ = k;
        table_.values.resize(csv_.columns().size());
        numbers_.resize(csv_.columns().size());
        while (next_row()) read_row();
        finish();
        return std::move(table_);
    }

private:
    void add_faults(const std::vector<std::string>& faults) {
        for (const std::string& fault : faults) table_.faults.push_back(header_ + fault);
    }
    // Returns false at the end. A row with another number of cells is a fault and is skipped.
    bool next_row() {
        for (;;) {
            try {
                return csv_.next();
            } catch (const SetupError& error) { row_.add(error.what()); }
            if (csv_.line() == last_line_) return false;  // reading itself failed
            last_line_ = csv_.line();
        }
    }
    void read_row() {
        if (session_ && !read_session()) return;
        if (table_.rows() == 0) look_for_dates();
        table_.line.push_back(csv_.line());
        std::optional<std::int64_t> t_ns;
        if (time_.is_there()) try {
                t_ns = time_.read(csv_);
            } catch (const SetupError& error) { time_fault_.add(error.what()); }
        table_.t_ns.push_back(t_ns);
        for (std::size_t k = 0; k < table_.values.size(); ++k) {
            if (csv_.separator() != ',') thousands_.look(k, csv_.text(k));
            const bool is_number =
                table_.columns[k].kind != ColumnKind::time && table_.columns[k].kind != ColumnKind::session;
            const auto value = is_number ? csv_.value(k) : kNaN;
            if (!value) cell_[k].add(fmt::format("{}:{}: {}", csv_.name(), csv_.line(), csv_.fault(k)));
            numbers_[k] += value && std::isfinite(*value) ? 1 : 0;
            const Column& column = table_.columns[k];
            table_.values[k].push_back(column.factor * value.value_or(kNaN) + column.offset);
        }
    }
    // Returns false if the row's session was not chosen.
    bool read_session() {
        const std::string name(csv_.text(*session_));
        if (name.empty()) {
            session_fault_.add(fmt::format("{}:{}: column {} is empty; which session is this row of?", csv_.name(),
                                           csv_.line(), csv_.columns()[*session_]));
            return false;
        }
        if (std::find(seen_.begin(), seen_.end(), name) == seen_.end()) {
            if (seen_.size() == kMaxSessions) {
                session_fault_.add(
                    fmt::format("{}:{}: more than {} sessions; a session is one mounting or one recording, not "
                                "one row",
                                csv_.name(), csv_.line(), kMaxSessions));
                return false;
            }
            seen_.push_back(name);
        }
        const auto& wanted = selection_.sessions;
        if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) return false;
        const auto at = std::find(table_.sessions.begin(), table_.sessions.end(), name);
        table_.session.push_back(std::size_t(at - table_.sessions.begin()));
        if (at == table_.sessions.end()) table_.sessions.push_back(name);
        return true;
    }
    void look_for_dates() {
        if (!time_.is_there()) time_.look_at(csv_);
        for (std::size_t k = 0; k < table_.columns.size(); ++k) {
            Column& column = table_.columns[k];
            if (column.kind == ColumnKind::unknown && is_date(csv_.text(k))) column.kind = ColumnKind::time;
            const auto used = time_.columns();
            if (std::find(used.begin(), used.end(), k) != used.end()) column.is_used = column.kind == ColumnKind::time;
        }
    }
    void finish() {
        table_.about = csv_.about();
        table_.time_about = time_.is_there() ? time_.about() : "";
        for (const std::size_t k : time_.columns()) table_.columns[k].note = table_.time_about;
        if (selection_.channels.empty() && !selection_.only_labels) {
            check_counts(table_);
            std::vector<std::string> faults;
            find_channels(table_.columns, faults);
            add_faults(faults);
            set_texts();
            check_column_data(table_);
        }
        for (std::size_t k = 0; k < table_.columns.size(); ++k)
            if (table_.columns[k].is_used) cell_[k].say(table_.faults);
        for (const Repeated* fault : {&row_, &time_fault_, &session_fault_}) fault->say(table_.faults);
        if (time_.is_there()) check_whole_seconds();
        if (const std::string number = thousands_.doubt(); !number.empty())
            table_.faults.push_back(
                fmt::format("{}\"{}\" and all numbers like it: thousands or decimals? Write thousands without "
                            "a mark, or all decimals with another number of digits",
                            header_, number));
        check_sessions();
    }
    void set_texts() {
        for (std::size_t k = 0; k < table_.columns.size(); ++k) {
            Column& column = table_.columns[k];
            if (column.kind != ColumnKind::unknown || !column.note.empty() || numbers_[k] > 0) continue;
            column.kind = cell_[k].count > 0 ? ColumnKind::text : ColumnKind::constant;
            column.note = cell_[k].count > 0 ? "" : "empty";
        }
    }
    // Times in whole seconds: without a unit in the name they may be milliseconds; with several rows in each second their
    // parts are missing. One time with a part of a second removes both doubts.
    void check_whole_seconds() {
        std::size_t steps = 0, repeats = 0;
        for (std::size_t i = 0; i < table_.rows(); ++i) {
            if (!table_.t_ns[i]) continue;
            if (*table_.t_ns[i] % 1'000'000'000 != 0) return;
            if (i > 0 && table_.t_ns[i - 1]) ++(*table_.t_ns[i] != *table_.t_ns[i - 1] ? steps : repeats);
        }
        if (steps == 0) return;
        if (!time_.is_assumed() && repeats > steps)
            table_.faults.push_back(
                fmt::format("{}column {}: whole seconds with several rows in each; write the parts of a second, "
                            "too, or delete the column",
                            header_, table_.columns[time_.columns()[0]].name));
        if (time_.is_assumed())
            table_.faults.push_back(
                fmt::format("{}no unit: {}; its numbers are whole, so that seconds are in doubt: name it t_s, "
                            "t_ms, t_us or t_ns",
                            header_, table_.columns[time_.columns()[0]].name));
    }
    void check_sessions() {
        const auto add = [&](const std::string& text) { table_.faults.push_back(text); };
        if (!selection_.sessions.empty() && !session_) add(header_ + "has no column \"session\" to choose from");
        for (const auto& name : selection_.sessions)
            if (session_ && std::find(seen_.begin(), seen_.end(), name) == seen_.end())
                add(fmt::format("{}: has no session \"{}\"; its sessions are {}", csv_.name(), name, fmt::join(seen_, " ")));
        if (table_.rows() == 0 && row_.count == 0) add(csv_.name() + ": has no rows");
        if (table_.sessions.size() > kSessionsOfFewRows && table_.rows() < 2 * table_.sessions.size())
            add(fmt::format("{}: {} sessions in {} rows; a session is one mounting or one recording, not one row",
                            csv_.name(), table_.sessions.size(), table_.rows()));
    }

    const Selection& selection_;
    CsvReader csv_;
    TimeColumn time_;
    LabelledTable table_;
    std::string header_;  // "file:line: " of the header
    std::optional<std::size_t> session_;
    std::vector<std::string> seen_;  // sessions, chosen or not
    std::vector<Repeated> cell_;     // per column
    Thousands thousands_;
    std::vector<std::size_t> numbers_;
    Repeated row_, time_fault_, session_fault_;
    std::int64_t last_line_ = -1;
};

}  // namespace

std::string LabelledTable::list() const {
    return list_of_columns(
        about.empty() ? fmt::format("columns of {}:", name) : fmt::format("columns of {} ({}):", name, about), columns);
}

LabelledTable read_labelled_table(const std::string& path, const Selection& selection) {
    return TableReader(path, selection).read();
}

void refuse_faults(const std::vector<const LabelledTable*>& tables) {
    std::vector<std::string> faults;
    std::string lists;
    for (const LabelledTable* table : tables) {
        faults.insert(faults.end(), table->faults.begin(), table->faults.end());
        lists += "\n" + table->list();
    }
    if (faults.empty()) return;
    lists.pop_back();  // the line feed at the end
    if (faults.size() > kMaxFaults) {
        const std::size_t more = faults.size() - kMaxFaults + 1;
        faults.resize(kMaxFaults - 1);
        faults.push_back(fmt::format("and {} more faults", more));
    }
    throw SetupError(fmt::format("{}{}", fmt::join(faults, "\n"), lists));
}

}  // namespace tactiled
