// Statements of an array against the truth: sum, centre, area and axis of balls, punches and edges, with a
// noise and gains at random, and dead taxels. Fixed seeds: the same table everywhere.
//
//   arrays                        6 s
//   arrays --faults               30 s: taxels and lines with faults that nobody declared
//   arrays --count N TAXELS VALUES    N frames of a pressed array, for instruction counts by valgrind
#include <fmt/format.h>

#include <cstdlib>
#include <functional>
#include <map>
#include <string_view>

#include "decoupling/patch/patch.hpp"
#include "pressed_array.hpp"

namespace {

using namespace tactiled;
using pressed::Array;
using pressed::Body;
using pressed::Kind;

constexpr int kFrames = 2000;
constexpr double kWrong_N = 1;  // a tenth of the largest press

// Errors relative to their stated sd.
struct Held {
    int n = 0, none = 0, within = 0, beyond = 0;
    void add(double error, double sd) {
        if (!(sd >= 0)) return void(++none);
        ++n;
        within += std::abs(error) <= sd ? 1 : 0;
        beyond += std::abs(error) > 5 * sd ? 1 : 0;
    }
};

struct Worst {
    double beyond = 0, wrong = 0;  // %
};

struct Run {
    explicit Run(const Array& of) : array(of), patch(make_decoupler(pressed::calibration_of(of))) {}

    // Judges frames with bodies at random places.
    void judge(Worst& worst, const std::string& name, const std::function<Body(std::mt19937_64&)>& make,
               std::size_t dead = 0) {
        std::mt19937_64 random(7);
        std::normal_distribution<double> normal(0, 1);
        std::map<std::string, Held> held;
        int good = 0, wrong = 0;
        for (int k = 0; k < kFrames; ++k) {
            const Body body = make(random);
            std::vector<double> gain(array.taxels());
            for (double& g : gain) g = 1 + array.gain_sd * normal(random);
            std::vector<float> raw(array.taxels() * array.values, 0);
            pressed::press(array, body, gain, raw);
            for (float& value : raw) value += float(array.noise_N * array.counts_per_N * normal(random));
            for (std::size_t i = 0; i < dead; ++i) raw[random() % array.taxels()] = std::numeric_limits<float>::quiet_NaN();
            Reading reading;
            const auto n = std::uint16_t(array.taxels());
            reading.taxels = {{n, std::uint16_t(array.values)}, raw};
            const Estimate e = patch->decouple(reading);
            const auto& seen = *static_cast<const tactiled_array*>(patch->patch()->record(tactiled_sample{}));
            held["fz"].add(e.wrench_S[2] + body.force, e.sd[2]);
            held["mx"].add(e.wrench_S[3] + body.y * body.force, e.sd[3]);
            held["x"].add(double(seen.cop_S_m[0]) - body.x, double(seen.cop_sd_m[0]));
            held["y"].add(double(seen.cop_S_m[1]) - body.y, double(seen.cop_sd_m[1]));
            held["area"].add(double(seen.area_m2) - body.area_m2(), double(seen.area_sd_m2));
            const double turn = std::remainder(double(seen.axis_rad) - body.turn, std::numbers::pi);
            held["axis"].add(turn, double(seen.axis_sd_rad));
            const bool is_good = e.quality() == TACTILED_GOOD;
            good += is_good ? 1 : 0;
            wrong += is_good && std::abs(e.wrench_S[2] + body.force) > kWrong_N ? 1 : 0;
        }
        fmt::print("{}: GOOD {:.1f} %, GOOD and off by 10 % {:.2f} %\n", name, 100. * good / kFrames,
                   100. * wrong / kFrames);
        worst.wrong = std::max(worst.wrong, 100. * wrong / kFrames);
        for (const auto& [what, h] : held) {
            if (h.n > kFrames / 10) worst.beyond = std::max(worst.beyond, 100. * h.beyond / h.n);
            fmt::print("  {:5} within 1 sd {:5.1f} %, beyond 5 sd {:5.2f} %, none {:5.1f} %\n", what,
                       100. * h.within / std::max(h.n, 1), 100. * h.beyond / std::max(h.n, 1), 100. * h.none / kFrames);
        }
    }

    Array array;
    std::unique_ptr<Decoupler> patch;
};

double between(std::mt19937_64& random, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
}

// Faults of taxels under the press: each is one taxel in contact, three of them, or a whole column through the centre.
enum class Fault { none, dead, stuck, weak, shifted, swapped };
constexpr std::array<std::string_view, 6> kFaults{"no fault", "dead", "stuck", "weak", "shifted", "swapped"};

// The taxels of a fault, where the body presses: of a column if `n` is 0.
std::vector<std::size_t> taxels_under(const Array& array, const Body& body, std::size_t n, std::mt19937_64& random) {
    const std::vector<double> part = pressed::parts_of(array, body);
    std::vector<std::size_t> under, result;
    for (std::size_t i = 0; i < part.size(); ++i)
        if (part[i] > 0) under.push_back(i);
    for (std::size_t k = 0; k < n; ++k) result.push_back(under[random() % under.size()]);
    const auto peak = std::size_t(std::max_element(part.begin(), part.end()) - part.begin());
    for (std::size_t i = peak % array.columns; n == 0 && i < part.size(); i += array.columns) result.push_back(i);
    return result;
}

// The reading with noise of its own, and the fault. A stuck taxel has no noise.
std::vector<float> with_fault(const Array& array, Fault fault, const std::vector<std::size_t>& taxels, std::uint64_t seed,
                              std::vector<float> raw, std::mt19937_64& noise) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, array.noise_N * array.counts_per_N);
    const std::size_t n = array.taxels();
    const double gain = between(random, 0.3, 0.7), shift_N = between(random, 0.2, 1), stuck_N = between(random, 0, 1);
    for (const std::size_t i : taxels) {
        const std::size_t other = random() % n;
        for (std::size_t v = 0; v < array.values; ++v) {
            float& value = raw[v * n + i];
            if (fault == Fault::dead) value = 0;
            if (fault == Fault::weak) value *= float(gain);
            if (fault == Fault::shifted && v + 1 == array.values) value += float(shift_N * array.counts_per_N);
            if (fault == Fault::swapped) std::swap(value, raw[v * n + other]);
        }
    }
    for (float& value : raw) value += float(normal(noise));
    for (const std::size_t i : taxels)
        for (std::size_t v = 0; fault == Fault::stuck && v < array.values; ++v)
            raw[v * n + i] = float(stuck_N * array.counts_per_N);
    return raw;
}

// Presses with a fault: how many are GOOD, and GOOD and off by more than a tenth of the largest press, or of their own.
double judge_faults(Run& run, Fault fault, std::size_t n, const std::string& name,
                    const std::function<Body(std::mt19937_64&)>& make) {
    const Array& array = run.array;
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal(0, 1);
    int good = 0, wrong = 0, of_load = 0, misplaced = 0;
    for (int k = 0; k < kFrames; ++k) {
        const Body body = make(random);
        std::vector<double> gain(array.taxels());
        for (double& g : gain) g = 1 + array.gain_sd * normal(random);
        std::vector<float> raw(array.taxels() * array.values, 0);
        pressed::press(array, body, gain, raw);
        const std::vector<std::size_t> taxels = taxels_under(array, body, n, random);
        const std::uint64_t seed = random();
        Estimate e;
        for (unsigned frame = 0; frame <= (fault == Fault::stuck ? array.frozen_after : 0); ++frame) {
            const std::vector<float> seen = with_fault(array, fault, taxels, seed, raw, random);
            Reading reading;
            reading.taxels = {{std::uint16_t(array.taxels()), std::uint16_t(array.values)}, seen};
            e = run.patch->decouple(reading);
        }
        if (e.quality() != TACTILED_GOOD) continue;
        const double error = std::abs(e.wrench_S[2] + body.force);
        const auto& seen = *static_cast<const tactiled_array*>(run.patch->patch()->record(tactiled_sample{}));
        ++good;
        wrong += error > kWrong_N ? 1 : 0;
        of_load += error > 0.1 * body.force ? 1 : 0;
        misplaced += std::abs(double(seen.cop_S_m[0]) - body.x) > 5 * double(seen.cop_sd_m[0]) ? 1 : 0;
    }
    fmt::print(
        "  {:28} {:8} GOOD {:5.1f} %, and off by 10 % of the largest press {:5.2f} %, of this one {:5.2f} %, "
        "place beyond 5 sd {:5.2f} %\n",
        name, kFaults[std::size_t(fault)], 100. * good / kFrames, 100. * wrong / kFrames, 100. * of_load / kFrames,
        100. * misplaced / kFrames);
    return 100. * wrong / kFrames;
}

int count(int frames, std::size_t taxels, std::size_t values) {
    Array array;
    array.rows = 1;
    while (array.rows * array.rows < taxels) array.rows *= 2;
    array.columns = taxels / array.rows;
    array.values = values;
    Run run(array);
    std::vector<float> raw(array.taxels() * values, 0);
    pressed::press(array, {Kind::ball, 0, 0, 5, 4e-3, 4e-3, 0}, std::vector<double>(array.taxels(), 1), raw);
    Reading reading;
    reading.taxels = {{std::uint16_t(array.taxels()), std::uint16_t(values)}, raw};
    double sum = 0;
    for (int k = 0; k < frames; ++k) {
        sum += run.patch->decouple(reading).wrench_S[2];
        (void)run.patch->patch()->record(tactiled_sample{});
    }
    return std::isfinite(sum) ? 0 : 1;
}

void print_faults(double narrowest_mm) {
    Array array;
    array.narrowest_mm = narrowest_mm;
    array.frozen_after = 20;
    Run run(array);
    const double edge = 8 * array.pitch_m;
    const std::function<Body(std::mt19937_64&)> ball = [&](std::mt19937_64& random) {
        const double a = between(random, 3e-3, 7e-3);
        const auto place = [&] { return between(random, a - edge, edge - a); };
        return Body{Kind::ball, place(), place(), between(random, 1, 10), a, a, 0};
    };
    const std::function<Body(std::mt19937_64&)> punch = [&](std::mt19937_64& random) {
        const auto place = [&] { return between(random, 8e-3 - edge, edge - 8e-3); };
        return Body{Kind::punch, place(), place(), between(random, 1, 10), 5e-3, 5e-3, between(random, -1.5, 1.5)};
    };
    const std::array<std::pair<const char*, const std::function<Body(std::mt19937_64&)>*>, 2> bodies{
        {{"ball", &ball}, {"punch", &punch}}};
    fmt::print("faults of one, three and a column of taxels under the press, narrowest_contact_mm = {}:\n", narrowest_mm);
    for (const auto& [name, make] : bodies) judge_faults(run, Fault::none, 1, name, *make);
    for (std::size_t f = 1; f < kFaults.size(); ++f) {
        std::array<double, 3> worst{};
        for (const auto& [name, make] : bodies)
            for (std::size_t k = 0; k < 3; ++k) {
                constexpr std::array<std::size_t, 3> kTaxels{1, 3, 0};
                const std::string of = fmt::format("{}, {}", name, k == 2 ? "a column" : fmt::format("{}", kTaxels[k]));
                worst[k] = std::max(worst[k], judge_faults(run, Fault(f), kTaxels[k], of, *make));
            }
        fmt::print("GOOD and wrong, {} mm, {}: one {:.2f} %, three {:.2f} %, a column {:.2f} %\n", narrowest_mm, kFaults[f],
                   worst[0], worst[1], worst[2]);
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc == 5 && std::string_view(argv[1]) == "--count")
        return count(std::atoi(argv[2]), std::size_t(std::atoi(argv[3])), std::size_t(std::atoi(argv[4])));
    if (argc == 2 && std::string_view(argv[1]) == "--faults") {
        for (const double narrowest_mm : {0, 6}) print_faults(narrowest_mm);
        return 0;
    }
    Worst worst;
    for (const std::size_t values : {std::size_t{1}, std::size_t{3}}) {
        Array array;
        array.values = values;
        Run run(array);
        const double edge = 8 * array.pitch_m;
        const auto place = [&](std::mt19937_64& random, double reach) {
            return between(random, reach - edge, edge - reach);
        };
        const std::string of = values == 1 ? "normal, " : "three axes, ";
        run.judge(worst, of + "nothing", [](auto&) { return Body{}; });
        run.judge(worst, of + "ball", [&](auto& random) {
            const double a = between(random, 3e-3, 7e-3);
            return Body{Kind::ball, place(random, a), place(random, a), between(random, 1, 10), a, a, 0};
        });
        run.judge(worst, of + "small ball", [&](auto& random) {
            const double a = between(random, 0.3e-3, 1.5e-3);
            return Body{Kind::ball, place(random, a), place(random, a), between(random, 1, 10), a, a, 0};
        });
        run.judge(worst, of + "edge", [&](auto& random) {
            return Body{Kind::edge, place(random, 9e-3),       place(random, 9e-3), between(random, 2, 10), 8e-3,
                        1.5e-3,     between(random, -1.5, 1.5)};
        });
        run.judge(worst, of + "punch", [&](auto& random) {
            return Body{Kind::punch, place(random, 8e-3),       place(random, 8e-3), between(random, 2, 10), 5e-3,
                        5e-3,        between(random, -1.5, 1.5)};
        });
        run.judge(
            worst, of + "ball, 1 % dead",
            [&](auto& random) {
                const double a = between(random, 4e-3, 7e-3);
                return Body{Kind::ball, place(random, a), place(random, a), between(random, 1, 10), a, a, 0};
            },
            3);
    }
    fmt::print("worst: beyond 5 sd {:.2f} %, GOOD and wrong {:.2f} %\n", worst.beyond, worst.wrong);
}
