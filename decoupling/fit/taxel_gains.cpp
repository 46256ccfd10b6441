#include "decoupling/fit/taxel_gains.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "decoupling/fit/array_presses.hpp"
#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

constexpr double kSmallest = 1e-5;  // least s and spread: below it they change nothing
constexpr std::size_t kParts = 5;
constexpr int kRounds = 5;  // rounds of opening priors; each finds fewer than the one before

}  // namespace

TaxelGains::TaxelGains(std::size_t taxels)
    : gain(Eigen::VectorXd::Ones(Eigen::Index(taxels))), sd(gain), other(taxels, 0), own_(0 * gain) {}

Eigen::VectorXd TaxelGains::variance_of(const GainEquations& equations) const {
    Eigen::VectorXd variance = equations.v * gain.cwiseAbs2() + equations.within;
    for (Eigen::Index k = 0; k < variance.size(); ++k)
        variance[k] += std::pow(spread[equations.kind[std::size_t(k)]] * equations.scale[k], 2);
    return variance;
}

bool TaxelGains::solve(const GainEquations& equations, const Eigen::VectorXd& used, Solution& out) const {
    using Eigen::VectorXd;
    const Eigen::Index n = gain.size();
    const VectorXd variance = variance_of(equations);
    out.weight = used.cwiseQuotient(variance);
    VectorXd& prior = out.prior;
    prior = (own_.array() > 0).select(own_, VectorXd::Constant(n, s * s)).cwiseInverse();
    const GainEquations::Matrix weighted = out.weight.asDiagonal() * equations.b;
    Eigen::SparseMatrix<double> a = equations.b.transpose() * weighted;
    Eigen::SparseMatrix<double> on_diagonal(n, n);
    on_diagonal.setIdentity();
    on_diagonal.diagonal() = prior;
    a += on_diagonal;
    out.factor.compute(a);
    if (out.factor.info() != Eigen::Success || !(out.factor.vectorD().minCoeff() > 0)) return false;
    const VectorXd left = equations.y - equations.b * VectorXd::Ones(n);
    const VectorXd right = weighted.transpose() * left;
    out.error = out.factor.solve(right);
    out.fit = out.factor.vectorD().array().log().sum() - prior.array().log().sum() +
              (used.array() * variance.array().log()).sum() + left.dot(out.weight.cwiseProduct(left)) - right.dot(out.error);
    return std::isfinite(out.fit);
}

// Minimises along each of log s and the logs of the spreads in turn, with ever smaller steps.
void TaxelGains::search(const GainEquations& equations) {
    const Eigen::VectorXd all = Eigen::VectorXd::Ones(equations.y.size());
    Solution solution;
    const auto fit = [&] {
        return solve(equations, all, solution) ? solution.fit : std::numeric_limits<double>::infinity();
    };
    double best = fit();
    for (const double step : {2., 1.4, 1.15})
        for (bool any = true; any;) {
            any = false;
            for (double* const value : {&s, &spread[0], &spread[1]})
                for (const double by : {step, 1 / step})
                    for (;;) {
                        const double before = *value;
                        *value = std::max(kSmallest, before * by);
                        const double now = *value != before ? fit() : best;
                        if (!(now < best)) {
                            *value = before;
                            break;
                        }
                        best = now;
                        any = true;
                    }
        }
}

// The equations alone put the error of a taxel at m with the variance c, by division of its posterior by its prior. It is
// one of its kind if m is within the level of N(0, s^2 + c).
bool TaxelGains::find_others() {
    const double level = contact_level(std::size_t(gain.size()));
    bool any = false;
    for (Eigen::Index i = 0; i < gain.size(); ++i) {
        const double posterior = sd[i] * sd[i];
        if (other[std::size_t(i)] != 0 || !(posterior < s * s)) continue;
        const double c = 1 / (1 / posterior - 1 / (s * s)), m = c * (gain[i] - 1) / posterior;
        if (m * m <= level * level * (s * s + c)) continue;
        other[std::size_t(i)] = 1;
        own_[i] = m * m - c;  // most likely
        any = true;
    }
    return any;
}

void TaxelGains::fit(const GainEquations& equations) {
    const Eigen::VectorXd all = Eigen::VectorXd::Ones(equations.y.size());
    Eigen::SparseMatrix<double> identity(gain.size(), gain.size());
    identity.setIdentity();
    for (int round = 0; round < kRounds; ++round) {
        search(equations);
        Solution solution;
        if (!solve(equations, all, solution)) throw Undetermined("the presses contradict each other: no gains explain them");
        gain = Eigen::VectorXd::Ones(gain.size()) + solution.error;
        sd = quadratic_forms(solution.factor, identity).cwiseSqrt();
        if (!find_others()) break;
    }
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
        Solution solution;
        if (rows.empty() || !solve(equations, used, solution)) continue;
        Eigen::SparseMatrix<double> left(gain.size(), Eigen::Index(rows.size()));
        left.setFromTriplets(triplets.begin(), triplets.end());
        const Eigen::VectorXd of_gains = quadratic_forms(solution.factor, left);
        const Eigen::VectorXd predicted = left.transpose() * (Eigen::VectorXd::Ones(gain.size()) + solution.error);
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
    Solution solution;
    if (!solve(equations, Eigen::VectorXd::Ones(equations.y.size()), solution))
        throw Undetermined("the presses contradict each other: no gains explain them");
    // The information of the equations on the factor, g' G g - g' G A^-1 G g with A = G + prior, without cancellation.
    // Places have none, because their equations are homogeneous.
    const Eigen::VectorXd weighted = solution.prior.cwiseProduct(gain), solved = solution.factor.solve(weighted);
    return 1 / std::sqrt(gain.dot(weighted) - weighted.dot(solved));
}

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

}  // namespace tactiled
