// Zeros that drift: calibrate sees a recording with this drift, then the sensor is tared and measures for an hour. Prints
// the share of GOOD samples that are off by more than 5 sd, in parentheses without the rate of calibrate, and the share of
// samples whose zero is old. Then eight hours of picks, also by how far the zero has moved at their end, and an hour of
// picks with a drift that the recording does not have.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "node/sensor.hpp"
#include "node/sensor_setup.hpp"
#include "node/setup.hpp"

namespace tactiled {
namespace {

constexpr double kFullScale_N = 10, kWidth = 2e5, kRate_Hz = 2, kHour_s = 3600, kWarm_s = 600;
constexpr int kSensors = 40;

enum class Use { held, picks, standing };
struct Case {
    const char* name;
    double per_min = 0, warm_up = 0;  // in widths of a channel
    Use use = Use::held;
    double load = 0;  // standing, in sd
};

// Channels with random gains, slightly bent, and a noise of 0.05 % of their width; each drifts its own way.
class Made {
public:
    Made(int number, const Case& of) : random_(unsigned(number)), of_(of) {
        static constexpr std::size_t kChannels[] = {3, 6, 8, 15};
        std::normal_distribution<double> normal;
        gain_.resize(kChannels[std::size_t(number) % 4]);
        for (auto& row : gain_)
            for (double& x : row) x = normal(random_) * kWidth / kFullScale_N / 2;
        turn();
    }
    // Another session: another direction of the drift.
    void turn() {
        std::uniform_real_distribution<double> uniform(-1, 1);
        drift_.resize(gain_.size());
        for (double& x : drift_) x = uniform(random_);
    }
    std::vector<double> read(const std::array<double, 3>& force_N, double t_s) {
        const double moved = of_.per_min * t_s / 60 + of_.warm_up * (1 - std::exp(-t_s / kWarm_s));
        std::vector<double> channel;
        for (std::size_t k = 0; k < gain_.size(); ++k) {
            double x = 0;
            for (std::size_t c = 0; c < 3; ++c) x += gain_[k][c] * force_N[c];
            channel.push_back(x + 0.02 * x * x / kWidth + kWidth * drift_[k] * moved + 5e-4 * kWidth * noise_(random_));
        }
        return channel;
    }
    std::array<double, 3> load() {
        std::uniform_real_distribution<double> uniform(-0.8, 0.8);
        return {kFullScale_N * uniform(random_), kFullScale_N * uniform(random_), kFullScale_N * uniform(random_)};
    }
    // Two sessions of half an hour, in which each press is followed by a rest.
    Labelled recording() {
        Labelled labelled;
        labelled.name = "drifting.csv";
        labelled.sessions = {"1", "2"};
        for (std::size_t k = 0; k < gain_.size(); ++k) labelled.channels.push_back(fmt::format("c{}", k + 1));
        for (std::size_t session = 0; session < 2; ++session, turn())
            for (int i = 0; i < 900; ++i) {
                const double t_s = 2.0 * i;
                const auto force = i % 2 == 0 ? std::array<double, 3>{} : load();
                labelled.rows.push_back({.line = std::int64_t(labelled.rows.size()) + 2,
                                         .channel = read(force, t_s),
                                         .wrench_S = {force[0], force[1], force[2], kNaN, kNaN, kNaN},
                                         .session = session,
                                         .t_ns = 1 + std::uint64_t(t_s * 1e9)});
            }
        return labelled;
    }
    std::mt19937_64& random() { return random_; }

private:
    std::mt19937_64 random_;
    Case of_;
    std::normal_distribution<double> noise_;
    std::vector<std::array<double, 3>> gain_;
    std::vector<double> drift_;
};

struct Count {
    std::size_t samples = 0, old = 0, good = 0, wrong = 0;
    void add(const Count& more) { samples += more.samples, old += more.old, good += more.good, wrong += more.wrong; }
};

Count measure(Made made, const Case& of, const Calibration& calibration, bool ages, double hours = 1) {
    Count count;
    Sensor::Setup setup;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) setup.channel_of_frame.push_back(int(k));
    setup.frame_channels = calibration.channels.size();
    setup.tuning.stale_ns = 2'000'000'000;
    setup.tuning.tare_ms = 5000;
    setup.needs_tare = calibration.validation.ends_with(Calibration::kOwnZeros);
    if (ages) setup.zero = zero_rates(calibration);
    setup.decoupler = make_decoupler(calibration);
    Sensor sensor(std::move(setup));
    sensor.start(1, 0);
    std::array<double, 3> held = made.load(), standing{};
    const std::size_t axis = made.random()() % 3;
    standing[axis] = of.load * calibration.sd[axis];
    Frame frame;
    frame.n_channels = std::uint8_t(calibration.channels.size());
    const int n_tare = int(10 * kRate_Hz);
    for (int i = 0; i < int(hours * kHour_s * kRate_Hz); ++i) {
        const double t_s = double(i + 1) / kRate_Hz;
        const bool presses = i > n_tare && (of.use == Use::held || (of.use == Use::picks && int(t_s) % 20 < 10));
        if (of.use == Use::picks && i % int(20 * kRate_Hz) == 0) held = made.load();
        const auto force = presses ? held : i > n_tare ? standing : std::array<double, 3>{};
        const auto channel = made.read(force, t_s);
        std::copy(channel.begin(), channel.end(), frame.channel.begin());
        frame.t_ns = 1 + std::uint64_t(t_s * 1e9);
        if (i == int(kRate_Hz)) sensor.begin_tare(frame.t_ns);
        const tactiled_sample s = sensor.sample(frame, frame.t_ns);
        (void)sensor.poll_tare(frame.t_ns);
        if (i <= n_tare) continue;
        ++count.samples;
        count.old += (s.reasons & TACTILED_ZERO_OLD) != 0 ? 1 : 0;
        if (s.quality != TACTILED_GOOD) continue;
        ++count.good;
        bool wrong = false;
        for (std::size_t c = 0; c < 3; ++c) wrong |= std::abs(s.force_S_N[c] - force[c]) > 5 * s.sd_force_N[c];
        count.wrong += wrong ? 1 : 0;
    }
    return count;
}

// A zero that has moved by more may be a load of which 10 % of full scale are one standard deviation: it is old.
constexpr double kFar = 0.3;

// Returns how far the zero moves in this time, in its largest component.
double moved_N(Made made, const Calibration& calibration, double t_s) {
    const auto decoupler = make_decoupler(calibration);
    const auto force_at = [&](double at_s) {
        decoupler->forget();
        const auto channel = made.read({}, at_s);
        return decoupler->decouple({.channel = channel}).wrench_S;
    };
    const Wrench begin = force_at(0), end = force_at(t_s);
    double farthest_N = 0;
    for (std::size_t c = 0; c < 3; ++c) farthest_N = std::max(farthest_N, std::abs(end[c] - begin[c]));
    return farthest_N;
}

double percent(std::size_t part, std::size_t of) { return of == 0 ? 0 : 100.0 * double(part) / double(of); }

Calibration calibrated(Made& made, int number) {
    FitRequest request;
    request.model = "generic";
    request.method = number % 8 < 4 ? "matrix" : "quadratic";
    request.date = "2026-01-01";
    return fit(made.recording(), request).calibration;
}

void print(const std::string& what, const Count& now, const Count& before) {
    fmt::print("{}: {:.3f} % of GOOD beyond 5 sd ({:.1f} %), {:.1f} % old\n", what, percent(now.wrong, now.good),
               percent(before.wrong, before.good), percent(now.old, now.samples));
    std::fflush(stdout);
}

void run_day() {
    Count day, day_before;
    std::array<Count, 2> by_distance;  // near, far
    std::array<int, 2> sensors{};
    const Case picks{"picks", 1e-4, 0, Use::picks, 0};
    for (int number = 0; number < kSensors; ++number) {
        Made made(number, picks);
        const Calibration calibration = calibrated(made, number);
        const Count one = measure(made, picks, calibration, true, 8);
        const bool is_far = moved_N(made, calibration, 8 * kHour_s) > kFar * kFullScale_N;
        day.add(one);
        by_distance[is_far].add(one);
        ++sensors[is_far];
        day_before.add(measure(made, picks, calibration, false, 8));
    }
    print("eight hours of picks, drift 0.01 %/min", day, day_before);
    for (const bool is_far : {false, true})
        fmt::print("of these {} sensors whose zero moves by {} than 30 % of full scale: {:.3f} % old\n", sensors[is_far],
                   is_far ? "more" : "less", percent(by_distance[is_far].old, by_distance[is_far].samples));
}

int run() {
    std::vector<Case> cases;
    for (const auto& [use, name, load] : {std::tuple{Use::held, "held", 0.0},
                                          {Use::picks, "picks", 0.0},
                                          {Use::standing, "load of 0.5 sd", 0.5},
                                          {Use::standing, "load of 1 sd", 1.0},
                                          {Use::standing, "load of 2 sd", 2.0}}) {
        for (const double per_min : {1e-4, 1e-3, 5e-3, 2e-2}) cases.push_back({name, per_min, 0, use, load});
        for (const double warm_up : {0.01, 0.03, 0.1}) cases.push_back({name, 0, warm_up, use, load});
    }
    Count all, all_before;
    for (const Case& of : cases) {
        Count count, before;
        for (int number = 0; number < kSensors; ++number) {
            Made made(number, of);
            const Calibration calibration = calibrated(made, number);
            count.add(measure(made, of, calibration, true));
            before.add(measure(made, of, calibration, false));
        }
        all.add(count);
        all_before.add(before);
        print(fmt::format("{}, {} {:g} %{}", of.name, of.per_min > 0 ? "drift" : "warm-up",
                          100 * (of.per_min > 0 ? of.per_min : of.warm_up), of.per_min > 0 ? "/min" : ""),
              count, before);
    }
    print("all", all, all_before);
    run_day();
    for (const double per_min : {1e-4, 1e-3, 5e-3}) {
        Count unseen, unseen_before;
        const Case drifting{"picks", per_min, 0, Use::picks, 0};
        for (int number = 0; number < kSensors; ++number) {
            Made still(number, {"picks", 0, 0, Use::picks, 0});
            const Calibration calibration = calibrated(still, number);
            unseen.add(measure(Made(number, drifting), drifting, calibration, true));
            unseen_before.add(measure(Made(number, drifting), drifting, calibration, false));
        }
        print(fmt::format("picks, drift of {:g} %/min that the recording does not have", 100 * per_min), unseen,
              unseen_before);
    }
    return 0;
}

}  // namespace
}  // namespace tactiled

int main() { return tactiled::run(); }
