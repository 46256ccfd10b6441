// The tables of the configuration: the list of fields of each, and the parts of load_config() with a file of their
// own. For use in config/ only.
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "config/fields.hpp"

namespace tactiled {

const Fields<NodeSettings>& node_fields();
const Fields<RealtimeSettings>& realtime_fields();
const Fields<LinkSettings>& link_fields();      // the other keys of [[link]] are the driver's
const Fields<SensorSettings>& sensor_fields();  // the other keys of [[sensor]] are the model's
const Fields<GraspSettings>& grasp_fields();
const Fields<JawSettings>& jaw_fields();
const Fields<ToolSettings>& tool_fields();
const Fields<ToolSensorSettings>& tool_sensor_fields();
const Fields<ModbusSettings>& modbus_fields();
const Fields<RtuSettings>& rtu_fields();
const Fields<ShmSettings>& shm_fields();
const Fields<GpioSettings>& gpio_fields();

// Returns the names of links or sensors. setup
template <typename Settings>
std::vector<std::string> names_of(const std::vector<Settings>& all) {
    std::vector<std::string> names;
    for (const auto& one : all) names.push_back(one.name);
    return names;
}
// Returns the fault of a name that is not among `names`: `link = "x" is no [[link]]; did you mean "y"?`. setup
std::string is_no(const char* key, const std::string& name, const char* table, const std::vector<std::string>& names);

// Reads one [[sensor]]. setup: never throws for bad input
SensorSettings read_sensor(Options table, const std::string& folder);
// Pairs the sensors that are compared; either of the two may name the other. setup: never throws for bad input
void pair_sensors(std::vector<SensorSettings>& sensors);
// Fills in the index of the sensor that `temperature_of` names.
void find_thermometers(std::vector<SensorSettings>& sensors);
// Checks sensors that read the same frame: each has its own channels. setup: never throws for bad input
void check_shared_frames(std::vector<SensorSettings>& sensors);

// Reads [modbus] and [modbus.rtu]. setup: never throws for bad input
ModbusSettings read_modbus(Options table, const std::string& node_name);

// Reads [grasp] and checks it against the sensors; nothing if the file has none. setup: never throws for bad input
std::optional<GraspSettings> read_grasp(Options& root, const std::string& node_name,
                                        const std::vector<SensorSettings>& sensors, const std::string& folder);

// Returns two axes of one frame, configured with any length, as rows of an orthonormal matrix: x, y, z. `key_x` and `key_z`
// name them in the problems. setup: never throws for bad input
std::array<std::array<double, 3>, 3> read_axes(Options& table, const std::array<double, 3>& x,
                                               const std::array<double, 3>& z);
// Adds a problem of `key` unless the vector is 0 ("not known") or has a length that occurs on Earth. setup
void check_gravity(Options& table, const char* key, const std::array<double, 3>& gravity_m_s2);

// Reads [tool], checked against the sensors; nothing if the file has none. setup: never throws for bad input
std::optional<ToolSettings> read_tool(Options& root, const std::vector<SensorSettings>& sensors,
                                      const std::optional<GraspSettings>& grasp);

// Reads [gpio]; nothing if the file has none. setup: never throws for bad input
std::optional<GpioSettings> read_gpio(Options& root);

// Checks that no file that the daemon writes is another file of the configuration. setup: never throws for bad input
void check_written_files(Config& config);

}  // namespace tactiled
