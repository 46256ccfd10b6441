// The error of a method in a trial, and the quality that it states.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/latency.hpp"
#include "decoupling/solve/domain.hpp"
#include "node/lab/tradeoff.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kUndetected_sd = 5;

double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return values.empty() ? kNaN : std::sqrt(sum / double(values.size()));
}

// Returns, for the components together, the root mean square from the mean squares of each.
double rms_of(const std::array<std::vector<double>, 6>& errors) {
    std::vector<double> of_axis;
    for (std::size_t c = 0; c < 3; ++c)
        if (!errors[c].empty()) of_axis.push_back(rms(errors[c]));
    return rms(of_axis);
}

}  // namespace

std::size_t first_load(const Labelled& rows) {
    const auto loaded = [](const LabelledRow& row) {
        return std::any_of(row.wrench_S.begin(), row.wrench_S.end(), [](double v) { return std::isfinite(v) && v != 0; });
    };
    return std::size_t(std::find_if(rows.rows.begin(), rows.rows.end(), loaded) - rows.rows.begin());
}

namespace {

// Returns the column of `rows` of each channel of the candidate's calibration.
std::vector<std::size_t> columns_of(const Candidate& candidate, const Labelled& rows) {
    std::vector<std::size_t> columns;
    for (const auto& name : candidate.calibration.channels) {
        const auto at = std::find(rows.channels.begin(), rows.channels.end(), name);
        if (at == rows.channels.end())
            throw SetupError(fmt::format("{} has no channel \"{}\", which {} needs", rows.name, name,
                                         candidate.calibration.path.empty() ? candidate.model : candidate.calibration.path));
        columns.push_back(std::size_t(at - rows.channels.begin()));
    }
    return columns;
}

}  // namespace

std::vector<double> delays_of(const Candidate& candidate, const Labelled& rows, const std::vector<double>& delay_s) {
    std::vector<double> delays;
    if (delay_s.empty()) return delays;
    for (const std::size_t column : columns_of(candidate, rows)) delays.push_back(delay_s[column]);
    return delays;
}

std::vector<Reading> readings_of(const Candidate& candidate, const Labelled& rows, std::vector<double>& storage) {
    const std::vector<std::size_t> columns = columns_of(candidate, rows);
    const auto& channels = candidate.calibration.channels;
    storage.assign(rows.rows.size() * channels.size(), kNaN);
    std::vector<Reading> readings;
    for (std::size_t i = 0; i < rows.rows.size(); ++i) {
        double* const channel = storage.data() + i * channels.size();
        Reading reading{.channel = {channel, channels.size()}, .missing = 0, .saturated = 0, .t_ns = rows.rows[i].t_ns};
        for (std::size_t k = 0; k < channels.size(); ++k) {
            channel[k] = rows.rows[i].channel[columns[k]];
            if (std::isnan(channel[k])) reading.missing |= 1u << k;
        }
        readings.push_back(reading);
    }
    return readings;
}

Judged judge(Decoupler& decoupler, const Candidate& candidate, const Labelled& rows, const std::vector<double>& delay_s) {
    std::vector<double> storage;
    const auto readings = readings_of(candidate, rows, storage);
    const Calibration& calibration = candidate.calibration;
    Wrench full_scale = kUnseen, zero{};
    for (std::size_t i = 0; i < calibration.full_scale.size(); ++i)
        full_scale[component_index(calibration.components[i])] = calibration.full_scale[i];
    const std::size_t begin = first_load(rows);
    std::array<double, 6> sum{};
    std::size_t at_rest = 0;
    Judged judged;
    std::array<std::vector<double>, 6> errors, good_errors;
    const std::vector<double> delays_s = delays_of(candidate, rows, delay_s);
    Latency latency;
    latency.set_delay(delay_of_components_s(decoupler, delays_s));
    decoupler.set_delay(delays_s);
    for (std::size_t i = 0; i < readings.size(); ++i) {
        Estimate e = decoupler.decouple(readings[i]);
        if (e.quality() == TACTILED_BAD)
            latency.forget();
        else
            latency.widen(e.wrench_S, readings[i].t_ns, e.sd);
        if (i < begin) {  // the second half of the time at rest is the tare
            if (i < begin / 2 || e.quality() == TACTILED_BAD) continue;
            ++at_rest;
            for (std::size_t c = 0; c < sum.size(); ++c) sum[c] += std::isfinite(e.wrench_S[c]) ? e.wrench_S[c] : 0;
            continue;
        }
        if (i == begin && at_rest > 0)
            for (std::size_t c = 0; c < sum.size(); ++c) zero[c] = sum[c] / double(at_rest);
        ++judged.samples;
        if (e.quality() == TACTILED_BAD) {
            ++judged.bad;
            continue;
        }
        const bool good = e.quality() == TACTILED_GOOD;
        ++(good ? judged.good : judged.uncertain);
        bool undetected = false;
        for (std::size_t c = 0; c < errors.size(); ++c) {
            const double error = e.wrench_S[c] - zero[c] - rows.rows[i].wrench_S[c];
            if (!std::isfinite(error) || !(full_scale[c] > 0)) continue;
            errors[c].push_back(100 * std::abs(error) / full_scale[c]);
            if (!good) continue;
            good_errors[c].push_back(errors[c].back());
            undetected = undetected || std::abs(error) > kUndetected_sd * e.sd[c];
        }
        judged.undetected += undetected;
    }
    for (std::size_t c = 0; c < errors.size(); ++c) {
        judged.rms_percent[c] = rms(errors[c]);
        if (errors[c].empty()) continue;
        const auto at = errors[c].begin() + std::ptrdiff_t(0.99 * double(errors[c].size() - 1));
        std::nth_element(errors[c].begin(), at, errors[c].end());
        judged.p99_percent[c] = *at;
    }
    judged.force_rms_percent = rms_of(errors);
    judged.good_rms_percent = rms_of(good_errors);
    return judged;
}

Judged over_all(const std::vector<Judged>& trials) {
    Judged all;
    const bool blind =
        std::any_of(trials.begin(), trials.end(), [](const Judged& j) { return j.samples > 0 && j.bad == j.samples; });
    const auto mean = [&](auto error) {
        double sum = 0;
        std::size_t n = 0;
        for (const Judged& j : trials)
            if (const double value = error(j); std::isfinite(value)) sum += std::log(std::max(value, 1e-9)), ++n;
        return blind || n == 0 ? kNaN : std::exp(sum / double(n));
    };
    for (std::size_t c = 0; c < all.rms_percent.size(); ++c) {
        all.rms_percent[c] = mean([c](const Judged& j) { return j.rms_percent[c]; });
        if (blind) continue;
        for (const Judged& j : trials) all.p99_percent[c] = std::fmax(all.p99_percent[c], j.p99_percent[c]);
    }
    all.force_rms_percent = mean([](const Judged& j) { return j.force_rms_percent; });
    all.good_rms_percent = mean([](const Judged& j) { return j.good_rms_percent; });
    for (const Judged& j : trials) {
        all.samples += j.samples;
        all.good += j.good;
        all.uncertain += j.uncertain;
        all.bad += j.bad;
        all.undetected += j.undetected;
    }
    return all;
}

}  // namespace tactiled::ctl
