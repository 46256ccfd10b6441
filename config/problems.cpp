#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <tuple>

#include "config/options_node.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kLongestName = 64;   // a longer word is not a mistyped key, and comparing it would take long
constexpr std::size_t kLongestQuote = 60;  // bytes

char lower(char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; }

// Optimal string alignment: insertions, deletions, replacements and swaps of neighbours, which are the usual typing
// errors. Upper and lower case count as equal.
std::size_t distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), now(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        now[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const bool same = lower(a[i - 1]) == lower(b[j - 1]);
            now[j] = std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
            if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) && lower(a[i - 2]) == lower(b[j - 1]))
                now[j] = std::min(now[j], before[j - 2] + 1);
        }
        std::swap(before, last);
        std::swap(last, now);
    }
    return last[b.size()];
}

bool one_starts_the_other(std::string_view a, std::string_view b) {
    return std::min(a.size(), b.size()) >= 3 && (a.substr(0, b.size()) == b || b.substr(0, a.size()) == a);
}

}  // namespace

void Problems::add(const std::string& file, std::uint32_t line, const std::string& text, std::uint32_t column) {
    list_.push_back({file, line, column, text});
}

std::vector<std::string> Problems::lines() const {
    auto sorted = list_;
    for (const Problem& back : list_)
        if (back.column == kTakesBack)
            std::erase_if(
                sorted, [&](const Problem& p) { return p.line == back.line && p.file == back.file && p.text == back.text; });
    std::stable_sort(sorted.begin(), sorted.end(), [](const Problem& a, const Problem& b) {
        return std::tie(a.file, a.line, a.column) < std::tie(b.file, b.line, b.column);
    });
    std::vector<std::string> lines;
    for (const auto& [file, line, column, text] : sorted) {
        std::string one = file;
        if (line != 0) one += fmt::format(":{}", line);
        if (column != 0) one += fmt::format(":{}", column);
        one += ": " + text;
        if (std::find(lines.begin(), lines.end(), one) == lines.end()) lines.push_back(std::move(one));
    }
    return lines;
}

void Problems::throw_if_any() const {
    if (!list_.empty()) throw SetupError(fmt::format("{}", fmt::join(lines(), "\n")));
}

std::optional<std::string> nearest_name(std::string_view name, const std::vector<std::string>& known) {
    if (name.size() > kLongestName) return std::nullopt;
    std::optional<std::string> nearest;
    std::size_t min = 0;
    for (const auto& candidate : known) {
        if (candidate.size() > kLongestName) continue;
        // One error in three letters is accepted; "baudrate" for "baud" and "stale" for "stale_ms" are accepted, too.
        const std::size_t max = (std::max(name.size(), candidate.size()) + 1) / 3;
        std::size_t slips = distance(name, candidate);
        if (slips > 1 && one_starts_the_other(name, candidate)) slips = 1;
        if (slips > max || (nearest && slips >= min)) continue;
        nearest = candidate;
        min = slips;
    }
    return nearest;
}

std::string is_unknown(std::string_view name, const std::vector<std::string>& known) {
    const auto near = nearest_name(name, known);
    return fmt::format("is unknown; {}known: \"{}\"", near ? fmt::format("did you mean \"{}\"? ", *near) : "",
                       fmt::join(known, "\", \""));
}

std::string in_quotes(std::string_view text) {
    std::string out = "\"";
    std::size_t i = 0;
    for (; i < text.size(); ++i) {
        const auto byte = static_cast<unsigned char>(text[i]);
        const bool starts_a_character = (byte & 0xC0u) != 0x80u;
        if (i >= kLongestQuote && starts_a_character) break;
        const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0u;
        if (byte < 0x20 || byte == 0x7F)
            out += fmt::format("\\x{:02x}", byte);
        else if (byte == 0xC2 && next >= 0x80 && next < 0xA0)  // U+0080 .. U+009F control terminals as well
            out += fmt::format("\\x{:02x}", unsigned(text[++i]) & 0xFFu);
        else
            out += text[i];
    }
    if (i < text.size()) out += "...";
    return out + "\"";
}

}  // namespace tactiled
