#include "decoupling/curved_distance.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kTogether = 4;  // columns that share one pass over the sums: fewer loads and stores

// Adds by[0] column[0] + by[1] column[1] .. to `sum`. The number of columns is a multiple of kTogether.
template <std::size_t kRows>
void add_columns(const double (*column)[kRows], const double* by, std::size_t columns, std::size_t rows,
                 double* sum) noexcept {
    for (std::size_t k = 0; k < columns; k += kTogether) {
        const double *const a = column[k], *const b = column[k + 1], *const c = column[k + 2], *const d = column[k + 3];
        const double by_a = by[k], by_b = by[k + 1], by_c = by[k + 2], by_d = by[k + 3];
        for (std::size_t i = 0; i < rows; ++i) sum[i] += (a[i] * by_a + b[i] * by_b) + (c[i] * by_c + d[i] * by_d);
    }
}

constexpr std::size_t multiple(std::size_t n, std::size_t of) { return (n + of - 1) / of * of; }

}  // namespace

CurvedDistance::CurvedDistance(const JointDomain& domain)
    : n_(domain.mean.size()),
      n_directions_(domain.curved.directions.size()),
      n_features_(curved_features(n_directions_)),
      growth_(domain.curved.growth),
      per_limit_squared_(1 / (domain.curved.limit * domain.curved.limit)) {
    const CurvedDomain& curved = domain.curved;
    std::copy(domain.mean.begin(), domain.mean.end(), mean_);
    std::copy(curved.feature_mean.begin(), curved.feature_mean.end(), feature_mean_);
    for (std::size_t k = 0; k < n_; ++k) {
        for (std::size_t j = 0; j < n_directions_; ++j) direction_[k][j] = curved.directions[j][k];
        for (std::size_t i = k; i < n_; ++i) column_[k][i] = curved.whitening[i][k];
    }
    for (std::size_t f = 0; f < n_features_; ++f) {
        for (std::size_t g = f; g < n_features_; ++g) feature_column_[f][g] = curved.feature_whitening[g][f];
        for (std::size_t i = 0; i < n_; ++i)
            for (std::size_t k = 0; k <= i; ++k) column_[n_ + f][i] -= curved.whitening[i][k] * curved.coefficients[k][f];
    }
}

double CurvedDistance::squared(const double* channel) const noexcept {
    // Channels minus their mean, then features minus their mean, padded with zeros; the sums are padded to pairs.
    double input[kMaxInputs];
    double* const feature = input + n_;
    for (std::size_t k = 0; k < n_; ++k) input[k] = channel[k] - mean_[k];
    for (std::size_t k = 0; k < kTogether; ++k) feature[k] = 0;
    double y[kMaxDirections]{};
    add_columns(direction_, input, multiple(n_, kTogether), kMaxDirections, y);
    std::size_t n = 0;
    for (std::size_t j = 0; j < n_directions_; ++j) feature[n++] = y[j];
    for (std::size_t i = 0; i < n_directions_; ++i)
        for (std::size_t j = i; j < n_directions_; ++j) feature[n++] = y[i] * y[j];
    for (std::size_t f = 0; f < n_features_; ++f) feature[f] -= feature_mean_[f];
    for (std::size_t f = n_features_; f < n_features_ + kTogether; ++f) feature[f] = 0;
    double z[kMaxChannels]{}, u[kMaxFeatures]{};
    add_columns(column_, input, multiple(n_ + n_features_, kTogether), multiple(n_, 2), z);
    add_columns(feature_column_, feature, multiple(n_features_, kTogether), multiple(n_features_, 2), u);
    double sum = 0, from_rows = 0;
    for (std::size_t i = 0; i < n_; ++i) sum += z[i] * z[i];
    for (std::size_t g = 0; g < n_features_; ++g) from_rows += u[g] * u[g];
    return sum * per_limit_squared_ / (1 + growth_ * from_rows);
}

}  // namespace tactiled
