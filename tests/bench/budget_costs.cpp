// Cost of the budget of one sample with six components: its parts and its correlations, as the loop sets them. Prints the
// time of a sample in batches of 1,000.
//
//   budget_costs              1 s
//   budget_costs --count N    N samples, for instruction counts by valgrind; --count N bare: without the budget
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "node/budget.hpp"

namespace {

using namespace tactiled;

class Stream {
public:
    Stream() {
        correlations_.full_scale.fill(10);
        estimate_.has_value = true;
        estimate_.noise.fill(0.003);
        estimate_.reference.fill(-0.01);
        estimate_.temperature.fill(0.02);
    }
    // Returns the number of samples whose parts have the sd of the sample, of `samples`.
    std::uint64_t run(std::uint64_t samples, bool with_budget) {
        std::uint64_t right = 0;
        for (std::uint64_t i = 0; i < samples; ++i) {
            for (std::size_t c = 0; c < 6; ++c) {
                noise_ = noise_ * 6364136223846793005u + 1442695040888963407u;
                estimate_.wrench_S[c] = double(noise_ >> 40) * 1e-7;
                sd_.of_model[c] = 0.05 + 0.01 * estimate_.wrench_S[c];
                sd_.with_zero[c] = sd_.of_model[c] + 0.02;
                sd_.published[c] = sd_.with_zero[c] + 0.01;
            }
            if (with_budget) {
                put_parts(estimate_, sd_, budget_);
                put_correlations(correlations_, estimate_.wrench_S, budget_);
            }
            right += !with_budget || budget_.sd_part[TACTILED_OF_MOTION][5] > 0.01F ? 1 : 0;
        }
        return right;
    }

private:
    Correlations correlations_;
    Estimate estimate_;
    SdStages sd_;
    tactiled_budget budget_{};
    std::uint64_t noise_ = 1;
};

double p50_ns(bool with_budget) {
    constexpr std::uint64_t kBatch = 1000;
    constexpr int kBatches = 1000;
    Stream stream;
    std::vector<double> ns;
    std::uint64_t right = 0;
    for (int i = 0; i < kBatches; ++i) {
        const auto begun = std::chrono::steady_clock::now();
        right += stream.run(kBatch, with_budget);
        ns.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begun).count() / kBatch);
    }
    if (right != kBatch * kBatches) std::abort();  // another path would be measured
    std::nth_element(ns.begin(), ns.begin() + kBatches / 2, ns.end());
    return ns[kBatches / 2];
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 2 && std::string_view(argv[1]) == "--count") {
        const std::uint64_t samples = std::strtoull(argv[2], nullptr, 10);
        return Stream().run(samples, argc == 3) == samples ? 0 : 1;
    }
    fmt::print("budget of a sample: p50 {:.1f} ns\n", p50_ns(true) - p50_ns(false));
}
