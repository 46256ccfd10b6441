// Names of bits and of values, and the order in which faults are told.
#include <array>

#include "node/modbus/table.hpp"
#include "tactiled/layout.h"

namespace tactiled::modbus {
namespace {

constexpr Name kStatusBits[] = {{0, "ready"},
                                {1, "any contact"},
                                {2, "grasped: GRIP_STATE is grasped, lifting, holding or slipping"},
                                {3, "slip now: see SLIP"},
                                {4, "slip latched: see SLIP_LATCH"},
                                {5, "WEIGHT holds a value"},
                                {6, "WEIGHT is stable"},
                                {7, "overload: see OVERLOAD"},
                                {8, "taring"},
                                {9, "simulated or replayed data"},
                                {10, "stale"},
                                {11, "uncalibrated"},
                                {12, "the PLC's watchdog has expired: PLC_HEARTBEAT stands"},
                                {13, "settings are unlocked"},
                                {14, "warning: see WARN"},
                                {15, "fault: see FAULT"}};
constexpr Name kFaultBits[] = {{0, "sensor lost"},         {1, "overrange"}, {2, "open gauge"}, {3, "pipeline overrun"},
                               {4, "calibration missing"}, {6, "storage"},   {7, "bus error"},  {8, "internal"}};
constexpr Name kWarnBits[] = {{1, "drift: the zero of a sensor at rest has moved"},
                              {2, "lost samples"},
                              {4, "the last tare was refused or failed: the zero before is in force"},
                              {5, "a sensor's method auto has stepped down or misses its budget"},
                              {6, "a sensor's rate is not the declared one"},
                              {7, "the last reload was refused: the configuration before is in force"}};
constexpr Name kSensorStatusBits[] = {{0, "ok: the value is GOOD"},
                                      {1, "contact"},
                                      {2, "incipient slip"},
                                      {3, "gross slip"},
                                      {4, "overload: above OVERLOAD_AT, or a register saturates"},
                                      {5, "saturated channel"},
                                      {6, "stale: no data"},
                                      {7, "taring"},
                                      {8, "tared"},
                                      {9, "uncalibrated"},
                                      {10, "low pass on"},
                                      {11, "method auto has stepped down or misses its budget"},
                                      {12, "uncertain: a value with a weakness; FAULT says which"},
                                      {13, "the rate is not the declared one"},
                                      {14, "maintenance: the zero at rest has moved"},
                                      {15, "fault: no value; FAULT says why"}};
constexpr Name kCommandStates[] = {{0, "idle"}, {1, "running"}, {2, "done"}, {3, "rejected or failed"}};
constexpr Name kCommandResults[] = {{0, "ok"},
                                    {1, "unknown"},
                                    {2, "bad mask"},
                                    {3, "bad parameter"},
                                    {4, "not now"},
                                    {5, "locked"},
                                    {6, "failed"},
                                    {7, "timed out"},
                                    {8, "refused: a sensor moved while its zero was averaged"},
                                    {9, "refused: a sensor is under load, beyond tare_limit_N"}};
constexpr Name kCommands[] = {{1, "tare"},          {2, "untare"},      {3, "clear latches"}, {4, "start weighing"},
                              {5, "stop weighing"}, {6, "reset peaks"}, {7, "zero weight"},   {8, "self-test"},
                              {9, "known weight"},  {10, "teach"}};
constexpr Name kGripperStates[] = {{0, "open"},    {1, "closing"}, {2, "closed"},
                                   {3, "lifting"}, {4, "moving"},  {5, "opening"}};
constexpr Name kSaveStates[] = {{0, "idle"}, {1, "storing"}, {2, "failed"}};
constexpr Name kGripStates[] = {{TACTILED_GRIP_OPEN, "open"},       {TACTILED_GRIP_CONTACT, "contact"},
                                {TACTILED_GRIP_GRASPED, "grasped"}, {TACTILED_GRIP_LIFTING, "lifting"},
                                {TACTILED_GRIP_HOLDING, "holding"}, {TACTILED_GRIP_SLIPPING, "slipping"},
                                {TACTILED_GRIP_LOST, "lost"}};
constexpr Name kSlipStates[] = {{0, "none"}, {1, "incipient"}, {2, "gross"}};
constexpr Name kWeightStates[] = {{0, "none"}, {1, "estimating"}, {2, "stable"}, {3, "overload"}, {4, "not observable"}};

// Gravest first. The numbers are the map's and do not follow the order of enum tactiled_reason.
struct Fault {
    std::uint32_t reason;
    Name name;
};
constexpr Fault kSensorFaults[] = {
    {TACTILED_DAEMON_STOPPED, {1, "daemon stopped or hangs"}},
    {TACTILED_DISCONNECTED, {2, "disconnected"}},
    {TACTILED_NO_DATA_YET, {3, "no data yet"}},
    {TACTILED_STALE, {4, "stale"}},
    {TACTILED_WRONG_DEVICE,
     {5, "wrong device: its frames have another number of channels, or two devices count under its name"}},
    {TACTILED_NOT_FINITE, {6, "result is no number"}},
    {TACTILED_IDLE_BUS, {17, "all channels read all zeros or all ones"}},
    {TACTILED_FROZEN, {14, "a channel is frozen"}},
    {TACTILED_MISSING_CHANNEL, {7, "missing channel"}},
    {TACTILED_UNCALIBRATED, {8, "uncalibrated"}},
    {TACTILED_SATURATED, {9, "saturated channel"}},
    {TACTILED_DISAGREEMENT, {10, "channels contradict each other"}},
    {TACTILED_SENSORS_DIFFER, {19, "differs from the sensor that it should agree with"}},
    {TACTILED_UNPROVED_AGE, {20, "its age is not proved: frames were delayed, or the device paused"}},
    {TACTILED_STEPPED, {18, "a channel has changed faster than it can"}},
    {TACTILED_OUTSIDE_DOMAIN, {11, "outside the calibrated domain"}},
    {TACTILED_UNKNOWN_UNCERTAINTY, {12, "uncertainty unknown"}},
    {TACTILED_READER_OVERRUN, {13, "internal: read overrun"}},
};

constexpr auto kSensorFaultNames = [] {
    std::array<Name, std::size(kSensorFaults) + 3> names{};
    names[0] = {0, "none"};
    names[names.size() - 2] = {kFaultNoSensor, "no sensor has this block"};
    names[names.size() - 1] = {kFaultUnknown, "a reason that this map does not know"};
    for (std::size_t i = 0; i < std::size(kSensorFaults); ++i) names[i + 1] = kSensorFaults[i].name;
    return names;
}();

}  // namespace

std::span<const Name> names_of(std::string_view name) {
    if (name == "global.STATUS") return kStatusBits;
    if (name == "global.FAULT") return kFaultBits;
    if (name == "global.WARN") return kWarnBits;
    if (name == "global.CMD_STATE") return kCommandStates;
    if (name == "global.CMD_RESULT") return kCommandResults;
    if (name == "global.WEIGHT_STATE") return kWeightStates;
    if (name == "global.GRIP_STATE") return kGripStates;
    if (name == "sensor.SLIP_STATE") return kSlipStates;
    if (name == "sensor.STATUS" || name == "sensor_float.STATUS") return kSensorStatusBits;
    if (name == "sensor.FAULT") return kSensorFaultNames;
    if (name == "control.CMD") return kCommands;
    if (name == "control.GRIPPER_STATE") return kGripperStates;
    if (name == "control.SAVE") return kSaveStates;
    return {};
}

std::uint16_t fault_of(std::uint32_t reasons) {
    for (const Fault& fault : kSensorFaults)
        if ((reasons & fault.reason) != 0) return fault.name.value;
    return 0;
}

}  // namespace tactiled::modbus
