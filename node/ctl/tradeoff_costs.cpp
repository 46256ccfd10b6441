// tactilectl tradeoff --cost: the list of the costs of accuracy, and what they measured as text, CSV, JSON and figure.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "config/names.hpp"
#include "config/text_file.hpp"
#include "node/ctl/costs/cost.hpp"
#include "node/ctl/tradeoff.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {

extern const CostEntry filter_cost, hairs_cost, converter_cost, fidelity_cost, map_cost, solver_cost, precision_cost,
    batch_cost, register_cost;

namespace {

constexpr const CostEntry* kCosts[] = {&filter_cost, &hairs_cost,     &converter_cost, &fidelity_cost, &map_cost,
                                       &solver_cost, &precision_cost, &batch_cost,     &register_cost};

const CostEntry& entry_of(const std::string& name) {
    std::vector<std::string> names{"list", "all"};
    for (const CostEntry* entry : kCosts) {
        if (entry->name == name) return *entry;
        names.emplace_back(entry->name);
    }
    const auto near = nearest_name(name, names);
    throw SetupError(fmt::format("--cost {}: there is none of that name; {}", name,
                                 near ? "did you mean " + *near + "?" : fmt::format("known are {}", fmt::join(names, " "))));
}

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.4g}", value) : ""; }

std::string csv_of(const Cost& cost) {
    std::string text = fmt::format("{}\n", fmt::join(cost.columns, ","));
    for (const auto& row : cost.rows) {
        text += row.name.find(',') == row.name.npos ? row.name : '"' + row.name + '"';
        for (const double value : row.values) text += "," + number(value);
        text += "\n";
    }
    return text;
}

nlohmann::json json_of(const CostEntry& entry, const Cost& cost) {
    nlohmann::json json{{"schema", 1}, {"cost", entry.name}, {"advice", cost.advice}, {"rows", nlohmann::json::array()}};
    for (const auto& row : cost.rows) {
        nlohmann::json one;
        one[cost.columns[0]] = row.name;
        for (std::size_t i = 0; i < row.values.size(); ++i)
            one[cost.columns[i + 1]] = std::isfinite(row.values[i]) ? nlohmann::json(row.values[i]) : nlohmann::json();
        json["rows"].push_back(one);
    }
    return json;
}

std::string text_of(const CostEntry& entry, const Cost& cost) {
    std::vector<std::size_t> width;
    for (const auto& column : cost.columns) width.push_back(std::max<std::size_t>(column.size(), 8));
    for (const auto& row : cost.rows) width[0] = std::max(width[0], row.name.size());
    std::string text = fmt::format("{}\n\n{:{}}", entry.title, cost.columns[0], width[0]);
    for (std::size_t i = 1; i < width.size(); ++i) text += fmt::format("  {:>{}}", cost.columns[i], width[i]);
    for (const auto& row : cost.rows) {
        text += fmt::format("\n{:{}}", row.name, width[0]);
        for (std::size_t i = 0; i < row.values.size(); ++i)
            text += fmt::format("  {:>{}}", number(row.values[i]), width[i + 1]);
    }
    return text + "\n\n" + cost.advice + "\n";
}

}  // namespace

Calibration shipped_calibration(const CostSetup& setup, const std::string& name) {
    Problems problems;
    Calibration calibration = load_calibration(setup.folder + "/config/calibration/" + name, problems);
    if (!problems.empty())
        throw SetupError(problems.lines().front() + "; run it in the project's folder, or name that with --folder");
    return calibration;
}

void check_output(const std::string& path) {
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    if (std::filesystem::is_directory(path)) throw SetupError(fmt::format("{}: is a folder; name a file", path));
    if (::access(folder.empty() ? "." : folder.c_str(), W_OK | X_OK) != 0)
        throw SetupError(fmt::format("{}: no file can be written there: {}", path, std::strerror(errno)));
}

int tradeoff_costs(const std::string& name, const TradeoffOutput& output) {
    const CostSetup setup{output.samples, output.folder, output.influence};
    if ((name == "list" || name == "all") && (output.json || !output.csv.empty() || !output.svg.empty()))
        throw SetupError(fmt::format("--cost {}: --json, --csv and --svg are for one cost", name));
    if (name == "list") {
        for (const CostEntry* entry : kCosts) fmt::print("{:10} {} ({})\n", entry->name, entry->title, entry->path);
        return kGood;
    }
    if (name == "all") {
        for (const CostEntry* entry : kCosts) check_output(fmt::format("{}/{}", output.folder, entry->path));
        for (const CostEntry* entry : kCosts) {
            const Cost cost = entry->measure(setup);
            replace_file(fmt::format("{}/{}", output.folder, entry->path), figure_svg(cost.figure));
            fmt::print("{}\n", text_of(*entry, cost));
        }
        return kGood;
    }
    const CostEntry& entry = entry_of(name);
    for (const auto& path : {output.csv, output.svg})
        if (!path.empty()) check_output(path);
    const Cost cost = entry.measure(setup);
    if (!output.csv.empty()) replace_file(output.csv, csv_of(cost));
    if (!output.svg.empty()) replace_file(output.svg, figure_svg(cost.figure));
    fmt::print("{}", output.json ? json_of(entry, cost).dump(2) + "\n" : text_of(entry, cost));
    return kGood;
}

}  // namespace tactiled::ctl
