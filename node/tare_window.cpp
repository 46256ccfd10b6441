#include "node/tare_window.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled {
namespace {

// The error of the zero is then at most half of that, which is little more than the stated error of each sample.
constexpr double kMaxSd = 3;
// The range of four means of white noise reaches 6 of their standard deviations once in 10^4 for one component, and
// once in 10^3 for six.
constexpr double kMaxNoise = 6;
constexpr unsigned kMinForNoise = 8;  // fewer neighbours do not distinguish a ramp from noise

}  // namespace

void TareWindow::begin(std::uint64_t now_ns, std::uint64_t length_ns) noexcept {
    *this = {};
    begin_ns_ = now_ns;
    length_ns_ = length_ns;
}

bool TareWindow::add(const Wrench& raw_S, std::uint64_t t_ns) noexcept {
    const std::uint64_t age_ns = t_ns - begin_ns_;
    // quarters of the time, or of the samples of a slow sensor
    const std::uint64_t by_time = length_ns_ == 0 ? kParts : age_ns * kParts / length_ns_,
                        by_number = samples_ * kParts / kMinForNoise;
    const std::size_t part = std::min<std::size_t>({by_time, by_number, kParts - 1});
    for (std::size_t i = 0; i < raw_S.size(); ++i) {
        sum_[part][i] += raw_S[i];
        if (samples_ == 0) continue;
        const double square = (raw_S[i] - before_[i]) * (raw_S[i] - before_[i]);
        steps_[i] += square;
        second_[i] = std::max(second_[i], std::min(square, largest_[i]));
        largest_[i] = std::max(largest_[i], square);
    }
    ++n_[part];
    ++samples_;
    before_ = raw_S;
    return age_ns >= length_ns_ && samples_ >= kMinForNoise;
}

Wrench TareWindow::mean_S() const noexcept {
    Wrench mean{};
    for (std::size_t i = 0; i < mean.size(); ++i) {
        for (const Wrench& sum : sum_) mean[i] += sum[i];
        mean[i] /= samples_;
    }
    return mean;
}

bool TareWindow::has_moved(const Wrench& sd) const noexcept {
    for (std::size_t i = 0; i < sd.size(); ++i) {
        double min = HUGE_VAL, max = -HUGE_VAL;
        for (std::size_t part = 0; part < kParts; ++part) {
            if (n_[part] == 0) continue;
            min = std::min(min, sum_[part][i] / n_[part]);
            max = std::max(max, sum_[part][i] / n_[part]);
        }
        // Without the two largest steps: a push and its end are a motion, however large.
        const double noise = std::max(0.0, steps_[i] - largest_[i] - second_[i]);
        const double variance = noise / (2.0 * (samples_ - 3));
        const double of_a_mean = std::sqrt(variance * kParts / samples_);
        const double of_a_sample =
            std::isnan(sd[i]) ? 0 : sd[i];  // if the model does not know its sd, only the noise is used
        if (max - min > kMaxSd * of_a_sample + kMaxNoise * of_a_mean) return true;  // false with NaN
    }
    return false;
}

}  // namespace tactiled
