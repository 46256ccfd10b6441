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

class TableReader {
public:
    TableReader(const std::string& path, const Selection& selection)
        : selection_(selection), csv_(path, selection.columns), time_(csv_.columns()), cell_(csv_.columns().size()) {}

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
        if (time_.is_assumed()) check_assumed_seconds();
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
    // Numbers of a time without a unit are taken as seconds if one of them has parts of a second. Whole numbers that differ
    // may as well be milliseconds.
    void check_assumed_seconds() {
        double steps = 0;
        for (std::size_t i = 0; i < table_.rows(); ++i) {
            if (!table_.t_ns[i]) continue;
            if (*table_.t_ns[i] % 1'000'000'000 != 0) return;
            if (i > 0 && table_.t_ns[i - 1] && *table_.t_ns[i] != *table_.t_ns[i - 1]) ++steps;
        }
        if (steps > 0)
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
