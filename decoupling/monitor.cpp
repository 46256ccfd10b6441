#include "decoupling/monitor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/names.hpp"

namespace tactiled {
namespace {

constexpr double kMaxFactor = 1e6;    // largest factor of a standard deviation, which keeps it finite for any bits
constexpr std::size_t kTogether = 4;  // columns that share one pass over the sums: fewer loads and stores
constexpr std::size_t kMaxRows = kMaxChannels + products_of(kMaxScores) + 2;

constexpr std::size_t multiple(std::size_t n, std::size_t of) { return (n + of - 1) / of * of; }

// Adds by[0] column[0] + by[1] column[1] .. to `sum`, and returns the end of the columns. Their number is a multiple of
// kTogether, their length an even number.
const double* add_columns(const double* column, const double* __restrict by, std::size_t columns, std::size_t rows,
                          double* __restrict sum) noexcept {
    for (std::size_t k = 0; k < columns; k += kTogether, column += kTogether * rows) {
        const double *const b = column + rows, *const c = b + rows, *const d = c + rows;
        for (std::size_t i = 0; i < rows; ++i)
            sum[i] += (column[i] * by[k] + b[i] * by[k + 1]) + (c[i] * by[k + 2] + d[i] * by[k + 3]);
    }
    return column;
}

double squares(const double* from, std::size_t n) noexcept {
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += from[i] * from[i];
    return sum;
}

class Monitored final : public Decoupler {
public:
    Monitored(const Monitor& monitor, std::unique_ptr<Decoupler> inner)
        : inner_(std::move(inner)), n_(monitor.mean.size()), distance_(monitor) {}

    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        Estimate estimate = inner_->decouple(reading);
        if (!estimate.has_value || reading.missing != 0 || reading.channel.size() != n_) return estimate;
        const double ratio = distance_.squared(reading.channel.data());
        // True for a NaN, which a missing channel has that this method does not use.
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
    std::unique_ptr<Decoupler> inner_;
    std::size_t n_;
    MonitorDistance distance_;
};

}  // namespace

MonitorDistance::MonitorDistance(const Monitor& monitor)
    : n_(monitor.mean.size()),
      n_scores_(monitor.scores.size()),
      n_residuals_(monitor.residual.size()),
      n_products_(monitor.product_mean.size()),
      rows_(multiple(n_scores_ + n_residuals_, 2)),
      product_rows_(multiple(n_residuals_ + n_products_, 2)),
      per_limit_(1 / (monitor.limit * monitor.limit)),
      per_residual_limit_(n_residuals_ > 0 ? 1 / (monitor.residual_limit * monitor.residual_limit) : 0),
      per_feature_(1 / double(n_scores_ + n_products_)) {
    const std::size_t columns = multiple(n_, kTogether), product_columns = multiple(n_products_, kTogether);
    block_.resize(columns * (1 + rows_) + product_columns * (1 + product_rows_));
    double* at = block_.data();
    std::copy(monitor.mean.begin(), monitor.mean.end(), at);
    at += columns;
    for (std::size_t k = 0; k < n_; ++k)
        for (std::size_t i = 0; i < n_scores_ + n_residuals_; ++i)
            at[k * rows_ + i] = i < n_scores_ ? monitor.scores[i][k] : monitor.residual[i - n_scores_][k];
    at += columns * rows_;
    std::copy(monitor.product_mean.begin(), monitor.product_mean.end(), at);
    at += product_columns;
    for (std::size_t f = 0; f < n_products_; ++f, at += product_rows_) {
        for (std::size_t i = 0; i < n_residuals_; ++i) at[i] = -monitor.coefficients[i][f];
        for (std::size_t g = f; g < n_products_; ++g) at[n_residuals_ + g] = monitor.product_whitening[g][f];
    }
}

double MonitorDistance::squared(const double* channel) const noexcept {
    const std::size_t columns = multiple(n_, kTogether);
    const double* at = block_.data();
    double from_mean[kMaxChannels + kTogether], t[kMaxRows];
    std::fill_n(t, rows_, 0.0);
    for (std::size_t k = 0; k < n_; ++k) from_mean[k] = channel[k] - at[k];
    for (std::size_t k = n_; k < columns; ++k) from_mean[k] = 0;
    at = add_columns(at + columns, from_mean, columns, rows_, t);
    double of_scores = squares(t, n_scores_);
    const double ratio = of_scores * per_limit_;
    if (n_residuals_ == 0) return ratio;
    double e[kMaxRows];  // the residuals, then the whitened products
    std::copy_n(t + n_scores_, n_residuals_, e);
    if (n_products_ > 0) {
        std::fill_n(e + n_residuals_, n_products_ + 1, 0.0);
        const std::size_t product_columns = multiple(n_products_, kTogether);
        double product[products_of(kMaxScores) + kTogether];
        std::size_t f = 0;
        for (std::size_t i = 0; i < n_scores_; ++i)
            for (std::size_t j = i; j < n_scores_; ++j, ++f) product[f] = t[i] * t[j] - at[f];
        for (; f < product_columns; ++f) product[f] = 0;
        add_columns(at + product_columns, product, product_columns, product_rows_, e);
        of_scores += squares(e + n_residuals_, n_products_);
    }
    const double residual = squares(e, n_residuals_) * per_residual_limit_ / (1 + per_feature_ * of_scores);
    return residual > ratio ? residual : ratio;  // not a NaN of products that overflow
}

std::unique_ptr<Decoupler> with_monitor(const Calibration& calibration, std::unique_ptr<Decoupler> inner) {
    if (inner == nullptr || calibration.monitor.limit == 0) return inner;
    return std::make_unique<Monitored>(calibration.monitor, std::move(inner));
}

std::string fault_of_monitor(const Calibration& calibration) {
    const Monitor& monitor = calibration.monitor;
    if (monitor.limit == 0) return "";
    const std::size_t n = calibration.channels.size(), m = monitor.scores.size(), r = monitor.residual.size(),
                      products = monitor.product_mean.size();
    const auto has = [](const auto& rows, std::size_t size, std::size_t numbers) {
        return rows.size() == size &&
               std::all_of(rows.begin(), rows.end(), [=](const auto& row) { return row.size() == numbers; });
    };
    bool fits = n <= kMaxChannels && m >= 1 && m + r <= n && monitor.mean.size() == n && has(monitor.scores, m, n) &&
                has(monitor.residual, r, n) && (r == 0) == (monitor.residual_limit == 0);
    fits = fits && (products == 0 || (r > 0 && m <= kMaxScores && products == products_of(m))) &&
           has(monitor.coefficients, products == 0 ? 0 : r, products) && monitor.product_whitening.size() == products;
    for (std::size_t i = 0; fits && i < products; ++i) fits = monitor.product_whitening[i].size() == i + 1;
    return fits ? "" : fmt::format("monitor has the wrong shape for {} channels, {} scores and {} residuals", n, m, r);
}

}  // namespace tactiled
