// What is worth its time: the Pareto front of (time, error), and a sentence about it.
#pragma once
#include <string>
#include <vector>

namespace tactiled::ctl {

struct Offer {
    std::string name;
    double time_us, error_percent;  // NaN = unknown: never on the front
    double bad_percent = 0;         // of the samples had no value
};

// Those that no other beats in one of the two without being worse in the other, the fastest first: indices. Of equals the
// first.
std::vector<std::size_t> front(const std::vector<Offer>& offers);

// "table: linear from 0.05 us a sample (2.1 % rms of full scale); map from 1.5 us (0.6 %)." Of the front, those that are
// better than the one before by 5 % or more; each with the share of samples without a value, where there are any.
std::string front_sentence(const std::string& model, const std::vector<Offer>& offers);

}  // namespace tactiled::ctl
