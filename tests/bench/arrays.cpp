// Statements of an array against the truth: sum, centre, area and axis of balls, punches and edges, with a
// noise and gains at random, and dead taxels. Fixed seeds: the same table everywhere.
//
//   arrays                        20 s
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

}  // namespace

int main(int argc, char** argv) {
    if (argc == 5 && std::string_view(argv[1]) == "--count")
        return count(std::atoi(argv[2]), std::size_t(std::atoi(argv[3])), std::size_t(std::atoi(argv[4])));
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
