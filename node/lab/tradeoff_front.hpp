// The best methods for their time: the Pareto front of (time, error), and a sentence about it.
#pragma once
#include <string>
#include <vector>

namespace tactiled::ctl {

struct Offer {
    std::string name;
    double time_us, error_percent;  // NaN = unknown: never on the front
    double bad_percent = 0;         // share of samples without a value
};

// Returns the indices of the offers for which no other is better in one of the two without being worse in the other,
// the fastest first. The first of equal offers is taken.
std::vector<std::size_t> front(const std::vector<Offer>& offers);

// Returns "table: linear from 0.05 us a sample (2.1 % rms of full scale); map from 1.5 us (0.6 %)." The list has the
// offers of the front that are better than the one before by 5 % or more, each with its share of samples without a
// value, if any.
std::string front_sentence(const std::string& model, const std::vector<Offer>& offers);

}  // namespace tactiled::ctl
