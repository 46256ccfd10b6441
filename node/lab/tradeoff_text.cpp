// The results as a table, as CSV and as JSON. An unknown value is empty or null.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "decoupling/solve/domain.hpp"
#include "node/lab/tradeoff.hpp"

namespace tactiled::ctl {
namespace {

std::string cell(double value, int digits = 4) { return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : ""; }

double percent(std::size_t part, std::size_t whole) { return whole == 0 ? kNaN : 100 * double(part) / double(whole); }

// Returns the columns of one row, defined once: CSV and JSON have the same names.
std::vector<std::pair<std::string, double>> numbers(const Measure& m) {
    const Judged& j = m.judged;
    std::vector<std::pair<std::string, double>> columns{
        {"samples", double(j.samples)}, {"rms_percent", j.force_rms_percent}, {"rms_of_good_percent", j.good_rms_percent}};
    for (std::size_t c = 0; c < 5; ++c) {  // no sensor measures mz
        columns.emplace_back(fmt::format("{}_rms_percent", kComponentNames[c]), j.rms_percent[c]);
        columns.emplace_back(fmt::format("{}_99_percent", kComponentNames[c]), j.p99_percent[c]);
    }
    columns.emplace_back("good_percent", percent(j.good, j.samples));
    columns.emplace_back("uncertain_percent", percent(j.uncertain, j.samples));
    columns.emplace_back("bad_percent", percent(j.bad, j.samples));
    columns.emplace_back("good_but_off_5sd_percent", percent(j.undetected, j.samples));
    columns.emplace_back("p50_ns", m.p50_ns);
    columns.emplace_back("p99_ns", m.p99_ns);
    columns.emplace_back("p99_9_ns", m.p99_9_ns);
    columns.emplace_back("instructions", m.instructions);
    return columns;
}

}  // namespace

std::string tradeoff_text(const std::vector<Result>& results) {
    std::string text;
    for (const Result& result : results) {
        const Contest& contest = *result.contest;
        text += fmt::format("{}: rms error, % of full scale\n{:26}", contest.model, "");
        for (const Measure& m : result.measures.front()) text += fmt::format(" {:>9}", m.trial.substr(0, 9));
        text += fmt::format(" {:>8} {:>8} {:>8} {:>7} {:>6} {:>6} {:>6} {:>7}\n", "p50 ns", "p99", "p99.9", "instr.",
                            "good%", "unc.%", "bad%", "off5sd%");
        for (std::size_t i = 0; i < contest.candidates.size(); ++i) {
            const auto& measures = result.measures[i];
            text += fmt::format("{} {:24}", measures.back().on_front ? '*' : ' ', contest.candidates[i].name);
            for (const Measure& m : measures) text += fmt::format(" {:>9}", cell(m.judged.force_rms_percent, 3));
            const Measure& all = measures.back();
            const Judged& j = all.judged;
            text +=
                fmt::format(" {:>8.0f} {:>8.0f} {:>8.0f} {:>7} {:>6.1f} {:>6.1f} {:>6.1f} {:>7.2f}\n", all.p50_ns,
                            all.p99_ns, all.p99_9_ns, cell(all.instructions), percent(j.good, j.samples),
                            percent(j.uncertain, j.samples), percent(j.bad, j.samples), percent(j.undetected, j.samples));
        }
        for (const auto& why : contest.refused) text += fmt::format("  {}\n", why);
        text += '\n';
    }
    for (const Result& result : results) text += result.sentence + "\n";
    text += fmt::format(
        "* on the front of error over p50. all: geometric mean of the scenes but that with the damaged channel, where a "
        "method\n"
        "may say BAD or UNCERTAIN. off5sd: GOOD, and off by more than 5 of its standard deviations. Reading the clock took "
        "{:.0f}\nns, which are subtracted; caches were warm.\n",
        clock_ns());
    if (const auto why = why_no_instructions(); !why.empty()) text += why + "\n";
    return text;
}

std::string tradeoff_csv(const std::vector<Result>& results) {
    std::string text = "model,method,scene";
    for (const auto& [name, value] : numbers(Measure{})) text += "," + name;
    text += ",front\n";
    for (const Result& result : results)
        for (std::size_t i = 0; i < result.measures.size(); ++i)
            for (const Measure& m : result.measures[i]) {
                text += fmt::format("{},\"{}\",{}", result.contest->model, result.contest->candidates[i].name, m.trial);
                for (const auto& [name, value] : numbers(m)) text += "," + cell(value);
                text += fmt::format(",{}\n", int(m.on_front));
            }
    return text;
}

std::string tradeoff_json(const std::vector<Result>& results) {
    nlohmann::json json{{"schema", 1}, {"clock_ns", clock_ns()}, {"notes", nlohmann::json::array()}};
    if (const auto why = why_no_instructions(); !why.empty()) json["notes"].push_back(why);
    for (const Result& result : results) {
        nlohmann::json model{{"model", result.contest->model},
                             {"sentence", result.sentence},
                             {"refused", result.contest->refused},
                             {"methods", nlohmann::json::array()}};
        for (std::size_t i = 0; i < result.measures.size(); ++i) {
            const Candidate& candidate = result.contest->candidates[i];
            nlohmann::json method{{"method", candidate.method},
                                  {"name", candidate.name},
                                  {"calibration", candidate.calibration.path},
                                  {"scenes", nlohmann::json::array()}};
            for (const Measure& m : result.measures[i]) {
                nlohmann::json row{{"scene", m.trial}, {"front", m.on_front}};
                for (const auto& [name, value] : numbers(m)) row[name] = value;
                method["scenes"].push_back(std::move(row));
            }
            model["methods"].push_back(std::move(method));
        }
        json["models"].push_back(std::move(model));
    }
    return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace tactiled::ctl
