// tactilectl decouple: passes a file of readings through the Decoupler of the loop, row by row.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/csv_time.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/fit/array_presses.hpp"
#include "decoupling/patch/patch.hpp"
#include "decoupling/place.hpp"
#include "node/ctl/command_line.hpp"
#include "node/lab/row_sensor.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kLatest_s = 9e9;  // 2^64 ns minus the time that a first row before 0 and kPast_s need
constexpr double kPast_s = 1000;   // time by which rows may precede a first row that is before 0

struct Settings {
    std::string calibration, method, in = "-", out = "-";
    double budget_us = 10;  // for method auto
    double delay_ms = 0;
    double tare_s = 0;
    bool budget = false, each_row_alone = false;
    double saturates_below = -std::numeric_limits<double>::infinity();
    double saturates_above = std::numeric_limits<double>::infinity();
    TemperatureInUse temperature;
};

// Returns the column of each channel, by name.
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

// The values of an array in a row, in the order of a frame.
class ArrayColumns {
public:
    ArrayColumns(const CsvReader& csv, Patch& patch, std::vector<std::string> channels)
        : shape_(patch.shape()), columns_(taxel_columns(csv, shape_.taxels, channels)), value_(shape_.size()) {}
    Taxels read(const CsvReader& csv) {
        for (std::size_t k = 0; k < value_.size(); ++k)
            value_[k] = float(csv.number(columns_[k / shape_.taxels][k % shape_.taxels]));
        return {shape_, value_};
    }

private:
    TaxelShape shape_;
    std::vector<std::vector<std::size_t>> columns_;
    std::vector<float> value_;
};

// The time of a row in seconds: column t_s, or any other time that its name, its size or its form states.
class RowTime {
public:
    explicit RowTime(const CsvReader& csv) : t_s_(csv.find("t_s")), other_(csv.columns()) {}
    double read(const CsvReader& csv) {
        if (t_s_ && csv.value(*t_s_) && std::abs(*csv.value(*t_s_)) <= kLatest_s) return csv.number(*t_s_);
        if (!other_.is_there()) other_.look_at(csv);
        if (!other_.is_there()) csv.refuse("has no column t_s");
        const auto t_ns = other_.read(csv);
        if (other_.is_assumed()) csv.refuse("its time has no unit: name it t_s, t_ms, t_us or t_ns");
        return t_ns ? double(*t_ns) / 1e9 : kNaN;
    }

private:
    std::optional<std::size_t> t_s_;
    TimeColumn other_;
};

// Subtracts the mean of the GOOD forces of the first seconds, or where none is, of the UNCERTAIN ones; keeps these rows
// until it is known.
class Tare {
public:
    Tare(double duration_s, RowSensor& sensor, ForcesWriter& forces)
        : duration_s_(duration_s), is_array_(sensor.patch() != nullptr), sensor_(sensor), forces_(forces) {}

    // Ends the tare if the row at `t_s` is not one of its rows. Before the row is judged.
    void look_at(double t_s) {
        if (!until_s_) until_s_ = t_s + duration_s_;
        if (t_s >= *until_s_) end();
    }

    void write(double t_s, Estimate estimate, const tactiled_budget& budget) {
        if (!ended_) {
            waiting_.push_back({t_s, estimate, budget});
            return;
        }
        for (std::size_t c = 0; c < zero_S_.size(); ++c) estimate.wrench_S[c] -= zero_S_[c];
        // The place of Sensor::put_place(); the taxels of an array are not tared here.
        if (is_array_ && duration_s_ > 0) {
            estimate.cop_S_m = estimate.cop_sd_m = {kNaN, kNaN};
        } else if (!is_array_ && (duration_s_ > 0 || !std::isfinite(estimate.cop_S_m[0]))) {
            const PressPlace place =
                place_of(estimate.wrench_S, estimate.sd, covariance_of(*estimate.correlations, estimate.sd));
            estimate.cop_S_m = place.cop_S_m;
            estimate.cop_sd_m = place.sd_m;
        }
        forces_.write(t_s, estimate, quality_text(estimate.quality(), estimate.reasons), budget);
    }

    void end() {
        if (std::exchange(ended_, true) || waiting_.empty()) return;
        const auto has = [&](std::uint8_t quality) {
            return std::count_if(waiting_.begin(), waiting_.end(),
                                 [&](const Row& row) { return row.estimate.quality() == quality; });
        };
        const std::uint8_t best = has(TACTILED_GOOD) != 0 ? TACTILED_GOOD : TACTILED_UNCERTAIN;
        const auto n = double(has(best));
        if (n == 0) throw SetupError(fmt::format("--tare-s {:g}: every force of this time is BAD", duration_s_));
        for (std::size_t c = 0; c < zero_S_.size(); ++c)
            for (const Row& row : waiting_)
                if (row.estimate.quality() == best) zero_S_[c] += row.estimate.wrench_S[c] / n;
        if (!is_array_) sensor_.tare(zero_S_);
        for (const Row& row : std::exchange(waiting_, {})) write(row.t_s, row.estimate, row.budget);
    }

private:
    struct Row {
        double t_s;
        Estimate estimate;
        tactiled_budget budget;
    };

    double duration_s_;
    bool is_array_;
    RowSensor& sensor_;
    ForcesWriter& forces_;
    std::optional<double> until_s_;
    std::vector<Row> waiting_;
    Wrench zero_S_{};
    bool ended_ = false;
};

int decouple(const Settings& settings) {
    Problems problems;
    const Calibration calibration = load_calibration(settings.calibration, problems);
    problems.throw_if_any();
    const auto& [lowest_C, highest_C, difference_K, sd_K] = settings.temperature;
    if (std::isnan(lowest_C) != std::isnan(highest_C) || lowest_C > highest_C)
        throw SetupError(
            "--temperature-from-C and --temperature-to-C: the lowest and the highest temperature, both or none");
    if (settings.budget && settings.each_row_alone)
        throw SetupError("--budget is that of a sample of the daemon; delete --each-row-alone");
    RowSensor sensor(calibration, {.method = settings.method,
                                   .budget_us = settings.budget_us,
                                   .delay_ms = settings.delay_ms,
                                   .saturates_at = {settings.saturates_below, settings.saturates_above},
                                   .temperature = settings.temperature,
                                   .has_tare = settings.tare_s > 0,
                                   .each_alone = settings.each_row_alone});
    CsvReader csv(settings.in);
    RowTime time(csv);
    std::optional<ArrayColumns> array;
    if (Patch* const patch = sensor.patch(); patch != nullptr) array.emplace(csv, *patch, calibration.channels);
    const auto columns = array ? std::vector<std::size_t>{} : channel_columns(csv, calibration);
    const std::string& dummy = calibration.temperature.dummy;
    const auto thermometer = csv.find(dummy.empty() ? "temperature_C" : dummy);
    if (!dummy.empty() && !thermometer)
        csv.refuse(fmt::format("lacks the dummy {}; {} takes the temperature from it", dummy, calibration.path));
    std::error_code none;
    if (settings.in != "-" && settings.out != "-" && std::filesystem::equivalent(settings.in, settings.out, none))
        throw SetupError(settings.out + ": is the input too; it would be overwritten before it is read");
    if (settings.tare_s == 0 && calibration.validation.ends_with(Calibration::kOwnZeros))
        fmt::print(stderr,
                   "warning: {} holds after a tare, because each of its sessions had its own zero: begin the file without "
                   "a load, and use --tare-s\n",
                   settings.calibration);
    ForcesWriter forces(settings.out, settings.budget);
    Tare tare(settings.tare_s, sensor, forces);
    std::vector<double> channel(columns.size());
    std::optional<double> origin_s;  // subtracted from the times for the models, which must not be negative
    while (csv.next()) {
        const double t_s = time.read(csv);
        if (std::isnan(t_s)) csv.refuse("the time is empty; when was this row read?");
        if (!origin_s) origin_s = t_s < 0 ? t_s - kPast_s : 0;
        if (t_s < *origin_s)
            csv.refuse(fmt::format("column t_s: {} s lies before the rows above it; sort the rows by time", t_s));
        const auto t_ns = std::uint64_t(std::round((t_s - *origin_s) * 1e9));
        Reading reading{.channel = channel, .missing = 0, .saturated = 0, .t_ns = t_ns};
        for (std::size_t k = 0; k < columns.size(); ++k) {
            channel[k] = csv.number(columns[k]);
            if (std::isnan(channel[k])) reading.missing |= 1u << k;
            if (channel[k] <= settings.saturates_below || channel[k] >= settings.saturates_above)
                reading.saturated |= 1u << k;
        }
        if (array) reading.taxels = array->read(csv);
        tare.look_at(t_s);
        const Estimate estimate = sensor.judge(reading, thermometer ? csv.number(*thermometer) : kNaN);
        tare.write(t_s, estimate, sensor.budget());
    }
    tare.end();
    forces.close();
    return kGood;
}

}  // namespace

Run add_decouple(Command verb) {
    auto settings = std::make_shared<Settings>();
    verb.add_option("--calibration", settings->calibration, "the calibration file").required();
    verb.add_option("--method", settings->method, "of the model; the calibration's own if not given; auto");
    verb.add_option("--budget-us", settings->budget_us, "time that a sample may take with --method auto").show_default();
    verb.add_option("--in", settings->in,
                    "signals.csv: a time and a column a channel, or Z0, Z1 ... of an array; - is standard input")
        .show_default();
    verb.add_option("--out", settings->out, "forces.csv; - is standard output").show_default();
    verb.add_option("--delay-ms", settings->delay_ms,
                    "delay of the measuring chain, as in the configuration: channels that move meanwhile do not contradict "
                    "each other")
        .not_negative()
        .show_default();
    verb.add_option("--tare-s", settings->tare_s,
                    "the mean force of so many seconds at the beginning, without a load, is subtracted")
        .not_negative();
    verb.add_flag("--each-row-alone", settings->each_row_alone,
                  "rows in no order of time, or with labels: quality and standard deviation of the method, without the "
                  "daemon's checks of jumps, frozen channels and the zero");
    verb.add_flag("--budget", settings->budget,
                  "also write the parts of each standard deviation and how they correlate (node/guide/uncertainty.md)");
    verb.add_option("--temperature-from-C", settings->temperature.lowest_C,
                    "with --temperature-to-C: temperature_range_C of the configuration");
    verb.add_option("--temperature-to-C", settings->temperature.highest_C, "highest temperature of the rows");
    verb.add_option("--temperature-sd-K", settings->temperature.sd_K, "temperature_sd_K of the configuration").positive();
    verb.add_option("--temperature-difference-K", settings->temperature.difference_K,
                    "temperature_difference_K of the configuration")
        .not_negative();
    verb.add_option("--saturates-below", settings->saturates_below,
                    "a channel at or below is saturated (unit of the calibration)");
    verb.add_option("--saturates-above", settings->saturates_above,
                    "a channel at or above is saturated (unit of the calibration)");
    return [settings] { return decouple(*settings); };
}

}  // namespace tactiled::ctl
