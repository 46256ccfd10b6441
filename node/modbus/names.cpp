// Names of bits and of values, and the order in which faults are reported.
#include <algorithm>
#include <array>

#include "node/modbus/table.hpp"
#include "tactiled/layout.h"

namespace tactiled::modbus {
namespace {

constexpr Name kStatusBits[] = {{0, "ready", "READY"},
                                {1, "any contact", "ANY_CONTACT"},
                                {2, "grasped: GRIP_STATE is grasped, lifting, holding or slipping", "GRASPED"},
                                {3, "slip now: see SLIP", "SLIP"},
                                {4, "slip latched: see SLIP_LATCH", "SLIP_LATCHED"},
                                {5, "WEIGHT holds a value", "HAS_WEIGHT"},
                                {6, "WEIGHT is stable", "WEIGHT_STABLE"},
                                {7, "overload: see OVERLOAD", "OVERLOAD"},
                                {8, "taring", "TARING"},
                                {9, "simulated or replayed data", "SIMULATED"},
                                {10, "stale", "STALE"},
                                {11, "uncalibrated", "UNCALIBRATED"},
                                {12, "each PLC is silent: no new PLC_HEARTBEAT and no hint for PLC_WATCHDOG", "PLC_EXPIRED"},
                                {13, "settings are unlocked", "UNLOCKED"},
                                {14, "warning: see WARN", "WARNING"},
                                {15, "fault: see FAULT", "FAULT"}};
constexpr Name kFaultBits[] = {{0, "sensor lost", "SENSOR_LOST"},
                               {1, "overrange", "OVERRANGE"},
                               {2, "open gauge", "OPEN_GAUGE"},
                               {3, "pipeline overrun", "OVERRUN"},
                               {4, "calibration missing", "NO_CALIBRATION"},
                               {6, "storage", "STORAGE"},
                               {7, "bus error", "BUS"},
                               {8, "internal", "INTERNAL"}};
constexpr Name kWarnBits[] = {{1, "drift: the zero of a sensor at rest has moved", "DRIFT"},
                              {2, "lost samples", "LOST_SAMPLES"},
                              {4, "the last tare was refused or failed: the previous zero is in force", "TARE"},
                              {5, "a sensor's method auto has stepped down or misses its budget", "BUDGET"},
                              {6, "a sensor's rate is not the declared one", "RATE"},
                              {7, "the last reload was refused: the previous configuration is in force", "RELOAD"},
                              {8, "the jaws contradict the weight: see WEIGHT_WHY", "JAWS"},
                              {9, "a hint of a PLC has expired: gravity or gripper state is not known", "HINTS"}};
constexpr Name kDoubtBits[] = {
    {0, "the presses do not balance: a wrong gain, or a tilt or an acceleration that is not reported", "BALANCE"},
    {1, "the jaws do not share the load as they should: a wrong gain or direction", "SHARES"},
    {2, "the load came onto the other jaws and not onto this one", "DEAD_SHEAR"},
    {3, "the mass is negative: the direction of gravity or of a jaw is wrong", "NEGATIVE"},
    {4, "gain or zero of a jaw has changed since the weight was first stable", "CREEPS"},
    {5, "the load moves", "MOVES"},
    {6, "a force across gravity: a tilt that is not reported, a table, a turned jaw", "ACROSS"},
    {7, "the load came onto this jaw later than onto the others", "LATE"}};
constexpr Name kSensorStatusBits[] = {{0, "ok: the value is GOOD", "GOOD"},
                                      {1, "contact", "CONTACT"},
                                      {2, "incipient slip", "INCIPIENT_SLIP"},
                                      {3, "gross slip", "GROSS_SLIP"},
                                      {4, "overload: above OVERLOAD_AT, or a register saturates", "OVERLOAD"},
                                      {5, "saturated channel", "SATURATED"},
                                      {6, "stale: no data", "STALE"},
                                      {7, "taring", "TARING"},
                                      {8, "tared", "TARED"},
                                      {9, "uncalibrated", "UNCALIBRATED"},
                                      {10, "low pass on", "LOW_PASS"},
                                      {11, "method auto has stepped down or misses its budget", "STEPPED_DOWN"},
                                      {12, "uncertain: a value with a weakness; FAULT says which", "UNCERTAIN"},
                                      {13, "the rate is not the declared one", "WRONG_RATE"},
                                      {14, "maintenance: the zero at rest has moved", "DRIFTED"},
                                      {15, "fault: no value; FAULT says why", "FAULT"}};
constexpr Name kCommandStates[] = {
    {0, "idle", "IDLE"}, {1, "running", "RUNNING"}, {2, "done", "DONE"}, {3, "rejected or failed", "REJECTED"}};
constexpr Name kCommandResults[] = {
    {0, "ok", "OK"},
    {1, "unknown", "UNKNOWN"},
    {2, "bad mask", "BAD_MASK"},
    {3, "bad parameter", "BAD_PARAMETER"},
    {4, "not now", "NOT_NOW"},
    {5, "locked", "LOCKED"},
    {6, "failed", "FAILED"},
    {7, "timed out", "TIMED_OUT"},
    {8, "refused: a sensor moved while its zero was averaged", "MOVING"},
    {9, "refused: a sensor is under load, beyond tare_limit_N", "UNDER_LOAD"},
    {10, "zeros cannot be kept: see the daemon's log", "NOT_STORED"},
    {11, "adopted, not run: the first CMD_SEQ since the daemon's start; write another one", "ADOPTED"},
    {12, "repeated: this CMD_SEQ was taken before, and nothing was run now", "REPEATED"}};
constexpr Name kCommands[] = {{1, "tare", "TARE"},
                              {2, "untare", "UNTARE"},
                              {3, "clear latches", "CLEAR_LATCHES"},
                              {4, "start weighing", "START_WEIGHING"},
                              {5, "stop weighing", "STOP_WEIGHING"},
                              {6, "reset peaks", "RESET_PEAKS"},
                              {7, "zero weight", "ZERO_WEIGHT"},
                              {8, "self-test", "SELF_TEST"},
                              {9, "known weight", "KNOWN_WEIGHT"},
                              {10, "teach", "TEACH"}};
constexpr Name kDirectCommands[] = {{1, "tare"},          {2, "untare"},      {3, "clear latches"}, {4, "start weighing"},
                                    {5, "stop weighing"}, {6, "reset peaks"}, {7, "zero weight"},   {9, "known weight"},
                                    {10, "teach"},        {11, "clear slips"}};
constexpr Name kGripperStates[] = {{0, "open", "OPEN"},       {1, "closing", "CLOSING"}, {2, "closed", "CLOSED"},
                                   {3, "lifting", "LIFTING"}, {4, "moving", "MOVING"},   {5, "opening", "OPENING"}};
constexpr Name kSaveStates[] = {{0, "idle"}, {1, "storing"}, {2, "failed"}};
constexpr Name kGripStates[] = {
    {TACTILED_GRIP_OPEN, "open", "OPEN"},          {TACTILED_GRIP_CONTACT, "contact", "CONTACT"},
    {TACTILED_GRIP_GRASPED, "grasped", "GRASPED"}, {TACTILED_GRIP_LIFTING, "lifting", "LIFTING"},
    {TACTILED_GRIP_HOLDING, "holding", "HOLDING"}, {TACTILED_GRIP_SLIPPING, "slipping", "SLIPPING"},
    {TACTILED_GRIP_LOST, "lost", "LOST"}};
constexpr Name kToolBits[] = {{0, "gravity is not known: no value", "GRAVITY"},
                              {1, "a sensor has no value: see NO_VALUE", "SENSOR"},
                              {2, "gravity was not known at the tare of a sensor: no value; tare again, or untare", "TARE"},
                              {3, "a sensor's value is uncertain", "DOUBTED"},
                              {4, "the hand may accelerate, and the robot does not report it: in SD_FX ..", "MOVES"},
                              {5, "a component of the torque is not seen", "TORQUE"},
                              {6, "the sensors' frames are further apart than 50 ms", "APART"},
                              {8, "the value is GOOD", "GOOD"},
                              {9, "uncertain", "UNCERTAIN"},
                              {10, "saturated: a register is at the end of its range", "RANGE"},
                              {15, "no value", "NO_VALUE"}};
#define TACTILED_NAME_OF_PART_(part, word, cause, ...) {TACTILED_OF_##part, word ": " cause, #part},
constexpr Name kParts[] = {TACTILED_PART_TABLE(TACTILED_NAME_OF_PART_)};
#undef TACTILED_NAME_OF_PART_
constexpr Name kComponentBits[] = {{0, "fx"}, {1, "fy"}, {2, "fz"}};
constexpr Name kSlipStates[] = {{0, "none", "NONE"}, {1, "incipient", "INCIPIENT"}, {2, "gross", "GROSS"}};
constexpr Name kWeightStates[] = {
    {0, "none", "NONE"},         {1, "estimating", "ESTIMATING"},         {2, "stable", "STABLE"},
    {3, "overload", "OVERLOAD"}, {4, "not observable", "NOT_OBSERVABLE"}, {5, "temperature", "TEMPERATURE"}};

struct Fault {
    std::uint32_t reason;
    Name name;
};
#define TACTILED_FAULT_(reason, word, best, fault, constant, use, meaning, remedy) \
    {TACTILED_##reason, {fault, meaning, constant}},
constexpr Fault kReasons[] = {TACTILED_REASON_TABLE(TACTILED_FAULT_)};
#undef TACTILED_FAULT_

constexpr bool is_fault(const Fault& one) { return one.name.value != 0; }

constexpr auto kSensorFaultNames = [] {
    std::array<Name, std::size_t(std::count_if(std::begin(kReasons), std::end(kReasons), is_fault)) + 3> names{};
    names[0] = {0, "none", "NONE"};
    names[names.size() - 2] = {kFaultNoSensor, "no sensor has this block", "NO_SENSOR"};
    names[names.size() - 1] = {kFaultUnknown, "a reason that this map does not know", "OTHER"};
    std::size_t n = 1;
    for (const Fault& one : kReasons)
        if (is_fault(one)) names[n++] = one.name;
    return names;
}();

}  // namespace

std::span<const Name> names_of(std::string_view name) {
    if (name == "global.STATUS") return kStatusBits;
    if (name == "global.FAULT") return kFaultBits;
    if (name == "global.WARN") return kWarnBits;
    if (name == "global.CMD_STATE" || name == "command.DIRECT_STATE") return kCommandStates;
    if (name == "global.CMD_RESULT" || name == "command.DIRECT_RESULT") return kCommandResults;
    if (name == "command.DIRECT_CMD") return kDirectCommands;
    if (name == "global.WEIGHT_STATE") return kWeightStates;
    if (name == "doubt.WEIGHT_WHY") return kDoubtBits;
    if (name == "tool.STATUS" || name == "tool_float.STATUS") return kToolBits;
    if (name == "global.GRIP_STATE") return kGripStates;
    if (name == "sensor.SLIP_STATE") return kSlipStates;
    if (name == "sensor.STATUS" || name == "sensor_float.STATUS" || name == "sensor_sd.STATUS") return kSensorStatusBits;
    if (name == "sensor_sd.PART") return kParts;
    if (name == "sensor.FAULT") return kSensorFaultNames;
    if (name == "head.COMPONENTS") return kComponentBits;
    if (name == "control.CMD") return kCommands;
    if (name == "control.GRIPPER_STATE") return kGripperStates;
    if (name == "control.SAVE") return kSaveStates;
    return {};
}

std::uint16_t fault_of(std::uint32_t reasons) {
    for (const Fault& one : kReasons)
        if ((reasons & one.reason) != 0 && is_fault(one)) return one.name.value;
    return 0;
}

}  // namespace tactiled::modbus
