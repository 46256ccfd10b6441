#include "decoupling/parity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "config/names.hpp"
#include "decoupling/latency.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kSkew = 0.5;     // share of the motion over the last samples that is added to the standard deviation
constexpr int kOff = 400;         // samples
constexpr int kTests = 3;         // tests of each channel before a channel is named
constexpr std::size_t kPast = 3;  // readings; four with the present one

class ParityChecked final : public Decoupler {
public:
    ParityChecked(const Calibration& calibration, std::unique_ptr<Decoupler> inner)
        : inner_(std::move(inner)),
          parity_(calibration.parity),
          n_(calibration.channels.size()),
          n_features_(parity_features(n_, parity_.order)),
          coefficient_(n_features_ * n_) {
        for (std::size_t k = 0; k < n_; ++k) {
            if (parity_.sd[k] > 0) checked_ |= 1u << k;
            for (std::size_t f = 0; f < n_features_ && parity_.sd[k] > 0; ++f)
                coefficient_[f * n_ + k] = parity_.coefficients[k][f];
            // The standard deviation with channel k replaced, of each component.
            sd_without_[k].fill(kNaN);
            for (std::size_t i = 0; i < calibration.components.size() && k < calibration.sd_without.size(); ++i)
                for (std::size_t c = 0; c < kComponentNames.size(); ++c)
                    if (calibration.components[i] == kComponentNames[c]) sd_without_[k][c] = calibration.sd_without[k][i];
            if (k < calibration.parity_harmless.size()) harmless_[k] = calibration.parity_harmless[k];
        }
        set_domain(calibration.joint_domain);
        for (auto& past : past_) past.resize(2 * n_);
    }

    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        if (reading.channel.size() != n_ || reading.missing != 0 || reading.saturated != 0) {
            n_past_ = 0;
            return inner_->decouple(reading);
        }
        double x[kMaxChannels], prediction[kMaxChannels], motion[kMaxChannels];
        for (std::size_t k = 0; k < n_; ++k) x[k] = reading.channel[k];
        predict(x, prediction);
        follow_motion(reading.t_ns, x, prediction, motion);
        // A prediction from inputs outside the calibration's rows is no better than the estimate, which is already flagged.
        const std::uint32_t judged = judged_channels(x);
        std::uint32_t off = 0;
        if (judged != 0) {
            off = disagreeing(x, prediction, motion, judged);
            follow_alarm(off != 0);
            if (is_alarmed_ && off != 0) look_for_damage(x, prediction, motion);
        }
        if (!is_alarmed_) [[likely]]
            return inner_->decouple(reading);
        return doubtful_estimate(reading, x, prediction, off != 0);
    }

    void forget() noexcept override {
        n_past_ = 0;
        inner_->forget();
    }
    void set_delay(std::span<const double> of_channel_s) noexcept override {
        spacing_ns_ = std::uint64_t(measured_over_s(of_channel_s) / double(kPast) * 1e9);
        inner_->set_delay(of_channel_s);
    }
    [[nodiscard]] std::uint32_t timed_by(std::size_t c) const noexcept override { return inner_->timed_by(c); }
    [[nodiscard]] std::string_view method() const noexcept override { return inner_->method(); }

private:
    void set_domain(const JointDomain& domain) {
        if (domain.limit == 0) return;
        limit_squared_ = domain.limit * domain.limit;
        mean_ = domain.mean;
        precision_.assign(n_ * n_, 0);
        for (std::size_t i = 0; i < n_; ++i)
            for (std::size_t k = 0; k <= i; ++k)
                for (std::size_t j = 0; j <= i; ++j)
                    precision_[k * n_ + j] += domain.whitening[i][k] * domain.whitening[i][j];
    }

    // Bit k: all channels but k are within their ranges and their joint domain. With the inverse C^-1 of the covariance and
    // w = C^-1 (x - mean), the squared distance of the others is that of all channels minus w_k^2 / (C^-1)_kk.
    [[nodiscard]] std::uint32_t judged_channels(const double* x) const noexcept {
        std::uint32_t beyond = 0;
        for (std::size_t k = 0; k < n_; ++k)
            beyond |= std::abs(x[k] - parity_.centre[k]) <= (1 + 2 * kDomainMargin) * parity_.scale[k] ? 0 : 1u << k;
        if (precision_.empty()) return beyond == 0 ? checked_ : std::has_single_bit(beyond) ? checked_ & beyond : 0;
        double w[kMaxChannels]{}, squared = 0;
        for (std::size_t k = 0; k < n_; ++k) {
            const double from_mean = x[k] - mean_[k], *const row = &precision_[k * n_];
            for (std::size_t i = 0; i < n_; ++i) w[i] += row[i] * from_mean;
        }
        for (std::size_t k = 0; k < n_; ++k) squared += w[k] * (x[k] - mean_[k]);
        std::uint32_t judged = 0;
        for (std::size_t k = 0; k < n_; ++k) {
            const double others = squared - w[k] * w[k] / precision_[k * n_ + k];
            judged |= others <= limit_squared_ && (beyond & ~(1u << k)) == 0 ? 1u << k : 0;
        }
        return judged & checked_;
    }

    void predict(const double* x, double* prediction) const noexcept {
        double feature[kMaxParityFeatures];
        put_features(parity_, {x, n_}, feature);
        double sum[kMaxChannels]{};
        const double* row = coefficient_.data();
        for (std::size_t f = 0; f < n_features_; ++f, row += n_)
            for (std::size_t k = 0; k < n_; ++k) sum[k] += row[k] * feature[f];
        for (std::size_t k = 0; k < n_; ++k) prediction[k] = sum[k];
    }

    // Computes the motion of channels and predictions over the last samples, or over twice the delay of the chain.
    void follow_motion(std::uint64_t t_ns, const double* x, const double* prediction, double* motion) noexcept {
        for (std::size_t k = 0; k < n_; ++k) {
            double min = x[k], max = x[k], min_p = prediction[k], max_p = prediction[k];
            for (std::size_t i = 0; i < n_past_; ++i) {
                min = std::min(min, past_[i][k]);
                max = std::max(max, past_[i][k]);
                min_p = std::min(min_p, past_[i][n_ + k]);
                max_p = std::max(max_p, past_[i][n_ + k]);
            }
            motion[k] = (max - min) + (max_p - min_p);
        }
        if (n_past_ != 0 && t_ns - past_ns_ < spacing_ns_) return;
        past_ns_ = t_ns;
        std::copy_n(x, n_, past_[next_].begin());
        std::copy_n(prediction, n_, past_[next_].begin() + std::ptrdiff_t(n_));
        next_ = (next_ + 1) % kPast;
        n_past_ = std::min(n_past_ + 1, kPast);
    }

    // Returns the channels of `judged` (bit k) whose residual exceeds the limit and the harmless residual. False for a NaN.
    [[nodiscard]] std::uint32_t disagreeing(const double* x, const double* prediction, const double* motion,
                                            std::uint32_t judged) const noexcept {
        std::uint32_t off = 0;
        for (std::size_t k = 0; k < n_; ++k) {
            const double error = x[k] - prediction[k], moved = kSkew * motion[k], sd = parity_.sd[k];
            const double limit =
                std::max(kParityLimit * kParityLimit * (sd * sd + moved * moved), harmless_[k] * harmless_[k]);
            off |= error * error > limit ? 1u << k : 0;
        }
        return off & judged;
    }

    void follow_alarm(bool off) noexcept {
        const bool raises = parity_alarm(recent_, off);
        agreeing_ = off ? 0 : std::min(agreeing_ + 1, kOff);
        if (!is_alarmed_ && raises) {
            is_alarmed_ = true;
            cleared_ = 0;
            tests_ = 0;
            turn_ = 0;
        }
        if (is_alarmed_ && agreeing_ >= kOff) is_alarmed_ = false;
    }

    // Replaces one channel by its prediction. If others still disagree, this channel is not the only damaged one.
    void look_for_damage(const double* x, const double* prediction, const double* motion) noexcept {
        const std::size_t k = turn_;
        turn_ = (turn_ + 1) % n_;
        if (turn_ == 0) tests_ = std::min(tests_ + 1, kTests);
        if ((cleared_ >> k & 1u) != 0) return;
        bool explains = (checked_ >> k & 1u) != 0;
        if (explains) {
            double replaced[kMaxChannels], again[kMaxChannels];
            std::copy_n(x, n_, replaced);
            replaced[k] = prediction[k];
            predict(replaced, again);
            explains = (disagreeing(replaced, again, motion, checked_) & ~(1u << k)) == 0;
        }
        if (!explains) cleared_ |= 1u << k;
    }

    // Returns the largest shift of a component, in standard deviations, by damage of one of `suspects`, which cannot be
    // distinguished: the residual relative to the residual of a shift by one standard deviation. NaN if that is unknown, or
    // if there is no suspect.
    [[nodiscard]] double shift(std::uint32_t suspects, const double* x, const double* prediction) const noexcept {
        double greatest = suspects == 0 ? kNaN : 0;
        for (std::size_t k = 0; k < n_; ++k)
            if ((suspects >> k & 1u) != 0)
                greatest = harmless_[k] > 0 ? std::max(greatest, std::abs(x[k] - prediction[k]) / harmless_[k]) : kNaN;
        return greatest;
    }

    // Without a named channel, a sample that agrees keeps its standard deviation, since the damage has no effect in it; the
    // joint domain increases the standard deviation of a sample that is not judged.
    [[nodiscard]] Estimate doubtful_estimate(const Reading& reading, double* x, const double* prediction,
                                             bool disagrees) noexcept {
        const std::uint32_t suspects = checked_ & ~cleared_;
        const bool is_named = tests_ >= kTests && std::popcount(suspects) == 1;
        const auto k = std::size_t(is_named ? std::countr_zero(suspects) : 0);
        const double factor = is_named || !disagrees ? 1 : std::hypot(1, shift(suspects, x, prediction));
        Reading used = reading;
        if (is_named) {
            x[k] = prediction[k];
            used.channel = {x, n_};
        }
        Estimate estimate = inner_->decouple(used);
        if (!estimate.has_value) return estimate;
        estimate.reasons |= TACTILED_DISAGREEMENT;
        bool is_known = false;
        for (std::size_t c = 0; c < estimate.sd.size(); ++c) {
            estimate.sd[c] = is_named ? std::hypot(estimate.sd[c], sd_without_[k][c]) : factor * estimate.sd[c];
            is_known = is_known || std::isfinite(estimate.sd[c]);
        }
        if (!is_known) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        return estimate;
    }

    std::unique_ptr<Decoupler> inner_;
    Parity parity_;
    std::size_t n_, n_features_;
    std::vector<double> coefficient_;  // [feature][channel]
    std::uint32_t checked_ = 0;        // bit k: channel k is predicted
    std::array<Wrench, kMaxChannels> sd_without_{};
    std::array<double, kMaxChannels> harmless_{};
    double limit_squared_ = 0;
    std::vector<double> mean_, precision_;  // joint domain; precision: C^-1 by rows, empty = there is none

    std::array<std::vector<double>, kPast> past_;  // channels, then predictions
    std::size_t next_ = 0, n_past_ = 0;
    std::uint64_t past_ns_ = 0, spacing_ns_ = 0;
    std::uint32_t recent_ = 0;  // bit i: a channel disagreed i samples ago
    int agreeing_ = 0;          // consecutive samples
    bool is_alarmed_ = false;
    std::uint32_t cleared_ = 0;  // bit k: channel k alone does not explain the alarm
    std::size_t turn_ = 0;       // the channel that is replaced next
    int tests_ = 0;              // tests of each channel since the alarm
};

}  // namespace

std::size_t parity_features(std::size_t n, int order) noexcept { return 1 + n + (order > 1 ? n * (n + 1) / 2 : 0); }

void put_features(const Parity& parity, std::span<const double> channel, double* feature) noexcept {
    const std::size_t n = channel.size();
    feature[0] = 1;
    for (std::size_t k = 0; k < n; ++k) feature[1 + k] = (channel[k] - parity.centre[k]) / parity.scale[k];
    if (parity.order < 2) return;
    const double* const x = feature + 1;
    double* product = feature + 1 + n;
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i; j < n; ++j) *product++ = x[i] * x[j];
}

double predicted(const Parity& parity, std::span<const double> channel, std::size_t k) {
    std::vector<double> feature(parity_features(channel.size(), parity.order));
    put_features(parity, channel, feature.data());
    double sum = 0;
    for (std::size_t f = 0; f < feature.size(); ++f) sum += parity.coefficients[k][f] * feature[f];
    return sum;
}

std::unique_ptr<Decoupler> with_parity(const Calibration& calibration, std::unique_ptr<Decoupler> inner) {
    if (inner == nullptr || calibration.parity.sd.empty()) return inner;
    return std::make_unique<ParityChecked>(calibration, std::move(inner));
}

std::string fault_of_parity(const Calibration& calibration) {
    const Parity& parity = calibration.parity;
    if (parity.sd.empty()) return "";
    const std::size_t n = calibration.channels.size();
    if (parity.order < 1 || parity.order > 2 || parity_features(n, parity.order) > kMaxParityFeatures)
        return fmt::format("parity.order = {} with {} channels", parity.order, n);
    if (parity.centre.size() != n || parity.scale.size() != n || parity.sd.size() != n || parity.coefficients.size() != n)
        return fmt::format("parity has {} centres, {} scales, {} sd and {} rows of coefficients for {} channels",
                           parity.centre.size(), parity.scale.size(), parity.sd.size(), parity.coefficients.size(), n);
    for (std::size_t k = 0; k < n; ++k) {
        if (!(parity.scale[k] > 0)) return fmt::format("parity.scale[{}] is not above 0", k);
        if (parity.coefficients[k].size() != parity_features(n, parity.order))
            return fmt::format("parity.coefficients[{}] has {} numbers, not {}", k, parity.coefficients[k].size(),
                               parity_features(n, parity.order));
    }
    return "";
}

}  // namespace tactiled
