#include "node/ctl/status_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

std::string number(double value, int digits) { return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "-"; }

}  // namespace

std::string tool_why_text(std::uint32_t why) {
    static constexpr const char* kWords[] = {"gravity", "sensor", "tare", "doubted", "moves", "torque", "apart"};
    return words_of(why, kWords);
}

std::string tool_lines(const tactiled_tool& t) {
    if (t.quality == TACTILED_NO_VALUE) return "";
    const double sd_N = std::max({t.sd_force_N[0], t.sd_force_N[1], t.sd_force_N[2]});
    const std::string why = tool_why_text(t.why);
    return fmt::format("tool {}  force {} {} {} +- {} N  torque {} {} {} Nm\n", quality_text(t.quality, 0),
                       number(t.force_G_N[0], 2), number(t.force_G_N[1], 2), number(t.force_G_N[2], 2), number(sd_N, 2),
                       number(t.torque_G_Nm[0], 3), number(t.torque_G_Nm[1], 3), number(t.torque_G_Nm[2], 3)) +
           (why.empty() ? "" : fmt::format("  {}\n", why));
}

nlohmann::json tool_json(const Segment& segment, const tactiled_tool& t) {
    if (t.quality == TACTILED_NO_VALUE) return nullptr;
    nlohmann::json out{
        {"quality", quality_text(t.quality, 0)}, {"why", tool_why_text(t.why)}, {"force_G_N", t.force_G_N},
        {"torque_G_Nm", t.torque_G_Nm},          {"sd_force_N", t.sd_force_N},  {"sd_torque_Nm", t.sd_torque_Nm},
        {"gravity_G_m_s2", t.gravity_G_m_s2},    {"mass_kg", t.mass_kg}};
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if ((t.sensors >> i & 1u) != 0)
            out["sensors"][segment.sensor(i).name] = {{"quality", quality_text(t.sensor_quality[i], 0)},
                                                      {"force_G_N", t.sensor_force_G_N[i]},
                                                      {"torque_G_Nm", t.sensor_torque_G_Nm[i]},
                                                      {"sd_force_N", t.sensor_sd_force_N[i]},
                                                      {"sd_torque_Nm", t.sensor_sd_torque_Nm[i]}};
    return out;
}

}  // namespace tactiled::ctl
