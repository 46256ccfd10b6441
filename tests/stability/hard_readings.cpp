// Cost of a hard reading compared with an easy one: hard_readings [METHOD] gives each method ordinary readings and
// then hard ones, each through one_sample(), and prints a line each. tests/stability/instructions.py counts their
// instructions.
#include <fmt/format.h>

#include <cmath>
#include <random>

#include "tests/stability/methods.hpp"

namespace {
using namespace tactiled;
using namespace tactiled::stability;

double sum = 0;  // keeps the optimiser from removing the loop
std::uint64_t t_ns = 1'000'000'000;
}  // namespace

// Its instructions are what is counted; by this name.
extern "C" [[gnu::noinline]] void one_sample(Decoupler* decoupler, const Reading* reading);
void one_sample(Decoupler* decoupler, const Reading* reading) { sum += decoupler->decouple(*reading).wrench_S[2]; }

namespace {

class Meter {
public:
    explicit Meter(const Method& method) : method_(method), decoupler_(made(method.calibration)) {}
    void sample(const char* what, const std::vector<double>& channel, std::uint32_t missing = 0,
                std::uint32_t saturated = 0) {
        const Reading reading{.channel = channel, .missing = missing, .saturated = saturated, .t_ns = t_ns += 1'000'000};
        one_sample(decoupler_.get(), &reading);
        fmt::print("{} {}\n", method_.name, what);
    }
    void ordinary(const char* what) { sample(what, method_.ordinary[n_++ % method_.ordinary.size()]); }
    [[nodiscard]] std::vector<double> next() const { return method_.ordinary[n_ % method_.ordinary.size()]; }

private:
    const Method& method_;
    std::unique_ptr<Decoupler> decoupler_;
    std::size_t n_ = 0;
};

void measure(const Method& method) {
    constexpr double kInf = std::numeric_limits<double>::infinity();
    Meter meter(method);
    meter.ordinary("first");
    // Long enough for whatever is kept: piezo's window of 128 points, and the search beside the samples of table/map.
    for (int i = 0; i < 400; ++i) meter.ordinary("easy");
    const auto each = [&](const char* what, const auto& change) {
        for (std::size_t k = 0; k < method.calibration.channels.size(); ++k) {
            auto channel = meter.next();
            std::uint32_t missing = 0, saturated = 0;
            change(channel[k], missing, saturated, 1u << k);
            meter.sample(what, channel, missing, saturated);
            meter.ordinary("after_it");
        }
    };
    each("nan", [](double& value, auto&, auto&, auto) { value = kNaN; });
    each("infinite", [](double& value, auto&, auto&, auto) { value = kInf; });
    each("huge", [](double& value, auto&, auto&, auto) { value = -1e300; });
    each("missing", [](double&, auto& missing, auto&, auto bit) { missing = bit; });
    each("saturated", [](double&, auto&, auto& saturated, auto bit) { saturated = bit; });
    each("dead", [](double& value, auto&, auto&, auto) { value = 0; });
    each("three_times", [](double& value, auto&, auto&, auto) { value *= 3; });
    // Every subset of dead, of saturated channels, and of dead ones with one saturated channel.
    for (std::uint32_t subset = 1; subset < 1u << method.calibration.channels.size(); ++subset) {
        auto channel = meter.next();
        meter.sample("saturated_ones", channel, 0, subset);
        for (std::size_t k = 0; k < channel.size(); ++k)
            if ((subset >> k & 1u) != 0) channel[k] = 0;
        meter.sample("dead_ones", channel);
        meter.sample("dead_ones_and_a_rail", channel, 0, ~subset & (subset + 1));
    }
    const auto all = [&](const char* what, double factor, double offset) {
        auto channel = meter.next();
        for (double& value : channel) value = factor * value + offset;
        meter.sample(what, channel);
        meter.ordinary("after_it");
    };
    all("zeros", 0, 0);
    all("denormal", 0, 1e-310);
    all("turned", -1, 0);
    all("hundredfold", 100, 0);
    all("all_huge", 0, 1e200);
    std::mt19937_64 random(20260403);
    std::uniform_real_distribution<double> any(-1, 1);
    for (int i = 0; i < 30; ++i) {
        auto channel = meter.next();
        for (double& value : channel) value *= 1 + 3 * any(random);
        meter.sample("random", channel);
    }
}

}  // namespace

int main(int argc, char** argv) {
    bool known = false;
    for (const Method& method : all_methods()) {
        if (argc >= 2 && method.name != argv[1]) continue;
        known = true;
        measure(method);
    }
    if (!known || argc > 2) {
        fmt::print(stderr, "hard_readings [METHOD]: one of table/linear, generic/rbf ..\n");
        return 2;
    }
    return sum == 1 ? 1 : 0;
}
