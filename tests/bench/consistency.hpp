// A decoupler and the latency of the loop over the rows of a scene: quality, errors and stated standard deviations.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/latency.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/unloading.hpp"
#include "node/lab/tradeoff.hpp"

namespace tactiled {

using ctl::Candidate;

struct Shares {
    std::size_t samples = 0, good = 0, undetected = 0;  // GOOD and off by more than 5 sd in some component
    // The undetected samples that are off by more than 5 sd from every load of the time in which the channels were measured.
    // The others are late: no channel shows yet that the load has moved.
    std::size_t wrong = 0;
    std::size_t values = 0, within = 0, beyond = 0;  // components of GOOD samples: 1 sd, 5 sd
    std::size_t within_true = 0;                     // within the true rms error of this course
    double sharpness_together = 0;                   // median sd / rms, each as rms over components in full scales
    // The largest ratio of a component's median sd with that of latency to that without: of the loop, and of an oracle that
    // adds the true change of the load over the delay.
    double latency = 0, latency_of_oracle = 0;
    std::size_t flagged_inside = 0;  // outside-domain, although each component of the load is within its full scale
    // The first reason that is true: the load moved while the channels were measured; a channel is beyond its calibrated
    // range; an estimate is beyond its full scale; none of these.
    std::array<std::size_t, 4> inside_by{};
    std::size_t undetected_by_oracle = 0;  // like `undetected`, by the oracle's sd
    double sharpness_without = 0;          // sharpness_together without the part of latency
    std::map<std::uint32_t, std::size_t> reasons;
};

struct Errors {
    std::vector<float> sd, error, without_latency, of_oracle;  // the last two: sd
    double squares = 0;
};

// A component of a GOOD sample.
struct Traced {
    std::uint64_t t_ns;
    float error, sd, late;   // late: the part of latency in sd
    bool is_settled;         // no component of the load moved while the channels were measured
    float load, below_peak;  // the estimate less the tare: relative to full scale, and below its peak since the last rest
};

class Course {
public:
    // `delay_s`: of each channel of `rows`.
    Course(const Candidate& candidate, const Labelled& rows, const std::vector<double>& delay_s)
        : candidate_(candidate), domain_(candidate.calibration), decoupler_(candidate.make()) {
        const std::vector<double> delays_s = ctl::delays_of(candidate, rows, delay_s);
        decoupler_->set_delay(delays_s);
        latency_.set_delay(delay_s_ = delay_of_components_s(*decoupler_, delays_s));
    }
    // Tares on the second half of the rest before the first load. Samples outside [from_s, to_s] are not judged.
    // `only`, if not empty: a mark for each row that is judged.
    void judge(const Labelled& rows, double from_s = 0, double to_s = 1e9, const std::vector<bool>& only = {}) {
        std::vector<double> storage;
        const auto readings = ctl::readings_of(candidate_, rows, storage);
        const std::size_t begin = is_tared_ ? 0 : ctl::first_load(rows);
        std::size_t at_rest = 0;
        Wrench sum{};
        for (std::size_t i = 0; i < readings.size(); ++i) {
            Estimate e = decoupler_->decouple(readings[i]);
            before_ = e.sd;
            if (e.quality() == TACTILED_BAD)
                latency_.forget();
            else
                latency_.widen(e.wrench_S, readings[i].t_ns, e.sd);
            if (i < begin) {
                if (i < begin / 2 || e.quality() == TACTILED_BAD) continue;
                ++at_rest;
                for (std::size_t c = 0; c < 6; ++c) sum[c] += std::isfinite(e.wrench_S[c]) ? e.wrench_S[c] : 0;
                continue;
            }
            if (i == begin && at_rest > 0)
                for (std::size_t c = 0; c < 6; ++c) zero_[c] = sum[c] / double(at_rest);
            // The first sample of a scene is at 1 s of the clock (node/lab/tradeoff_rows.cpp).
            if (const double t_s = double(readings[i].t_ns) * 1e-9 - 1;
                t_s >= from_s && t_s <= to_s && (only.empty() || only[i]))
                take(e, readings[i], rows, i);
        }
        is_tared_ = true;
    }
    // The next rows are those of another mounting, which is tared, too.
    void mount_again() { is_tared_ = false; }
    // Keeps the GOOD samples, by the number of the component. Before the first row.
    void trace() { is_traced_ = true; }
    [[nodiscard]] std::array<std::vector<Traced>, 6>& traced() { return traced_; }
    // The variances of the GOOD samples in squares of full scales: constant, with the component, with the load, of the loop
    // besides (unloading, the method's own), latency.
    [[nodiscard]] const std::array<double, 5>& terms() const { return terms_; }
    // They are not tared.
    void keep_zero() { is_tared_ = true; }
    Shares shares() {
        double sds = 0, sds_without = 0, errors_squared = 0;
        const auto median = [](std::vector<float>& values) {
            const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
            std::nth_element(values.begin(), middle, values.end());
            return double(*middle);
        };
        for (std::size_t i = 0; i < candidate_.calibration.components.size(); ++i) {
            Errors& errors = errors_[component_index(candidate_.calibration.components[i])];
            if (errors.sd.empty()) continue;
            const double sd = median(errors.sd), without = median(errors.without_latency);
            const double rms = std::sqrt(errors.squares / double(errors.sd.size()));
            for (const float error : errors.error) shares_.within_true += std::abs(double(error)) <= rms;
            const double full_scale =
                i < candidate_.calibration.full_scale.size() ? candidate_.calibration.full_scale[i] : 1;
            shares_.latency = std::max(shares_.latency, sd / without);
            shares_.latency_of_oracle = std::max(shares_.latency_of_oracle, median(errors.of_oracle) / without);
            sds += std::pow(sd / full_scale, 2);
            sds_without += std::pow(without / full_scale, 2);
            errors_squared += std::pow(rms / full_scale, 2);
        }
        shares_.sharpness_together = std::sqrt(sds / errors_squared);
        shares_.sharpness_without = std::sqrt(sds_without / errors_squared);
        return shares_;
    }

private:
    // A component of the loads while the channels of row i were measured, over twice the delay of the chain.
    [[nodiscard]] std::pair<double, double> lately(const Labelled& rows, std::size_t i, std::size_t c) const {
        double min = rows.rows[i].wrench_S[c], max = min;
        const double from_ns = double(rows.rows[i].t_ns) - 2e9 * delay_s_[c];
        for (std::size_t k = i; k-- > 0 && double(rows.rows[k + 1].t_ns) > from_ns;) {
            min = std::min(min, rows.rows[k].wrench_S[c]);
            max = std::max(max, rows.rows[k].wrench_S[c]);
        }
        return {min, max};
    }
    [[nodiscard]] bool is_settled(const Labelled& rows, std::size_t i) const {
        for (const std::string& name : candidate_.calibration.components) {
            const auto [min, max] = lately(rows, i, component_index(name));
            if (min != max) return false;
        }
        return true;
    }
    // The change of a component of the load over the delay before row i, between two rows by a straight line.
    [[nodiscard]] double true_change(const Labelled& rows, std::size_t i, std::size_t c) const {
        const double at_ns = double(rows.rows[i].t_ns) - 1e9 * delay_s_[c], now = rows.rows[i].wrench_S[c];
        std::size_t k = i;
        while (k > 0 && double(rows.rows[k].t_ns) > at_ns) --k;
        const LabelledRow &before = rows.rows[k], &after = rows.rows[std::min(k + 1, i)];
        const double width_ns = double(after.t_ns) - double(before.t_ns);
        const double part = width_ns > 0 ? std::clamp((at_ns - double(before.t_ns)) / width_ns, 0.0, 1.0) : 0;
        return now - (before.wrench_S[c] + part * (after.wrench_S[c] - before.wrench_S[c]));
    }
    [[nodiscard]] bool is_calibrated(const Wrench& load_S) const {
        const Calibration& calibration = candidate_.calibration;
        for (std::size_t i = 0; i < calibration.full_scale.size(); ++i)
            if (std::abs(load_S[component_index(calibration.components[i])]) > calibration.full_scale[i]) return false;
        return true;
    }
    [[nodiscard]] std::size_t reason_inside(const Estimate& e, const Reading& reading, const Labelled& rows,
                                            std::size_t i) const {
        const Calibration& calibration = candidate_.calibration;
        bool is_beyond = false;
        if (!is_settled(rows, i)) return 0;
        for (std::size_t k = 0; k < calibration.components.size(); ++k) {
            const std::size_t c = component_index(calibration.components[k]);
            is_beyond = is_beyond || std::abs(e.wrench_S[c]) > (1 + kDomainMargin) * calibration.full_scale[k];
        }
        for (std::size_t k = 0; k < reading.channel.size(); ++k)
            if (domain_.is_beyond(k, reading.channel[k])) return 1;
        return is_beyond ? 2 : 3;
    }
    void take(const Estimate& e, const Reading& reading, const Labelled& rows, std::size_t i) {
        const LabelledRow& row = rows.rows[i];
        if (is_traced_ && e.quality() != TACTILED_BAD) {
            Wrench tared = e.wrench_S;
            for (std::size_t c = 0; c < 6; ++c) tared[c] -= zero_[c];
            load_ = load_of(tared, candidate_.calibration);
            below_peak_ = peak_.next(load_, row.t_ns);
        }
        ++shares_.samples;
        ++shares_.reasons[e.quality() == TACTILED_GOOD ? 0 : e.reasons];
        if ((e.reasons & TACTILED_OUTSIDE_DOMAIN) != 0 && is_calibrated(row.wrench_S)) {
            ++shares_.flagged_inside;
            ++shares_.inside_by[reason_inside(e, reading, rows, i)];
        }
        if (e.quality() != TACTILED_GOOD) return;
        ++shares_.good;
        bool undetected = false, wrong = false, undetected_by_oracle = false;
        const bool settled = is_traced_ && is_settled(rows, i);
        for (const std::string& name : candidate_.calibration.components) {
            const std::size_t c = component_index(name);
            const double error = e.wrench_S[c] - zero_[c] - row.wrench_S[c];
            if (!std::isfinite(error)) continue;
            ++shares_.values;
            shares_.within += std::abs(error) <= e.sd[c];
            const bool beyond = std::abs(error) > 5 * e.sd[c];
            shares_.beyond += beyond;
            undetected = undetected || beyond;
            if (beyond) {
                const auto [min, max] = lately(rows, i, c);
                const double value = e.wrench_S[c] - zero_[c];
                wrong = wrong || value < min - 5 * e.sd[c] || value > max + 5 * e.sd[c];
            }
            errors_[c].sd.push_back(float(e.sd[c]));
            const double oracle = std::hypot(before_[c], true_change(rows, i, c));
            undetected_by_oracle = undetected_by_oracle || std::abs(error) > 5 * oracle;
            errors_[c].without_latency.push_back(float(before_[c]));
            errors_[c].of_oracle.push_back(float(oracle));
            errors_[c].error.push_back(float(error));
            add_terms(e, c);
            if (is_traced_)
                traced_[c].push_back({row.t_ns, float(error), float(e.sd[c]),
                                      float(std::sqrt(std::max(0.0, e.sd[c] * e.sd[c] - before_[c] * before_[c]))), settled,
                                      float(load_), float(below_peak_)});
            errors_[c].squares += error * error;
        }
        shares_.undetected += undetected;
        shares_.wrong += wrong;
        shares_.undetected_by_oracle += undetected_by_oracle;
    }

    void add_terms(const Estimate& e, std::size_t c) {
        const Calibration& calibration = candidate_.calibration;
        const auto i =
            std::size_t(std::find(calibration.components.begin(), calibration.components.end(), kComponentNames[c]) -
                        calibration.components.begin());
        if (i >= calibration.sd.size() || i >= calibration.full_scale.size()) return;
        const double of_full_scale = 1 / (calibration.full_scale[i] * calibration.full_scale[i]);
        const double constant = calibration.sd[i] * calibration.sd[i];
        const double slope = calibration.sd_slope.empty() ? 0 : calibration.sd_slope[i] * e.wrench_S[c];
        const double load = calibration.sd_load.empty() ? 0 : calibration.sd_load[i] * load_of(e.wrench_S, calibration);
        const double parts[] = {constant, slope * slope, load * load,
                                before_[c] * before_[c] - constant - slope * slope - load * load,
                                e.sd[c] * e.sd[c] - before_[c] * before_[c]};
        for (std::size_t k = 0; k < terms_.size(); ++k) terms_[k] += of_full_scale * std::max(0.0, parts[k]);
    }

    const Candidate& candidate_;
    Domain domain_;
    std::unique_ptr<Decoupler> decoupler_;
    Latency latency_;
    Wrench delay_s_{};
    Wrench zero_{}, before_{};
    bool is_tared_ = false;
    std::array<Errors, 6> errors_;
    std::array<double, 5> terms_{};
    bool is_traced_ = false;
    LoadPeak peak_ = LoadPeak::rested();
    double load_ = 0, below_peak_ = 0;
    std::array<std::vector<Traced>, 6> traced_;
    Shares shares_;
};

inline double percent(std::size_t part, std::size_t whole) {
    return whole == 0 ? std::nan("") : 100 * double(part) / double(whole);
}

// consistency_scenes.cpp: one line of a table; `first` is its first column.
void print_titles(const std::string& first);
void print_shares(const std::string& first, const Shares& shares);

// consistency_scenes.cpp: each [[expect]] of the scenes in `folder`, or of the one named, with its calibration and method.
// setup: throws SetupError
void judge_scenes(const std::string& folder, const std::string& name);

inline constexpr std::size_t kMaxCalibrationRows = 40'000;
struct Expectation {
    std::string sensor, calibration, method;
    double from_s, to_s;
    std::size_t max_rows = kMaxCalibrationRows;
};
// consistency_scenes.cpp: the scenes in `folder` whose name matches, the expectations of a scene's forces, and a calibration
// scene as rows and request.
// setup: throws SetupError
std::vector<std::filesystem::path> scenes_in(const std::string& folder, const std::string& pattern);
std::vector<Expectation> expectations_of(const std::filesystem::path& path);
struct CalibrationOfScene {
    ctl::CalibrationScene scene;
    FitRequest request;
};
CalibrationOfScene calibration_of_scene(const std::filesystem::path& path, const std::string& method);
// The calibrations of `tactilectl tradeoff`, and the scenes in which it judges them.
struct Contested {
    const char *calibration, *scenes;
    std::vector<const char*> methods;
};
const std::vector<Contested>& contested();
inline constexpr std::size_t kRowsOfContest = 600;  // node/lab/tradeoff_plan.cpp

// consistency_parts.cpp: the scenes with an [[expect]] on COUNT sensors, each calibrated by itself, from serial and seed
// `first` on. setup: throws SetupError
void judge_parts(const std::string& folder, std::uint64_t first, std::uint64_t count, const std::string& name);

// consistency_lost.cpp: the GOOD samples that the checks cost in undamaged scenes, with seeds from `first` on.
// setup: throws SetupError
void judge_lost(const std::string& folder, std::uint64_t first, std::uint64_t count, const std::string& name);

// consistency_lost.cpp: for each row, whether the daemon, with its default limits, would call a channel of the calibration
// frozen. Simulated channels are not known to be noisy.
std::vector<bool> is_frozen(const Candidate& candidate, const Labelled& rows);

// consistency_damage.cpp: each damage of the channels of a recording. setup: throws SetupError
void judge_damage(const std::string& fit_file, const std::string& judge_file, const std::string& methods);

// consistency_ensemble.cpp: each method, over loads and mountings on which nothing was chosen, for so many hours, and with
// each cause of its errors held away. setup: throws SetupError
void judge_ensemble(const std::string& folder, const std::vector<ctl::Contest>& contests, double hours);

// consistency_costs.cpp: ns per sample of each check of each method, on the first scene of its contest.
void print_costs(const std::vector<ctl::Contest>& contests);

}  // namespace tactiled
