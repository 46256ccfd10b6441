// Noise, drift and silence of each channel under one captured load, as text and as JSON.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "node/lab/capture_file.hpp"

namespace tactiled::ctl {

// One channel under one load.
struct Steadiness {
    std::string name;
    double mean = 0, sd = 0, min = 0, max = 0, drift = 0;  // drift: mean of the last quarter minus mean of the first one
    std::size_t missing = 0;
    bool moves = false;  // drift is greater than noise explains; a ramp shows with seven rows or more
    bool stuck = false;  // every row has the same value, and another channel changed
};

// Returns one entry per channel; `names` are those of the file, in its order. `rows` must not be empty.
std::vector<Steadiness> steadiness(const std::vector<CapturedRow>& rows, const std::vector<std::string>& names);

// Returns a sentence for each channel that is stuck.
std::vector<std::string> stuck_channels(const std::vector<Steadiness>& channels);

// Returns the names of the channels that moved by more than 5 % of their range in the file, and none while it has no rows.
std::vector<std::string> moving_channels(const std::vector<Steadiness>& channels, const CaptureFile& file);

// Prints the load as a table with one line per channel, and the sentences of stuck_channels().
void print_load(const std::vector<CapturedRow>& rows, const std::vector<Steadiness>& channels);
nlohmann::json load_json(const std::vector<CapturedRow>& rows, const std::vector<Steadiness>& channels);

}  // namespace tactiled::ctl
