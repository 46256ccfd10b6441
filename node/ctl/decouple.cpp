// tactilectl decouple: a file of readings through the very Decoupler of the loop, row by row.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/fit/csv.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

struct Settings {
    std::string calibration, method, in = "-", out = "-";
    double saturates_below = -std::numeric_limits<double>::infinity();
    double saturates_above = std::numeric_limits<double>::infinity();
};

std::unique_ptr<Decoupler> make_decoupler(const Calibration& calibration, std::string method) {
    const DecouplerEntry* entry = find_decoupler(calibration.model);
    if (entry == nullptr)
        throw SetupError(fmt::format("{}: model \"{}\" is unknown; known are {}", calibration.path, calibration.model,
                                     fmt::join(decoupler_names(), " ")));
    if (method.empty()) method = calibration.method.empty() ? entry->methods.front() : calibration.method;
    if (std::find(entry->methods.begin(), entry->methods.end(), method) == entry->methods.end())
        throw SetupError(fmt::format("{}: model \"{}\" has no method \"{}\"; it has {}", calibration.path, calibration.model,
                                     method, fmt::join(entry->methods, " ")));
    Problems problems;
    Options none = Options::parse_text("", calibration.path, problems);
    auto decoupler = entry->make(calibration, method, none);
    problems.throw_if_any();
    return decoupler;
}

// The column of each channel, by name.
std::vector<std::size_t> channel_columns(const CsvReader& csv, const Calibration& calibration) {
    std::vector<std::size_t> columns;
    std::vector<std::string> lacking;
    for (const auto& name : calibration.channels) {
        const auto column = csv.find(name);
        if (column)
            columns.push_back(*column);
        else
            lacking.push_back(name);
    }
    if (!lacking.empty())
        csv.refuse(fmt::format("lacks the channels {}, which {} needs; its columns are {}", fmt::join(lacking, " "),
                               calibration.path, fmt::join(csv.columns(), " ")));
    return columns;
}

int decouple(const Settings& settings) {
    Problems problems;
    const Calibration calibration = load_calibration(settings.calibration, problems);
    problems.throw_if_any();
    const auto decoupler = make_decoupler(calibration, settings.method);
    CsvReader csv(settings.in);
    const auto time = csv.find("t_s");
    if (!time) csv.refuse("has no column t_s");
    const auto columns = channel_columns(csv, calibration);
    std::error_code none;
    if (settings.in != "-" && settings.out != "-" && std::filesystem::equivalent(settings.in, settings.out, none))
        throw SetupError(settings.out + ": is the input too; it would be overwritten before it is read");
    ForcesWriter forces(settings.out);
    std::vector<double> channel(columns.size());
    while (csv.next()) {
        const double t_s = csv.number(*time);
        if (std::isnan(t_s)) csv.refuse("column t_s is empty; when was this row read?");
        Reading reading{.channel = channel, .missing = 0, .saturated = 0};
        for (std::size_t k = 0; k < columns.size(); ++k) {
            channel[k] = csv.number(columns[k]);
            if (std::isnan(channel[k])) reading.missing |= 1u << k;
            if (channel[k] <= settings.saturates_below || channel[k] >= settings.saturates_above)
                reading.saturated |= 1u << k;
        }
        const Estimate estimate = decoupler->decouple(reading);
        forces.write(t_s, estimate, quality_text(estimate.quality, estimate.reasons));
    }
    forces.close();
    return kGood;
}

}  // namespace

void add_decouple(CLI::App& app, Run& run) {
    auto settings = std::make_shared<Settings>();
    auto* verb = app.add_subcommand("decouple", "Turns a file of readings into forces, with the code of the daemon's loop");
    verb->add_option("--calibration", settings->calibration, "the calibration file")->required();
    verb->add_option("--method", settings->method, "of the model; the calibration's own if not given");
    verb->add_option("--in", settings->in, "signals.csv: t_s and a column a channel; - is standard input")
        ->capture_default_str();
    verb->add_option("--out", settings->out, "forces.csv; - is standard output")->capture_default_str();
    verb->add_option("--saturates-below", settings->saturates_below,
                     "a channel at or below is at its rail (unit of the calibration)");
    verb->add_option("--saturates-above", settings->saturates_above,
                     "a channel at or above is at its rail (unit of the calibration)");
    verb->callback([settings, &run] { run = [settings] { return decouple(*settings); }; });
}

}  // namespace tactiled::ctl
