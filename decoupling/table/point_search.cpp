#include "decoupling/table/point_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tactiled {
namespace {

constexpr std::size_t kAngles = 96;  // twice the number of the map, as for the rings: beside a column minima are 60 um apart
constexpr std::size_t kBlocksAStep = 128, kRingsAStep = 10;
// Number of points that continue in each round, and their evaluations of the map.
struct Round {
    std::size_t candidates;
    int steps;
};
constexpr Round kRounds[] = {{16, 5}, {8, 5}, {6, 5}, {4, 5}, {3, 5}, {3, 5}, {16, 5}, {16, 5}, {8, 5}};
// After these rounds the search ends if the best point explains the readings as well as the right point does in 19 of
// 20 cases.
constexpr std::size_t kUsualRounds = 6;
constexpr double kExplained = 8;  // variances
// Minima in one valley are this far apart along it: checked last, from the best one.
constexpr double kAside_m = 6e-5;
constexpr int kAsideSteps = 6;
constexpr double kApart_m = 1e-5, kApart_sd = 2;

}  // namespace

PointSearch::PointSearch(const PointSolver& solver)
    : solver_(solver), rings_(2 * std::size_t(std::lround(solver.map().radius_m() / solver.map().spacing_m()))) {
    const std::size_t n = 1 + rings_ * kAngles;
    blocks_.resize((n + kLanes - 1) / kLanes, Block{});
    squares_.assign(blocks_.size() * kLanes, std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < n; ++i) {
        const auto q = solver_.basis(i == 0 ? point_of(0, 0) : point_of(1 + (i - 1) / kAngles, (i - 1) % kAngles));
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < 8; ++k)
                blocks_[i / kLanes].q[c][k][i % kLanes] = float(q(Eigen::Index(k), Eigen::Index(c)));
    }
}

Eigen::Vector2d PointSearch::point_of(std::size_t ring, std::size_t angle) const noexcept {
    const double r = solver_.map().radius_m() * double(ring) / double(rings_),
                 turn = 2 * std::numbers::pi * double(angle) / double(kAngles);
    return {r * std::cos(turn), r * std::sin(turn)};
}

void PointSearch::begin(const Gauges& y, std::uint32_t usable, double variance) noexcept {
    y_ = y;
    for (int k = 0; k < 8; ++k)
        if ((usable >> k & 1u) == 0) y_[k] = 0;
    usable_ = usable;
    variance_ = variance;
    n_candidates_ = at_ = round_ = 0;
    stage_ = Stage::kScan;
}

bool PointSearch::step() noexcept {
    if (stage_ == Stage::kScan) {
        scan(at_, std::min(at_ + kBlocksAStep, blocks_.size()));
        at_ += kBlocksAStep;
        if (at_ >= blocks_.size()) stage_ = Stage::kMinima, at_ = 0;
    } else if (stage_ == Stage::kMinima) {
        pick_minima(at_, std::min(at_ + kRingsAStep, rings_ + 1));
        at_ += kRingsAStep;
        if (at_ > rings_) stage_ = Stage::kDownhill, at_ = 0;
    } else if (stage_ == Stage::kDownhill) {
        downhill();
    } else if (stage_ == Stage::kAside) {
        aside();
    }
    return stage_ == Stage::kDone;
}

void PointSearch::run(const Gauges& y, std::uint32_t usable, double variance) noexcept {
    begin(y, usable, variance);
    while (!step()) {}
}

// Computes the residual of the best force at each point. A gauge that is not usable may have any reading: with P = I
// - q q' and rho = P y, leaving out the gauges m lowers the squares by rho_m' P_mm^-1 rho_m.
void PointSearch::scan(std::size_t first, std::size_t last) noexcept {
    const double norm = y_.norm();
    float y[8];
    std::size_t out[2] = {0, 0}, n_out = 0;
    for (std::size_t k = 0; k < 8; ++k) {
        y[k] = norm > 0 ? float(y_[Eigen::Index(k)] / norm) : 0;
        if ((usable_ >> k & 1u) == 0 && n_out < 2) out[n_out++] = k;
    }
    for (std::size_t b = first; b < last; ++b) {
        const Block& block = blocks_[b];
        float part[3][kLanes] = {};
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < 8; ++k)
                for (std::size_t l = 0; l < kLanes; ++l) part[c][l] += block.q[c][k][l] * y[k];
        float* const squares = squares_.data() + b * kLanes;
        for (std::size_t l = 0; l < kLanes; ++l)
            squares[l] = 1 - part[0][l] * part[0][l] - part[1][l] * part[1][l] - part[2][l] * part[2][l];
        if (n_out == 0) continue;
        const auto &i = out[0], &j = out[1];
        for (std::size_t l = 0; l < kLanes; ++l) {
            float ri = 0, rj = 0, ii = 1, jj = 1, ij = 0;  // rho, P
            for (std::size_t c = 0; c < 3; ++c) {
                ri -= block.q[c][i][l] * part[c][l];
                rj -= block.q[c][j][l] * part[c][l];
                ii -= block.q[c][i][l] * block.q[c][i][l];
                jj -= block.q[c][j][l] * block.q[c][j][l];
                ij -= block.q[c][i][l] * block.q[c][j][l];
            }
            if (n_out == 1) rj = ij = 0, jj = 1;
            squares[l] -= (jj * ri * ri - 2 * ij * ri * rj + ii * rj * rj) / std::max(ii * jj - ij * ij, 1e-4f);
        }
    }
}

// Selects the points of the grid that are no worse than their neighbours.
void PointSearch::pick_minima(std::size_t first_ring, std::size_t last_ring) noexcept {
    const float* const all = squares_.data();
    if (first_ring == 0 && all[0] <= *std::min_element(all + 1, all + 1 + kAngles)) pick(0, 0);
    for (std::size_t ring = std::max<std::size_t>(1, first_ring); ring < last_ring; ++ring) {
        const float* const here = all + 1 + (ring - 1) * kAngles;
        const float* const in = ring > 1 ? here - kAngles : nullptr;
        const float* const out = ring < rings_ ? here + kAngles : nullptr;
        for (std::size_t a = 0; a < kAngles; ++a) {
            const std::size_t left = a == 0 ? kAngles - 1 : a - 1, right = a + 1 == kAngles ? 0 : a + 1;
            const float one = here[a];
            if (!(one <= here[left] && one <= here[right])) continue;
            if (in != nullptr ? !(one <= in[a] && one <= in[left] && one <= in[right]) : !(one <= all[0])) continue;
            if (out != nullptr && !(one <= out[a] && one <= out[left] && one <= out[right])) continue;
            pick(ring, a);
        }
    }
}

void PointSearch::pick(std::size_t ring, std::size_t angle) noexcept {
    const float squares = squares_[ring == 0 ? 0 : 1 + (ring - 1) * kAngles + angle];
    std::size_t place = n_candidates_;
    while (place > 0 && squares < candidates_[place - 1].squares) --place;
    if (place == kMaxCandidates) return;
    n_candidates_ = std::min(n_candidates_ + 1, kMaxCandidates);
    for (std::size_t i = n_candidates_ - 1; i > place; --i) candidates_[i] = candidates_[i - 1];
    candidates_[place] = {squares, {}};
    candidates_[place].contact.point_m = point_of(ring, angle);
    candidates_[place].contact.squares = std::numeric_limits<double>::infinity();
}

// Refines one candidate of this round. After the last candidate, the better ones enter the next round.
void PointSearch::downhill() noexcept {
    if (n_candidates_ == 0) {  // readings that are not finite
        candidates_[0] = {};
        candidates_[0].contact.squares = std::numeric_limits<double>::infinity();
        ambiguous_ = true;
        stage_ = Stage::kDone;
        return;
    }
    const Round& round = kRounds[round_];
    const std::size_t n = std::min(n_candidates_, round.candidates);
    while (at_ < n && candidates_[at_].contact.converged) ++at_;
    if (at_ < n) {
        PointContact& contact = candidates_[at_].contact;
        const PointContact further = solver_.refine(y_, usable_, contact, round.steps);
        if (further.squares <= contact.squares) contact = further;
        ++at_;
    }
    if (at_ < n) return;
    std::sort(candidates_.begin(), candidates_.begin() + std::ptrdiff_t(n),
              [](const Candidate& a, const Candidate& b) { return a.contact.squares < b.contact.squares; });
    at_ = 0;
    ++round_;
    const bool explained = candidates_[0].contact.squares < kExplained * variance_;
    if (round_ == std::size(kRounds) || (round_ == kUsualRounds && explained)) stage_ = Stage::kAside;
}

// Evaluates the neighbours of the best point along the direction that the gauges determine worst, two on each side.
void PointSearch::aside() noexcept {
    PointContact& best = candidates_[0].contact;
    if (at_ == 0) {
        solver_.sds(y_, usable_, variance_, best);
        aside_m_ = kAside_m * best.worst;
        n_candidates_ = std::min(n_candidates_, kMaxCandidates - 4);  // the worst candidates are replaced
    }
    constexpr double kTimes[] = {1, -1, 2, -2};
    candidates_[n_candidates_++].contact =
        solver_.refine(y_, usable_, contact_at(best.point_m + kTimes[at_] * aside_m_), kAsideSteps);
    if (++at_ == std::size(kTimes)) judge();
}

void PointSearch::judge() noexcept {
    for (std::size_t i = 1; i < n_candidates_; ++i)
        if (candidates_[i].contact.squares < candidates_[0].contact.squares) std::swap(candidates_[0], candidates_[i]);
    PointContact& best = candidates_[0].contact;
    solver_.sds(y_, usable_, variance_, best);
    ambiguous_ = false;
    const auto moments = [](const PointContact& contact) {
        const auto& f = contact.force_N;
        return std::array<double, 5>{f.x(), f.y(), f.z(), contact.point_m.y() * f.z(), -contact.point_m.x() * f.z()};
    };
    const auto w = moments(best);
    for (std::size_t i = 1; i < n_candidates_; ++i) {
        const PointContact& other = candidates_[i].contact;
        if (!(other.squares - best.squares < kOther * variance_) || (other.point_m - best.point_m).norm() <= kApart_m)
            continue;
        const auto v = moments(other);
        for (std::size_t c = 0; c < 5; ++c) ambiguous_ = ambiguous_ || !(std::abs(v[c] - w[c]) <= kApart_sd * best.sd[c]);
    }
    stage_ = Stage::kDone;
}

}  // namespace tactiled
