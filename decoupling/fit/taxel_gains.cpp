#include "decoupling/fit/taxel_gains.hpp"

#include <algorithm>
#include <cmath>
#include <future>
#include <limits>
#include <utility>

#include "decoupling/fit/array_presses.hpp"
#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

constexpr double kSmallest = 1e-5;   // least s and spread: below it they change nothing
constexpr double kFinestStep = 1.1;  // s of 100 gains is known to 7 %
constexpr std::size_t kParts = 5;
constexpr double kNu = 3;  // the least whole number with which the gain of an unloaded taxel has a variance
// The sd of a gain is known to 5 % from 200 independent samples; of the samples of a poorly loaded taxel one in two is.
constexpr int kSweeps = 400, kBurnIn = 50, kRounds = 4;
constexpr double kSure = 0.99;

// Diagonal of x' A^-1 x for the columns of x.
Eigen::VectorXd quadratic_forms(const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>& a,
                                const Eigen::SparseMatrix<double>& x) {
    constexpr Eigen::Index kAtOnce = 256;
    Eigen::VectorXd result(x.cols());
    for (Eigen::Index first = 0; first < x.cols(); first += kAtOnce) {
        const Eigen::Index count = std::min(kAtOnce, x.cols() - first);
        const Eigen::MatrixXd some = x.middleCols(first, count), solved = a.solve(some);
        result.segment(first, count) = some.cwiseProduct(solved).colwise().sum();
    }
    return result;
}

}  // namespace

void EquationMaker::begin(std::size_t kind, std::size_t press) {
    kind_.push_back(kind), press_.push_back(press);
    y_.push_back(0), scale_.push_back(0), hidden_sd_.push_back(0);
}

void EquationMaker::add_taxel(std::size_t taxel, double force, double variance) {
    b_.emplace_back(int(y_.size()) - 1, int(taxel), force);
    v_.emplace_back(int(y_.size()) - 1, int(taxel), variance);
}

GainEquations EquationMaker::take() {
    using Map = Eigen::Map<const Eigen::VectorXd>;
    const auto n = Eigen::Index(y_.size());
    GainEquations out;
    out.b.resize(n, taxels_), out.v.resize(n, taxels_);
    out.b.setFromTriplets(b_.begin(), b_.end());
    out.v.setFromTriplets(v_.begin(), v_.end());
    out.y = Map(y_.data(), n);
    out.scale = Map(scale_.data(), n);
    out.hidden = Map(hidden_sd_.data(), n).cwiseAbs2();
    out.kind = std::move(kind_);
    out.press = std::move(press_);
    return out;
}

TaxelGains::TaxelGains(std::size_t taxels)
    : gain(Eigen::VectorXd::Ones(Eigen::Index(taxels))), sd(gain), is_far(taxels, 0), u_(gain) {}

Eigen::VectorXd TaxelGains::variance_of(const GainEquations& equations) const {
    Eigen::VectorXd variance = equations.v * gain.cwiseAbs2() + equations.hidden;
    for (Eigen::Index k = 0; k < variance.size(); ++k)
        variance[k] += std::pow(spread[equations.kind[std::size_t(k)]] * equations.scale[k], 2);
    return variance;
}

TaxelGains::Normal TaxelGains::normal(const GainEquations& equations, const Eigen::VectorXd& used) const {
    const Eigen::VectorXd variance = variance_of(equations), weight = used.cwiseQuotient(variance),
                          left = equations.y - equations.b * Eigen::VectorXd::Ones(gain.size());
    const GainEquations::Matrix weighted = weight.asDiagonal() * equations.b;
    Normal out;
    out.information = equations.b.transpose() * weighted;
    out.right = weighted.transpose() * left;
    out.fit = (used.array() * variance.array().log()).sum() + left.dot(weight.cwiseProduct(left));
    return out;
}

// Factorises the sum of the information and the prior. A factor is used for one pattern of the information.
bool TaxelGains::factorise(const Normal& normal, const Eigen::VectorXd& u, Factor& out) const {
    Sparse prior(gain.size(), gain.size());
    prior.setIdentity();
    prior.diagonal() = u / (s * s);
    const Sparse sum = normal.information + prior;
    if (out.rows() != sum.rows()) out.analyzePattern(sum);
    out.factorize(sum);
    return out.info() == Eigen::Success && out.vectorD().minCoeff() > 0;
}

// -2 log likelihood of s and the spreads with the present u, less a constant.
double TaxelGains::misfit(const GainEquations& equations, Factor& factor) const {
    const Normal sums = normal(equations, Eigen::VectorXd::Ones(equations.y.size()));
    if (!factorise(sums, u_, factor)) return std::numeric_limits<double>::infinity();
    const double value = sums.fit + factor.vectorD().array().log().sum() - (u_ / (s * s)).array().log().sum() -
                         sums.right.dot(factor.solve(sums.right));
    return std::isfinite(value) ? value : std::numeric_limits<double>::infinity();
}

// Minimises along each of log s and the logs of the spreads in turn, with ever smaller steps from `step` on.
void TaxelGains::search(const GainEquations& equations, double step) {
    Factor factor;
    double best = misfit(equations, factor);
    for (; step > kFinestStep; step = std::sqrt(step))
        for (bool any = true; any;) {
            any = false;
            for (double* const value : {&s, &spread[0], &spread[1]})
                for (const double by : {step, 1 / step})
                    for (;;) {
                        const double before = *value;
                        *value = std::max(kSmallest, before * by);
                        const double now = *value != before ? misfit(equations, factor) : best;
                        if (!(now < best)) {
                            *value = before;
                            break;
                        }
                        best = now;
                        any = true;
                    }
        }
}

// Draws e given u, then u given e: a Gamma variable of the shape (nu + 1) / 2 = 2, which is the sum of two exponential ones.
TaxelGains::Sums TaxelGains::chain(const Normal& normal, int sweeps, std::uint64_t seed) const {
    static_assert(kNu == 3);
    using Eigen::VectorXd;
    const Eigen::Index n = gain.size();
    const double limit = contact_level(std::size_t(n)) * bulk_sd();
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss(0, 1);
    std::exponential_distribution<double> exponential(1);
    Sums sums{VectorXd::Zero(n), VectorXd::Zero(n), VectorXd::Zero(n), VectorXd::Zero(n)};
    VectorXd u = u_;
    Factor factor;
    for (int sweep = 0; sweep < sweeps; ++sweep) {
        if (!factorise(normal, u, factor)) throw Undetermined("the presses contradict each other: no gains explain them");
        VectorXd z(n);
        for (Eigen::Index i = 0; i < n; ++i) z[i] = gauss(random) / std::sqrt(factor.vectorD()[i]);
        const VectorXd turned = factor.matrixU().solve(z);
        const VectorXd error = factor.solve(normal.right) + factor.permutationPinv() * turned;
        for (Eigen::Index i = 0; i < n; ++i) {
            const double two = exponential(random) + exponential(random);
            u[i] = 2 * two / (kNu + error[i] * error[i] / (s * s));
            sums.far[i] += std::abs(error[i]) > limit ? 1. / sweeps : 0;
        }
        sums.error += error / sweeps;
        sums.square += error.cwiseAbs2() / sweeps;
        sums.u += u / sweeps;
    }
    return sums;
}

// Two chains side by side, for two cores, of half as many sweeps each. The result depends on the seed alone.
TaxelGains::Sums TaxelGains::sample(const Normal& normal, int sweeps, std::uint64_t seed) const {
    auto other = std::async(std::launch::async, [&] { return chain(normal, sweeps / 2, 2 * seed + 1); });
    Sums sums = chain(normal, sweeps / 2, 2 * seed);
    const Sums more = other.get();
    sums.error = (sums.error + more.error) / 2;
    sums.square = (sums.square + more.square) / 2;
    sums.u = (sums.u + more.u) / 2;
    sums.far = (sums.far + more.far) / 2;
    return sums;
}

void TaxelGains::fit(const GainEquations& equations) {
    const Eigen::VectorXd all = Eigen::VectorXd::Ones(equations.y.size());
    for (int round = 0; round < kRounds; ++round) {
        search(equations, round == 0 ? 2 : 1.2);
        const Sums sums = sample(normal(equations, all), kBurnIn, std::uint64_t(round));
        gain = Eigen::VectorXd::Ones(gain.size()) + sums.error;
        u_ = sums.u;
    }
    search(equations, 1.2);
    const Sums sums = sample(normal(equations, all), kSweeps, kRounds);
    gain = Eigen::VectorXd::Ones(gain.size()) + sums.error;
    sd = (sums.square - sums.error.cwiseAbs2()).cwiseSqrt();
    u_ = sums.u;
    for (Eigen::Index i = 0; i < gain.size(); ++i) is_far[std::size_t(i)] = sums.far[i] >= kSure ? 1 : 0;
}

TaxelGains::HeldOut TaxelGains::hold_out(const GainEquations& equations) const {
    HeldOut out;
    const Eigen::Index n = equations.y.size();
    const Eigen::VectorXd variance = variance_of(equations);
    const std::size_t presses = 1 + *std::max_element(equations.press.begin(), equations.press.end());
    std::vector<double> squares(presses, 0), number(presses, 0);
    for (std::size_t part = 0; part < kParts; ++part) {
        Eigen::VectorXd used = Eigen::VectorXd::Ones(n);
        std::vector<Eigen::Triplet<double>> triplets;
        std::vector<Eigen::Index> rows;
        for (Eigen::Index k = 0; k < n; ++k) {
            if (equations.press[std::size_t(k)] % kParts != part) continue;
            used[k] = 0;
            for (GainEquations::Matrix::InnerIterator at(equations.b, k); at; ++at)
                triplets.emplace_back(int(at.col()), int(rows.size()), at.value());
            rows.push_back(k);
        }
        const Normal sums = normal(equations, used);
        Factor factor;
        if (rows.empty() || !factorise(sums, u_, factor)) continue;
        Eigen::SparseMatrix<double> left(gain.size(), Eigen::Index(rows.size()));
        left.setFromTriplets(triplets.begin(), triplets.end());
        const Eigen::VectorXd of_gains = quadratic_forms(factor, left);
        const Eigen::VectorXd predicted = left.transpose() * (Eigen::VectorXd::Ones(gain.size()) + factor.solve(sums.right));
        for (std::size_t r = 0; r < rows.size(); ++r) {
            const Eigen::Index k = rows[r];
            const double error = predicted[Eigen::Index(r)] - equations.y[k];
            const double sd_of = std::sqrt(of_gains[Eigen::Index(r)] + variance[k]);
            squares[equations.press[std::size_t(k)]] += std::pow(error / sd_of, 2);
            ++number[equations.press[std::size_t(k)]];
            if (equations.kind[std::size_t(k)] != GainEquations::kForce) continue;
            out.error.push_back(error);
            out.of_sd.push_back(error / sd_of);
        }
    }
    double sum = 0, n_presses = 0;
    for (std::size_t p = 0; p < presses; ++p)
        if (number[p] > 0) sum += squares[p] / number[p], ++n_presses;
    out.ratio2 = n_presses > 0 ? sum / n_presses : std::numeric_limits<double>::quiet_NaN();
    return out;
}

double TaxelGains::common_sd(const GainEquations& equations) const {
    Factor factor;
    if (!factorise(normal(equations, Eigen::VectorXd::Ones(equations.y.size())), u_, factor))
        throw Undetermined("the presses contradict each other: no gains explain them");
    Eigen::VectorXd load = Eigen::VectorXd::Zero(gain.size());
    for (Eigen::Index k = 0; k < equations.y.size(); ++k)
        if (equations.kind[std::size_t(k)] == GainEquations::kForce)
            for (GainEquations::Matrix::InnerIterator at(equations.b, k); at; ++at) load[at.col()] += std::abs(at.value());
    return std::sqrt(load.dot(factor.solve(load))) / load.dot(gain);
}

}  // namespace tactiled
