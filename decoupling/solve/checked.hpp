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
#include "decoupling/solve/domain.hpp"
#include "decoupling/solve/pairs.hpp"

namespace tactiled {

class CheckedModel : public Decoupler {
public:
    // rt: as solve()
    Estimate decouple(const Reading& reading) noexcept override;

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

    // decouple() around `solve`, all in one function: a model of some 100 instructions overrides decouple() with this and
    // its own solve(). In checked_loop.hpp. rt: as `solve`
    template <typename Solve>
    Estimate checked(const Reading& reading, Solve solve) noexcept;

    // The two ends of checked(), for a model that is short of time: in between it solves what is plain, and where something
    // is not, it begins anew with checked(). Channels: there, not at their rails and in the domain; `kChannels` of them, 0 =
    // any number; `r` as in Input, set in any case. The caller has compared the number of channels. rt: wait-free
    template <std::size_t kChannels>
    bool is_plain(const Reading& reading, double* r) const noexcept;
    // The estimate of `wrench`, fx fy and fz mx and where there are more my mz; `sd_factor` as in Input. Does not forget()
    // where it is BAD: for models without a memory. rt: wait-free
    template <std::size_t kPairs>
    Estimate finished(const Pair (&wrench)[kPairs], const double* sd_factor, double residual) const noexcept;

    [[nodiscard]] std::size_t n_channels() const noexcept { return n_; }
    [[nodiscard]] const std::array<bool, 6>& seen() const noexcept { return seen_; }
    [[nodiscard]] const Domain& domain() const noexcept { return domain_; }
    // One of the channels `mask` is outside of the domain. rt: wait-free
    [[nodiscard]] bool is_outside(std::span<const double> r, std::uint32_t mask) const noexcept;

private:
    struct Looked {
        bool bad;
        bool outside;  // and what follows: as in Input and Estimate
        std::uint32_t usable, reasons;
    };
    Looked look_at_each(const Reading& reading, double* r) const noexcept;
    template <std::size_t kPairs>
    void finish(bool outside, const double* sd_factor, Estimate& estimate) const noexcept;
    void finish_hard(bool outside, const double* sd_factor, Estimate& estimate) const noexcept;

    std::size_t n_;
    std::uint32_t used_, all_;
    // Of every sample: TACTILED_UNCALIBRATED of a nominal calibration, TACTILED_UNKNOWN_UNCERTAINTY of one without sd.
    std::uint32_t always_;
    std::uint32_t needed_;
    bool has_third_;  // pair of components_
    // A channel within its bounds is in the domain, and less its zero it is finite: all in one comparison.
    struct ChannelPair {
        Pair zero{}, min{}, max{};
    } channels_[kMaxChannels / 2];
    // The same of a component within `most`, whose sd the sum of two squares gives.
    struct {
        PairMask seen{};              // -1 where seen, else 0
        Pair unseen_nan{both(kNaN)};  // 0 where seen
        Pair max{}, sd_squared{}, slope{};
    } components_[3];
    std::array<double, 6> full_scale_, sd_{}, sd_slope_{};
    std::array<bool, 6> seen_{};
    Domain domain_;
};

// What is wrong with the parts that a CheckedModel uses, "" where nothing is. setup
std::string fault_of_checked(const Calibration& calibration);

}  // namespace tactiled
