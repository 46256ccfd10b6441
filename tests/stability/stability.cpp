// All hard cases, judged.
//
//   stability             exit 1 where a case is outside of its bound, and says which
//   stability --table     the same as a Markdown table: tests/stability/CASES.md
//   stability --long      with a recursion over 10^9 updates, some minutes
//   stability --naive     the textbook's numbers in the place of ours: which go red, and exit 1
// Any other word: exit 2.
#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"

namespace tactiled::stability {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

double error_of(double value, const Real& reference) {
    if (!std::isfinite(value)) return std::numeric_limits<double>::infinity();
    const Real difference = abs(Real(value) - reference);
    return double(reference == 0 ? difference : difference / abs(reference));
}

std::string text_of(const Published& p) {
    const char* const quality = p.quality == TACTILED_GOOD ? "good" : p.quality == TACTILED_UNCERTAIN ? "uncertain" : "bad";
    return p.quality == TACTILED_BAD ? quality : fmt::format("{:.4g}, {}", p.value, quality);
}

bool holds(const Published& p, const Marked& m) {
    if (m.reasons == 0) return p.quality == TACTILED_BAD && std::isnan(p.value);
    const bool right = std::isnan(m.truth) || std::abs(p.value - m.truth) <= m.within * std::abs(m.truth);
    return p.quality == TACTILED_UNCERTAIN && std::isfinite(p.value) && (p.reasons & m.reasons) == m.reasons && right;
}

}  // namespace

Published published(const Estimate& estimate, std::size_t component) {
    return {estimate.wrench_S[component], estimate.quality(), estimate.reasons};
}

Published as_good(double value) { return {value, TACTILED_GOOD, 0}; }

void Cases::value(const std::string& id, const std::string& what, const Value& v) {
    const double naive = error_of(v.naive, v.reference), ours = error_of(v.ours, v.reference);
    const double bound = v.times * v.kappa * kEpsilon + v.slack;
    const bool bounds = bound < 1;  // one that is not, or no number, judges nothing
    using Naive = Result::Naive;
    const Naive red = v.textbook == Textbook::single ? Naive::red_single : Naive::red_same_precision;
    const Naive naive_is = v.textbook == Textbook::none ? Naive::none : naive <= bound ? Naive::holds : red;
    results_.push_back({id, what, fmt::format("{:.2g}", v.kappa),
                        naive_is == Naive::none ? "" : fmt::format("{:.1e}", naive), fmt::format("{:.1e}", ours),
                        fmt::format("{:.1e}", bound), naive_is, bounds && ours <= bound});
}

void Cases::marked(const std::string& id, const std::string& what, const Marked& m) {
    results_.push_back({id, what, "", text_of(m.naive), text_of(m.ours),
                        std::isnan(m.truth) ? (m.reasons == 0 ? "bad" : "marked") : fmt::format("marked, {:.4g}", m.truth),
                        Result::Naive::states_no_quality, holds(m.ours, m)});
}

void Cases::refused(const std::string& id, const std::string& what, double naive, const std::string& said,
                    const std::string& because) {
    const bool is_said = said.find(because) != std::string::npos;
    results_.push_back({id, what, "", fmt::format("{:.4g}, good", naive), is_said ? "refused" : "refused not: " + said,
                        "refused", Result::Naive::states_no_quality, is_said});
}

Estimate estimate_of(const Calibration& calibration, const std::vector<double>& channel, std::uint32_t missing,
                     std::uint32_t saturated) {
    return made(calibration)->decouple({.channel = channel, .missing = missing, .saturated = saturated, .t_ns = 1'000'000});
}

std::string refusal_of(const Calibration& calibration) {
    try {
        (void)made(calibration);
        return "";
    } catch (const SetupError& error) { return error.what(); }
}

}  // namespace tactiled::stability

int main(int argc, char** argv) {
    using namespace tactiled::stability;
    using Naive = Result::Naive;
    const auto has = [&](const char* option) { return argc > 1 && std::strcmp(argv[1], option) == 0; };
    if (argc > 2 || (argc == 2 && !has("--table") && !has("--long") && !has("--naive"))) {
        fmt::print(stderr, "stability [--table | --long | --naive]\n");
        return 2;
    }
    Cases cases(has("--long") ? 1'000'000'000 : 300'000);
    for (const auto add : {add_table_cases, add_hair_cases, add_capacitive_cases, add_piezo_cases, add_generic_cases,
                           add_fit_cases, add_number_cases, add_simulator_cases})
        add(cases);
    std::size_t red = 0, naive[5] = {};
    if (has("--table")) fmt::print("| id | case | kappa | textbook | ours | bound |\n|---|---|---|---|---|---|\n");
    for (const Result& r : cases.results()) {
        if (has("--table")) fmt::print("| {} | {} | {} | {} | {} | {} |\n", r.id, r.what, r.kappa, r.naive, r.ours, r.bound);
        red += r.ours_holds ? 0 : 1;
        ++naive[int(r.naive_is)];
        const bool naive_red = r.naive_is == Naive::red_same_precision || r.naive_is == Naive::red_single;
        if ((has("--naive") ? naive_red : !r.ours_holds) && !has("--table"))
            fmt::print("RED {} {}: {} beside a bound of {}\n", r.id, r.what, has("--naive") ? r.naive : r.ours, r.bound);
    }
    const std::size_t n_same = naive[int(Naive::red_same_precision)], n_single = naive[int(Naive::red_single)],
                      n_holds = naive[int(Naive::holds)];
    fmt::print(
        "{}{} cases: {} red. The textbook's code: of {} with its number, {} red in the same precision, {} in single, {} "
        "hold; {} would have to be marked or refused, which it cannot say; {} without one\n",
        has("--table") ? "\n" : "", cases.results().size(), red, n_same + n_single + n_holds, n_same, n_single, n_holds,
        naive[int(Naive::states_no_quality)], naive[int(Naive::none)]);
    return (has("--naive") ? n_same + n_single : red) == 0 ? 0 : 1;
}
