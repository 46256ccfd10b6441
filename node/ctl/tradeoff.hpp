// The parts of `tactilectl tradeoff`, one file each.
#pragma once
#include <cstddef>
#include <string>

namespace tactiled::ctl {

// What every form of the verb may write. An empty path writes nothing.
struct TradeoffOutput {
    std::string csv, svg;
    bool json = false;        // on standard output, instead of the table
    std::size_t samples = 0;  // to time of each thing that is compared; 0 = the verb's own number
    // Of --cost: the project's folder, for config/ and with `all` for the figures; a calibration with an influence map, "" =
    // the one in config/.
    std::string folder = ".", influence;
};

// ---- tradeoff_costs.cpp: what one thing costs against another way of doing it ----

// `name` as --cost says it. Returns the exit status. setup: throws SetupError where there is none of that name
int tradeoff_costs(const std::string& name, const TradeoffOutput& output);

}  // namespace tactiled::ctl
