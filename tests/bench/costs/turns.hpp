// Times of things that are compared: they take turns within a round, so that what disturbs the machine disturbs all alike.
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

namespace tactiled::ctl {

// Calls of one contender, the first to the last but one; what they compute is returned, so that it is computed at all.
using Contender = std::function<double(std::size_t first, std::size_t last)>;

// ns a call of each: median over the rounds of 64 calls that make up `calls`. The clock's 25 ns are spread over them.
std::vector<double> ns_alternating(const std::vector<Contender>& contenders, std::size_t calls);

// The value that this share of them lies below; NaN of none. Sorts a copy.
double quantile(std::vector<double> values, double share);

}  // namespace tactiled::ctl
