// Model "table", method "linear": the table-shaped sensor of Lee, Kim, Shikida and Sato, four inner gauges R1 R3 R5 R7
// and, where they are wired, four outer gauges R2 R4 R6 R8. With N = -fz > 0 while pressing,
//
//     r = G (Fx, Fy, N),    rows of G by the sign table:    R1 (-ti  0  ni)   R5 (+ti  0  ni)
//                                                           R3 ( 0 -ti ni)   R7 ( 0 +ti ni)
//                                                           R2 (+to  0  no)   R6 (-to  0  no)
//                                                           R4 ( 0 +to no)   R8 ( 0 -to no)
//
// For the inner four the least-squares solution is Lee et al., eq. 1-3, with the signs of their table and not of their
// eq. 2 and 3 (table.md, "Errata"): Fx = (r5 - r1) / 2 ti, Fy = (r7 - r3) / 2 ti, N = (r1 + r3 + r5 + r7) / 4 ni.
// What four gauges say more than three forces is the parity r1 - r3 + r5 - r7 = 0; with eight, five such sums.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <vector>

#include "decoupling/checked.hpp"
#include "decoupling/pairs.hpp"
#include "decoupling/table_methods.hpp"
#include "decoupling/table_signs.hpp"

namespace tactiled {
namespace {

// A residual is doubtful from here on, in standard deviations. 6 sigma of pure noise is once in 5e8 samples, 6 days at
// 1 kHz; 4 sigma would be once in 16 s.
constexpr double kDoubtful = 6;
// Gauges that differ from their common gain by 1 % are sound: within the documents' 4.84 % hysteresis and 0.99 %
// linearity nobody can calibrate them closer. All four off by 1 % in the worst signs make a residual of 2 sigma, one
// gauge alone has to be off by about 12 % of the others' reading to reach kDoubtful.
constexpr double kGainError = 0.01;
// Subsets worse conditioned than this are not solved: all that leave three inner gauges stay below 10.
constexpr double kWorstCondition = 100;

// The forces from the usable gauges: pseudo-inverse of their rows of G.
struct Solution {
    // From each channel to Fx Fy N and nothing; 0 where the gauge is not used. Four, so that they go side by side.
    std::array<std::array<double, 4>, 8> inverse{};
    std::array<double, 3> noise_gain{};  // sd of Fx Fy N at 1 sd of independent noise a gauge
    std::array<double, 8> used{};        // 1 for a gauge that is, else 0
    std::array<double, 4> sd_factor{};   // noise_gain over that of all gauges, and nothing
    int gauges = 0;
    double per_gauge = 0, per_freedom = 0;  // 1 / gauges, 1 / (gauges - 3)
    bool solvable = false;
};

using Gains = Eigen::Matrix<double, Eigen::Dynamic, 3>;

Solution solve(const Gains& gains, std::uint32_t usable) {
    Solution solution;
    std::vector<Eigen::Index> rows;
    for (Eigen::Index k = 0; k < gains.rows(); ++k)
        if ((usable >> k & 1u) != 0) rows.push_back(k);
    if (rows.size() < 3) return solution;
    Gains g(Eigen::Index(rows.size()), 3);
    for (Eigen::Index i = 0; i < g.rows(); ++i) g.row(i) = gains.row(rows[std::size_t(i)]);
    const Eigen::RowVector3d scale = g.colwise().norm();
    if (!(scale.minCoeff() > 0)) return solution;
    for (Eigen::Index j = 0; j < 3; ++j) g.col(j) /= scale[j];
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd{Eigen::MatrixXd(g)};
    if (!(svd.singularValues()[2] * kWorstCondition > svd.singularValues()[0])) return solution;
    const Eigen::MatrixXd inverse =
        Eigen::MatrixXd(g).colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(g.rows(), g.rows()));
    for (Eigen::Index j = 0; j < 3; ++j) {
        for (Eigen::Index i = 0; i < g.rows(); ++i)
            solution.inverse[std::size_t(rows[std::size_t(i)])][std::size_t(j)] = inverse(j, i) / scale[j];
        solution.noise_gain[std::size_t(j)] = inverse.row(j).norm() / scale[j];
    }
    solution.gauges = int(rows.size());
    solution.per_gauge = 1.0 / solution.gauges;
    if (solution.gauges > 3) solution.per_freedom = 1.0 / (solution.gauges - 3);
    for (const Eigen::Index k : rows) solution.used[std::size_t(k)] = 1;
    solution.solvable = true;
    return solution;
}

class Table final : public CheckedModel {
public:
    explicit Table(const Calibration& calibration, const Gains& gains)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0) {
        const std::size_t n = calibration.channels.size();
        std::uint32_t inner = 0;
        for (std::size_t k = 0; k < n; ++k) {
            zero_[k] = calibration.zero[k];
            for (Eigen::Index j = 0; j < 3; ++j) gains_[std::size_t(j)][k] = gains(Eigen::Index(k), j);
            if (table_gauge(calibration.channels[k])->inner) inner |= 1u << k;
        }
        for (std::uint32_t usable = 0; usable < 1u << n; ++usable) {
            // N comes from the inner gauges only (the outer ones read about 0 under a press), and with two of them
            // left nothing would tell a press from a bent plate.
            const bool enough = std::popcount(usable & inner) >= 3;
            solutions_.push_back(enough ? tactiled::solve(gains, usable) : Solution{});
        }
        for (Solution& solution : solutions_)
            for (std::size_t c = 0; c < 3; ++c)
                solution.sd_factor[c] = solution.noise_gain[c] / solutions_.back().noise_gain[c];
        const auto noise = calibration.parameters.find("noise");
        noise_ = noise != calibration.parameters.end()
                     ? noise->second
                     : kDefaultNoise_per_reading * calibration.parameters.at("normal_inner");
    }

    [[nodiscard]] std::string_view method() const noexcept override { return "linear"; }

private:
    using Gauges = std::array<double, 8>;
    using Force = std::array<double, 4>;  // Fx Fy N, and nothing

    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const Solution* solution = &solutions_[input.usable];
        if (!solution->solvable) return;  // BAD
        Gauges r;
        for (std::size_t k = 0; k < 8; k += 2) store(r.data() + k, load(input.r.data() + k));
        Force force = forces(*solution, r);
        estimate.residual = residual(*solution, force, r);
        if (is_doubtful(*solution, estimate.residual)) solution = doubt(r, *solution, input, estimate, force);
        // In pairs, as they are read again: a load that spans two stores waits for both. fz = -N, and 0 rather than -0 at
        // rest.
        store(estimate.wrench_S.data(), Pair{force[0], force[1]});
        store(estimate.wrench_S.data() + 2, Pair{0.0 - force[2], kNaN});
        store(estimate.wrench_S.data() + 4, both(kNaN));
        store(input.sd_factor.data(), load(solution->sd_factor.data()));
        store(input.sd_factor.data() + 2, load(solution->sd_factor.data() + 2));
    }

    // Without the gauge that is dead, where that is known. Its own function: the good reading does not pay for it.
    [[gnu::noinline]] const Solution* doubt(const Gauges& r, const Solution& all, Input& input, Estimate& estimate,
                                            Force& force) const noexcept {
        estimate.reasons |= TACTILED_DISAGREEMENT;
        const std::uint32_t usable = drop_dead_gauge(r, input.usable);
        if (usable == input.usable) {  // which gauge is wrong is not known, so neither is how wrong the forces are
            estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
            return &all;
        }
        estimate.reasons |= TACTILED_MISSING_CHANNEL;
        const Solution& rest = solutions_[usable];
        force = forces(rest, r);
        Gauges channel{};
        for (std::size_t k = 0; k < 8; ++k) channel[k] = r[k] + zero_[k];
        input.outside = domain().outside({channel.data(), n_channels()}, usable);
        return &rest;
    }

    // The products and sums in the order of the channels, the forces side by side; a gauge that is not used has r = 0 or
    // inverse 0.
    static Force forces(const Solution& solution, const Gauges& r) noexcept {
        Pair tangential = both(0), normal = both(0);
        for (std::size_t k = 0; k < 8; ++k) {
            tangential += load(solution.inverse[k].data()) * both(r[k]);
            normal += load(solution.inverse[k].data() + 2) * both(r[k]);
        }
        return {tangential[0], tangential[1], normal[0], normal[1]};
    }

    // What the gauges would read, the unused ones too.
    [[nodiscard]] Gauges predicted(const Force& force) const noexcept {
        Gauges p;
        for (std::size_t k = 0; k < 8; k += 2)
            store(p.data() + k, load(gains_[0].data() + k) * both(force[0]) + load(gains_[1].data() + k) * both(force[1]) +
                                    load(gains_[2].data() + k) * both(force[2]));
        return p;
    }

    // Root mean square of what the forces do not explain of the usable gauges, a degree of freedom, in standard
    // deviations of a gauge: noise and gain error together. NaN where three gauges leave nothing to compare.
    // rt: wait-free
    [[nodiscard]] double residual(const Solution& solution, const Force& force, const Gauges& r) const noexcept {
        if (solution.gauges <= 3) return kNaN;
        const Gauges p = predicted(force);
        double unexplained = 0, reading = 0;
        for (std::size_t k = 0; k < 8; k += 2) {  // pairs of products, summed one by one
            const Pair used = load(solution.used.data() + k), read = load(r.data() + k);
            const Pair rest = used * (read - load(p.data() + k));
            const Pair rest2 = rest * rest, read2 = used * read * read;
            unexplained = unexplained + rest2[0] + rest2[1];
            reading = reading + read2[0] + read2[1];
        }
        const double variance = noise_ * noise_ + kGainError * kGainError * reading * solution.per_gauge;
        if (!std::isfinite(variance)) return std::numeric_limits<double>::infinity();  // readings of 1e154 and more
        return std::sqrt(unexplained * solution.per_freedom / variance);
    }

    // Three gauges cannot contradict each other; of more, a residual that overflowed is doubtful too.
    static bool is_doubtful(const Solution& solution, double residual) noexcept {
        return solution.gauges > 3 && !(residual <= kDoubtful);
    }

    // The usable gauges but the one that delivers 0 as no live gauge would: the readings of the others are consistent
    // and demand another value there. The same set where there is none or more than one such.
    // rt: wait-free
    [[nodiscard]] std::uint32_t drop_dead_gauge(const Gauges& r, std::uint32_t usable) const noexcept {
        std::uint32_t found = usable;
        for (std::size_t k = 0; k < n_channels(); ++k) {
            const std::uint32_t rest = usable & ~(1u << k);
            if (rest == usable || !(std::abs(r[k] + zero_[k]) <= 3 * noise_) || !solutions_[rest].solvable) continue;
            const Force force = forces(solutions_[rest], r);
            if (is_doubtful(solutions_[rest], residual(solutions_[rest], force, r)) ||
                !(std::abs(predicted(force)[k] - r[k]) > kDoubtful * noise_))
                continue;
            if (found != usable) return usable;
            found = rest;
        }
        return found;
    }

    Gauges zero_{};
    std::array<Gauges, 3> gains_{};
    std::vector<Solution> solutions_;  // index: bit k set where channel k is usable
    double noise_ = 0;                 // one standard deviation of a gauge's reading
};

// What is wrong with the calibration, "" where nothing is.
std::string fault_of(const Calibration& calibration) {
    std::uint32_t seen = 0;
    for (const auto& name : calibration.channels) {
        const auto gauge = table_gauge(name);
        if (!gauge) return fmt::format("channel \"{}\"; a table sensor has R1 .. R8", name);
        if ((seen >> gauge->number & 1u) != 0) return fmt::format("channel \"{}\" twice", name);
        seen |= 1u << gauge->number;
    }
    for (const int inner : {1, 3, 5, 7})
        if ((seen >> inner & 1u) == 0) return fmt::format("channels lacks R{}; needed are R1 R3 R5 R7", inner);
    if (calibration.zero.size() != calibration.channels.size())
        return fmt::format("zero has {} numbers for {} channels", calibration.zero.size(), calibration.channels.size());
    for (const auto& name : calibration.components)
        if (name != "fx" && name != "fy" && name != "fz")
            return fmt::format("component \"{}\"; the linear method sees fx fy fz", name);
    const std::vector<std::string> known{"normal_inner", "tangential_inner", "normal_outer", "tangential_outer", "noise"};
    for (const auto& [name, value] : calibration.parameters) {
        if (std::find(known.begin(), known.end(), name) == known.end()) {
            const auto near = nearest_name(name, known);
            return fmt::format(
                "parameter {} is unknown; {}", name,
                near ? "did you mean " + *near + "?" : "known are " + fmt::format("{}", fmt::join(known, " ")));
        }
        if (value < 0 && name != "normal_outer") return fmt::format("parameter {} = {} is below 0", name, value);
    }
    std::vector<std::string> needed{"normal_inner", "tangential_inner"};
    if (calibration.channels.size() > 4) needed.emplace_back("tangential_outer");
    for (const auto& name : needed)
        if (calibration.parameters.count(name) == 0 || calibration.parameters.at(name) == 0)
            return fmt::format("parameter {} (1/N, dR/R0 at 1 N) is missing or 0", name);
    return fault_of_shared_parts(calibration);
}

}  // namespace

std::unique_ptr<Decoupler> make_table_linear(const Calibration& calibration, std::string& fault) {
    fault = fault_of(calibration);
    if (!fault.empty()) return nullptr;
    Gains gains(Eigen::Index(calibration.channels.size()), 3);
    const auto rows = gains_of_signs(calibration);
    for (std::size_t k = 0; k < rows.size(); ++k)
        for (std::size_t j = 0; j < 3; ++j) gains(Eigen::Index(k), Eigen::Index(j)) = rows[k][j];
    if (!solve(gains, (1u << calibration.channels.size()) - 1).solvable) {
        fault = "these gains cannot tell the three forces apart";
        return nullptr;
    }
    return std::make_unique<Table>(calibration, gains);
}

}  // namespace tactiled
