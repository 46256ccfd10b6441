// Tests the promise of decoupler.hpp with arbitrary readings: for any input bits, a finite wrench with a true
// quality, or BAD with NaN; and equal output bits for equal input bits if a method has no memory.
//
//   any_bits [READINGS] [MODEL]      readings a model (10,000 if not given), all its methods in turn; exit 1 with what broke
//
// Built with address and undefined-behaviour sanitizers it also finds what they find: tests/stability/README.md. A method
// that searches (table/map) gets one reading in a hundred: one costs as much as a thousand of the others.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <random>

#include "decoupling/solve/domain.hpp"
#include "tests/stability/methods.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::stability;

class AnyReading {
public:
    explicit AnyReading(const Method& method) : method_(method), random_(20260402) {}

    // Channels, masks and time of the next reading; `channel` is kept here.
    Reading next() {
        channel_ = method_.ordinary[n_++ % method_.ordinary.size()];
        // Every other stretch is sound, so that what remembers has something to lose.
        if (n_ / 512 % 2 == 1) {
            t_ns_ += 500'000;
            return {.channel = channel_, .t_ns = t_ns_};
        }
        // A third as it is, a third with one odd channel, a third odd all over.
        const auto kind = random_() % 3;
        if (kind == 1) odd(channel_[random_() % channel_.size()]);
        if (kind == 2)
            for (double& value : channel_) odd(value);
        const std::uint64_t bits = random_();
        Reading reading;
        reading.missing = bits % 4 == 0 ? std::uint32_t(random_() & random_()) : 0;
        reading.saturated = bits / 4 % 4 == 0 ? std::uint32_t(random_() & random_()) : 0;
        t_ns_ = bits / 16 % 64 == 0 ? random_() : t_ns_ + (bits / 1024 % 8) * 500'000;
        reading.t_ns = t_ns_;
        const bool short_of_one = bits / 8192 % 256 == 0;
        reading.channel = {channel_.data(), channel_.size() - (short_of_one ? 1 : 0)};
        return reading;
    }

private:
    void odd(double& value) {
        static constexpr double kInf = std::numeric_limits<double>::infinity();
        static constexpr double kOdd[] = {kNaN,   kInf,  -kInf,  0.0,   -0.0,       5e-324, -5e-324, 2.2250738585072014e-308,
                                          1e-310, 1e308, -1e308, 1e154, -1.34e154,  1e200,  1e17,    -1e17,
                                          1e-200, 1.0,   -1.0,   1e9,   4294967295, 1e300,  -1e300,  1.7976931348623157e308};
        const std::uint64_t bits = random_();
        switch (bits % 4) {
            case 0: value = kOdd[bits / 4 % std::size(kOdd)]; break;
            case 1: {
                const std::uint64_t pattern = random_();
                static_assert(sizeof value == sizeof pattern);
                std::memcpy(&value, &pattern, sizeof value);
                break;
            }
            case 2: value *= std::ldexp(1.0, int(bits / 4 % 80) - 40); break;
            default: value += (double(bits >> 11) * 0x1p-53 - 0.5) * value; break;
        }
    }

    const Method& method_;
    std::mt19937_64 random_;
    std::vector<double> channel_;
    std::size_t n_ = 0;
    std::uint64_t t_ns_ = 1'000'000'000;
};

// Returns the violation of the promise by an estimate; "" if there is none.
std::string broken(const Estimate& e, const Calibration& calibration) {
    for (std::size_t c = 0; c < 6; ++c) {
        bool seen = false;
        for (const auto& name : calibration.components) seen = seen || component_index(name) == c;
        const bool value = seen && e.quality() != TACTILED_BAD;
        if (std::isfinite(e.wrench_S[c]) != value || std::isinf(e.wrench_S[c]))
            return fmt::format("{} = {} with quality {}", kComponentNames[c], e.wrench_S[c], int(e.quality()));
        const bool sd = value && (e.reasons & TACTILED_UNKNOWN_UNCERTAINTY) == 0;
        if (std::isnan(e.sd[c]) == sd || e.sd[c] < 0) return fmt::format("sd of {} = {}", kComponentNames[c], e.sd[c]);
    }
    if ((e.quality() == TACTILED_GOOD) != (e.reasons == 0))
        return fmt::format("quality {}, reasons {:x}", int(e.quality()), e.reasons);
    if (std::isinf(e.cop_S_m[0]) || std::isinf(e.cop_S_m[1])) return "an infinite centre of pressure";
    if (e.residual < 0) return "a negative residual";
    return "";
}

bool same_bits(const Estimate& a, const Estimate& b) {
    return std::memcmp(a.wrench_S.data(), b.wrench_S.data(), sizeof a.wrench_S) == 0 && a.quality() == b.quality() &&
           a.reasons == b.reasons;
}

}  // namespace

int main(int argc, char** argv) {
    char* end = nullptr;
    const long readings = argc > 1 ? std::strtol(argv[1], &end, 10) : 10'000;
    const std::string only = argc > 2 ? argv[2] : "";
    const std::vector<Method> methods = all_methods();
    std::map<std::string, int> of_model;  // methods that take equal shares
    for (const Method& method : methods) of_model[method.model()] += method.name == "table/map" ? 0 : 1;
    if (argc > 3 || readings < 100 || (end != nullptr && *end != '\0') || (!only.empty() && of_model.count(only) == 0)) {
        fmt::print(stderr, "any_bits [READINGS, 100 at least] [MODEL: table, hair, capacitive, piezo, generic]\n");
        return 2;
    }
    int failed = 0;
    for (const Method& method : methods) {
        if (!only.empty() && method.model() != only) continue;
        const auto one = made(method.calibration), other = made(method.calibration);
        AnyReading any(method);
        const long n = method.name == "table/map" ? readings / 100 : readings / of_model[method.model()] + 1;
        long counts[3] = {};  // BAD, UNCERTAIN, GOOD
        for (long i = 0; i < n; ++i) {
            const Reading reading = any.next();
            const Estimate estimate = one->decouple(reading);
            std::string what = broken(estimate, method.calibration);
            if (what.empty() && !same_bits(estimate, other->decouple(reading))) what = "other bits the second time";
            ++counts[estimate.quality() == TACTILED_GOOD ? 2 : estimate.quality() == TACTILED_UNCERTAIN ? 1 : 0];
            if (what.empty()) continue;
            fmt::print("{}: reading {}: {}; reasons {:x}; missing {:x}, saturated {:x}, t_ns {}, channels", method.name, i,
                       what, estimate.reasons, reading.missing, reading.saturated, reading.t_ns);
            for (const double value : reading.channel) fmt::print(" {}", value);
            fmt::print("\n");
            if (++failed > 20) return 1;
        }
        fmt::print("{:22} {:>10} readings: {:>8} good {:>8} uncertain {:>8} bad\n", method.name, n, counts[2], counts[1],
                   counts[0]);
        std::fflush(stdout);
    }
    return failed == 0 ? 0 : 1;
}
