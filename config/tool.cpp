// [tool]: forces in the gripper's frame, minus the weight of the hand.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "config/names.hpp"
#include "config/tables.hpp"

namespace tactiled {
namespace {

using Vector = std::array<double, 3>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr Vector kNone{0, 0, 0}, kUnset{kNaN, kNaN, kNaN};

// The axes are those of the table, or those of the jaw with this sensor.
void read_frame(Options& table, ToolSensorSettings& sensor, const std::optional<GraspSettings>& grasp) {
    if (table.has("x_S_in_G") || table.has("z_S_in_G")) {
        sensor.S_from_G = read_axes(table, sensor.x_S_in_G, sensor.z_S_in_G);
        return;
    }
    if (grasp)
        for (const JawSettings& jaw : grasp->jaws)
            if (jaw.sensor == sensor.sensor) {
                sensor.S_from_G = jaw.S_from_G;
                return;
            }
    table.problem("x_S_in_G", fmt::format("x_S_in_G and z_S_in_G are missing, and {} is no [[grasp.jaw]] that has them",
                                          in_quotes(sensor.sensor)));
}

void check_name(std::vector<ToolSensorSettings>& all, ToolSensorSettings& one, const std::vector<SensorSettings>& sensors) {
    if (one.sensor.empty()) return;  // reported already
    const auto same = [&](const auto& other) { return &other != &one && other.sensor == one.sensor; };
    if (std::any_of(all.begin(), all.end(), same))
        one.options.problem("sensor", fmt::format("sensor = {} has two [[tool.sensor]]", in_quotes(one.sensor)));
    const std::vector<std::string> names = names_of(sensors);
    if (std::find(names.begin(), names.end(), one.sensor) == names.end())
        one.options.problem("sensor", is_no("sensor", one.sensor, "sensor", names));
}

}  // namespace

const Fields<ToolSensorSettings>& tool_sensor_fields() {
    using S = ToolSensorSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, sensor), kRequired, Text::any, "Name of a [[sensor]]."},
        {TACTILED_KEY(S, x_S_in_G), Default(kUnset, "the axis of [[grasp.jaw]]"), range(-1000, 1000), "",
         "Direction of the sensor's x axis in G, of any length."},
        {TACTILED_KEY(S, z_S_in_G), Default(kUnset, "the axis of [[grasp.jaw]]"), range(-1000, 1000), "",
         "Direction of the sensor's z axis in G; perpendicular to x within 1 degree."},
        {TACTILED_KEY(S, position_G_mm), kNone, range(-10'000, 10'000), "mm",
         "Origin of the sensor's frame in G: the lever arm of its force."},
        {TACTILED_KEY(S, mass_kg), 0, range(0, 1000), "kg",
         "Mass of the part of the hand that this sensor carries: all of the hand at a wrist, its own pad at a finger. "
         "`tactilectl tool-fit` measures this key and the following ones."},
        {TACTILED_KEY(S, mass_sd_kg), 0, range(0, 1000), "kg", "Its standard deviation."},
        {TACTILED_KEY(S, centre_G_mm), kNone, range(-10'000, 10'000), "mm", "Centre of that mass in G."},
        {TACTILED_KEY(S, centre_sd_mm), 0, range(0, 10'000), "mm", "Its standard deviation, each component."},
        {TACTILED_KEY(S, zero_S_N), kNone, range(-1e6, 1e6), "N",
         "Force that the sensor reads without any load and without the weight, in its frame; used where no tare is in "
         "force."},
        {TACTILED_KEY(S, zero_S_Nm), kNone, range(-1e6, 1e6), "Nm", "The same of the torque."},
        {TACTILED_KEY(S, zero_sd_N), 0, range(0, 1e6), "N", "Standard deviation of zero_S_N."},
        {TACTILED_KEY(S, zero_sd_Nm), 0, range(0, 1e6), "Nm", "Standard deviation of zero_S_Nm."},
    };
    return fields;
}

const Fields<ToolSettings>& tool_fields() {
    using S = ToolSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, gravity_G_m_s2), Default(kNone, "the one of [grasp], else not known"), range(-10, 10), "m/s^2",
         "Direction in which weight pulls, seen in G, with a length of 9.7 .. 9.9, until the PLC writes GRAVITY_X .. "
         "GRAVITY_Z. A hand that turns needs the latter."},
        {TACTILED_KEY(S, acceleration_m_s2), 2, range(0, 50), "m/s^2",
         "Largest acceleration of the arm. It is in the standard deviation while the force is not steady and the PLC does "
         "not write the acceleration."},
        {TACTILED_KEY(S, accelerates_ms), 1000, range(0, 5000), "ms",
         "Time for which an arm accelerates at the longest: after so long a steady force is that of a hand at rest."},
    };
    return fields;
}

std::optional<ToolSettings> read_tool(Options& root, const std::vector<SensorSettings>& sensors,
                                      const std::optional<GraspSettings>& grasp) {
    Options table = root.table("tool");  // marks the table as known even if the file does not have it
    if (!root.has("tool")) return std::nullopt;
    ToolSettings tool{};
    for (auto& one : table.tables("sensor", kMaxSensors)) {
        ToolSensorSettings sensor{};
        sensor.options = one;
        read_fields(tool_sensor_fields(), one, sensor);
        read_frame(one, sensor, grasp);
        tool.sensors.push_back(std::move(sensor));
    }
    read_fields(tool_fields(), table, tool);
    if (!table.has("sensor")) table.problem("sensor", "[tool] has no [[tool.sensor]]; one for each sensor of the sum");
    for (auto& sensor : tool.sensors) check_name(tool.sensors, sensor, sensors);
    check_gravity(table, "gravity_G_m_s2", tool.gravity_G_m_s2);
    if (tool.gravity_G_m_s2 == kNone && grasp) tool.gravity_G_m_s2 = grasp->gravity_G_m_s2;
    return tool;
}

}  // namespace tactiled
