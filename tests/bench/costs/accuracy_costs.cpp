// accuracy_costs: the list of the costs of accuracy (node/costs.md), and what they measured as text, CSV, JSON and figure.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "config/names.hpp"
#include "config/text_file.hpp"
#include "node/ctl/command_line.hpp"
#include "node/lab/output.hpp"
#include "tests/bench/costs/cost.hpp"

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
    throw SetupError(fmt::format("{}: there is none of that name; {}", name,
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

namespace {

struct Args {
    std::string name, csv, svg;
    bool json = false;
    CostSetup setup;
};

int costs(const Args& args) {
    const auto& [name, csv, svg, json, setup] = args;
    if ((name == "list" || name == "all") && (json || !csv.empty() || !svg.empty()))
        throw SetupError(fmt::format("{}: --json, --csv and --svg are for one cost", name));
    if (name == "list") {
        for (const CostEntry* entry : kCosts) fmt::print("{:10} {} ({})\n", entry->name, entry->title, entry->path);
        return kGood;
    }
    if (name == "all") {
        for (const CostEntry* entry : kCosts) check_output(fmt::format("{}/{}", setup.folder, entry->path));
        for (const CostEntry* entry : kCosts) {
            const Cost cost = entry->measure(setup);
            replace_file(fmt::format("{}/{}", setup.folder, entry->path), figure_svg(cost.figure));
            fmt::print("{}\n", text_of(*entry, cost));
        }
        return kGood;
    }
    const CostEntry& entry = entry_of(name);
    for (const auto& path : {csv, svg})
        if (!path.empty()) check_output(path);
    const Cost cost = entry.measure(setup);
    if (!csv.empty()) replace_file(csv, csv_of(cost));
    if (!svg.empty()) replace_file(svg, figure_svg(cost.figure));
    fmt::print("{}", json ? json_of(entry, cost).dump(2) + "\n" : text_of(entry, cost));
    return kGood;
}

}  // namespace
}  // namespace tactiled::ctl

int main(int argc, char** argv) {
    using namespace tactiled::ctl;
    Program app{
        "Measures what one thing costs in accuracy or time against another way of doing it, through the product's code.",
        "accuracy_costs"};
    Args args;
    app.add_option("name", args.name, "list, all (each figure to its place in --folder), or one of the list").required();
    app.add_option("--csv", args.csv, "write the table as CSV");
    app.add_option("--svg", args.svg, "write the figure as SVG");
    app.add_flag("--json", args.json, "print the table as JSON");
    app.add_option("--samples", args.setup.samples, "to take of each thing that is compared").integer_in(1, 100'000'000);
    app.add_option("--folder", args.setup.folder, "the project's folder, for config/").show_default();
    app.add_option("--influence", args.setup.influence,
                   "of map, solver, batch: a calibration with the plate's influence map, if not the one in config/");
    return run_program(app, argc, argv, [&] { return costs(args); });
}
