// Times of variants that are compared: they alternate within a round, so that disturbances of the machine affect all
// alike.
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

namespace tactiled::ctl {

// Calls of one contender, from the first to the last but one; the result is returned, so that it is computed at all.
using Contender = std::function<double(std::size_t first, std::size_t last)>;

// ns a call of each: median over the rounds of 64 calls that make up `calls`. The clock's 25 ns are spread over them.
std::vector<double> ns_alternating(const std::vector<Contender>& contenders, std::size_t calls);

// Returns the value below which this share of them is; NaN for none. Sorts a copy.
double quantile(std::vector<double> values, double share);

}  // namespace tactiled::ctl
