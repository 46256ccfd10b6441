// What presses on an array, from the press of each taxel along its normal: centre, area, peak, and the axis of a long
// contact, each with its standard deviation.
//
// A taxel is in contact if its press exceeds z sd with z = sqrt(2 ln(n / 0.01)): noise alone then puts one of the n taxels
// into contact in at most one frame of 100 (tail of the normal distribution, below exp(-z^2 / 2)). Centre and axis are
// moments of the press over the taxels in contact and those beside them, which carry the rest of it:
//
//     c = sum p r / P,    P = sum p,    var c = sum (r - c)^2 (sd^2 + g^2 p^2) / P^2 + sum e^2 pitch^2 / 12 / P^2
//
// with the sd and the gain's sd g of a taxel. e is the part of a press that its neighbours do not predict, and may lie
// anywhere within the taxel; for a contact smaller than a taxel it is the whole press.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "decoupling/patch/sums.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class Contact {
public:
    // setup
    Contact(const TaxelPlaces& places, const TaxelNoise& noise);
    // Fills the members of `array` that describe the contact. The forces of `out` are predicted. rt: wait-free
    void find(const TaxelForces& forces, const TaxelForces& zero, const std::vector<TaxelOut>& out,
              tactiled_array& array) noexcept;

private:
    struct Term {
        double weight, variance, unexplained;  // p, variance of p, e^2
        std::size_t taxel;
    };
    [[nodiscard]] float press(const TaxelForces& forces, const TaxelForces& zero, std::size_t i) const noexcept;
    void find_region(const std::vector<TaxelOut>& out) noexcept;
    void put_centre(tactiled_array& array) const noexcept;
    void put_axis(tactiled_array& array) const noexcept;

    const TaxelPlaces& places_;
    TaxelNoise noise_;
    float limit_N_;
    std::vector<float> press_;
    std::vector<std::uint8_t> region_;  // 0 outside, 1 beside the contact, 2 in contact
    std::vector<Term> terms_;           // of the region
    double sum_N_ = 0, boundary_ = 0;
    std::array<double, 3> centre_m_{};
};

}  // namespace tactiled
