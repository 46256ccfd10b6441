#include "decoupling/patch/sums.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled {
namespace {

// Sums of products over all taxels. The partial sums are side by side in the processor's registers, and their order does not
// depend on them: results are equal on all machines.
constexpr std::size_t kLanes = 16;

template <class F>
double sum(std::size_t n, F term) noexcept {
    float lane[kLanes]{};
    std::size_t i = 0;
    for (; i + kLanes <= n; i += kLanes)
        for (std::size_t k = 0; k < kLanes; ++k) lane[k] += term(i + k);
    for (std::size_t k = 0; i < n; ++i, ++k) lane[k] += term(i);
    double total = 0;
    for (const float part : lane) total += double(part);
    return total;
}

// Mean force of the neighbours of i that have one, without `skipped`, after the zero; their number in `n`.
float mean_beside(const TaxelPlaces& places, const TaxelForces& zero, const TaxelForces& forces, std::size_t c,
                  std::size_t i, std::size_t skipped, unsigned& n) noexcept {
    const TaxelPlaces::Neighbours& beside = places.neighbours[i];
    float mean = 0;
    n = 0;
    for (std::size_t k = 0; k < beside.n; ++k) {
        const std::size_t j = beside.of[k];
        if (j == skipped || !has_force(forces.state[j])) continue;
        mean += forces.component[c][j] - zero.component[c][j];
        ++n;
    }
    return n > 0 ? mean / float(n) : 0;
}

}  // namespace

void predict(const TaxelPlaces& places, const TaxelNoise& noise, const TaxelForces& zero, TaxelForces& forces,
             std::vector<TaxelOut>& out) noexcept {
    for (TaxelOut& one : out) {
        const std::size_t i = one.taxel;
        const TaxelPlaces::Neighbours& beside = places.neighbours[i];
        for (std::size_t c = 0; c < 3; ++c) {
            if (forces.component[c].empty()) continue;
            unsigned n = 0;
            const float mean = mean_beside(places, zero, forces, c, i, i, n);
            one.is_supported = n > 0 && 2 * n >= beside.n;
            float squares = 0;
            for (std::size_t k = 0; k < beside.n; ++k) {
                const std::size_t j = beside.of[k];
                unsigned n_beside = 0;
                if (!has_force(forces.state[j])) continue;
                const float error =
                    forces.component[c][j] - zero.component[c][j] - mean_beside(places, zero, forces, c, j, i, n_beside);
                squares += error * error;
            }
            one.variance[c] = n > 0 ? squares / float(n) : noise.sd[c] * noise.sd[c];
            forces.component[c][i] = zero.component[c][i] + mean;
        }
    }
}

Sums::Sums(const TaxelPlaces& places, const TaxelNoise& noise, bool is_common)
    : places_(places), noise_(noise), is_common_(is_common), none_(places.n, 0) {
    for (std::size_t i = 0; i < places.n; ++i) {
        const std::array<double, 3> r{double(places.x[i]), double(places.y[i]), double(places.z[i])};
        std::array<std::array<double, 3>, 3> covariance{};  // covariance of its force, in S
        for (std::size_t k = 0; k < 3; ++k) {
            const double v = double(noise.sd[k]) * double(noise.sd[k]);
            for (std::size_t a = 0; a < 3; ++a)
                for (std::size_t b = 0; b < 3; ++b)
                    covariance[a][b] += places.is_flat() ? (a == k && b == k ? v : 0)
                                                         : v * double(places.axes[i][k][a]) * double(places.axes[i][k][b]);
        }
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t a = (c + 1) % 3, b = (c + 2) % 3;
            of_noise_[c] += covariance[c][c];
            of_noise_[3 + c] +=
                r[a] * r[a] * covariance[b][b] + r[b] * r[b] * covariance[a][a] - 2 * r[a] * r[b] * covariance[a][b];
        }
    }
    for (std::size_t i = 0; i < places.n; ++i) {
        arm_[0].push_back(places.x[i] * noise.gain[i]);
        arm_[1].push_back(places.y[i] * noise.gain[i]);
        arm_[2].push_back(places.z[i] * noise.gain[i]);
    }
    for (double& variance : of_noise_) variance *= is_common ? double(places.n) : 1;  // at most: the sd of all are added
}

// Adds the variance of the gains.
void Sums::add_gains(const std::array<const float*, 3>& force) noexcept {
    for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t a = (c + 1) % 3, b = (c + 2) % 3;
        variance_[c] +=
            sum(places_.n, [f = force[c], g = noise_.gain.data()](std::size_t i) { return (g[i] * f[i]) * (g[i] * f[i]); });
        variance_[3 + c] +=
            sum(places_.n, [ra = arm_[a].data(), rb = arm_[b].data(), fa = force[a], fb = force[b]](std::size_t i) {
                const float moment = ra[i] * fb[i] - rb[i] * fa[i];
                return moment * moment;
            });
    }
}

// Sets the variance from the sd that the taxels state.
void Sums::add_stated(const TaxelForces& forces) noexcept {
    const std::array<const float*, 3> r{places_.x.data(), places_.y.data(), places_.z.data()};
    std::array<double, 6> linear{}, squares{};
    const auto put = [&](std::size_t c, double error) { linear[c] += error, squares[c] += error * error; };
    for (std::size_t i = 0; i < places_.n; ++i)
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t a = (c + 1) % 3, b = (c + 2) % 3;
            const auto sd = [&](std::size_t k) { return forces.sd[k].empty() ? 0 : double(forces.sd[k][i]); };
            put(c, sd(c));
            put(3 + c, std::hypot(double(r[a][i]) * sd(b), double(r[b][i]) * sd(a)));
        }
    for (std::size_t c = 0; c < 6; ++c) variance_[c] = is_common_ ? linear[c] * linear[c] : squares[c];
}

void Sums::add(const TaxelForces& forces, const std::vector<TaxelOut>& out) noexcept {
    const std::size_t n = places_.n;
    const std::array<const float*, 3> r{places_.x.data(), places_.y.data(), places_.z.data()};
    std::array<const float*, 3> f{};
    variance_ = of_noise_;
    for (std::size_t c = 0; c < 3; ++c) {
        f[c] = forces.component[c].empty() ? none_.data() : forces.component[c].data();
        wrench_[c] = sum(n, [a = f[c]](std::size_t i) { return a[i]; });
    }
    for (std::size_t c = 0; c < 3; ++c) {  // the moment about axis c: r_a f_b - r_b f_a
        const std::size_t a = (c + 1) % 3, b = (c + 2) % 3;
        const auto moment = [ra = r[a], rb = r[b], fa = f[a], fb = f[b]](std::size_t i) {
            return ra[i] * fb[i] - rb[i] * fa[i];
        };
        wrench_[3 + c] = sum(n, moment);
    }
    if (forces.sd[2].empty())
        add_gains(f);
    else
        add_stated(forces);
    for (const TaxelOut& one : out)
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t a = (c + 1) % 3, b = (c + 2) % 3;
            const auto arm = [&](std::size_t k) { return double(r[k][one.taxel]) * double(r[k][one.taxel]); };
            variance_[c] += double(one.variance[c]);
            variance_[3 + c] += arm(a) * double(one.variance[b]) + arm(b) * double(one.variance[a]);
        }
}

}  // namespace tactiled
