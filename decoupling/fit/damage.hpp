// Damaged channels: readings of rows in which one channel is wrong, and the share of them that no check of a sample finds.
#pragma once
#include <random>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Makes the readings of rows, of which one channel is damaged: the kinds of kDamageKinds. Calls in the same order give the
// same readings.
class DamagedRows {
public:
    // `rows`, in the order of the file, must outlive this object. `calibration`: ranges and zeros of the channels.
    DamagedRows(const Rows& rows, const Calibration& calibration) : rows_(rows), calibration_(calibration) {}

    // Returns the channels of row i with channel k damaged:
    //   stuck      the channel's value in an earlier row, drawn for each row
    //   half_gain  zero + (value - zero) / 2
    //   drifting   value + 30 % of the channel's range x (i + 1) / number of rows
    //   exchanged  the channel has the value of another one, drawn for each row, and that one has the channel's
    //   zero       the reading without a load
    [[nodiscard]] std::vector<double> reading(std::size_t kind, std::size_t i, std::size_t k);

private:
    const Rows& rows_;
    const Calibration& calibration_;
    std::mt19937 random_{1};
};

// Returns for each kind and channel the share of undetected damage of the calibration's own method (config/calibration.hpp).
// At most 500 of the `rows`, evenly over them and in their order, are damaged and estimated by the decoupler of the loop
// with its verdict; the loop's checks over time (frozen, stepped) find more. Unknown if no row is GOOD without damage. The
// rows may be those of the fit, because their labels are not used: shares of parts that were fitted without their rows were
// no nearer to those of later rows (tests/bench/damaged_channels.py). setup
UndetectedDamage undetected_damage(const Calibration& calibration, const Rows& rows);

// Sets `undetected_damage` of each fit of the calibration, which is finished. setup
void set_undetected_damage(const Rows& rows, Calibration& calibration);

}  // namespace tactiled
