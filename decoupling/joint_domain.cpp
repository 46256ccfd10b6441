#include "decoupling/joint_domain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "config/names.hpp"
#include "decoupling/curved_distance.hpp"

namespace tactiled {
namespace {

constexpr double kMaxFactor = 1e6;  // largest factor of a standard deviation, which keeps it finite for any bits

class JointlyChecked final : public Decoupler {
public:
    JointlyChecked(const JointDomain& domain, std::unique_ptr<Decoupler> inner)
        : inner_(std::move(inner)), n_(domain.mean.size()), per_limit_squared_(1 / (domain.limit * domain.limit)) {
        if (domain.curved.limit > 0) curved_.emplace(domain);
        std::copy(domain.mean.begin(), domain.mean.end(), mean_);
        for (std::size_t k = 0; k < n_; ++k)
            for (std::size_t i = k; i < n_; ++i) column_[k][i] = domain.whitening[i][k];
    }

    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        Estimate estimate = inner_->decouple(reading);
        if (!estimate.has_value || reading.missing != 0 || reading.channel.size() != n_) return estimate;
        const double* const channel = reading.channel.data();
        // False for a NaN, which a missing channel has that this method does not use.
        double ratio = distance_squared(channel) * per_limit_squared_;
        if (curved_)
            if (const double curved = curved_->squared(channel); curved > ratio) ratio = curved;
        if (!(ratio > 1)) [[likely]]
            return estimate;
        estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        const double factor = std::min(kMaxFactor, std::sqrt(ratio));
        for (double& sd : estimate.sd) sd *= factor;
        return estimate;
    }
    void forget() noexcept override { inner_->forget(); }
    void set_delay(std::span<const double> of_channel_s) noexcept override { inner_->set_delay(of_channel_s); }
    [[nodiscard]] std::uint32_t timed_by(std::size_t c) const noexcept override { return inner_->timed_by(c); }
    [[nodiscard]] std::string_view method() const noexcept override { return inner_->method(); }

private:
    // Column by column: each step adds a multiple of a column and does not wait for the previous sum.
    [[nodiscard]] double distance_squared(const double* channel) const noexcept {
        double z[kMaxChannels]{};
        for (std::size_t k = 0; k < n_; ++k) {
            const double from_mean = channel[k] - mean_[k];
            for (std::size_t i = 0; i < n_; ++i) z[i] += column_[k][i] * from_mean;
        }
        double sum = 0;
        for (std::size_t i = 0; i < n_; ++i) sum += z[i] * z[i];
        return sum;
    }

    std::unique_ptr<Decoupler> inner_;
    std::size_t n_;
    double per_limit_squared_;
    std::optional<CurvedDistance> curved_;
    double mean_[kMaxChannels]{};
    double column_[kMaxChannels][kMaxChannels]{};  // columns of the lower triangle
};

std::string fault_of_curved_domain(const CurvedDomain& domain, std::size_t n) {
    const std::size_t m = domain.directions.size(), features = curved_features(m);
    const auto is_triangle = [](const auto& rows, std::size_t size) {
        if (rows.size() != size) return false;
        for (std::size_t i = 0; i < size; ++i)
            if (rows[i].size() != i + 1) return false;
        return true;
    };
    const auto has = [](const auto& rows, std::size_t size, std::size_t numbers) {
        return rows.size() == size &&
               std::all_of(rows.begin(), rows.end(), [=](auto& row) { return row.size() == numbers; });
    };
    if (m >= 1 && m <= kMaxDirections && has(domain.directions, m, n) && domain.feature_mean.size() == features &&
        is_triangle(domain.feature_whitening, features) && has(domain.coefficients, n, features) &&
        is_triangle(domain.whitening, n))
        return "";
    return fmt::format("joint_domain.curved has the wrong shape for {} directions and {} channels", m, n);
}

}  // namespace

std::unique_ptr<Decoupler> with_joint_domain(const Calibration& calibration, std::unique_ptr<Decoupler> inner) {
    if (inner == nullptr || calibration.joint_domain.limit == 0) return inner;
    return std::make_unique<JointlyChecked>(calibration.joint_domain, std::move(inner));
}

double joint_distance(const JointDomain& domain, std::span<const double> channel) {
    double sum = 0;
    for (std::size_t i = 0; i < domain.mean.size(); ++i) {
        double z = 0;
        for (std::size_t k = 0; k <= i; ++k) z += domain.whitening[i][k] * (channel[k] - domain.mean[k]);
        sum += z * z;
    }
    return std::sqrt(sum);
}

std::string fault_of_joint_domain(const Calibration& calibration) {
    const JointDomain& domain = calibration.joint_domain;
    if (domain.limit == 0) return "";
    const std::size_t n = calibration.channels.size();
    if (domain.mean.size() != n || domain.whitening.size() != n)
        return fmt::format("joint_domain has a mean of {} numbers and {} rows of whitening for {} channels",
                           domain.mean.size(), domain.whitening.size(), n);
    for (std::size_t i = 0; i < n; ++i)
        if (domain.whitening[i].size() != i + 1)
            return fmt::format("joint_domain.whitening[{}] has {} numbers; a lower triangle has {} there", i,
                               domain.whitening[i].size(), i + 1);
    return domain.curved.limit == 0 ? "" : fault_of_curved_domain(domain.curved, n);
}

}  // namespace tactiled
