// What every model does alike around its formula: is this the reading of that sensor, is every channel there that is
// needed, is it inside of what the calibration saw, is the result finite, and how sure is it.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "config/names.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/domain.hpp"

namespace tactiled {

class CheckedModel : public Decoupler {
public:
    // rt: as solve()
    Estimate decouple(const Reading& reading) noexcept final;

protected:
    // What solve() gets and gives.
    struct Input {
        // The channels less their zeros; 0 where not usable. Up to 8 of them may be read whatever the size: 0, too.
        std::span<const double> r;
        std::uint32_t usable;  // bit k: channel k is there and not at its rail
        bool outside;          // of the domain of the calibration
        std::uint64_t t_ns;    // of the frame
        // sd of each component as a multiple of the calibration's: how much worse the usable channels determine it.
        std::array<double, 6> sd_factor{1, 1, 1, 1, 1, 1};
    };

    // Bit k: the model uses channel k; it cannot do without channel k. One that is used but not needed, and is missing or
    // saturated, is not usable, and the estimate says so. One that is not used may be anything.
    CheckedModel(const Calibration& calibration, std::uint32_t used, std::uint32_t needed);

    // Sets `estimate.wrench_S` of what can be seen, NaN elsewhere; may set reasons, residual, direction. What is not a
    // number among the calibration's components, where the estimate has no reason for it, makes it BAD.
    // rt: wait-free, no allocation
    virtual void solve(Input& input, Estimate& estimate) noexcept = 0;

    [[nodiscard]] std::size_t n_channels() const noexcept { return n_; }
    [[nodiscard]] const std::array<bool, 6>& seen() const noexcept { return seen_; }
    [[nodiscard]] const Domain& domain() const noexcept { return domain_; }

private:
    bool subtract_zeros(const double* channel, double* r) const noexcept;
    bool look_at_each(const Reading& reading, double* r, Input& input, Estimate& estimate) const noexcept;
    bool is_finite(const Wrench& wrench) const noexcept;
    void finish(const Input& input, Estimate& estimate) const noexcept;

    std::size_t n_;
    std::uint32_t used_, needed_, all_;
    std::array<bool, 6> seen_{};
    bool sd_known_;
    std::uint32_t uncalibrated_;  // TACTILED_UNCALIBRATED where the calibration is nominal, else 0
    Domain domain_;
    // Plain arrays, read in pairs. A channel within plain_ is in the domain, and less its zero it is finite: all in
    // one comparison. The same of a component within plain_most_.
    double zero_[kMostChannels]{}, plain_channel_least_[kMostChannels]{}, plain_channel_most_[kMostChannels]{};
    double plain_most_[6]{}, full_scale_[6]{}, sd_[6], sd_slope_[6]{};
    std::int64_t seen_mask_[6]{};  // -1 where seen, else 0
    double unseen_nan_[6];         // NaN where not seen, else 0
};

// What is wrong with the parts that a CheckedModel uses, "" where nothing is. setup
std::string fault_of_checked(const Calibration& calibration);

}  // namespace tactiled
