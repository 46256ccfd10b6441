// Searches the whole plate for the contact that explains the gauges best, and checks for another contact that explains them
// as well. The steps are a grid, its local minima, and a descent from each; each round drops the worse ones. The search runs
// in pieces, so that it can continue beside the samples.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "decoupling/table/point_contact.hpp"

namespace tactiled {

class PointSearch {
public:
    // Two minima can be distinguished if their squared residuals differ by this many variances: 4.5 sigma. With 3
    // sigma, 4 of 10,000 first touches under 1 % of noise are GOOD and in the wrong minimum.
    static constexpr double kOther = 20;

    explicit PointSearch(const PointSolver& solver);  // setup; the solver must outlive the search

    // Starts a search for these readings. Rows outside of `usable` are ignored; at most two rows may be unusable.
    // `variance`: of a reading. rt: wait-free
    void begin(const Gauges& y, std::uint32_t usable, double variance) noexcept;
    // Does the next piece. Returns true if it was the last. rt: wait-free, about 3 us
    bool step() noexcept;
    // Does begin() and all steps. rt: wait-free, about 100 us
    void run(const Gauges& y, std::uint32_t usable, double variance) noexcept;

    [[nodiscard]] bool is_running() const noexcept { return stage_ != Stage::kDone; }
    void stop() noexcept { stage_ = Stage::kDone; }
    [[nodiscard]] const PointContact& found() const noexcept { return candidates_[0].contact; }
    // True if another contact explains the readings as well, and its forces differ by more than 2 sd.
    [[nodiscard]] bool is_ambiguous() const noexcept { return ambiguous_; }

private:
    static constexpr std::size_t kLanes = 8, kMaxCandidates = 16;
    enum class Stage { kScan, kMinima, kDownhill, kAside, kDone };
    // Orthonormal bases of the influence at eight points: [Fx Fy Fz][gauge][point]. Single precision is sufficient,
    // because it only selects the start points.
    struct Block {
        float q[3][8][kLanes];
    };
    struct Candidate {
        float squares = 0;  // at the grid's point, relative to the readings' squares
        PointContact contact;
    };
    [[nodiscard]] Eigen::Vector2d point_of(std::size_t ring, std::size_t angle) const noexcept;
    void scan(std::size_t first, std::size_t last) noexcept;
    void pick_minima(std::size_t first_ring, std::size_t last_ring) noexcept;
    void pick(std::size_t ring, std::size_t angle) noexcept;
    void downhill() noexcept;
    void aside() noexcept;
    void judge() noexcept;

    const PointSolver& solver_;
    std::size_t rings_;
    std::vector<Block> blocks_;
    std::vector<float> squares_;  // for each point: the centre, then ring by ring
    std::array<Candidate, kMaxCandidates> candidates_;
    std::size_t n_candidates_ = 0, at_ = 0, round_ = 0;
    Eigen::Vector2d aside_m_ = Eigen::Vector2d::Zero();
    Gauges y_ = Gauges::Zero();
    std::uint32_t usable_ = 0;
    double variance_ = 0;
    Stage stage_ = Stage::kDone;
    bool ambiguous_ = false;
};

}  // namespace tactiled
