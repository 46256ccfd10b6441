// Parity of redundant channels: each channel that the others determine is predicted from them, by a polynomial that was
// fitted to the calibration's rows (fit/parity_fit.cpp). A channel that sticks, has lost gain or has moved disagrees with
// its prediction long before the force is implausible. This check is used for every model and method.
//
// A channel is compared with its prediction if the other channels are within their ranges and their joint domain. A residual
// counts if it would shift some component by more than the component's standard deviation, and if it exceeds kParityLimit of
// its own standard deviations, to which the motion of channel and prediction over the last samples is added: channels are
// not converted at the same instant. Five counted samples of ten raise the alarm; 400 consecutive samples without a counted
// residual end it. During the alarm each channel in turn is replaced by its prediction. If all others agree again for one
// channel only, this channel is damaged: the method continues with its prediction, and with the standard deviation that the
// calibration states for this case. If several channels explain the residuals, nothing is replaced, and the standard
// deviation includes the largest shift by damage of one of them. If no channel explains them, no standard deviation is
// stated.
#pragma once
#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled {

inline constexpr double kParityLimit = 4;  // standard deviations of a residual

// Returns true if five of the last ten samples count. `recent`: bit i, the sample i before counts. rt: wait-free
inline bool parity_alarm(std::uint32_t& recent, bool counts) noexcept {
    recent = (recent << 1 | (counts ? 1u : 0u)) & 0x3FF;
    return std::popcount(recent) >= 5;
}

// Passes each reading to `inner`; during an alarm, estimates become UNCERTAIN with TACTILED_DISAGREEMENT. Returns `inner`
// itself if the calibration has no parity. setup
std::unique_ptr<Decoupler> with_parity(const Calibration& calibration, std::unique_ptr<Decoupler> inner);

// Computes the features of the predictions of this order: 1, the `n` channels, and for order 2 their products. `feature` has
// room for parity_features(). rt: bounded by their number
void put_features(const Parity& parity, std::span<const double> channel, double* feature) noexcept;
std::size_t parity_features(std::size_t n, int order) noexcept;
// Returns the reading of channel k that the others predict. setup
double predicted(const Parity& parity, std::span<const double> channel, std::size_t k);

// Returns the fault of the calibration's parity, "" if there is none. setup
std::string fault_of_parity(const Calibration& calibration);

}  // namespace tactiled
