// The contact that explains the readings, sought over the whole plate: with all gauges and, where that finds none, without
// one that delivers 0. Up to nine searches (point_search.hpp), in pieces.
#pragma once
#include <cstdint>

#include "decoupling/point_search.hpp"

namespace tactiled {

// Root mean square of what a contact leaves unexplained, a degree of freedom, in standard deviations; NaN with fewer than
// six gauges. rt: wait-free
double residual_of(const PointContact& contact, std::uint32_t usable, double variance) noexcept;

class ContactSearch {
public:
    static constexpr double kDoubtful = 6;   // from this residual on a gauge is wrong; as method "linear"
    static constexpr int kFewestGauges = 6;  // five unknowns and something to compare

    explicit ContactSearch(const PointSolver& solver) : search_(solver) {}  // setup; the solver stays

    // `silent`: bit k: gauge k delivers 0, and may be dead. rt: wait-free
    void begin(const Gauges& y, std::uint32_t usable, std::uint32_t silent, double variance) noexcept;
    // The next piece; true where it was the last. rt: wait-free, some 1.5 us
    bool step() noexcept;

    [[nodiscard]] bool is_running() const noexcept { return running_; }
    void stop() noexcept { running_ = false; }
    // What was found, and what it leaves of the readings of begin().
    [[nodiscard]] const PointContact& found() const noexcept { return found_; }
    [[nodiscard]] double residual() const noexcept { return residual_; }
    [[nodiscard]] double residual_with_all() const noexcept { return residual_with_all_; }
    [[nodiscard]] std::uint32_t dead() const noexcept { return dead_; }  // bit k: without gauge k
    // Another contact explains the readings as well, and its forces differ.
    [[nodiscard]] bool is_ambiguous() const noexcept { return ambiguous_; }
    [[nodiscard]] const Gauges& readings() const noexcept { return y_; }
    [[nodiscard]] std::uint32_t usable() const noexcept { return usable_; }

private:
    bool begin_without_next() noexcept;

    PointSearch search_;
    Gauges y_ = Gauges::Zero();
    std::uint32_t usable_ = 0, silent_ = 0, without_ = 0, dead_ = 0;
    double variance_ = 0, residual_ = 0, residual_with_all_ = 0;
    PointContact found_;
    bool running_ = false, ambiguous_ = false;
};

}  // namespace tactiled
