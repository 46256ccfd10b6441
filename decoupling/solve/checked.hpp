// The checks of every model around its formula: number of channels, missing and saturated channels, domain and full
// scale of the calibration, finite result, and standard deviation.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "config/names.hpp"
#include "decoupling/correlations.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/solve/load_scale.hpp"

namespace tactiled {

class CheckedModel : public Decoupler {
public:
    // Every reading takes the same path through the checks, with or without faults.
    // rt: as solve(); the checks are wait-free, make one pass over the channels and one over the components
    Estimate decouple(const Reading& reading) noexcept final;
    [[nodiscard]] std::uint32_t timed_by(std::size_t /*c*/) const noexcept override { return used_; }

protected:
    // Arguments of solve(), and the results that are not in the Estimate.
    struct Input {
        // The channels minus their zeros; 0 if not usable. The first 8 may be read for any size: they are 0 from
        // size() on.
        std::span<const double> r;
        std::uint32_t usable;  // bit k: channel k is present and not saturated
        bool outside;          // outside the domain of the calibration
        std::uint64_t t_ns;    // time of the frame
        // Factor of the calibration's sd for each component: the loss of accuracy with the usable channels.
        std::array<double, 6> sd_factor{1, 1, 1, 1, 1, 1};
    };

    // `used`, bit k: the model uses channel k. `needed`, bit k: the model requires channel k. A channel that is used but not
    // needed, and is missing or saturated, is not usable, and the estimate reports it. A channel that is not used may have
    // any value.
    CheckedModel(const Calibration& calibration, std::uint32_t used, std::uint32_t needed);

    // Sets `estimate.wrench_S` of the measured components; may set reasons, residual, direction. A component of the
    // calibration that is not finite makes the estimate BAD, with NOT_FINITE if it has no other reason.
    // rt: wait-free, no allocation
    virtual void solve(Input& input, Estimate& estimate) noexcept = 0;

    [[nodiscard]] std::size_t n_channels() const noexcept { return n_; }
    [[nodiscard]] const std::array<bool, 6>& seen() const noexcept { return seen_; }
    [[nodiscard]] const Domain& domain() const noexcept { return domain_; }
    // Returns the sd of component c that the calibration states for this wrench, whose components are finite. rt: wait-free
    [[nodiscard]] double stated_sd(std::size_t c, const Wrench& wrench) const noexcept;
    // Returns true if one of the channels `mask` is outside of the domain. rt: wait-free
    [[nodiscard]] bool is_outside(std::span<const double> r, std::uint32_t mask) const noexcept;

private:
    // Sets usable and outside of `input` and the reasons. Returns false if a needed channel is missing. rt: wait-free
    bool check_channels(const Reading& reading, double* r, Input& input, Estimate& estimate) const noexcept;
    void put_parts(const Input& input, Estimate& estimate) const noexcept;
    // Sets quality and sd and adds reasons; BAD if a component is not finite. rt: wait-free
    void check_components(const Input& input, Estimate& estimate) const noexcept;

    std::size_t n_;
    std::uint32_t all_, used_, needed_;  // bit k: channel k
    // Reasons of every sample: TACTILED_UNCALIBRATED for a nominal calibration, TACTILED_UNKNOWN_UNCERTAINTY for one
    // without sd.
    std::uint32_t always_;
    // Plain arrays: the index of a std::array is checked here, and a loop that may end early is not vectorised.
    double zero_[kMaxChannels]{};
    double full_scale_[6], sd_[6]{}, sd_slope_[6]{}, sd_load_[6]{}, noise_[6]{}, reference_[6]{};
    double reference_gain_ = 0;
    bool has_reference_ = false;
    LoadScale load_;
    bool depends_on_load_ = false;
    // A component up to this magnitude is finite and within the full scale, and the squares of sd, sd_slope x
    // component and sd_load x load neither underflow nor overflow: the square root of their sum is then as good as
    // hypot(), which takes several times as long.
    double max_squared_[6]{};
    Correlations correlations_;
    std::array<bool, 6> seen_{};
    std::size_t n_seen_, order_[6];  // the measured components, n_seen_ of them, then the others
    Domain domain_;
};

// Returns the fault of the parts that a CheckedModel uses, "" if there is none. setup
std::string fault_of_checked(const Calibration& calibration);

}  // namespace tactiled
