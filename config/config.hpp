// The settings of a user as plain structures. config/KEYS.md lists the keys with units, ranges and defaults; the
// lists of fields that fill these structures are in the file of each table (tables.hpp).
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "config/options.hpp"

namespace tactiled {

inline constexpr std::size_t kMaxSensors = 16, kMaxLinks = 16;  // TACTILED_MAX_SENSORS and _LINKS

Options no_options();  // an empty table without a file

// The effect of a changed value when the daemon reads its configuration again (SIGHUP). It follows from the structure that
// holds the value: each structure of settings has kReload.
enum class Reload {
    restart,  // the reload is refused: the daemon must be restarted
    tune,     // takes effect without a lost sample; neither the measured value nor its zero changes
    epoch,    // takes effect without a lost sample; the sensor begins a new epoch without its tare
};

struct NodeSettings {
    static constexpr Reload kReload = Reload::restart;
    std::string name;  // the segment is tactiled.NAME in the run-time folder
    int watchdog_ms;   // readers consider the daemon dead when it has published nothing for this time
    // a link thread that is blocked in its device for this time stops the watchdog notifications to systemd; 0 = never
    int stuck_link_ms;
    std::string control;   // path of the control socket
    std::string zeros;     // path of the file of zeros; "" = zeros_path()
    double fault_clear_s;  // time after which a latched fault without a cause clears itself, 0 = never
};

struct RealtimeSettings {
    static constexpr Reload kReload = Reload::restart;
    int priority;  // SCHED_FIFO priority of the pipeline; links run two below
    int cpu;       // -1: any
    bool lock_memory;
    bool required;  // missing permissions end the daemon instead of setting RT_DEGRADED
    int period_us;  // longest time between two cycles of the pipeline while a sensor delivers
};

struct LinkSettings {
    static constexpr Reload kReload = Reload::restart;
    std::string name;
    std::string driver;
    std::optional<bool> simulated;   // STATUS shows that the data are simulated or replayed; unset: by the driver
    int sensors;                     // number of sensors that use it; filled by load_config
    Options options = no_options();  // the driver's own keys, not yet read
};

// The comparison of two sensors that measure the same force in the same frame; both sensors have this structure.
struct PairSettings {
    int other = -1;      // index of the sensor, -1: none
    double agree_N = 0;  // maximum magnitude of the difference
    int agree_ms = 0;    // maximum duration of a larger difference
    bool operator==(const PairSettings&) const = default;
};

// The keys of a [[sensor]] in three structures, by the effect of a change on a reload.
struct SensorPlace {
    static constexpr Reload kReload = Reload::restart;
    std::string name;
    std::string link;
    int device;
    std::string model;
    int stale_ms;
    double register_N;  // one count of its force registers; a power of ten
};

struct SensorMeasuring {
    static constexpr Reload kReload = Reload::epoch;
    // name of each channel of the frame in order, "-" = not used; empty = as calibrated
    std::vector<std::string> channels;
    double counts_per_unit;                     // raw number of the frame / this = the unit of the calibration
    std::string temperature;                    // name of the frame's channel, "" = none
    std::string temperature_of;                 // name of another sensor that has the same temperature, "" = none
    std::array<double, 2> temperature_range_C;  // lowest and highest; NaN = not declared
    double temperature_difference_K;            // NaN = not declared
    double temperature_sd_K;                    // NaN = not declared
    std::string expect_serial;                  // serial that the calibration must have; "" = any
    std::string serial_channel;                 // name of the frame's channel that is the number of the device, "" = none
    std::string calibration;                    // path, as given or beside the configuration file
    std::string method;                         // "" = the calibration's own; "auto"
    double budget_us;                           // time budget of a sample with method "auto"
};

// The running sensor uses this structure directly (node/tuning.hpp) and replaces it as a whole.
struct SensorTuning {
    static constexpr Reload kReload = Reload::tune;
    // lowest and highest raw number; a channel at or beyond one of them counts as saturated
    std::array<double, 2> saturates_at = {-kUnlimited, kUnlimited};
    int temperature_frozen_after = -1;  // number of readings; 0 = never, -1: by the driver
    double temperature_jump_K = -1;     // -1: 1 K, but any for a dummy
    int frozen_after = -1;              // number of readings; 0 = never, -1: by the calibration or the driver
    double delay_ms = -1;               // -1: by the driver
    double rate_Hz = 0;                 // 0 = not declared
    double rate_tolerance = 0.2;        // relative to rate_Hz
    double drift_limit_N = 0;           // 0 = none
    int tare_ms = 100;                  // length of a tare's mean
    double tare_limit_N = -1;           // magnitude; 0 = none, -1 = 20 % of full scale for each component
    std::string zero_after = "doubt";   // or "keep", "forget"
    bool accept_too_quiet = false;      // a device with less noise than in its calibration is the calibrated one
    bool accept_unproved_age = false;   // allows tares and weights although the stream would not reveal a delay
    // Share of readings that a damaged channel may leave GOOD and wrong, 0 .. 1.
    double undetected_damage_limit = kUnlimited;
    double filter_hz = 0;  // low pass on force and torque, 0 = off
    double contact_on_N = 0.5, contact_off_N = 0.25;
    double overload_N = 0;    // 0 = none
    std::string agrees_with;  // "" = no other sensor, or named by the other one
    double agree_N = 0;       // from this sensor's table; `pair` has the values of the sensor that names the other
    int agree_ms = 100;
    PairSettings pair;

    static constexpr double kUnlimited = std::numeric_limits<double>::infinity();
};

struct SensorSettings : SensorPlace, SensorMeasuring, SensorTuning {
    static constexpr Reload kReload = Reload::epoch;  // the model's keys
    int thermometer = -1;                             // index of the sensor that temperature_of names, -1: none
    Options options = no_options();                   // the model's own keys, not yet read
};

struct RtuSettings {
    static constexpr Reload kReload = Reload::restart;
    std::string device;  // "" = no RTU
    int baud;
    std::string parity;  // parity: "none", "odd" or "even"
    int address;
    int silence_us;  // between a request and its answer; 0 = 3.5 characters
    bool rs485;      // the kernel's driver switches the direction
};

struct ModbusSettings {
    static constexpr Reload kReload = Reload::restart;
    std::string listen;              // ADDRESS:PORT, "" = no TCP
    std::vector<std::string> allow;  // CIDR; required if `listen` is not the loopback
    std::vector<std::string> plc;    // addresses with reserved places
    int max_clients;
    int max_requests_per_s;                  // per client; 0 = no limit
    bool commands;                           // the writable block may be written
    std::vector<std::string> command_allow;  // CIDR; empty = all clients that may connect
    int hints_expire_ms;                     // start value of PLC_WATCHDOG; 0 = never
    bool scratch;
    std::string settings;  // file that SAVE writes
    RtuSettings rtu;
    std::string objects;  // from [grasp], written by TEACH; "" = there is no [grasp]
    // from the [[sensor]]s: the power of ten of register_N, by sensor; the default for those that are not there
    std::array<int, kMaxSensors> force_scales = [] {
        std::array<int, kMaxSensors> all;
        all.fill(-2);
        return all;
    }();

    [[nodiscard]] bool enabled() const { return !listen.empty() || !rtu.device.empty(); }
};

struct ShmSettings {
    static constexpr Reload kReload = Reload::restart;
    std::string group;  // "" = the daemon's own
    int history;        // samples kept per sensor, a power of two; 0 = as many as keep the segment within 2 MB
    int array_history;  // arrays kept per sensor with taxels, a power of two
};

struct JawSettings {
    static constexpr Reload kReload = Reload::tune;
    std::string sensor;
    std::array<double, 3> x_S_in_G, z_S_in_G;  // components as configured: of any length, perpendicular within 1 degree
    // rows: the axes of the skin's frame S, expressed in the gripper's frame G
    std::array<std::array<double, 3>, 3> S_from_G;
    double share;  // share of the object's weight, 0 = all jaws equally
    Options options = no_options();
};

struct GraspFiles {
    static constexpr Reload kReload = Reload::restart;
    std::string objects;  // path of the file of taught objects
};

struct GraspSettings : GraspFiles {
    static constexpr Reload kReload = Reload::tune;
    std::vector<JawSettings> jaws;
    int jaws_of_gripper;                   // with and without a sensor
    std::array<double, 3> gravity_G_m_s2;  // all 0: unknown
    double friction;                       // 0: unknown
    // variation of a jaw's share from grasp to grasp, after a known weight was shown
    double share_sd;
    double margin;  // recommended grip / minimum grip
    double weigh_window_ms;
    double slip_sensitivity;  // 0 .. 1; the key is in percent
    double lift_acceleration_m_s2, lift_accelerates_ms;
};

// A sensor whose force is transformed to the gripper's frame, and the part of the hand that it carries.
struct ToolSensorSettings {
    static constexpr Reload kReload = Reload::tune;
    std::string sensor;
    std::array<double, 3> x_S_in_G, z_S_in_G;       // axes in the file; all 0: those of [[grasp.jaw]]
    std::array<std::array<double, 3>, 3> S_from_G;  // rows: the axes of S in G
    std::array<double, 3> position_G_mm;            // origin of S
    double mass_kg, mass_sd_kg;
    std::array<double, 3> centre_G_mm;
    double centre_sd_mm;
    std::array<double, 3> zero_S_N, zero_S_Nm;
    double zero_sd_N, zero_sd_Nm;
    Options options = no_options();
};

struct ToolSettings {
    static constexpr Reload kReload = Reload::tune;
    std::vector<ToolSensorSettings> sensors;
    std::array<double, 3> gravity_G_m_s2;  // all 0: as in [grasp], where all 0 means unknown
    double acceleration_m_s2, accelerates_ms;
};

struct GpioSettings {
    static constexpr Reload kReload = Reload::restart;
    std::string chip;
    std::string fault, grasped, slip, alive;  // GPIO lines; "" = none
    std::string fault_is;                     // the level that means a fault: "low" or "high"
    int slip_ms;                              // minimum time for which a slip is shown
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
    Options root = no_options();  // call finish() when drivers and models have read their keys
};

// Returns advice about a [grasp] that is allowed but probably not intended, one sentence each; empty: none.
std::vector<std::string> grasp_advice(const GraspSettings& grasp);

// Reads every key that does not belong to a driver or a model, and checks names, references between them, and that
// each sensor's link exists. Errors go to `problems`. setup: never throws for bad input
Config load_config(const std::string& path, Problems& problems);
// Returns a [[sensor]] whose keys have their defaults, for data without a configuration. setup
SensorSettings default_sensor();

}  // namespace tactiled
