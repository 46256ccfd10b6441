// An array of taxels in operation: the load of each taxel, and a line of effects for each.
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "drivers/sim/choose.hpp"
#include "drivers/sim/pressure.hpp"

namespace tactiled::sim {

class TaxelArray {
public:
    // `block_size`: samples of a block, at most Block::kSize. Scene and extent must outlive it. setup
    TaxelArray(const Scene& scene, const Sensor& array, const Extent& extent, const Choice& choice, std::size_t block_size);

    // Computes the taxels from the load of the body. Sets the load of the block to its part on the array; where some of the
    // contact is beside the array, centre and moments become NaN. rt: wait-free, linear in the number of taxels
    void apply(Block& block) noexcept;

    // Value v of taxel i in sample n of the last block is at v * taxels + i. NaN = missing. rt: wait-free
    [[nodiscard]] std::span<const float> values(std::size_t n) const noexcept { return {values_.data() + n * size_, size_}; }
    // Area of the body's contact in sample n, and the direction of a long one; NaN for a round one. rt: wait-free
    [[nodiscard]] double area_m2(std::size_t n) const noexcept { return area_m2_[n]; }
    [[nodiscard]] double axis_rad() const { return pressure_.axis_rad(); }

private:
    void spread(const Block& block, std::size_t n) noexcept;
    void run(std::size_t taxel, const Block& block) noexcept;

    std::vector<Sensor> taxels_;  // effects may keep references
    Pressure pressure_;
    std::size_t size_, per_taxel_, of_material_ = 0;
    // Each taxel has per_taxel_ effects, of which the first of_material_ belong to the material.
    std::vector<std::unique_ptr<Effect>> effects_;
    std::vector<double> part_, parts_;  // parts of the last sample; parts of all samples of the block
    std::vector<float> values_;
    std::vector<double> area_m2_, on_array_;  // for each sample; on_array_: part of the force on the array, 1 = whole
    std::unique_ptr<Block> one_;              // a block of one taxel
    bool is_known_ = false;                   // part_ is that of the press and the place in last_
    std::array<double, 3> last_{};
    Pressure::Contact contact_{};
};

}  // namespace tactiled::sim
