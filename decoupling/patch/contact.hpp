// The contact on an array, from the press of each taxel along its normal: centre, area, peak, and the axis of a long
// contact, each with its standard deviation.
//
// A taxel is in contact if its press exceeds z sd with z = sqrt(2 ln(n / 0.01)): noise alone then puts one of the n taxels
// into contact in at most one frame of 100 (tail of the normal distribution, below exp(-z^2 / 2)). Centre and axis are
// stated if the press of the contact is above kPlace_sd of its sd (place.hpp), and they are
// moments of the press over the taxels in contact and those beside them, which carry the rest of it:
//
//     c = sum p r / P,    P = sum p,
//     P^2 var c = sum (r - c)^2 (sd^2 + g^2 p^2) + sum (e^2 / 12 + d^2 / 720) pitch^2
//
// with the sd and the gain's sd g of a taxel. e is the part of a press by which it exceeds that of its neighbours along the
// axis, and may lie anywhere within the taxel; for a contact smaller than a taxel it is the whole press. d is the difference
// of these neighbours: the boundary of a contact crosses the taxel at an unknown place f = 0 .. 1 and moves the moment by
// d pitch f (1 - f) / 2, whose variance is d^2 pitch^2 / 720.
//
// The axis is reported if the second moments along and across it differ by more than their noise, and by more than
// pitch^2 / 4, the difference that a contact smaller than a taxel has between two of them.
//
// The contact covers the taxels at its boundary by a part that depends on its shape, between 0 and 1 of them all:
// area = (n - b / 2) taxels, with the sd b / sqrt(12), for n taxels in contact and b of them at the boundary.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "decoupling/patch/doubts.hpp"
#include "decoupling/patch/sums.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class Contact {
public:
    // setup
    Contact(const TaxelPlaces& places, const TaxelNoise& noise, double narrowest_m);
    // Fills the members of `array` that describe the contact, and sets the state of doubted taxels in `forces`. The forces
    // of `out` are predicted. rt: wait-free
    void find(TaxelForces& forces, const TaxelForces& zero, const std::vector<TaxelOut>& out,
              tactiled_array& array) noexcept;
    // Sets that there is no contact. rt: wait-free
    void forget(tactiled_array& array) noexcept;
    // Variance of the moments of the press about x and y from its unknown places within the taxels, N^2 m^2; 0 without a
    // contact. rt: wait-free
    [[nodiscard]] std::array<double, 2> within() const noexcept;
    // The error of the wrench from the doubted taxels, all in one direction. The share of this in the press, and that of the
    // errors of the predicted taxels. 0 without a contact. rt: wait-free
    [[nodiscard]] const Wrench& doubt() const noexcept { return doubt_; }
    [[nodiscard]] double doubted_share() const noexcept { return share_of(doubted_N_); }
    [[nodiscard]] double predicted_share() const noexcept { return share_of(predicted_N_); }

private:
    struct Term {
        std::size_t taxel;
        double press, variance;        // N, N^2
        std::array<double, 3> within;  // variance of its moment within the taxel, along x, y and z, N^2 m^2
    };
    [[nodiscard]] float press(const TaxelForces& forces, const TaxelForces& zero, std::size_t i) const noexcept;
    [[nodiscard]] float variance_along(std::size_t i) const noexcept;
    void find_region() noexcept;
    void add_term(std::size_t i) noexcept;
    [[nodiscard]] float along_normal(const TaxelOut& one) const noexcept;
    void use_variances(const std::vector<TaxelOut>& out) noexcept;
    void add_doubts(TaxelForces& forces) noexcept;
    [[nodiscard]] double share_of(double error_N) const noexcept {
        return error_N > 0 ? error_N / std::max(sum_N_, error_N) : 0;
    }
    void put_centre(tactiled_array& array) const noexcept;
    void put_axis(tactiled_array& array) const noexcept;

    const TaxelPlaces& places_;
    TaxelNoise noise_;
    float z_, limit_N_;
    Doubts doubts_;
    const std::array<std::vector<float>, 3>* stated_ = nullptr;  // sd that the taxels of the last reading state
    std::vector<float> press_;
    std::vector<std::uint8_t> region_;  // a taxel is outside of the contact, in it, or beside it
    std::vector<Term> terms_;           // one for each taxel of the region
    double sum_N_ = 0;
    unsigned boundary_ = 0;  // taxels in contact beside one that is not
    std::array<double, 3> centre_m_{};
    Wrench doubt_{};
    double doubted_N_ = 0, predicted_N_ = 0;
};

}  // namespace tactiled
