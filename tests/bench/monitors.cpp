// Cost of the checks of one sample: Continuity, QuietCheck, JumpCheck and ZeroError together, six channels and six
// components, 1 kHz. Prints the time of a sample in batches of 1,000.
//
//   monitors              1 s
//   monitors --count N    N samples, for instruction counts by valgrind; --count N bare: without the checks
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "node/continuity.hpp"
#include "node/jump_check.hpp"
#include "node/quiet_check.hpp"
#include "node/zero_error.hpp"

namespace {

using namespace tactiled;

constexpr std::uint64_t kPeriod_ns = 1'000'000, kGap_ns = 1'100'000'000;

class Stream {
public:
    Stream() {
        tuning_.least_noise_of.fill(1e-6);
        tuning_.noise_interval_ns = kPeriod_ns;
        zero_.know(0);
        sd_.fill(0.01);
        frame_.has_sequence = true;
    }
    // Returns the number of samples that pass all checks, of `samples`.
    std::uint64_t run(std::uint64_t samples, bool with_checks) {
        std::uint64_t passed = 0;
        for (const std::uint64_t end = i_ + samples; i_ < end; ++i_) {
            for (double& x : wrench_) {
                noise_ = noise_ * 6364136223846793005u + 1442695040888963407u;
                x = double(noise_ >> 40) * 1e-9;
            }
            passed += !with_checks || check() ? 1 : 0;
        }
        return passed;
    }

private:
    bool check() {
        const std::uint64_t t_ns = (i_ + 1) * kPeriod_ns;
        frame_.device_time_us = t_ns / 1000;
        frame_.sequence = std::uint32_t(i_);
        const bool goes_on = continuity_.goes_on(frame_, true, t_ns, 1000, kGap_ns);
        const bool is_quiet = quiet_.judge(wrench_, 0x3F, t_ns, tuning_);
        const bool is_confirmed = jumps_.confirm(wrench_, sd_, t_ns, 0);
        zero_.follow(std::int64_t(t_ns), false);
        Wrench sd = sd_;
        const bool is_old = zero_.widen(sd);
        return goes_on && !is_quiet && is_confirmed && !is_old && sd[0] > 0;
    }

    Continuity continuity_;
    QuietCheck quiet_;
    JumpCheck jumps_;
    ZeroError zero_{{.per_s = {1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6}, .shift = kUnseen}};
    Tuning tuning_;
    Frame frame_;
    Wrench wrench_{}, sd_{};
    std::uint64_t noise_ = 1, i_ = 0;
};

double p50_ns(bool with_checks) {
    constexpr std::uint64_t kBatch = 1000;
    constexpr int kBatches = 1000;
    Stream stream;
    std::vector<double> ns;
    std::uint64_t passed = 0;
    for (int i = 0; i < kBatches; ++i) {
        const auto begun = std::chrono::steady_clock::now();
        passed += stream.run(kBatch, with_checks);
        ns.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begun).count() / kBatch);
    }
    if (passed < kBatch * kBatches * 99 / 100) std::abort();  // another path would be measured
    std::nth_element(ns.begin(), ns.begin() + kBatches / 2, ns.end());
    return ns[kBatches / 2];
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 2 && std::string_view(argv[1]) == "--count") {
        const std::uint64_t samples = std::strtoull(argv[2], nullptr, 10);
        return Stream().run(samples, argc == 3) > samples / 2 ? 0 : 1;
    }
    fmt::print("checks of a sample: p50 {:.1f} ns\n", p50_ns(true) - p50_ns(false));
}
