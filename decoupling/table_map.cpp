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
#include "decoupling/contact_search.hpp"
#include "decoupling/gauge_solver.hpp"
#include "decoupling/generic_methods.hpp"
#include "decoupling/table_methods.hpp"
#include "decoupling/table_signs.hpp"

namespace tactiled {
namespace {

constexpr double kDoubtful = ContactSearch::kDoubtful;
constexpr double kRest = 3;  // nothing touches: the readings are within 3 sigma of noise, root mean square
constexpr double kPoor = 3;  // from this residual on a point is not believed
constexpr double kDefaultLocate = 5;
// Shear over press; skin and rubber on a smooth surface reach 1 to 1.5. A wrong minimum beside a column has a small press or
// a pull, and what cannot be pushed so is not believed.
constexpr double kDefaultFriction = 1.5;
// A search that ends above this may have missed the right minimum, which is found above it once in 150 times.
constexpr double kSurely = 2;
constexpr int kFewestGauges = ContactSearch::kFewestGauges;
constexpr int kWarmSteps = 6;
constexpr int kPiecesASample = 2;  // of a search that is spread over samples: together less than an ordinary sample takes
// A point that moved farther than this between two samples has jumped: the minimum beside the last one may be another, and
// explain the readings well enough with a pull instead of a press. A finger that slides at 100 mm/s moves as far in 1 ms.
constexpr double kJump_m = 1e-4;
constexpr unsigned kSearchEvery = 256;  // samples: a minimum that was followed may no longer be the best
constexpr double kSame = 0.1;           // of the readings: they are those that no point explained a moment ago
constexpr double kStill = 0.05;         // of the readings' direction, from the first to the last sample of a spread search
constexpr unsigned kPoorEvery = 16;     // samples between searches while they are
constexpr unsigned kDeadEvery = 16;     // samples with disagreement between looks for a dead gauge

class TableMap final : public CheckedModel {
public:
    TableMap(const Calibration& calibration, InfluenceMap map, GaugeSolver spread, double noise, bool point,
             bool spread_search)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0),
          zero_(calibration.zero),
          noise_(noise),
          locate_(parameter_or(calibration, "locate", kDefaultLocate)),
          friction_(parameter_or(calibration, "friction", kDefaultFriction)),
          solver_(std::move(map)),
          search_(solver_),
          spread_(std::move(spread)),
          point_(point),
          spread_search_(spread_search) {
        sd_slope_.fill(0);
        for (std::size_t i = 0; i < calibration.sd.size(); ++i) {
            const std::size_t c = component_index(calibration.components[i]);
            sd_[c] = calibration.sd[i];
            if (!calibration.sd_slope.empty()) sd_slope_[c] = calibration.sd_slope[i];
        }
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "map"; }

private:
    // rt: bounded by one search, with a dead gauge nine; spread over samples: by two pieces of it
    void solve(Input& input, Estimate& estimate) noexcept override {
        Gauges y = Gauges::Zero();
        for (std::size_t k = 0; k < n_channels(); ++k) y[Eigen::Index(k)] = input.r[k];
        const double reading2 = y.squaredNorm() / std::max(1, std::popcount(input.usable));
        const double variance = noise_ * noise_ + kGainErrorOfGauge * kGainErrorOfGauge * reading2;
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
            seeks_ = false;
            return spread_evenly(input, estimate, !point_ || rests);
        }

        std::uint32_t silent = 0;
        for (std::size_t k = 0; k < n_channels(); ++k)
            silent |= std::uint32_t(std::abs(input.r[k] + zero_[k]) <= 3 * noise_) << k;
        PointContact contact;
        if (!locate(y, usable, silent, variance, contact)) return spread_evenly(input, estimate, false);
        usable &= ~dead_;
        estimate.residual = unexplained_by_all_;
        if (dead_ != 0) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
        const double unexplained = residual_of(contact, usable, variance);
        disagreements_ = unexplained <= kDoubtful ? 0 : disagreements_ + 1;
        solver_.deviations(y, usable, variance, contact);
        const double force_sd = noise_ / std::sqrt(variance) * contact.force_sd_N;
        if (!(unexplained <= kDoubtful) || !(contact.force_N.norm() > locate_ * force_sd)) {
            if (!(unexplained <= kDoubtful)) estimate.reasons |= TACTILED_DISAGREEMENT;
            has_point_ = false;
            return spread_evenly(input, estimate, false);
        }
        has_point_ = true;
        point_m_ = contact.point_m;
        const auto& f = contact.force_N;
        if (!(std::hypot(f.x(), f.y()) <= -friction_ * f.z()))
            estimate.reasons |= TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY;
        if (contact.at_rim) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        // The readings that a wrong minimum explains, it explains poorly: 3 sigma is once in 100,000 samples of the right
        // one.
        if (ambiguous_ || unexplained > kPoor) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        estimate.wrench_S = {f.x(), f.y(), f.z(), contact.point_m.y() * f.z(), -contact.point_m.x() * f.z(), kNaN};
        estimate.cop_S_m = {contact.point_m.x(), contact.point_m.y()};
        for (std::size_t c = 0; c < 5; ++c) add_sd(input, estimate, c, contact.sd[c]);
    }

    void forget() noexcept override { lose_point(); }
    void lose_point() noexcept {
        has_point_ = ambiguous_ = poor_ = seeks_ = found_other_ = false;
        since_search_ = disagreements_ = 0;
        search_.stop();
        dead_ = 0;
    }

    // On from the last point where that still explains the readings, close by; else a search over the plate. False: which is
    // not yet at its end.
    bool locate(const Gauges& y, std::uint32_t usable, std::uint32_t silent, double variance,
                PointContact& contact) noexcept {
        bool jumped = false;
        if (has_point_) {
            contact = solver_.refine(y, usable, contact_at(point_m_), kWarmSteps);
            unexplained_by_all_ = residual_of(contact, usable, variance);
            const bool explains = unexplained_by_all_ <= kPoor;
            jumped = explains && (contact.point_m - point_m_).norm() > kJump_m;
            if (explains && !jumped && contact.converged) {
                look_elsewhere(y, usable, variance, contact);
                return true;
            }
        }
        // Two fingers: no point explains these readings, nor those that are nearly the same.
        if (poor_ && !jumped && !seeks_ && usable == search_.usable() &&
            (y - search_.readings()).norm() <= kSame * y.norm() && ++since_search_ < kPoorEvery) {
            if (!has_point_) {
                contact = search_.found();
                contact.squares *= y.squaredNorm() / search_.readings().squaredNorm();
                unexplained_by_all_ = residual_of(contact, usable, variance);
            }
            return true;
        }
        if (!seeks_ || usable != search_.usable()) {
            search_.begin(y, usable, disagreements_ % kDeadEvery == 0 ? silent : 0, variance);
            has_point_ = found_other_ = false;
            seeks_ = true;
        }
        for (int i = 0; !search_.step(); ++i)
            if (spread_search_ && i + 1 == kPiecesASample) return false;
        seeks_ = false;
        return take_found(y, usable, variance, contact);
    }

    // What a search has found, for these readings; where they are others than those that it began with, on from there.
    bool take_found(const Gauges& y, std::uint32_t usable, double variance, PointContact& contact) noexcept {
        contact = search_.found();
        if (search_.dead() != 0) dead_ = search_.dead();
        unexplained_by_all_ = search_.residual_with_all();
        poor_ = !(search_.residual() <= kPoor);
        ambiguous_ = search_.is_ambiguous() || search_.residual() > kSurely;
        since_search_ = 0;
        if (!spread_search_) return true;
        const Gauges& then = search_.readings();
        const bool held_still = (y / y.norm() - then / then.norm()).norm() <= kStill;
        contact = solver_.refine(y, usable & ~dead_, contact_at(contact.point_m), kWarmSteps);
        // Else anew: from a place where the finger no longer is, the next minimum may be a wrong one that explains as much.
        return poor_ || (held_still && residual_of(contact, usable & ~dead_, variance) <= kPoor);
    }

    // A minimum that was followed may no longer be the best one: a search of the whole plate goes on beside the samples, a
    // piece each.
    void look_elsewhere(const Gauges& y, std::uint32_t usable, double variance, PointContact& near) noexcept {
        poor_ = false;
        if (found_other_) {
            found_other_ = false;
            const PointContact other = solver_.refine(y, usable, contact_at(search_.found().point_m), kWarmSteps);
            ambiguous_ = std::abs(other.squares - near.squares) < PointSearch::kOther * variance;
            if (other.squares < near.squares) near = other;
        } else if (search_.is_running()) {
            if (!search_.step()) return;
            found_other_ = (search_.found().point_m - near.point_m).norm() > kJump_m;
            if (!found_other_) ambiguous_ = search_.is_ambiguous();
        } else if (++since_search_ >= kSearchEvery) {
            since_search_ = 0;
            search_.begin(y, usable, 0, variance);
        }
    }

    // The forces of a load spread over the plate; moments 0, for its middle is the plate's. `true_here`: that is the
    // contact, or nothing touches.
    void spread_evenly(Input& input, Estimate& estimate, bool true_here) noexcept {
        double r[kMostGauges];
        for (std::size_t k = 0; k < kMostGauges; ++k) r[k] = (dead_ >> k & 1u) != 0 ? 0 : input.r.data()[k];
        const auto solved = spread_.solve<3>(r, input.usable & ~dead_);
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
    double noise_, locate_, friction_;
    PointSolver solver_;
    ContactSearch search_;
    GaugeSolver spread_;
    bool point_, spread_search_;
    Wrench sd_ = kUnseen, sd_slope_{};

    bool has_point_ = false, ambiguous_ = false;
    Eigen::Vector2d point_m_ = Eigen::Vector2d::Zero();
    unsigned since_search_ = 0, disagreements_ = 0;
    bool poor_ = false;         // the last search found nothing that explains its readings
    bool seeks_ = false;        // a search goes on, and until its end there is no point
    bool found_other_ = false;  // a search beside the samples has found another point
    double unexplained_by_all_ = 0;
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

std::unique_ptr<Decoupler> make_table_map(const Calibration& calibration, bool spread_search, std::string& fault) {
    const TableNeeds needs{{"gauge_factor", "noise", "contact", "locate", "friction"},
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
    GaugeSolver spread(columns, std::vector<double>(n, noise), calibration.zero, inner, 3);
    if (!spread.confused().empty() || !spread.solvable((1u << n) - 1)) {
        fault = "a load spread over the plate: these gauges cannot tell fx fy fz apart";
        return nullptr;
    }
    return std::make_unique<TableMap>(calibration, *map, std::move(spread), noise, contact == kPoint, spread_search);
}

}  // namespace tactiled
