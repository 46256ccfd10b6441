// Model "table", method "map": where one point touches the plate and with what force, against finite-element strains of the
// eight gauges per 1 N at every point of the plate. Eight readings, five unknowns (point_contact.hpp). The plate lies in z =
// 0 of frame S, so the moments are those of the force at the point: mx = y fz, my = -x fz; the centre of pressure is
// (-my / fz, mx / fz).
//
// A point is reported where the force is more than `locate` times the standard deviation that noise gives it (after Dargahi
// and Najarian 2004: the variance of the position goes with 1 / F^2). Else, and where no point on the plate explains the
// readings, the forces are those of a load spread evenly over the plate.
#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <optional>

#include "decoupling/checked.hpp"
#include "decoupling/gauge_solver.hpp"
#include "decoupling/generic_methods.hpp"
#include "decoupling/point_contact.hpp"
#include "decoupling/table_methods.hpp"
#include "decoupling/table_signs.hpp"

namespace tactiled {
namespace {

constexpr double kDoubtful = 6, kGainError = 0.01;  // as method "linear"
constexpr double kRest = 3;   // nothing touches: the readings are within 3 sigma of noise, root mean square
constexpr double kPoor = 3;   // from this residual on the last point is no longer believed
constexpr double kOther = 9;  // another minimum is as good: 3 sigma
constexpr double kDefaultLocate = 5;
constexpr int kFewestGauges = 6;  // five unknowns and something to compare
constexpr int kWarmSteps = 6;
// A point that moved farther than this between two samples has jumped: the minimum beside the last one may be another, and
// explain the readings well enough with a pull instead of a press. A finger that slides at 100 mm/s moves as far in 1 ms.
constexpr double kJump_m = 1e-4;
constexpr unsigned kSearchEvery = 64;  // samples: a minimum that was followed may no longer be the best
constexpr unsigned kDeadEvery = 16;    // samples with disagreement between looks for a dead gauge

class TableMap final : public CheckedModel {
public:
    TableMap(const Calibration& calibration, InfluenceMap map, GaugeSolver spread, double noise, bool point)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0),
          zero_(calibration.zero),
          noise_(noise),
          locate_(parameter_or(calibration, "locate", kDefaultLocate)),
          solver_(std::move(map)),
          spread_(std::move(spread)),
          point_(point) {
        sd_slope_.fill(0);
        for (std::size_t i = 0; i < calibration.sd.size(); ++i) {
            const std::size_t c = component_index(calibration.components[i]);
            sd_[c] = calibration.sd[i];
            if (!calibration.sd_slope.empty()) sd_slope_[c] = calibration.sd_slope[i];
        }
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "map"; }

private:
    // rt: bounded by one search, with a dead gauge nine
    void solve(Input& input, Estimate& estimate) noexcept override {
        Gauges y = Gauges::Zero();
        for (std::size_t k = 0; k < n_channels(); ++k) y[Eigen::Index(k)] = input.r[k];
        const double reading2 = y.squaredNorm() / std::max(1, std::popcount(input.usable));
        const double variance = noise_ * noise_ + kGainError * kGainError * reading2;
        const bool rests = reading2 <= kRest * kRest * noise_ * noise_;
        if (!std::isfinite(variance)) return lose_point();  // readings of 1e154 and more: BAD
        std::uint32_t usable = input.usable & ~dead_;
        if ((dead_ & input.usable) != 0) {
            const auto k = std::size_t(std::countr_zero(dead_));
            if (!(std::abs(input.r[k] + zero_[k]) <= 3 * noise_)) usable = input.usable;  // it lives again
        }
        if (usable == input.usable) dead_ = 0;
        if (!point_ || rests || std::popcount(usable) < kFewestGauges) {
            if (!rests || !point_) lose_point();
            return spread_evenly(input, estimate, !point_ || rests);
        }

        PointContact contact = locate(y, usable, variance);
        estimate.residual = residual(contact, usable, variance);
        if (estimate.residual > kDoubtful && disagreements_++ % kDeadEvery == 0)
            drop_dead_gauge(input, y, variance, usable, contact);
        if (dead_ != 0) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
        const double unexplained = residual(contact, usable, variance);
        if (unexplained <= kDoubtful) disagreements_ = 0;
        solver_.deviations(usable, contact);
        const double sigma = std::sqrt(variance);
        const double force_sd = noise_ * std::hypot(contact.sd[0], contact.sd[1], contact.sd[2]);
        if (!(unexplained <= kDoubtful) || !(contact.force_N.norm() > locate_ * force_sd)) {
            if (!(unexplained <= kDoubtful)) estimate.reasons |= TACTILED_DISAGREEMENT;
            has_point_ = false;
            return spread_evenly(input, estimate, false);
        }
        has_point_ = true;
        point_m_ = contact.point_m;
        if (contact.at_rim) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        if (ambiguous_) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        const auto& f = contact.force_N;
        estimate.wrench_S = {f.x(), f.y(), f.z(), contact.point_m.y() * f.z(), -contact.point_m.x() * f.z(), kNaN};
        estimate.cop_S_m = {contact.point_m.x(), contact.point_m.y()};
        for (std::size_t c = 0; c < 5; ++c) add_sd(input, estimate, c, sigma * contact.sd[c]);
    }

    void forget() noexcept override { lose_point(); }
    void lose_point() noexcept {
        has_point_ = ambiguous_ = false;
        since_search_ = disagreements_ = 0;
        dead_ = 0;
    }

    // On from the last point where that still explains the readings, close by; else a search over the plate.
    PointContact locate(const Gauges& y, std::uint32_t usable, double variance) noexcept {
        if (has_point_ && ++since_search_ < kSearchEvery) {
            const PointContact contact = solver_.refine(y, usable, point_m_, kWarmSteps);
            if (contact.converged && residual(contact, usable, variance) <= kPoor &&
                (contact.point_m - point_m_).norm() <= kJump_m)
                return contact;
        }
        since_search_ = 0;
        double other;
        const PointContact contact = solver_.search(y, usable, other);
        ambiguous_ = other - contact.squares < kOther * variance;
        return contact;
    }

    [[nodiscard]] static double residual(const PointContact& contact, std::uint32_t usable, double variance) noexcept {
        const int freedom = std::popcount(usable) - 5;
        return freedom > 0 ? std::sqrt(std::max(0.0, contact.squares) / freedom / variance) : kNaN;
    }

    // One gauge that delivers 0 although the rest, without it, agree on a point.
    void drop_dead_gauge(const Input& input, const Gauges& y, double variance, std::uint32_t& usable,
                         PointContact& contact) noexcept {
        std::uint32_t found = 0;
        PointContact best;
        double best_residual = kDoubtful;
        for (std::size_t k = 0; k < n_channels(); ++k) {
            const std::uint32_t rest = usable & ~(1u << k);
            if (rest == usable || !(std::abs(input.r[k] + zero_[k]) <= 3 * noise_) || std::popcount(rest) < kFewestGauges)
                continue;
            double other;
            const PointContact one = solver_.search(y, rest, other);
            const double unexplained = residual(one, rest, variance);
            if (!(unexplained < best_residual)) continue;
            best_residual = unexplained;
            best = one;
            found = 1u << k;
            ambiguous_ = other - one.squares < kOther * variance;
        }
        if (found == 0) return;
        dead_ = found;
        usable &= ~found;
        contact = best;
    }

    // The forces of a load spread over the plate; moments 0, for its middle is the plate's. `true_here`: that is the
    // contact, or nothing touches.
    void spread_evenly(Input& input, Estimate& estimate, bool true_here) noexcept {
        const auto solved = spread_.solve(input.r, zero_, input.usable & ~dead_);
        if (solved.used == 0) return;  // BAD
        if (true_here && !point_) {
            estimate.residual = solved.residual;
            if (solved.dead) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
            if (solved.doubtful) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        }
        if (!true_here) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;  // how wrong depends on where it touches
        for (std::size_t c = 0; c < 3; ++c) {
            estimate.wrench_S[c] = solved.load[c] + 0.0;
            if (point_) {
                add_sd(input, estimate, c, spread_.sd(c) * spread_.sd_factor(c, solved.used));
            } else {
                input.sd_factor[c] = spread_.sd_factor(c, solved.used);
            }
        }
        estimate.wrench_S[3] = estimate.wrench_S[4] = 0;
    }

    // The calibration's standard deviation and the one of the place together.
    void add_sd(Input& input, Estimate& estimate, std::size_t c, double local) noexcept {
        const double sd = std::hypot(sd_[c], sd_slope_[c] * estimate.wrench_S[c]);
        if (!seen()[c] || std::isnan(sd)) return;
        if (sd > 0 && std::isfinite(local)) {
            input.sd_factor[c] = std::hypot(1.0, local / sd);
        } else {
            estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        }
    }

    std::vector<double> zero_;
    double noise_, locate_;
    PointSolver solver_;
    GaugeSolver spread_;
    bool point_;
    Wrench sd_ = kUnseen, sd_slope_{};

    bool has_point_ = false, ambiguous_ = false;
    Eigen::Vector2d point_m_ = Eigen::Vector2d::Zero();
    unsigned since_search_ = 0, disagreements_ = 0;
    std::uint32_t dead_ = 0;
};

// Values of the parameter `contact`.
constexpr double kUniform = 0, kPoint = 1, kRigid = 2;

}  // namespace

std::optional<InfluenceMap> influence_of(const Calibration& calibration, std::string& fault) {
    const std::size_t n = calibration.channels.size();
    const auto* rows = table_of(calibration, "influence", 0, 26, fault);
    if (rows == nullptr) return std::nullopt;
    fault = InfluenceMap::fault_of(*rows);
    if (!fault.empty()) return std::nullopt;
    const double gauge_factor = parameter_or(calibration, "gauge_factor", 0);
    if (!(gauge_factor > 0)) {
        fault = "parameter gauge_factor (channel_unit per strain; about 2 for Ni-Cr and dR/R0) is missing or 0";
        return std::nullopt;
    }
    std::vector<double> scale(n, 1.0);
    if (calibration.tables.count("gauge_scale") != 0) {
        const auto* row = table_of(calibration, "gauge_scale", 1, n, fault);
        if (row == nullptr) return std::nullopt;
        scale = row->front();
    }
    std::array<int, 8> gauge;
    gauge.fill(-1);
    std::array<double, 8> gain{};
    for (std::size_t k = 0; k < n; ++k) {
        gauge[k] = table_gauge(calibration.channels[k])->number - 1;
        gain[k] = gauge_factor * scale[k];
    }
    return InfluenceMap(*rows, gauge, gain);
}

std::unique_ptr<Decoupler> make_table_map(const Calibration& calibration, std::string& fault) {
    const TableNeeds needs{{"gauge_factor", "noise", "contact", "locate"},
                           {"influence", "gauge_scale", "rigid"},
                           {"fx", "fy", "fz", "mx", "my"},
                           true};
    fault = fault_of_table(calibration, needs);
    if (!fault.empty()) return nullptr;
    const auto map = influence_of(calibration, fault);
    if (!map) return nullptr;
    const double contact = parameter_or(calibration, "contact", kPoint);
    if (contact != kUniform && contact != kPoint && contact != kRigid) {
        fault = fmt::format("parameter contact = {}; it is 0 (uniform), 1 (point) or 2 (rigid)", contact);
        return nullptr;
    }
    const std::size_t n = calibration.channels.size();
    if (contact == kPoint && n < std::size_t(kFewestGauges)) {
        fault = fmt::format("{} gauges; a point contact has five unknowns and needs {} or more", n, kFewestGauges);
        return nullptr;
    }
    if (contact != kPoint)
        for (const auto& name : calibration.components)
            if (name[0] == 'm') {
                fault = fmt::format("component \"{}\"; a contact that is not a point has fx fy fz", name);
                return nullptr;
            }
    const Influence mean = map->mean();
    std::vector<std::vector<double>> columns;
    for (Eigen::Index k = 0; k < Eigen::Index(n); ++k) columns.push_back({mean(k, 0), mean(k, 1), mean(k, 2)});
    if (contact == kRigid) {
        // A row a channel, channel_unit per N of fx fy fz.
        const auto* rigid = table_of(calibration, "rigid", n, 3, fault);
        if (rigid == nullptr) return nullptr;
        columns = *rigid;
    }
    const double noise = parameter_or(calibration, "noise", kDefaultNoise_per_reading * mean.cwiseAbs().maxCoeff());
    std::uint32_t inner = 0;
    for (std::size_t k = 0; k < n; ++k)
        if (table_gauge(calibration.channels[k])->inner) inner |= 1u << k;
    if (!(noise > 0)) {
        fault = "parameter noise (one standard deviation of a gauge, channel_unit) is not above 0";
        return nullptr;
    }
    GaugeSolver spread(columns, std::vector<double>(n, noise), inner, 3);
    if (!spread.confused().empty() || !spread.solvable((1u << n) - 1)) {
        fault = "a load spread over the plate: these gauges cannot tell fx fy fz apart";
        return nullptr;
    }
    return std::make_unique<TableMap>(calibration, *map, std::move(spread), noise, contact == kPoint);
}

}  // namespace tactiled
