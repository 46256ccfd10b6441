// Parity of redundant channels: each channel that the others determine is predicted from them, by a polynomial that was
// fitted to the calibration's rows (fit/parity_fit.cpp). A channel that sticks, has lost gain or has moved disagrees with
// its prediction long before the force is implausible. This check serves every model and method.
//
// The prediction of a channel is judged where the others lie within their ranges and within their joint domain. Its residual
// counts if it would shift some component by more than its standard deviation, and if it is more than kParityLimit of its
// own standard deviations, to which the motion of channel and prediction over the last samples is added: channels are not
// converted at the same instant. Five samples of ten that count raise the alarm, 400 judged ones in a row that do not end
// it. During the alarm each channel in turn is replaced by its prediction. The only one with which all others agree again is
// the damaged one: the method goes on with its prediction, and with the standard deviation that the calibration states for
// that. If several channels explain the residuals, nothing is replaced, and the standard deviation contains what the
// damage of any of them would shift. If none explains them there is no standard deviation.
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

// Returns true if, with this sample, five of the last ten count. `recent`: bit i, the sample i before counts. rt: wait-free
inline bool parity_alarm(std::uint32_t& recent, bool counts) noexcept {
    recent = (recent << 1 | (counts ? 1u : 0u)) & 0x3FF;
    return std::popcount(recent) >= 5;
}

// Marks estimates during an alarm: UNCERTAIN, TACTILED_DISAGREEMENT. Without parity in the calibration, `inner` itself is
// returned. setup
std::unique_ptr<Decoupler> with_parity(const Calibration& calibration, std::unique_ptr<Decoupler> inner);

// Powers and products of `n` channels of which the predictions consist, for a parity of this order: 1, then the channels,
// then for order 2 the products. `feature` has room for parity_features(). rt: bounded by their number
void put_features(const Parity& parity, std::span<const double> channel, double* feature) noexcept;
std::size_t parity_features(std::size_t n, int order) noexcept;
// The reading of channel k that the others predict. setup
double predicted(const Parity& parity, std::span<const double> channel, std::size_t k);

// The fault of the calibration's parity, "" if there is none. setup
std::string fault_of_parity(const Calibration& calibration);

}  // namespace tactiled
