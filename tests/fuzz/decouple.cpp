// A calibration's text, and then any bits as its channels. Oracles: what is accepted is written and read back the same;
// every method that takes it gives a finite wrench with its quality, or BAD and NaN, whatever the channels hold; without
// any channel it is BAD; what a missing channel holds changes nothing; told to forget, a decoupler is as good as new.
#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>

#include "config/calibration.hpp"
#include "decoupling/method.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;
using fuzz::Input;

void check_estimate(const Estimate& estimate) {
    const bool good = estimate.quality() == TACTILED_GOOD || estimate.quality() == TACTILED_UNCERTAIN;
    check(good || estimate.quality() == TACTILED_BAD);
    if (good == false) check(estimate.reasons != 0);
    for (std::size_t c = 0; c < 6; ++c) {
        const double value = estimate.wrench_S[c], sd = estimate.sd[c];
        if (!good) check(std::isnan(value));
        check(std::isfinite(value) || std::isnan(value));
        check(std::isnan(sd) || (std::isfinite(sd) && sd >= 0));
    }
}

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

void check_same(const Estimate& a, const Estimate& b) {
    check(a.quality() == b.quality() && a.reasons == b.reasons && a.direction == b.direction &&
          same(a.residual, b.residual));
    check(same(a.cop_S_m[0], b.cop_S_m[0]) && same(a.cop_S_m[1], b.cop_S_m[1]));
    for (std::size_t c = 0; c < 6; ++c) check(same(a.wrench_S[c], b.wrench_S[c]) && same(a.sd[c], b.sd[c]));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size > 20'000) return 0;
    // The text ends at the first zero; what follows are the channels.
    const auto* const end = static_cast<const std::uint8_t*>(size == 0 ? nullptr : std::memchr(data, 0, size));
    const std::size_t length = end == nullptr ? size : std::size_t(end - data);
    const std::string text(reinterpret_cast<const char*>(data), length);
    Problems problems;
    const Calibration calibration = parse_calibration(text, "fuzz.toml", problems);
    if (!problems.empty()) return 0;
    const std::string written = calibration_text(calibration);
    Problems again;
    check(calibration_text(parse_calibration(written, "again.toml", again)) == written && again.empty());

    for (const MethodEntry* const method : methods_of(calibration.model)) {
        std::string fault;
        const auto decoupler = make_method(*method, calibration, fault);
        if (decoupler == nullptr) continue;
        auto twin = make_method(*method, calibration, fault);
        Input input(data + length, size - length);
        (void)input.byte();
        std::uint64_t t_ns = 1'000'000'000;
        std::vector<double> channels(calibration.channels.size());
        for (int n = 0; n < 20 && (n == 0 || !input.is_empty()); ++n) {
            Reading reading{channels, 0, 0, t_ns};
            t_ns += std::uint64_t{1} << input.byte() % 40;
            const unsigned how = input.byte();
            if ((how & 1) != 0) reading.missing = input.number(4);
            if ((how & 2) != 0) reading.saturated = input.number(4);
            if ((how & 4) != 0) reading.missing = ~0u;
            for (std::size_t k = 0; k < channels.size(); ++k) {
                const auto bits = input.take(sizeof(double));
                if (!bits.empty()) std::memcpy(&channels[k], bits.data(), bits.size());
                if (std::isnan(channels[k])) reading.missing |= 1u << k;
            }
            std::vector<double> others = channels;
            for (std::size_t k = 0; k < others.size(); ++k)
                if ((reading.missing >> k & 1) != 0)
                    others[k] = std::bit_cast<double>(~std::bit_cast<std::uint64_t>(others[k]));
            const Estimate estimate = decoupler->decouple(reading);
            check_estimate(estimate);
            if (std::countr_one(reading.missing) >= int(channels.size())) check(estimate.quality() == TACTILED_BAD);
            check_same(estimate, twin->decouple({others, reading.missing, reading.saturated, reading.t_ns}));
            if ((how & 8) == 0) continue;
            decoupler->forget();
            twin = make_method(*method, calibration, fault);
        }
    }
    return 0;
}
