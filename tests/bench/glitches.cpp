// Single wrong readings and what a sensor says of them: bit slips of a converter of 24 bits (shifted left with ones, 0 or
// all ones), one channel that reads 0, and a channel with the value of its neighbour. A sensor of 1 to 15 channels with 0.1
// % of noise rests, or is pressed in strokes of 0.3 to 2 s, and is sampled at 10 to 1,000 Hz; 1 to 5 % of its readings are
// damaged. Fixed seeds: the same table everywhere. GOOD and wrong: by more than 10 % of full scale.
//
//   glitches              25 s
//   glitches --count N    N samples of a sensor at rest, for instruction counts by valgrind; --count N bare: without the
//   check
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <random>
#include <string_view>
#include <vector>

#include "node/jump_check.hpp"
#include "node/sensor.hpp"

namespace {

using namespace tactiled;

constexpr double kFullScale_N = 20, kNoise = 0.001, kSd = 0.01, kCounts = 1e6;  // counts of full scale
constexpr double kWrong_N = 0.1 * kFullScale_N;
constexpr std::size_t kSamples = 40'000;

// A linear model of many channels: the least-squares inverse of gains at random.
class Linear final : public Decoupler {
public:
    Linear(std::size_t channels, std::mt19937_64& random) : n_components_(std::min<std::size_t>(channels, 3)) {
        std::normal_distribution<double> normal(0, 1);
        for (std::size_t k = 0; k < channels; ++k) {
            gain.emplace_back();
            for (std::size_t c = 0; c < n_components_; ++c)  // each channel mostly follows one component
                gain[k][c] = kCounts / kFullScale_N * ((k % n_components_ == c ? 1 : 0) + 0.2 * normal(random));
        }
        invert();
    }
    Estimate decouple(const Reading& reading) noexcept override {
        Estimate e;
        for (std::size_t c = 0; c < n_components_; ++c) {
            e.wrench_S[c] = 0;
            for (std::size_t k = 0; k < gain.size(); ++k) e.wrench_S[c] += inverse_[k][c] * reading.channel[k];
            e.sd[c] = kSd * kFullScale_N;
        }
        e.has_value = true;
        return e;
    }
    std::string_view method() const noexcept override { return "linear"; }

    std::vector<std::array<double, 3>> gain;  // counts per N

private:
    // inverse = gain (gain^T gain)^-1, by Gauss-Jordan elimination.
    void invert() {
        std::array<std::array<double, 6>, 3> a{};
        for (std::size_t i = 0; i < n_components_; ++i) {
            for (std::size_t j = 0; j < n_components_; ++j)
                for (const auto& row : gain) a[i][j] += row[i] * row[j];
            a[i][3 + i] = 1;
        }
        for (std::size_t i = 0; i < n_components_; ++i) {
            const double pivot = a[i][i];
            for (double& x : a[i]) x /= pivot;
            for (std::size_t j = 0; j < n_components_; ++j) {
                if (j == i) continue;
                const double factor = a[j][i];
                for (std::size_t k = 0; k < 6; ++k) a[j][k] -= factor * a[i][k];
            }
        }
        for (const auto& row : gain) {
            inverse_.emplace_back();
            for (std::size_t c = 0; c < n_components_; ++c)
                for (std::size_t i = 0; i < n_components_; ++i) inverse_.back()[c] += row[i] * a[i][3 + c];
        }
    }

    std::size_t n_components_;
    std::vector<std::array<double, 3>> inverse_;
};

// A force that rests, or that goes from level to level in strokes with pauses.
class Motion {
public:
    Motion(bool moves, double rate_Hz, std::mt19937_64& random) : moves_(moves), rate_Hz_(rate_Hz), random_(random) {
        begin();
    }
    std::array<double, 3> next() {
        const double phase = std::clamp(at_s_ / stroke_s_, 0.0, 1.0);
        std::array<double, 3> force{};
        for (std::size_t c = 0; c < 3; ++c)
            force[c] = from_[c] + (to_[c] - from_[c]) * (1 - std::cos(std::numbers::pi * phase)) / 2;
        at_s_ += 1 / rate_Hz_;
        if (moves_ && at_s_ > stroke_s_ + pause_s_) begin();
        return force;
    }
    std::size_t strokes = 0;

private:
    void begin() {
        std::uniform_real_distribution<double> level(-0.8 * kFullScale_N, 0.8 * kFullScale_N), share;
        ++strokes;
        at_s_ = 0;
        stroke_s_ = 0.3 + 1.7 * share(random_);
        pause_s_ = share(random_);
        from_ = to_;
        for (double& x : to_) x = level(random_);
        if (!moves_) from_ = to_;
    }
    bool moves_;
    double rate_Hz_, at_s_ = 0, stroke_s_ = 1, pause_s_ = 0;
    std::array<double, 3> from_{}, to_{};
    std::mt19937_64& random_;
};

void damage(Frame& frame, int kind, std::mt19937_64& random) {
    const std::size_t n = frame.n_channels, k = random() % n;
    const auto bits = std::int32_t(frame.channel[k]);
    const unsigned shift = 1 + unsigned(random() % 6);
    constexpr std::uint32_t kMask = 0xFFFFFF;
    const auto of_24_bits = [](std::uint32_t value) { return double(std::int32_t(value << 8) >> 8); };
    switch (kind) {
        case 0: frame.channel[k] = of_24_bits((std::uint32_t(bits) << shift | ((1u << shift) - 1)) & kMask); break;
        case 1: frame.channel[k] = 0; break;
        case 2: frame.channel[k] = double((1u << (8 + random() % 16)) - 1); break;
        default: frame.channel[k] = frame.channel[(k + 1) % n];
    }
}

struct Count {
    std::size_t samples = 0, lost = 0, strokes = 0;  // lost: undamaged and not GOOD
    std::size_t large = 0, wrong = 0;                // damaged readings that change the force; of them GOOD
};

// `share` of the readings are damaged, in runs of `run` readings, or independently of each other if it is 0; then only those
// with a damaged neighbour count.
Count measure(std::size_t channels, double rate_Hz, int kind, bool moves, double share, std::size_t run, unsigned seed,
              std::size_t samples = kSamples) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0, kNoise * kCounts);
    auto linear = std::make_unique<Linear>(channels, random);
    const auto gain = linear->gain;
    Sensor::Setup setup;
    for (std::size_t k = 0; k < channels; ++k) setup.channel_of_frame.push_back(int(k));
    setup.frame_channels = channels;
    setup.tuning.stale_ns = 1'000'000'000;
    setup.decoupler = std::move(linear);
    Sensor sensor(std::move(setup));
    sensor.start(1, 0);
    Motion motion(moves, rate_Hz, random);
    Count count;
    std::uniform_real_distribution<double> chance;
    std::size_t damaged = 0, since = 0;  // readings of the present run, and since the last one
    Frame frame;
    frame.n_channels = std::uint8_t(channels);
    for (std::size_t i = 0; i < samples; ++i) {
        const auto force = motion.next();
        for (std::size_t k = 0; k < channels; ++k) {
            double value = noise(random);
            for (std::size_t c = 0; c < 3; ++c) value += gain[k][c] * force[c];
            frame.channel[k] = std::round(value);
        }
        frame.t_ns = std::uint64_t(double(i + 1) * 1e9 / rate_Hz);
        if (damaged > 0) --damaged;
        const bool may_begin = damaged == 0 && i > 100 && (run == 0 || since > 4);
        if (may_begin && chance(random) < share / double(std::max<std::size_t>(run, 1)))
            damaged = std::max<std::size_t>(run, 1);
        const bool is_counted = run > 0 || since == 0;
        if (damaged > 0) damage(frame, kind, random);
        since = damaged > 0 ? 0 : since + 1;
        const tactiled_sample s = sensor.sample(frame, frame.t_ns);
        if (i < 100) continue;
        ++count.samples;
        double off_N = 0;
        for (std::size_t c = 0; c < std::min<std::size_t>(channels, 3); ++c)
            off_N = std::max(off_N, std::abs(s.force_S_N[c] - force[c]));
        if (damaged == 0)
            count.lost += s.quality != TACTILED_GOOD ? 1 : 0;
        else if (is_counted && off_N > kWrong_N) {
            ++count.large;
            count.wrong += s.quality == TACTILED_GOOD ? 1 : 0;
        }
    }
    count.strokes = motion.strokes;
    return count;
}

constexpr std::size_t kChannels[] = {1, 3, 6, 15};
constexpr double kRates_Hz[] = {10, 80, 1000};

// The largest share of large errors that are GOOD, by number of channels, over kinds, rates and shares of damage.
void print_wrong(const char* name, bool moves, std::size_t run) {
    double worst = 0;
    std::size_t large = 0, wrong = 0;
    std::string by_channels;
    std::map<double, std::array<std::size_t, 2>> by_rate;
    for (const std::size_t channels : kChannels) {
        double here = 0;
        for (const double rate_Hz : kRates_Hz)
            for (int kind = 0; kind < 4; ++kind)
                for (const double share : {0.01, 0.05}) {
                    if (kind == 3 && channels == 1) continue;
                    const Count count = measure(channels, rate_Hz, kind, moves, share, run, unsigned(channels + 7 * kind));
                    large += count.large;
                    wrong += count.wrong;
                    by_rate[rate_Hz][0] += count.wrong;
                    by_rate[rate_Hz][1] += count.large;
                    if (count.large >= 20) here = std::max(here, double(count.wrong) / double(count.large));
                }
        by_channels += fmt::format("  {}: {:.2f} %", channels, 100 * here);
        worst = std::max(worst, here);
    }
    fmt::print("{:<22} {:6.2f} % of {:6} GOOD, worst {:6.2f} %; by channels{}", name, 100 * double(wrong) / double(large),
               large, 100 * worst, by_channels);
    for (const auto& [rate_Hz, counts] : by_rate)
        fmt::print("  {} Hz: {:.2f} %", rate_Hz, 100 * double(counts[0]) / double(counts[1]));
    fmt::print("\n");
}

void print_lost(const char* name, bool moves) {
    Count all;
    for (const double rate_Hz : kRates_Hz) {
        const double hours = rate_Hz > 100 ? 1 : 10;
        const Count count = measure(6, rate_Hz, 0, moves, 0, 1, 5, std::size_t(hours * 3600 * rate_Hz));
        all.lost += count.lost;
        all.samples += count.samples;
        all.strokes += count.strokes;
        fmt::print("{:<22} {:5.0f} Hz, {} h: {} of {} lost, {:.2f} a stroke\n", name, rate_Hz, hours, count.lost,
                   count.samples, double(count.lost) / double(std::max<std::size_t>(count.strokes, 1)));
    }
    fmt::print("{:<22} all: {:.4f} %\n", name, 100 * double(all.lost) / double(all.samples));
}

int run_check(std::size_t samples, bool with_check) {
    JumpCheck check;
    std::uint64_t noise = 1, confirmed = 0;
    Wrench wrench{}, sd{};
    for (std::size_t i = 0; i < samples; ++i) {
        for (double& x : wrench) {
            noise = noise * 6364136223846793005u + 1442695040888963407u;
            x = double(noise >> 40) * 1e-9;
        }
        sd.fill(0.01);
        confirmed += !with_check || check.confirm(wrench, sd, i * 1'000'000u, 0) ? 1 : 0;
        confirmed += std::uint64_t(wrench[i % 6] > 1);
    }
    return confirmed > samples / 2 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 2 && std::string_view(argv[1]) == "--count") return run_check(std::strtoull(argv[2], nullptr, 10), argc == 3);
    print_wrong("single, at rest", false, 1);
    print_wrong("single, moving", true, 1);
    print_wrong("adjacent, at rest", false, 0);
    print_wrong("adjacent, moving", true, 0);
    print_wrong("only pairs, at rest", false, 2);
    print_lost("undamaged, at rest", false);
    print_lost("undamaged, moving", true);
}
