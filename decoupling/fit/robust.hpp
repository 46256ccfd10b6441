// Constants of fits in which rows far from the rest lose their weight.
#pragma once

namespace tactiled {

inline constexpr double kRobustSd = 1.4826;  // median of |error| to standard deviation, for normal errors
// Scale of Cauchy's loss in robust standard deviations. The first keeps 95 % of least squares' efficiency on normal errors;
// with the second, mainly spikes lose weight.
inline constexpr double kCauchyEfficient = 2.385, kCauchyOfSpikes = 4;

}  // namespace tactiled
