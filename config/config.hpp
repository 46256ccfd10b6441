// The settings of a user as plain structures. config/KEYS.md lists the keys with units, ranges and defaults; the lists of
// fields that fill these structures stand in the file of each table (tables.hpp).
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "config/options.hpp"

namespace tactiled {

Options no_options();  // an empty table of no file

struct NodeSettings {
    std::string name;      // the segment is tactiled.NAME in the run-time folder
    int watchdog_ms;       // readers hold the daemon for dead when it published nothing for so long
    int stuck_link_ms;     // a link that is in its device for so long ends the feeding of systemd's watchdog; 0 = never
    std::string control;   // path of the control socket
    std::string zeros;     // path of the file of zeros; "" = zeros_path()
    double fault_clear_s;  // after which a latched fault without a cause clears itself, 0 = never
};

struct RealtimeSettings {
    int priority;  // SCHED_FIFO of the pipeline; links run two below
    int cpu;       // -1: any
    bool lock_memory;
    bool required;  // refused rights end the daemon instead of setting RT_DEGRADED
    int period_us;  // longest time between two cycles of the pipeline
};

struct LinkSettings {
    std::string name;
    std::string driver;
    std::optional<bool> simulated;   // STATUS shows that the data are simulated or replayed; unset: as the driver declares
    int sensors;                     // number of sensors that use it; filled by load_config
    Options options = no_options();  // the driver's own keys, not yet read
};

// A sensor of the same thing in the same frame: of two, one names the other, and both have this.
struct PairSettings {
    int other = -1;      // index of the sensor, -1: none
    double agree_N = 0;  // the magnitudes of their difference that is allowed
    int agree_ms = 0;    // and for how long a larger one is
    bool operator==(const PairSettings&) const = default;
};

struct SensorSettings {
    std::string name;
    std::string link;
    int device;
    std::vector<std::string> channels;   // name of each channel of the frame in order, "-" = not used; empty = as calibrated
    double counts_per_unit;              // raw number of the frame / this = the unit of the calibration
    std::array<double, 2> saturates_at;  // raw numbers, lowest and highest; at or beyond them a channel counts as saturated
    std::string model;
    std::string calibration;  // path, as given or beside the configuration file
    std::string method;       // "" = the calibration's own; "auto"
    double budget_us;         // time budget of a sample with method "auto"
    int stale_ms;
    int frozen_after;                // readings; -1: as the driver knows
    double slew_limit_per_s;         // raw numbers a second; infinity = none
    double rate_Hz, rate_tolerance;  // 0 = not declared; of rate_Hz
    double drift_limit_N;            // 0 = none
    int tare_ms;                     // length of a tare's mean
    double tare_limit_N;             // magnitude; 0 = none, -1 = 20 % of full scale, each component by its own
    std::string tare_after_restart;  // "restore" or "forget"
    bool accept_unproved_age;        // tared and weighed with although nothing in its stream would show a delay
    double filter_hz;                // low pass on force and torque, 0 = off
    double contact_on_N, contact_off_N;
    double overload_N;        // 0 = none
    std::string agrees_with;  // "" = none, or none that is named here
    double agree_N;           // as written on this sensor; `pair` has the values of the sensor that names the other
    int agree_ms;
    PairSettings pair;
    Options options = no_options();  // the model's own keys, not yet read
};

struct RtuSettings {
    std::string device;  // "" = no RTU
    int baud;
    std::string parity;  // "none", "odd" or "even"
    int address;
    int silence_us;  // between a request and its answer; 0 = 3.5 characters
    bool rs485;      // the kernel's driver switches the direction
};

struct ModbusSettings {
    std::string listen;              // ADDRESS:PORT, "" = no TCP
    std::vector<std::string> allow;  // CIDR; needed where `listen` is not the loopback
    std::vector<std::string> plc;    // addresses that always find a place
    int max_clients;
    int max_requests_per_s;                  // a client; 0 = no limit
    bool commands;                           // the writable block may be written
    std::vector<std::string> command_allow;  // CIDR; empty = whoever may connect
    bool scratch;
    std::string settings;  // file that SAVE writes
    RtuSettings rtu;
    std::string objects;  // of [grasp], where TEACH stores; "" = there is no [grasp], and nothing to weigh

    [[nodiscard]] bool enabled() const { return !listen.empty() || !rtu.device.empty(); }
};

struct ShmSettings {
    std::string group;  // "" = the daemon's own
    int history;        // samples kept a sensor, a power of two; 0 = as many as keep the segment within 1 MB
};

struct JawSettings {
    std::string sensor;
    std::array<double, 3> x_S_in_G, z_S_in_G;       // as written: of any length, perpendicular within 1 degree
    std::array<std::array<double, 3>, 3> S_from_G;  // rows: the axes of the skin's frame S, seen in the gripper's frame G
    double share;                                   // of the object's weight, 0 = all jaws alike
    Options options = no_options();
};

struct GraspSettings {
    std::vector<JawSettings> jaws;
    int jaws_of_gripper;                   // with and without a sensor
    std::array<double, 3> gravity_G_m_s2;  // all 0: not known
    double friction;                       // 0: not known
    double share_sd;                       // of a jaw's share from grasp to grasp, once a known weight was shown
    double margin;                         // recommended grip / least grip
    double weigh_window_ms;
    double slip_sensitivity;  // 0 .. 1; the key is in percent
    double lift_acceleration_m_s2, lift_accelerates_ms;
    std::string objects;  // path of the file of taught objects
};

// A sensor whose force is turned into the gripper's frame, and the part of the hand that it carries.
struct ToolSensorSettings {
    std::string sensor;
    std::array<double, 3> x_S_in_G, z_S_in_G;       // as written; all 0: as in [[grasp.jaw]]
    std::array<std::array<double, 3>, 3> S_from_G;  // rows: the axes of S, seen in G
    std::array<double, 3> position_G_mm;            // origin of S
    double mass_kg, mass_sd_kg;
    std::array<double, 3> centre_G_mm;
    double centre_sd_mm;
    std::array<double, 3> zero_S_N, zero_S_Nm;
    double zero_sd_N, zero_sd_Nm;
    Options options = no_options();
};

struct ToolSettings {
    std::vector<ToolSensorSettings> sensors;
    std::array<double, 3> gravity_G_m_s2;  // all 0: as [grasp]; there, too: not known
    double acceleration_m_s2, accelerates_ms;
};

struct GpioSettings {
    std::string chip;
    std::string fault, grasped, slip, alive;  // lines; "" = none
    std::string fault_is;                     // the level that means a fault: "low" or "high"
    int slip_ms;                              // a slip is shown for so long at least
};

struct Config {
    std::string path;
    NodeSettings node;
    RealtimeSettings realtime;
    ModbusSettings modbus;
    ShmSettings shm;
    std::vector<LinkSettings> links;
    std::vector<SensorSettings> sensors;
    std::optional<GraspSettings> grasp;
    std::optional<ToolSettings> tool;
    std::optional<GpioSettings> gpio;
    Options root = no_options();  // finish() it once drivers and models have read theirs
};

// Advice about a [grasp] that is allowed but hardly intended, a sentence each; empty: none.
std::vector<std::string> grasp_advice(const GraspSettings& grasp);

// Reads every key that is not a driver's or a model's own, checks names, references between them, and that each
// sensor's link exists. Errors go to `problems`. setup: never throws for bad input
Config load_config(const std::string& path, Problems& problems);

}  // namespace tactiled
