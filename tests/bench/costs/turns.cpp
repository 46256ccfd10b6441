#include "tests/bench/costs/turns.hpp"

#include <algorithm>
#include <limits>

#include "drivers/clock.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kBlock = 64, kMinRounds = 5;

}  // namespace

std::vector<double> ns_alternating(const std::vector<Contender>& contenders, std::size_t calls) {
    std::vector<std::vector<double>> ns(contenders.size());
    volatile double sink = 0;
    for (const auto& contender : contenders) sink = contender(0, kBlock);  // cold
    for (std::size_t round = 0; round < std::max(kMinRounds, calls / kBlock); ++round)
        for (std::size_t i = 0; i < contenders.size(); ++i) {
            const std::uint64_t begun_ns = now_ns();
            sink = contenders[i](round * kBlock, (round + 1) * kBlock);
            ns[i].push_back(double(now_ns() - begun_ns) / double(kBlock));
        }
    (void)sink;
    std::vector<double> medians;
    for (auto& one : ns) medians.push_back(quantile(std::move(one), 0.5));
    return medians;
}

double quantile(std::vector<double> values, double share) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto at = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

}  // namespace tactiled::ctl
