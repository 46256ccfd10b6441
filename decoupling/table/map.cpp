// Model "table", method "map": place and force of one point of contact on the plate, from finite-element strains of
// the eight gauges per 1 N at every point of the plate. Eight readings, five unknowns (point_contact.hpp). The plate
// is in z = 0 of frame S, so the moments are those of the force at the point: mx = y fz, my = -x fz; the centre of
// pressure is (-my / fz, mx / fz).
//
// A point is reported if the force is more than `locate` times its standard deviation from noise (after Dargahi and
// Najarian 2004: the variance of the position is proportional to 1 / F^2). Otherwise, and if no point on the plate
// explains the readings, the forces are those of a load spread evenly over the plate.
#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <optional>

#include "decoupling/place.hpp"
#include "decoupling/solve/checked.hpp"
#include "decoupling/solve/consistency.hpp"
#include "decoupling/table/gauge_solver.hpp"
#include "decoupling/table/methods.hpp"
#include "decoupling/table/point_search.hpp"
#include "decoupling/table/sign_table.hpp"

namespace tactiled {
namespace {

constexpr double kRest = 3;  // no contact: the readings are within 3 sigma of noise, root mean square
constexpr double kPoor = 3;  // a point with a larger residual is rejected
constexpr double kDefaultLocate = kPlace_sd;
// Limit of shear over press; skin and rubber on a smooth surface reach 1 to 1.5. A wrong minimum beside a column has
// a small press or a pull and exceeds this limit.
constexpr double kDefaultFriction = 1.5;
// A search with a larger residual may have missed the right minimum, whose residual is larger in one of 150 cases.
constexpr double kSurely = 2;
constexpr int kFewestGauges = 6;  // five unknowns and one redundant reading
constexpr int kWarmSteps = 6;
// A point that moves farther than this between two samples has jumped: the minimum beside the last one may be wrong, and
// explain the readings well enough with a pull instead of a press. A finger that slides at 100 mm/s moves as far in 1 ms.
constexpr double kJump_m = 1e-4;
constexpr unsigned kSearchEvery = 256;  // samples: a tracked minimum may no longer be the best
constexpr double kSame = 0.1;           // relative change of readings that a search failed to explain
constexpr unsigned kPoorEvery = 16;     // samples between searches while they change less
constexpr double kCommon = 0.1;         // scatter relative to the mean of readings with one common strain
constexpr unsigned kDeadEvery = 16;     // samples with disagreement between searches for a dead gauge

class TableMap final : public CheckedModel {
public:
    TableMap(const CalibrationData& data, InfluenceMap map, GaugeSolver spread, double noise, bool point)
        : CheckedModel(data.calibration(), (1u << data.calibration().channels.size()) - 1, 0),
          zero_(data.calibration().zero),
          noise_(noise),
          locate_(data["locate"]),
          friction_(data["friction"]),
          solver_(std::move(map)),
          search_(solver_),
          spread_(std::move(spread)),
          point_(point) {
        inner_ = inner_gauges(data.calibration());
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
            if (!(std::abs(input.r[k] + zero_[k]) <= 3 * noise_)) usable = input.usable;  // the gauge has recovered
        }
        if (usable == input.usable) dead_ = 0;
        if (!point_ || rests || std::popcount(usable) < kFewestGauges) {
            if (!rests || !point_) lose_point();
            return spread_evenly(input, estimate, !point_ || rests);
        }

        // A strain that all gauges share is caused by temperature or the frame: a contact does not make inner and outer
        // gauges equal.
        if (is_common(y, usable)) {
            lose_point();
            estimate.reasons |= TACTILED_DISAGREEMENT;
            return spread_evenly(input, estimate, false);
        }
        PointContact contact = locate(y, usable, variance);
        estimate.residual = residual(contact, usable, variance);
        if (estimate.residual > kDoubtful && disagreements_++ % kDeadEvery == 0)
            drop_dead_gauge(input, y, variance, usable, contact);
        if (dead_ != 0) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
        const double unexplained = residual(contact, usable, variance);
        if (unexplained <= kDoubtful) disagreements_ = 0;
        solver_.sds(y, usable, variance, contact);
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
        // A wrong minimum has a large residual: the right one exceeds 3 sigma once in 100,000 samples.
        if (ambiguous_ || unexplained > kPoor) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        estimate.wrench_S = {f.x(), f.y(), f.z(), contact.point_m.y() * f.z(), -contact.point_m.x() * f.z(), kNaN};
        estimate.cop_S_m = {contact.point_m.x(), contact.point_m.y()};
        for (std::size_t c = 0; c < 5; ++c) add_sd(input, estimate, c, contact.sd[c]);
        // The calibration states the errors of the moments, of which the point's are a part.
        for (std::size_t i = 0; i < 2; ++i)
            estimate.cop_sd_m[i] =
                std::hypot(contact.point_sd_m[i], seen()[4 - i] ? stated_sd(4 - i, estimate.wrench_S) / f.z() : 0);
    }

    void forget() noexcept override { lose_point(); }
    void lose_point() noexcept {
        has_point_ = ambiguous_ = false;
        since_search_ = disagreements_ = 0;
        poor_ = false;
        search_.stop();
        dead_ = 0;
    }

    // Continues from the last point if a nearby point still explains the readings; otherwise searches the plate.
    PointContact locate(const Gauges& y, std::uint32_t usable, double variance) noexcept {
        PointContact near = unexplained_;
        near.squares *= y.squaredNorm() / poor_y_.squaredNorm();
        bool jumped = false;
        if (has_point_) {
            near = solver_.refine(y, usable, contact_at(point_m_), kWarmSteps);
            const bool explains = residual(near, usable, variance) <= kPoor;
            jumped = explains && (near.point_m - point_m_).norm() > kJump_m;
            if (explains && !jumped && near.converged) return look_elsewhere(y, usable, variance, near);
        }
        // With two fingers no point explains these readings, nor nearly equal readings.
        if (poor_ && !jumped && usable == poor_usable_ && (y - poor_y_).norm() <= kSame * y.norm() &&
            ++since_search_ < kPoorEvery)
            return near;
        since_search_ = 0;
        search_.run(y, usable, variance);
        const PointContact& found = search_.found();
        ambiguous_ = search_.is_ambiguous() || residual(found, usable, variance) > kSurely;
        poor_ = !(residual(found, usable, variance) <= kPoor);
        if (poor_) unexplained_ = found, poor_y_ = y, poor_usable_ = usable;
        return found;
    }

    // A tracked minimum may no longer be the best one: a search of the whole plate runs beside the samples, one piece
    // per sample.
    PointContact look_elsewhere(const Gauges& y, std::uint32_t usable, double variance, const PointContact& near) noexcept {
        poor_ = false;
        if (!search_.is_running()) {
            if (++since_search_ < kSearchEvery) return near;
            since_search_ = 0;
            search_.begin(y, usable, variance);
        }
        if (!search_.step()) return near;
        if ((search_.found().point_m - near.point_m).norm() <= kJump_m) {
            ambiguous_ = search_.is_ambiguous();
            return near;
        }
        const PointContact other = solver_.refine(y, usable, contact_at(search_.found().point_m), kWarmSteps);
        ambiguous_ = std::abs(other.squares - near.squares) < PointSearch::kOther * variance;
        return other.squares < near.squares ? other : near;
    }

    // Returns true if the readings differ from their mean by less than a tenth of it, inner and outer gauges alike.
    [[nodiscard]] bool is_common(const Gauges& y, std::uint32_t usable) const noexcept {
        if ((usable & inner_) == 0 || (usable & ~inner_) == 0) return false;
        double sum = 0, squares = 0;
        for (std::size_t k = 0; k < n_channels(); ++k) {
            if ((usable >> k & 1u) == 0) continue;
            sum += y[Eigen::Index(k)];
            squares += y[Eigen::Index(k)] * y[Eigen::Index(k)];
        }
        const double n = std::popcount(usable), mean = sum / n;
        return squares / n - mean * mean < kCommon * kCommon * mean * mean;
    }

    [[nodiscard]] static double residual(const PointContact& contact, std::uint32_t usable, double variance) noexcept {
        const int freedom = std::popcount(usable) - 5;
        return freedom > 0 ? std::sqrt(std::max(0.0, contact.squares) / freedom / variance) : kNaN;
    }

    // Omits one gauge that delivers 0 if the others agree on a point without this gauge.
    void drop_dead_gauge(const Input& input, const Gauges& y, double variance, std::uint32_t& usable,
                         PointContact& contact) noexcept {
        std::uint32_t found = 0;
        PointContact best;
        double best_residual = kDoubtful;
        for (std::size_t k = 0; k < n_channels(); ++k) {
            const std::uint32_t rest = usable & ~(1u << k);
            if (rest == usable || !(std::abs(input.r[k] + zero_[k]) <= 3 * noise_) || std::popcount(rest) < kFewestGauges)
                continue;
            search_.run(y, rest, variance);
            const PointContact one = search_.found();
            const double unexplained = residual(one, rest, variance);
            if (!(unexplained < best_residual)) continue;
            best_residual = unexplained;
            best = one;
            found = 1u << k;
            ambiguous_ = search_.is_ambiguous();
        }
        if (found == 0) return;
        dead_ = found;
        usable &= ~found;
        contact = best;
    }

    // Computes the forces of a load that is spread over the plate; moments are 0, because its centre is the plate's.
    // `true_here`: there is such a contact, or none.
    void spread_evenly(Input& input, Estimate& estimate, bool true_here) noexcept {
        double r[kMaxGauges];
        for (std::size_t k = 0; k < kMaxGauges; ++k) r[k] = (dead_ >> k & 1u) != 0 ? 0 : input.r.data()[k];
        const auto solved = spread_.solve(r, input.usable & ~dead_);
        if (solved.used == 0) return;  // BAD
        if (true_here && !point_) {
            estimate.residual = solved.residual;
            if (solved.dead) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
            if (solved.doubtful) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        }
        if (!true_here) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;  // the error depends on the place of the contact
        for (std::size_t c = 0; c < 3; ++c) estimate.wrench_S[c] = solved.load[c] + 0.0;
        for (std::size_t c = 0; c < 3; ++c) {
            if (point_) {
                add_sd(input, estimate, c, spread_.sd(c) * solved.sd_factor[c]);
            } else {
                input.sd_factor[c] = solved.sd_factor[c];
            }
        }
        estimate.wrench_S[3] = estimate.wrench_S[4] = 0;
    }

    // Adds the standard deviation of the place to that of the calibration.
    void add_sd(Input& input, Estimate& estimate, std::size_t c, double local) noexcept {
        if (!seen()[c]) return;
        const double sd = stated_sd(c, estimate.wrench_S);
        if (sd > 0 && std::isfinite(local)) {
            input.sd_factor[c] = std::hypot(1.0, local / sd);
        } else {
            estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        }
    }

    std::vector<double> zero_;
    double noise_, locate_, friction_;
    PointSolver solver_;
    PointSearch search_;
    GaugeSolver spread_;
    bool point_;
    std::uint32_t inner_ = 0;  // gauges

    bool has_point_ = false, ambiguous_ = false;
    Eigen::Vector2d point_m_ = Eigen::Vector2d::Zero();
    unsigned since_search_ = 0, disagreements_ = 0;
    // The last search found no point that explains the readings; these are its result and the readings.
    bool poor_ = false;
    PointContact unexplained_;
    Gauges poor_y_ = Gauges::Ones();
    std::uint32_t poor_usable_ = 0;
    std::uint32_t dead_ = 0;
};

// Values of the parameter `contact`.
constexpr double kUniform = 0, kPoint = 1, kRigid = 2;

constexpr std::array<Parameter, 5> kParameters{
    {{"gauge_factor", "channel_unit per strain; about 2 for Ni-Cr and dR/R0", kAboveZero, kLargest},
     kGaugeNoise,
     {"contact", "0 (uniform), 1 (point) or 2 (rigid)", kUniform, kRigid, kPoint},
     {"locate", "force over its standard deviation, from which on a point is reported", 0, kLargest, kDefaultLocate},
     {"friction", "greatest shear over press", 0, kLargest, kDefaultFriction}}};
// rigid: one row per channel, channel_unit per N of fx fy fz.
constexpr std::array<KnownTable, 3> kTables{
    {{"influence", kAnyNumber, 26}, {"gauge_scale", 1, kPerChannel, false}, {"rigid", kPerChannel, 3, false}}};

std::string fault_of_contact(const CalibrationData& data) {
    const double contact = data["contact"];
    const std::size_t n = data.calibration().channels.size();
    if (contact != kUniform && contact != kPoint && contact != kRigid)
        return fmt::format("parameter contact = {}; it is 0 (uniform), 1 (point) or 2 (rigid)", contact);
    if (contact == kPoint && n < std::size_t(kFewestGauges))
        return fmt::format("{} gauges; a point contact has five unknowns and needs {} or more", n, kFewestGauges);
    for (const auto& name : data.calibration().components)
        if (contact != kPoint && name[0] == 'm')
            return fmt::format("component \"{}\"; a contact that is not a point has fx fy fz", name);
    if (contact == kRigid && data.table("rigid") == nullptr) return "table rigid is missing";
    return "";
}

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    const Calibration& calibration = data.calibration();
    fault = fault_of_gauges(calibration, kForcesAndMoments);
    if (!fault.empty()) return nullptr;
    const auto map = influence_of(calibration, fault);
    if (!map) return nullptr;
    fault = fault_of_contact(data);
    if (!fault.empty()) return nullptr;
    const std::size_t n = calibration.channels.size();
    const Influence mean = map->mean();
    NumberRows columns;
    for (Eigen::Index k = 0; k < Eigen::Index(n); ++k) columns.push_back({mean(k, 0), mean(k, 1), mean(k, 2)});
    if (data["contact"] == kRigid) columns = *data.table("rigid");
    const double noise = data.has("noise") ? data["noise"] : kDefaultNoise_per_reading * mean.cwiseAbs().maxCoeff();
    if (!(noise > 0)) {
        fault = "parameter noise (one standard deviation of a gauge, channel_unit) is not above 0";
        return nullptr;
    }
    GaugeSolver spread(columns, std::vector<double>(n, noise), calibration.zero, inner_gauges(calibration), 3);
    if (!spread.confused().empty() || !spread.solvable((1u << n) - 1)) {
        fault = "a load spread over the plate: these gauges do not determine fx fy fz";
        return nullptr;
    }
    return std::make_unique<TableMap>(data, *map, std::move(spread), noise, data["contact"] == kPoint);
}

const MethodEntry entry{
    .model = "table", .method = "map", .place = 40, .parameters = kParameters, .tables = kTables, .make = make};

}  // namespace

std::optional<InfluenceMap> influence_of(const Calibration& calibration, std::string& fault) {
    const CalibrationData data(calibration, kParameters, kTables);
    const std::size_t n = calibration.channels.size();
    const auto* rows = data.table("influence", kAnyNumber, 26, fault);
    if (rows == nullptr) return std::nullopt;
    fault = InfluenceMap::fault_of(*rows);
    if (fault.empty() && !(data["gauge_factor"] > 0))
        fault = "parameter gauge_factor (channel_unit per strain; about 2 for Ni-Cr and dR/R0) is missing or 0";
    if (!fault.empty()) return std::nullopt;
    std::vector<double> scale(n, 1.0);
    if (data.table("gauge_scale") != nullptr) {
        const auto* row = data.table("gauge_scale", 1, n, fault);
        if (row == nullptr) return std::nullopt;
        scale = row->front();
    }
    std::array<int, 8> gauge;
    gauge.fill(-1);
    std::array<double, 8> gain{};
    for (std::size_t k = 0; k < n; ++k) {
        gauge[k] = table_gauge(calibration.channels[k])->number - 1;
        gain[k] = data["gauge_factor"] * scale[k];
    }
    return InfluenceMap(*rows, gauge, gain);
}

}  // namespace tactiled
