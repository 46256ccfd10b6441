// Measures the change that each effect makes to the channels, and its time, on this machine, in this run.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "decoupling/fit/least_squares.hpp"
#include "node/lab/simulate.hpp"
#include "node/lab/tradeoff.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

using sim::Block;
using sim::Scene;
using sim::Simulation;

// Times are medians over pieces of a run, so that interruptions by other programs have no influence.
constexpr std::size_t kPiece_blocks = 16, kMaxPieces = 400, kMinPieces = 9;
constexpr std::uint64_t kTiming_ns = 400'000'000;

// A scene that restarts at its end, so that short ones can be timed, too.
class Endless {
public:
    Endless(const Scene& scene, std::string effects, std::size_t sensor, bool times)
        : scene_(scene), effects_(std::move(effects)), sensor_(sensor), times_(times) {
        begin();
    }
    // Returns ns per sample of the next piece.
    double piece() {
        if (left_ == 0) begin();
        std::size_t samples = 0;
        const std::uint64_t began_ns = monotonic_ns();
        for (std::size_t i = 0; i < kPiece_blocks && left_ > 0; ++i) {
            const std::size_t n = simulation_->advance(sensor_).n;
            samples += n;
            left_ -= n;
        }
        const double ns = double(monotonic_ns() - began_ns);
        samples_ = samples;
        return ns / double(samples);
    }
    [[nodiscard]] std::size_t samples() const { return samples_; }  // number in the last piece
    [[nodiscard]] std::vector<std::uint64_t> times_ns() {
        if (left_ == 0) begin();
        return simulation_->times_ns(sensor_);
    }
    [[nodiscard]] const std::vector<std::uint64_t>& times_after_ns() const { return simulation_->times_ns(sensor_); }

private:
    void begin() {
        simulation_ = std::make_unique<Simulation>(scene_, effects_);
        simulation_->measure_times(times_);
        left_ = scene_.samples;
    }
    const Scene& scene_;
    std::string effects_;
    std::size_t sensor_;
    bool times_;
    std::unique_ptr<Simulation> simulation_;
    std::uint64_t left_ = 0;
    std::size_t samples_ = 0;
};

void measure_times(const Scene& scene, const std::string& effects, std::size_t sensor, Measured& result) {
    if (scene.samples == 0) return;
    Endless none(scene, "none", sensor, false), chosen(scene, effects, sensor, false), all(scene, "all", sensor, false),
        steps(scene, "all", sensor, true);
    const std::size_t n = result.share_N.size();
    std::vector<double> none_ns, chosen_ns, all_ns;
    std::vector<std::vector<double>> step_ns(n + 1);
    const double reading_ns = clock_ns();
    constexpr double kLinearSteps = 4;  // clock, motion, drive, gauges
    const std::uint64_t began_ns = monotonic_ns();
    for (std::size_t i = 0; i < kMaxPieces && (i < kMinPieces || monotonic_ns() - began_ns < kTiming_ns); ++i) {
        const double a = none.piece(), b = chosen.piece(), c = all.piece();
        const auto before = steps.times_ns();
        steps.piece();
        if (i == 0) continue;  // skips the cold first piece
        none_ns.push_back(a);
        chosen_ns.push_back(b);
        all_ns.push_back(c);
        const double samples = double(steps.samples()), blocks = std::ceil(samples / double(Block::kSize));
        for (std::size_t d = 0; d <= n; ++d) {
            const double spent = double(steps.times_after_ns()[d] - before[d]);
            step_ns[d].push_back(std::max(0.0, spent - blocks * reading_ns * (d == n ? kLinearSteps : 1)) / samples);
        }
    }
    result.none_ns = median(none_ns);
    result.chosen_ns = median(chosen_ns);
    result.all_ns = median(all_ns);
    for (std::size_t d = 0; d < n; ++d) result.time_ns.push_back(median(step_ns[d]));
    result.linear_ns = median(step_ns[n]);
}

// 3 x n: the force, fx fy fz, that the gains assign to a change of the channels by least squares, each channel in its
// newtons.
struct ForceOfChange {
    std::array<std::array<double, sim::kMaxSensorChannels>, 3> row{};

    explicit ForceOfChange(const sim::Sensor& sensor) {
        double a[3][6] = {};  // normal matrix | unit matrix, by Gauss and Jordan
        for (std::size_t k = 0; k < sensor.n(); ++k) {
            if (!(sensor.per_N[k] > 0)) continue;
            for (std::size_t i = 0; i < 3; ++i)
                for (std::size_t j = 0; j < 3; ++j)
                    a[i][j] += sensor.gain[k][i] * sensor.gain[k][j] / (sensor.per_N[k] * sensor.per_N[k]);
        }
        for (std::size_t i = 0; i < 3; ++i) a[i][3 + i] = 1;
        for (std::size_t i = 0; i < 3; ++i) {
            const double pivot = a[i][i] > 1e-12 ? a[i][i] : std::nan("");
            for (double& x : a[i]) x /= pivot;
            for (std::size_t r = 0; r < 3; ++r) {
                if (r == i) continue;
                const double factor = a[r][i];
                for (std::size_t c = 0; c < 6; ++c) a[r][c] -= factor * a[i][c];
            }
        }
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t k = 0; k < sensor.n(); ++k)
                for (std::size_t j = 0; j < 3 && sensor.per_N[k] > 0; ++j)
                    row[i][k] += a[i][3 + j] * sensor.gain[k][j] / (sensor.per_N[k] * sensor.per_N[k]);
    }
};

constexpr std::size_t kNone = SIZE_MAX;

// Returns the chosen effects without number `other`, or with it if it was not chosen. None of the effects in such a
// list rests.
std::string names_of(const sim::Choice& choice, std::size_t other) {
    std::string list;
    for (std::size_t i = 0; i < choice.decisions.size(); ++i)
        if (choice.decisions[i].on != (i == other)) list += (list.empty() ? "" : ",") + name_of(choice.decisions[i]);
    return list.empty() ? "none" : list;
}

constexpr std::uint64_t kForceSamples = 60'000;

void measure_forces(const Scene& scene, const std::string& effects, std::size_t sensor_number, Measured& result) {
    const sim::Sensor& sensor = scene.sensors[sensor_number];
    const ForceOfChange force(sensor);
    Scene one = scene;  // the other sensors would only take time
    one.sensors = {sensor};
    using Row = std::array<double, sim::kMaxSensorChannels>;
    const auto channels = [&](const std::string& list) {
        Simulation simulation(one, list);
        std::vector<Row> rows;
        for (const Block* b = &simulation.advance(0); b->n > 0 && rows.size() < kForceSamples; b = &simulation.advance(0))
            for (std::size_t n = 0; n < b->n; ++n) {
                Row& row = rows.emplace_back();
                for (std::size_t k = 0; k < sensor.n(); ++k)
                    row[k] = b->dropped[n] || (b->missing[n] >> k & 1u) != 0 ? std::nan("") : b->channel[k][n];
            }
        return rows;
    };
    const sim::Choice choice = Simulation(scene, effects).choice(sensor_number);
    const std::vector<Row> base = channels(names_of(choice, kNone));
    result.force_samples = base.size();
    Progress progress(fmt::format("forces without each effect, {}", sensor.name));
    for (std::size_t d = 0; d < choice.decisions.size(); ++d) {
        std::array<double, 3> largest{};
        if (choice.decisions[d].bound.change_N > 0) {
            const std::vector<Row> other = channels(names_of(choice, d));
            for (std::size_t n = 0; n < base.size(); ++n)
                for (std::size_t i = 0; i < 3; ++i) {
                    double sum = 0;
                    for (std::size_t k = 0; k < sensor.n(); ++k) sum += force.row[i][k] * (base[n][k] - other[n][k]);
                    if (std::abs(sum) > largest[i]) largest[i] = std::abs(sum);
                }
        }
        for (std::size_t i = 0; i < 3; ++i)
            if (std::isnan(force.row[i][0])) largest[i] = std::nan("");
        result.force_N.push_back(largest);
        progress.show(double(d) / double(choice.decisions.size()));
    }
}

}  // namespace

Measured measure(const Scene& scene, const std::string& effects, std::size_t i) {
    const sim::Sensor& sensor = scene.sensors[i];
    Measured result;
    Simulation chosen(scene, effects), all(scene, "all");
    all.measure_shares(true);
    Progress progress(fmt::format("measuring {}", sensor.name));
    for (std::uint64_t done = 0; done < scene.samples;) {
        const Block& a = chosen.advance(i);
        const Block& b = all.advance(i);
        for (std::size_t n = 0; n < a.n; ++n) {
            if ((done + n) % sensor.every != 0 || a.dropped[n] || b.dropped[n]) continue;
            std::array<double, sim::kMaxSensorChannels> change{};
            for (std::size_t k = 0; k < sensor.n(); ++k)
                if (((a.missing[n] | b.missing[n]) >> k & 1u) == 0) change[k] = a.channel[k][n] - b.channel[k][n];
            result.difference_N = std::max(result.difference_N, sensor.largest_N(change));
            ++result.samples;
        }
        done += a.n;
        progress.show(double(done) / double(scene.samples));
    }
    result.share_N = all.shares_N(i);
    measure_forces(scene, effects, i, result);
    measure_times(scene, effects, i, result);
    return result;
}

}  // namespace tactiled::ctl
