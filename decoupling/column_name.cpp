#include "decoupling/column_name.hpp"

#include <algorithm>
#include <cctype>
#include <numbers>
#include <set>

namespace tactiled {
namespace {

constexpr double kG = 9.80665;                // m/s2, exact: 3rd CGPM, 1901
constexpr double kPound_N = 4.4482216152605;  // exact: NIST SP 811, appendix B.8
constexpr double kInch_m = 0.0254, kFoot_m = 0.3048;

// The one table of units. A letter's case counts in the first place only, because m and M are different prefixes.
constexpr ColumnUnit kUnits[] = {
    {"N", Quantity::force, 1},
    {"newton", Quantity::force, 1},
    {"newtons", Quantity::force, 1},
    {"mN", Quantity::force, 1e-3},
    {"cN", Quantity::force, 1e-2},
    {"dN", Quantity::force, 1e-1},
    {"kN", Quantity::force, 1e3},
    {"uN", Quantity::force, 1e-6},
    {"\u00b5N", Quantity::force, 1e-6},
    {"g", Quantity::force, 1e-3 * kG},
    {"gf", Quantity::force, 1e-3 * kG},
    {"gram", Quantity::force, 1e-3 * kG},
    {"grams", Quantity::force, 1e-3 * kG},
    {"mg", Quantity::force, 1e-6 * kG},
    {"kg", Quantity::force, kG},
    {"kgf", Quantity::force, kG},
    {"kp", Quantity::force, kG},
    {"lb", Quantity::force, kPound_N},
    {"lbs", Quantity::force, kPound_N},
    {"lbf", Quantity::force, kPound_N},
    {"oz", Quantity::force, kPound_N / 16},
    {"ozf", Quantity::force, kPound_N / 16},
    {"Nm", Quantity::moment, 1},
    {"mNm", Quantity::moment, 1e-3},
    {"uNm", Quantity::moment, 1e-6},
    {"cNm", Quantity::moment, 1e-2},
    {"kNm", Quantity::moment, 1e3},
    {"Nmm", Quantity::moment, 1e-3},
    {"Ncm", Quantity::moment, 1e-2},
    {"gmm", Quantity::moment, 1e-6 * kG},
    {"gcm", Quantity::moment, 1e-5 * kG},
    {"gfcm", Quantity::moment, 1e-5 * kG},
    {"kgcm", Quantity::moment, 1e-2 * kG},
    {"kgfcm", Quantity::moment, 1e-2 * kG},
    {"kgm", Quantity::moment, kG},
    {"kgfm", Quantity::moment, kG},
    {"lbin", Quantity::moment, kPound_N* kInch_m},
    {"lbfin", Quantity::moment, kPound_N* kInch_m},
    {"inlb", Quantity::moment, kPound_N* kInch_m},
    {"inlbf", Quantity::moment, kPound_N* kInch_m},
    {"ftlb", Quantity::moment, kPound_N* kFoot_m},
    {"lbft", Quantity::moment, kPound_N* kFoot_m},
    {"lbfft", Quantity::moment, kPound_N* kFoot_m},
    {"ozin", Quantity::moment, kPound_N / 16 * kInch_m},
    {"ozfin", Quantity::moment, kPound_N / 16 * kInch_m},
    {"s", Quantity::time, 1},
    {"sec", Quantity::time, 1},
    {"secs", Quantity::time, 1},
    {"second", Quantity::time, 1},
    {"seconds", Quantity::time, 1},
    {"ms", Quantity::time, 1e-3},
    {"msec", Quantity::time, 1e-3},
    {"msecs", Quantity::time, 1e-3},
    {"millis", Quantity::time, 1e-3},
    {"milliseconds", Quantity::time, 1e-3},
    {"us", Quantity::time, 1e-6},
    {"\u00b5s", Quantity::time, 1e-6},
    {"usec", Quantity::time, 1e-6},
    {"usecs", Quantity::time, 1e-6},
    {"micros", Quantity::time, 1e-6},
    {"microseconds", Quantity::time, 1e-6},
    {"ns", Quantity::time, 1e-9},
    {"nsec", Quantity::time, 1e-9},
    {"nsecs", Quantity::time, 1e-9},
    {"nanos", Quantity::time, 1e-9},
    {"nanosec", Quantity::time, 1e-9},
    {"nanosecs", Quantity::time, 1e-9},
    {"nanoseconds", Quantity::time, 1e-9},
    {"min", Quantity::time, 60},
    {"minutes", Quantity::time, 60},
    {"h", Quantity::time, 3600},
    {"hours", Quantity::time, 3600},
    {"C", Quantity::temperature, 1},
    {"degC", Quantity::temperature, 1},
    {"\u00b0C", Quantity::temperature, 1},
    {"\u2103", Quantity::temperature, 1},
    {"celsius", Quantity::temperature, 1},
    {"K", Quantity::temperature, 1, -273.15},
    {"kelvin", Quantity::temperature, 1, -273.15},
    {"F", Quantity::temperature, 5.0 / 9, -160.0 / 9},
    {"degF", Quantity::temperature, 5.0 / 9, -160.0 / 9},
    {"\u00b0F", Quantity::temperature, 5.0 / 9, -160.0 / 9},
    {"m", Quantity::length, 1},
    {"mm", Quantity::length, 1e-3},
    {"cm", Quantity::length, 1e-2},
    {"um", Quantity::length, 1e-6},
    {"\u00b5m", Quantity::length, 1e-6},
    {"inch", Quantity::length, kInch_m},
    {"rad", Quantity::angle, 1},
    {"deg", Quantity::angle, std::numbers::pi / 180},
    {"\u00b0", Quantity::angle, std::numbers::pi / 180},
    {"m/s", Quantity::motion, 1},
    {"mm/s", Quantity::motion, 1e-3},
    {"m/s2", Quantity::motion, 1},
    {"m/s^2", Quantity::motion, 1},
    {"rad/s", Quantity::motion, 1},
    {"deg/s", Quantity::motion, std::numbers::pi / 180},
    {"V", Quantity::reading},
    {"mV", Quantity::reading},
    {"uV", Quantity::reading},
    {"\u00b5V", Quantity::reading},
    {"mV/V", Quantity::reading},
    {"mA", Quantity::reading},
    {"uA", Quantity::reading},
    {"pF", Quantity::reading},
    {"fF", Quantity::reading},
    {"nF", Quantity::reading},
    {"Ohm", Quantity::reading},
    {"kOhm", Quantity::reading},
    {"\u03a9", Quantity::reading},
    {"k\u03a9", Quantity::reading},
    {"S", Quantity::reading},  // siemens
    {"mS", Quantity::reading},
    {"uS", Quantity::reading},
    {"\u00b5S", Quantity::reading},
    {"nS", Quantity::reading},
    {"T", Quantity::reading},
    {"mT", Quantity::reading},
    {"uT", Quantity::reading},
    {"\u00b5T", Quantity::reading},
    {"gauss", Quantity::reading},
    {"pC", Quantity::reading},
    {"Pa", Quantity::reading},
    {"kPa", Quantity::reading},
    {"hPa", Quantity::reading},
    {"mbar", Quantity::reading},
    {"bar", Quantity::reading},
    {"psi", Quantity::reading},
    {"lux", Quantity::reading},
    {"Hz", Quantity::reading},
    {"kHz", Quantity::reading},
    {"LSB", Quantity::reading},
    {"counts", Quantity::reading},
    {"count", Quantity::reading},
    {"raw", Quantity::reading},
    {"adc", Quantity::reading},
    {"au", Quantity::reading},
    {"a.u.", Quantity::reading},
    {"%", Quantity::reading},
    {"ustrain", Quantity::reading},
    {"strain", Quantity::reading},
};

char lower(char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; }

std::string lowered(std::string_view text) {
    std::string result;
    for (const char c : text) result += lower(c);
    return result;
}

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
// A byte of a letter beyond ASCII belongs to a word.
bool is_letter(char c) { return is_upper(c) || (c >= 'a' && c <= 'z') || static_cast<unsigned char>(c) >= 0x80; }

std::string_view trimmed(std::string_view text) {
    const std::size_t begin = text.find_first_not_of(" _-.:"), end = text.find_last_not_of(" _-.:");
    return begin == text.npos ? std::string_view() : text.substr(begin, end - begin + 1);
}

// "forceZ_12" becomes force, z, 12.
std::vector<std::string> words_of(std::string_view text) {
    std::vector<std::string> words;
    char before = 0;
    for (const char c : text) {
        if (is_letter(c) || is_digit(c)) {
            const bool begins = !(is_letter(before) || is_digit(before)) || is_digit(before) != is_digit(c) ||
                                (is_upper(c) && is_letter(before) && !is_upper(before));
            if (begins) words.emplace_back();
            words.back() += lower(c);
        }
        before = c;
    }
    return words;
}

// Removes a unit in brackets at the end, or behind the last blank, '_', '/' or ','.
const ColumnUnit* take_unit(std::string_view& name) {
    name = trimmed(name);
    if (name.empty()) return nullptr;
    if (const char last = name.back(); last == ')' || last == ']' || last == '}') {
        const std::size_t open = name.find_last_of(last == ')' ? '(' : last == ']' ? '[' : '{');
        if (open == name.npos) return nullptr;
        const ColumnUnit* unit = find_unit(name.substr(open + 1, name.size() - open - 2));
        if (unit != nullptr) name = trimmed(name.substr(0, open));
        return unit;
    }
    // "mV/V" behind '_' and "N.m" behind '/' are one unit; so the longest text that is a unit counts.
    const ColumnUnit* longest = nullptr;
    std::size_t end = 0;
    for (std::size_t at = name.size(); at-- > 1;) {
        if (std::string_view(" _/,.-").find(name[at]) == std::string_view::npos) continue;
        if (const ColumnUnit* unit = find_unit(name.substr(at + 1)); unit != nullptr) longest = unit, end = at;
    }
    if (longest != nullptr) name = trimmed(name.substr(0, end));
    return longest;
}

}  // namespace

const ColumnUnit* find_unit(std::string_view text) {
    std::string plain;
    for (const char c : trimmed(text))
        if (c != ' ' && c != '*' && c != '_') plain += c;
    for (const std::string_view dot : {"\u00b7", "\u22c5"})
        for (std::size_t at; (at = plain.find(dot)) != plain.npos;) plain.erase(at, dot.size());
    if (const std::size_t mu = plain.find("\u03bc"); mu == 0) plain.replace(0, 2, "\u00b5");
    for (const ColumnUnit& unit : kUnits)
        if (plain == unit.text) return &unit;
    // "N.m", "lbf-in": a product, not a name
    std::string product;
    for (const char c : plain)
        if (c != '.' && c != '-') product += c;
    for (const ColumnUnit& unit : kUnits)
        if (unit.quantity == Quantity::moment && product == unit.text) return &unit;
    for (const ColumnUnit& unit : kUnits) {
        const bool same_first =
            plain.size() > 1 ? !plain.empty() && plain[0] == unit.text[0] : unit.text == "N" || unit.text == "s";
        const bool is_word = unit.text.size() > 3;
        if (plain.size() == unit.text.size() && (same_first || is_word) && lowered(plain) == lowered(unit.text))
            return &unit;
        // "NM", "NMM": no prefix can be meant
        if (plain.size() == unit.text.size() && unit.text[0] == 'N' && lowered(plain) == lowered(unit.text)) return &unit;
    }
    return nullptr;
}

ColumnName column_name(std::string_view name) {
    ColumnName result;
    std::string_view stem = name;
    result.unit = take_unit(stem);
    if (result.unit == nullptr) stem = trimmed(name);
    result.stem = std::string(stem);
    result.words = words_of(stem);
    result.text = std::string(name);
    return result;
}

std::vector<ColumnName> column_names(const std::vector<std::string>& names) {
    // Returns the text before a letter at the end: "ch" of "ch_C"; "" if there is none.
    const auto before_letter = [](std::string_view name) {
        const std::string_view text = trimmed(name);
        const bool has =
            text.size() > 2 && is_letter(text.back()) && std::string_view(" _-.").find(text[text.size() - 2]) != text.npos;
        return std::string(has ? text.substr(0, text.size() - 2) : std::string_view());
    };
    std::set<std::string> families;  // with a letter that is neither a unit nor an axis
    for (const std::string& name : names)
        if (const std::string stem = before_letter(name); !stem.empty()) {
            const std::string_view letter = trimmed(name).substr(stem.size() + 1);
            if (find_unit(letter) == nullptr && std::string_view("xyzXYZ").find(letter) == letter.npos)
                families.insert(stem);
        }
    std::vector<ColumnName> result;
    for (const std::string& name : names) {
        result.push_back(column_name(name));
        ColumnName& each = result.back();
        if (name == "t_s" || each.unit == nullptr || each.unit->quantity == Quantity::force) continue;
        if (families.count(before_letter(name)) == 0) continue;
        each.unit = nullptr;
        each.stem = std::string(trimmed(name));
        each.words = words_of(each.stem);
    }
    return result;
}

}  // namespace tactiled
