#include "node/lab/warning_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string_view>

namespace tactiled::ctl {
namespace {

struct Cause {
    std::string_view words;   // in every warning of this cause
    std::string_view remedy;  // a sentence without its full stop; "" = the warning names it
};

// The one table of causes, by consequence: numbers without a claim, claims that may be false, claims that hold for less than
// the user may think, and what was left out or assumed. The first row whose words are in a warning counts.
constexpr Cause kCauses[] = {
    {"not validated, so no standard deviation", ""},
    // The claims may be false.
    {"no sensor is as good as that", ""},
    {"is no smaller than the spread", "See the loads of that axis, or leave the label out"},
    {"contradict", ""},
    {"labels are in ", "Correct the unit in the column's name: fz_mN, fz_g, mx_Nmm"},
    {"are the moments in Nmm", "Correct the unit in the column's name"},
    {"is fz_N in another unit", ""},
    {"is never negative", ""},
    {"falls under a press", "Change the sign of the labels"},
    {"rises under a shear towards it", ""},
    {"the geometry or the elastomer is not that", "State the parameters with --set"},
    {"all labels are exactly 0", ""},
    {"far better (straight line", "Shift the times of one of them (--labels FILE fits the offset)"},
    {"more rows disagree", ""},
    {"disagree with the rest in", ""},
    {"rises in every row", ""},
    {"is it at its saturation limit", ""},
    {"t_s goes backwards", ""},
    {"are these times in milliseconds", "Name the column t_ms"},
    {"condition number", "Leave out a channel that repeats others (--channels), or load the axes in other combinations"},
    {"hardly vary independently", "Load these axes one without the other"},
    {"to be multiplied by", ""},
    {"unexplained", ""},
    // The claims hold, but for less.
    {"the zero drifted in an hour", ""},
    {"each session has its own zero", ""},
    {"zero drift", "Tare after each mounting"},
    {"is not straight, so that a tare", ""},
    {"no row is unloaded", ""},
    {"not a straight line", "Use method quadratic or rbf (--method auto)"},
    {"one session only", "Record a second session after mounting the sensor again"},
    {"validated by loads", ""},
    {"hysteresis is not in the error", ""},
    {"do not determine all terms", ""},
    {"assumed", "State them with --set, or record such loads"},
    // Something was left out.
    {"saturation limit: left out", "Record these loads with a smaller gain"},
    {"lack a channel: left out", "See the empty cells of the channels"},
    {"left out", "It is not used; --channels chooses"},
    {"its held-out error is above", "Use that method"},
    {"is not lower than", ""},
    {"keeps method", "Use that method, which is faster"},
    {"Vp rises less and less", "Record presses in smaller steps"},
    {"no normal_curve", "Record presses in small steps up to full scale"},
    {"temperature_C covers", "Record over 2 K or more, or declare temperature_range_C"},
    {"needed to learn zero and gain", "Record more rows with a temperature"},
    {"does not follow the dummy", "Check this channel, or record over 2 K"},
    {"no channel follows temperature_C", "Nothing is corrected; check the thermometer's place"},
    {"was not used", "Leave the option out, or correct its name"},
};

std::size_t rank_of(const std::string& warning) {
    const auto at = std::find_if(std::begin(kCauses), std::end(kCauses),
                                 [&](const Cause& cause) { return warning.find(cause.words) != warning.npos; });
    return std::size_t(at - std::begin(kCauses));
}

struct Entry {
    std::size_t rank = std::size(kCauses);
    std::string text;
    std::vector<std::string> details;
};

std::vector<Entry> entries_of(const std::vector<std::string>& warnings) {
    std::vector<Entry> entries;
    for (const std::string& warning : warnings)
        if (warning.starts_with(' ') && !entries.empty())
            entries.back().details.push_back(warning);
        else
            entries.push_back({.rank = rank_of(warning), .text = warning, .details = {}});
    std::stable_sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.rank < b.rank; });
    return entries;
}

}  // namespace

std::vector<std::string> by_consequence(std::vector<std::string> warnings) {
    std::vector<std::string> result;
    for (Entry& entry : entries_of(warnings)) {
        result.push_back(std::move(entry.text));
        std::move(entry.details.begin(), entry.details.end(), std::back_inserter(result));
    }
    return result;
}

std::vector<std::string> warning_page(const std::vector<std::string>& warnings) {
    std::vector<Entry> merged;
    std::vector<std::size_t> more;  // warnings of the same cause
    for (Entry& entry : entries_of(warnings))
        if (!merged.empty() && entry.rank < std::size(kCauses) && entry.rank == merged.back().rank) {
            ++more.back();
        } else {
            merged.push_back(std::move(entry));
            more.push_back(0);
        }
    std::vector<std::string> lines;
    const std::size_t causes = merged.size() > kWarningLines ? kWarningLines - 1 : merged.size();
    std::size_t room = kWarningLines - std::min(kWarningLines, merged.size());
    for (std::size_t i = 0; i < causes; ++i) {
        const Entry& entry = merged[i];
        const std::string_view remedy = entry.rank < std::size(kCauses) ? kCauses[entry.rank].remedy : "";
        std::string line = entry.text;
        if (more[i] > 0) line += fmt::format(" (and {} more of this kind: --json has all)", more[i]);
        if (!remedy.empty()) line += fmt::format("{} {}", line.ends_with('?') ? "" : ".", remedy);
        lines.push_back(std::move(line));
        for (std::size_t k = 0; k < entry.details.size() && room > 0; ++k, --room) lines.push_back(entry.details[k]);
    }
    if (causes < merged.size()) lines.push_back(fmt::format("and {} more causes: --json has all", merged.size() - causes));
    return lines;
}

}  // namespace tactiled::ctl
