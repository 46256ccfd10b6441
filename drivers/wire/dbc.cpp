#include "drivers/wire/dbc.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>

namespace tactiled {
namespace {

constexpr std::size_t kMaxMessages = 10'000, kMaxSignals = 2'000 /* a message */, kMaxProblems = 20;
constexpr std::size_t kLongestName = 128;  // the format's own limit is 32; present writers exceed it
// limit of a transport protocol's message; for a signal that is used it is 64
constexpr unsigned kMaxMessageBytes = 4095;
constexpr std::uint32_t kExtended = 0x8000'0000u;
constexpr std::uint32_t kNoMessage = 0xC000'0000u;  // VECTOR__INDEPENDENT_SIG_MSG: signals without a message
constexpr std::string_view kBlanks = " \t\r";

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

// A line that is read from the left.
class Cursor {
public:
    explicit Cursor(std::string_view rest) : rest_(rest) {}

    [[nodiscard]] bool ended() {
        skip_blanks();
        return rest_.empty();
    }
    bool take(char wanted) {
        skip_blanks();
        if (rest_.empty() || rest_.front() != wanted) return false;
        rest_.remove_prefix(1);
        return true;
    }
    // Returns a C identifier, "" if there is none.
    std::string_view word() {
        skip_blanks();
        std::size_t n = 0;
        while (n < rest_.size() && (is_letter(rest_[n]) || (n > 0 && is_digit(rest_[n])))) ++n;
        const std::string_view word = rest_.substr(0, n);
        rest_.remove_prefix(n);
        return word;
    }
    template <class T>
    bool number(T& value) {
        skip_blanks();
        if (rest_.size() > 1 && rest_[0] == '+' && rest_[1] != '-') rest_.remove_prefix(1);
        if (rest_.empty() || !(is_digit(rest_[0]) || rest_[0] == '-' || rest_[0] == '.'))
            return false;  // no "inf", no "nan"
        const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
        if (error != std::errc{}) return false;
        rest_.remove_prefix(std::size_t(end - rest_.data()));
        return true;
    }

private:
    void skip_blanks() {
        const std::size_t n = std::min(rest_.find_first_not_of(kBlanks), rest_.size());
        rest_.remove_prefix(n);
    }
    std::string_view rest_;
};

class Parser {
public:
    Parser(std::string_view text, const std::string& file, Problems& problems)
        : text_(text), file_(file), problems_(problems) {}

    Dbc parse() {
        while (at_ < text_.size() && reported_ < kMaxProblems) {
            const std::string_view line = next_statement();
            Cursor cursor(line);
            const std::string_view keyword = cursor.word();
            if (cursor.ended()) continue;  // empty, or an entry of the list NS_
            if (keyword == "BO_")
                message(cursor);
            else if (keyword == "SG_")
                signal(cursor);
            else if (keyword == "SIG_VALTYPE_")
                value_type(cursor);
            else if (keyword == "SG_MUL_VAL_")
                nested_mux(cursor);
        }
        if (reported_ == 0) check();
        return std::move(dbc_);
    }

private:
    void problem(const std::string& text, std::uint32_t line) {
        if (reported_++ < kMaxProblems) problems_.add(file_, line, text);
    }
    void problem(const std::string& text) { problem(text, line_); }

    // Returns a line, and the following lines if a quoted text continues on them. `line_` is the number of the first
    // one.
    std::string_view next_statement() {
        const std::size_t begin = at_;
        line_ = next_line_;
        bool quoted = false;
        for (; at_ < text_.size(); ++at_) {
            const char c = text_[at_];
            next_line_ += c == '\n';
            if (c == '\n' && !quoted) break;
            if (c == '\\' && quoted && at_ + 1 < text_.size() && text_[at_ + 1] != '\n') {
                ++at_;
            } else if (c == '"') {
                quoted = !quoted;
            }
        }
        if (quoted) problem("a quoted text that begins here never ends; close it with \"");
        const std::string_view line = text_.substr(begin, at_ - begin);
        if (at_ < text_.size()) ++at_;
        return line;
    }

    // BO_ 291 Fingertip: 8 GRIPPER
    void message(Cursor& cursor) {
        constexpr const char* kWanted = "should be: BO_ ID NAME: BYTES SENDER";
        in_message_ = false;
        std::uint32_t id = 0;
        DbcMessage found;
        if (!cursor.number(id)) return problem(fmt::format("the message's id is no number of 32 bits; {}", kWanted));
        found.name = cursor.word();
        found.line = line_;
        if (found.name.empty() || !cursor.take(':') || !cursor.number(found.bytes)) return problem(kWanted);
        const std::string what = fmt::format("message {}", in_quotes(found.name));
        if (found.name.size() > kLongestName)
            return problem(fmt::format("{}: the name has more than {} letters", what, kLongestName));
        skip_signals_ = id == kNoMessage;
        if (skip_signals_) return;
        found.extended = (id & kExtended) != 0;
        found.id = id & ~kExtended;
        const std::uint32_t max = found.extended ? 0x1FFF'FFFF : 0x7FF;
        if (found.id > max)
            return problem(fmt::format("{}: id {:#x} is larger than {:#x}{}", what, found.id, max,
                                       found.extended ? "" : "; an id of 29 bits is written with bit 31 set, + 2147483648"));
        if (found.bytes > kMaxMessageBytes)
            return problem(fmt::format("{}: {} bytes; a message has at most {}", what, found.bytes, kMaxMessageBytes));
        if (dbc_.messages.size() == kMaxMessages) return problem(fmt::format("more than {} messages", kMaxMessages));
        if (const auto same = by_id_.find(id); same != by_id_.end())
            return problem(fmt::format("{} has the id of the one in line {}", what, dbc_.messages[same->second].line));
        if (const auto same = by_name_.find(found.name); same != by_name_.end())
            return problem(fmt::format("{} is there already, in line {}", what, same->second));
        by_id_.emplace(id, dbc_.messages.size());
        by_name_.emplace(found.name, line_);
        dbc_.messages.push_back(std::move(found));
        signal_lines_.clear();
        in_message_ = true;
    }

    // SG_ Fx m0 : 7|16@0- (0.01,0) [-320|320] "N" PLC
    void signal(Cursor& cursor) {
        if (skip_signals_) return;
        if (!in_message_) {
            if (reported_ == 0) problem("a signal that belongs to no message; SG_ stands below its BO_");
            return;  // an error of its message is reported already
        }
        DbcMessage& message = dbc_.messages.back();
        DbcSignal found;
        found.line = line_;
        found.name = cursor.word();
        const std::string what = fmt::format("signal {}", in_quotes(found.name));
        if (found.name.empty() || found.name.size() > kLongestName)
            return problem(fmt::format("the signal's name is missing or has more than {} letters", kLongestName));
        const std::string_view mux = cursor.word();
        if (!mux.empty() && !multiplexer(mux, found, message))
            return problem(fmt::format("{}: {} is no multiplexer; should be M, or m and a number", what, in_quotes(mux)));
        CanSignal& s = found.signal;
        unsigned order = 2;
        if (!cursor.take(':') || !cursor.number(s.start) || !cursor.take('|') || !cursor.number(s.length) ||
            !cursor.take('@') || !cursor.number(order) || order > 1)
            return problem(
                fmt::format("{}: should be: SG_ NAME : START|LENGTH@ORDER, with ORDER 0 (Motorola) or 1 (Intel)", what));
        s.order = order == 1 ? CanSignal::Order::intel : CanSignal::Order::motorola;
        const bool is_signed = cursor.take('-');
        if (!is_signed && !cursor.take('+'))
            return problem(fmt::format("{}: after the order comes + (unsigned) or - (signed)", what));
        if (is_signed) s.type = CanSignal::Type::is_signed;
        if (!cursor.take('(') || !cursor.number(s.factor) || !cursor.take(',') || !cursor.number(s.offset) ||
            !cursor.take(')'))
            return problem(fmt::format("{}: then comes (FACTOR,OFFSET), two numbers", what));
        if (const std::string why = why_no_signal(s, std::min<std::size_t>(message.bytes, kMaxMessageBytes)); !why.empty())
            // The message of a transport protocol is longer than a frame. Its signals beyond 64 bytes are ignored.
            if (message.bytes <= kCanMaxBytes) return problem(fmt::format("{}: {}", what, why));
        if (message.signals.size() == kMaxSignals)
            return problem(fmt::format("more than {} signals in a message", kMaxSignals));
        const auto [same, is_new] = signal_lines_.emplace(found.name, line_);
        if (!is_new) return problem(fmt::format("{} is there already, in line {}", what, same->second));
        message.signals.push_back(std::move(found));
    }

    // Parses "M", "m7" or "m7M". Returns false for any other word.
    bool multiplexer(std::string_view word, DbcSignal& found, DbcMessage& message) {
        if (word == "M") return found.selects = true;
        if (word.front() != 'm') return false;
        std::uint32_t value = 0;
        const auto [end, error] = std::from_chars(word.data() + 1, word.data() + word.size(), value);
        if (error != std::errc{}) return false;
        found.mux = value;
        const std::string_view rest(end, std::size_t(word.data() + word.size() - end));
        if (rest == "M") message.nested_mux_line = line_;
        return rest.empty() || rest == "M";
    }

    // SIG_VALTYPE_ 291 Fx : 1;
    void value_type(Cursor& cursor) {
        std::uint32_t id = 0;
        unsigned type = 3;
        std::string_view name;
        if (!cursor.number(id) || (name = cursor.word()).empty())
            return problem("should be: SIG_VALTYPE_ ID SIGNAL : TYPE;");
        (void)cursor.take(':');  // some writers omit it
        if (!cursor.number(type) || type > 2)
            return problem("the type of SIG_VALTYPE_ should be 0 (integer), 1 (float) or 2 (double)");
        DbcSignal* const signal = look_up(id, name);
        if (signal == nullptr || type == 0) return;
        const unsigned bits = type == 1 ? 32 : 64;
        if (signal->signal.length != bits)
            return problem(fmt::format("signal {} is said to be a float of {} bits, but has {} in line {}",
                                       in_quotes(signal->name), bits, signal->signal.length, signal->line));
        signal->signal.type = CanSignal::Type::is_float;
    }

    // SG_MUL_VAL_ 291 Fx Which 0-3;
    void nested_mux(Cursor& cursor) {
        std::uint32_t id = 0;
        if (!cursor.number(id)) return problem("should be: SG_MUL_VAL_ ID SIGNAL SELECTOR RANGES;");
        if (const auto at = by_id_.find(id); at != by_id_.end()) dbc_.messages[at->second].nested_mux_line = line_;
    }

    // Returns nullptr and reports an error if there is no such signal.
    DbcSignal* look_up(std::uint32_t id, std::string_view name) {
        if (id == kNoMessage) return nullptr;
        const auto at = by_id_.find(id);
        if (at == by_id_.end()) {
            problem(fmt::format("there is no message with id {}", id));
            return nullptr;
        }
        for (auto& signal : dbc_.messages[at->second].signals)
            if (signal.name == name) return &signal;
        problem(fmt::format("message {} has no signal {}", in_quotes(dbc_.messages[at->second].name), in_quotes(name)));
        return nullptr;
    }

    void check() {
        for (const auto& message : dbc_.messages) {
            const DbcSignal* const selector = message.selector();
            for (const auto& signal : message.signals) {
                if (message.nested_mux_line != 0) break;  // refused if the signal is used
                const std::string what = fmt::format("signal {}", in_quotes(signal.name));
                if (signal.selects && &signal != selector)
                    problem(fmt::format("{} selects (M), but so does {}", what, in_quotes(selector->name)), signal.line);
                if (signal.selects && signal.signal.type != CanSignal::Type::is_unsigned)
                    problem(fmt::format("{} selects (M), but is not unsigned", what), signal.line);
                if (signal.mux && selector == nullptr)
                    problem(
                        fmt::format("{} is multiplexed (m{}), but no signal of its message selects (M)", what, *signal.mux),
                        signal.line);
            }
        }
    }

    std::string_view text_;
    const std::string& file_;
    Problems& problems_;
    std::size_t at_ = 0, reported_ = 0;
    std::uint32_t line_ = 1, next_line_ = 1;
    Dbc dbc_;
    std::map<std::uint32_t, std::size_t> by_id_;  // with bit 31, as in the file
    std::map<std::string, std::uint32_t, std::less<>> by_name_, signal_lines_;
    bool in_message_ = false, skip_signals_ = false;
};

}  // namespace

const DbcSignal* DbcMessage::find(std::string_view signal) const {
    for (const auto& each : signals)
        if (each.name == signal) return &each;
    return nullptr;
}

const DbcSignal* DbcMessage::selector() const {
    for (const auto& each : signals)
        if (each.selects) return &each;
    return nullptr;
}

const DbcMessage* Dbc::find(std::string_view message) const {
    for (const auto& each : messages)
        if (each.name == message) return &each;
    return nullptr;
}

Dbc parse_dbc(std::string_view text, const std::string& file, Problems& problems) {
    return Parser(text, file, problems).parse();
}

}  // namespace tactiled
