// Error of the weight against time after lift-off, as an SVG that can be printed in black and white, and as CSV.
#pragma once
#include <string>
#include <vector>

#include "tests/bench/grasp_session.hpp"

namespace tactiled::bench {

struct Panel {
    std::string title;
    std::vector<Outcome> outcomes;
};

// Rows: acceleration (panel), sensed jaws, ms after lift-off, error that 68 and 95 % of the grasps are within (%), part of
// them that is stable (%).
std::string error_csv(const std::vector<Panel>& panels);
std::string error_svg(const std::vector<Panel>& panels, const std::string& title);

}  // namespace tactiled::bench
