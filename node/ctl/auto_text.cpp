#include "node/ctl/status_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <vector>

namespace tactiled::ctl {
namespace {

struct Front {
    std::vector<std::string> methods;  // most accurate first; none if the sensor's method is not "auto"
    int now = -1;                      // -1: unknown, the sample is BAD
    unsigned down = 0, up = 0;
    std::string why, state;
};

Front front_of(const Segment& segment, std::uint32_t index, const tactiled_sample& s) {
    Front front;
    std::istringstream names(tactiled_methods_of(segment.c(), index));
    for (std::string name; names >> name && front.methods.size() < TACTILED_MAX_METHODS;) front.methods.push_back(name);
    if (front.methods.empty()) return front;
    const tactiled_sensor& sensor = segment.sensor(index);
    const std::uint32_t first = std::min<std::uint32_t>(sensor.first_method, std::uint32_t(front.methods.size() - 1));
    front.why = fmt::format("{}: {} of {} within {:g} us", front.methods[first],
                            sensor.method_us[first] <= sensor.budget_us ? "the most accurate" : "the fastest, for none is",
                            front.methods.size(), sensor.budget_us);
    const std::uint32_t now = TACTILED_METHOD(s.state), steps = TACTILED_STEPS(s.state);
    if (now == 0 || now > front.methods.size()) return front;
    front.now = int(now - 1);
    front.down = unsigned(std::max(0, int(steps) + front.now - int(first))) / 2;
    front.up = steps - std::min(front.down, steps);
    front.state = (s.state & TACTILED_OVER_BUDGET) != 0    ? "over-budget"
                  : (s.state & TACTILED_STEPPED_DOWN) != 0 ? "stepped-down"
                                                           : "within-budget";
    return front;
}

}  // namespace

nlohmann::json auto_json(const Segment& segment, std::uint32_t index, const tactiled_sample& newest) {
    const Front front = front_of(segment, index, newest);
    if (front.methods.empty()) return nullptr;
    const tactiled_sensor& sensor = segment.sensor(index);
    nlohmann::json out{{"budget_us", sensor.budget_us}, {"began_with", front.why}};
    if (front.now >= 0) {
        out["now"] = front.methods[std::size_t(front.now)];
        out["state"] = front.state;
        out["steps_down"] = front.down;
        out["steps_up"] = front.up;
    }
    for (std::size_t i = 0; i < front.methods.size(); ++i)
        out["front"].push_back({{"method", front.methods[i]},
                                {"measured_us", sensor.method_us[i]},
                                {"sd_of_full_scale", sensor.method_error[i]}});
    return out;
}

std::string auto_lines(const Segment& segment, std::uint32_t index, const tactiled_sample& newest) {
    const Front front = front_of(segment, index, newest);
    if (front.methods.empty()) return "";
    const tactiled_sensor& sensor = segment.sensor(index);
    std::string out = fmt::format("{}: method auto, ", sensor.name);
    out += front.now < 0 ? "no sample\n"
                         : fmt::format("{} runs, {}, {} steps down, {} up; began with {}\n",
                                       front.methods[std::size_t(front.now)], front.state, front.down, front.up, front.why);
    for (std::size_t i = 0; i < front.methods.size(); ++i)
        out += fmt::format("    {:<10} {:>8.3f} us measured  {:>6.2f} % of full scale\n", front.methods[i],
                           double(sensor.method_us[i]), 100 * double(sensor.method_error[i]));
    return out;
}

}  // namespace tactiled::ctl
