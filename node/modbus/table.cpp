#include "node/modbus/table.hpp"

#include <array>

#include "tactiled/layout.h"

namespace tactiled::modbus {
namespace {

constexpr Register kGlobal[] = {
    {kMagic0, "MAGIC0", Type::text, "", "0x5441 \"TA\"; reading 0x4354 here: the client is off by one"},
    {kMagic1, "MAGIC1", Type::text, "", "0x4354 \"CT\""},
    {kMapVersion, "MAP_VER", Type::text, "", "256 * major + minor; a minor version only adds"},
    {kSensors, "N_SENSORS", Type::u16, "", "1 .. 16"},
    {kSeq, "SEQ", Type::count, "", "number of the published frame, wraps"},
    {kHeartbeat, "HEARTBEAT", Type::count, "1 / 100 ms", "stops when acquisition, the loop or every sensor stops"},
    {kAgeMs, "AGE_MS", Type::u16, "ms", "age of the newest sensor frame when the answer was built; 65534 = that or more"},
    {kStatus, "STATUS", Type::bits, "", "state of the node"},
    {kFault, "FAULT", Type::bits, "", "latched"},
    {kWarn, "WARN", Type::bits, "", "true now"},
    {kOk, "OK", Type::mask, "", "the sensor's value is GOOD"},
    {kContact, "CONTACT", Type::mask, "", "not yet measured: 0"},
    {kSlip, "SLIP", Type::mask, "", "not yet measured: 0"},
    {kSlipLatch, "SLIP_LATCH", Type::mask, "", "not yet measured: 0"},
    {kOverload, "OVERLOAD", Type::mask, "", "a channel is at its rail, or a register saturates"},
    {kStale, "STALE", Type::mask, "", "the sensor delivers nothing"},
    {kGripForce, "GRIP_FORCE", Type::u16, "0.01 N", "not yet measured: 0xFFFF"},
    {kGripState, "GRIP_STATE", Type::enumeration, "", "not yet measured: 0xFFFF"},
    {kWeightG, "WEIGHT_G", Type::u16, "1 g", "not yet measured: 0xFFFF"},
    {kWeightState, "WEIGHT_STATE", Type::enumeration, "", "not yet measured: 0"},
    {kWeight, "WEIGHT", Type::i32, "0.1 g", "not yet measured: 0x80000000"},
    {kWeightSd, "WEIGHT_SD", Type::u16, "0.1 g", "not yet measured: 0xFFFF"},
    {kRecGrip, "REC_GRIP", Type::u16, "0.01 N", "not yet measured: 0xFFFF"},
    {kSlipCount, "SLIP_COUNT", Type::count, "", "not yet measured: 0"},
    {kCmdSeqAck, "CMD_SEQ_ACK", Type::count, "", "number of the last command taken"},
    {kCmdState, "CMD_STATE", Type::enumeration, "", "of that command"},
    {kCmdResult, "CMD_RESULT", Type::enumeration, "", "of that command"},
    {kCalId, "CAL_ID", Type::text, "", "CRC-16 of configuration and calibrations: changes when either does"},
    {kPlcHbEcho, "PLC_HB_ECHO", Type::count, "", "not yet writable: 0"},
    {kCycleWorst, "CYCLE_WORST", Type::u16, "us", "worst turn of the pipeline within the last second"},
    {kSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kSensor[] = {
    {kSensorSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kSensorStatus, "STATUS", Type::bits, "", "state of this sensor"},
    {kSensorFault, "FAULT", Type::enumeration, "", "why the value is not GOOD: the gravest reason"},
    {kSensorAgeMs, "AGE_MS", Type::u16, "ms", "since the last byte of its frame; 65534 = that or more"},
    {kFx, "FX", Type::i16, "0.01 N", "force on the sensor, frame S: x along the connector"},
    {kFy, "FY", Type::i16, "0.01 N", ""},
    {kFz, "FZ", Type::i16, "0.01 N", "z out of the skin: a press is negative"},
    {kTx, "TX", Type::i16, "0.001 Nm", "torque on the sensor, frame S"},
    {kTy, "TY", Type::i16, "0.001 Nm", ""},
    {kTz, "TZ", Type::i16, "0.001 Nm", ""},
    {kFTang, "F_TANG", Type::u16, "0.01 N", "magnitude of (FX, FY)"},
    {kFMag, "F_MAG", Type::u16, "0.01 N", "magnitude of (FX, FY, FZ)"},
    {kCopX, "COP_X", Type::i16, "0.01 mm", "centre of pressure"},
    {kCopY, "COP_Y", Type::i16, "0.01 mm", ""},
    {kFrictionUse, "FRICTION_USE", Type::u16, "0.1 %", "not yet measured: 0xFFFF"},
    {kSlipState, "SLIP_STATE", Type::enumeration, "", "not yet measured: 0xFFFF"},
    {kSensorSlipCount, "SLIP_COUNT", Type::count, "", "not yet measured: 0"},
    {kPeak, "PEAK", Type::u16, "0.01 N", "not yet measured: 0xFFFF"},
    {kTemp, "TEMP", Type::i16, "0.1 degC", "0x8000: the sensor has none"},
    {kScale, "SCALE", Type::i16, "", "power of ten of the forces: -2"},
    {kTareCount, "TARE_COUNT", Type::count, "", "finished tares; 0 = none in force"},
    {kRate, "RATE", Type::u16, "Hz", "measured over a second"},
    {kLost, "LOST", Type::count, "", "frames known to be lost"},
    {kRawState, "RAW_STATE", Type::bits, "", "bit n: channel n is missing or at its rail (channels 0 .. 15)"},
    {kSensorSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kConstant[] = {
    {9000, "CONST_U16", Type::text, "", "0x1234"},
    {9001, "CONST_I16", Type::text, "", "-1234"},
    {9002, "CONST_I32", Type::text, "", "0x12345678, high word first"},
    {9004, "CONST_F32_ABCD", Type::text, "", "1234.5, high word first"},
    {9006, "CONST_F32_CDAB", Type::text, "", "1234.5, low word first"},
    {9008, "CONST_TEXT", Type::text, "", "\"ABCDEFGH\""},
};

constexpr Area kAreas[] = {
    {kGlobalAt, kGlobalSize, "Global block", kGlobal},
    {kSensorsAt, kSensorSize* kSensorBlocks, "Sensor blocks", kSensor},
    {kConstantsAt, kConstantsSize, "Constants", kConstant},
};

constexpr std::uint16_t kConstantValues[kConstantsSize] = {0x1234, 0xFB2E, 0x1234, 0x5678, 0x449A, 0x5000,
                                                           0x5000, 0x449A, 0x4142, 0x4344, 0x4546, 0x4748};

constexpr Name kStatusBits[] = {{0, "ready"},
                                {7, "overload: see OVERLOAD"},
                                {8, "taring"},
                                {9, "simulated or replayed data"},
                                {10, "stale"},
                                {11, "uncalibrated"},
                                {14, "warning: see WARN"},
                                {15, "fault: see FAULT"}};
constexpr Name kFaultBits[] = {{0, "sensor lost"},         {1, "overrange"}, {2, "open gauge"}, {3, "pipeline overrun"},
                               {4, "calibration missing"}, {7, "bus error"}, {8, "internal"}};
constexpr Name kWarnBits[] = {{2, "lost samples"}};
constexpr Name kSensorStatusBits[] = {{0, "ok: the value is GOOD"},
                                      {4, "overload: a force register saturates"},
                                      {5, "saturated channel"},
                                      {6, "stale: no data"},
                                      {7, "taring"},
                                      {8, "tared"},
                                      {9, "uncalibrated"},
                                      {12, "uncertain: a value with a weakness; FAULT says which"},
                                      {15, "fault: no value; FAULT says why"}};
constexpr Name kCommandStates[] = {{0, "idle"}, {1, "running"}, {2, "done"}, {3, "rejected"}};
constexpr Name kCommandResults[] = {{0, "ok"},      {1, "unknown"}, {2, "bad mask"}, {3, "bad parameter"},
                                    {4, "not now"}, {5, "locked"},  {6, "failed"},   {7, "timed out"}};
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
    {TACTILED_WRONG_DEVICE, {5, "wrong device: its frames have another number of channels"}},
    {TACTILED_NOT_FINITE, {6, "result is no number"}},
    {TACTILED_MISSING_CHANNEL, {7, "missing channel"}},
    {TACTILED_UNCALIBRATED, {8, "uncalibrated"}},
    {TACTILED_SATURATED, {9, "saturated channel"}},
    {TACTILED_DISAGREEMENT, {10, "channels contradict each other"}},
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

std::span<const Register> global_registers() { return kGlobal; }
std::span<const Register> sensor_registers() { return kSensor; }
std::span<const Register> constant_registers() { return kConstant; }
std::span<const Area> areas() { return kAreas; }
std::span<const std::uint16_t> constants() { return kConstantValues; }

const Area* area_of(std::uint32_t at, std::uint32_t count) {
    for (const Area& area : kAreas)
        if (at >= area.at && at + count <= std::uint32_t(area.at) + area.size) return &area;
    return nullptr;
}

std::span<const Name> names_of(std::string_view name) {
    if (name == "global.STATUS") return kStatusBits;
    if (name == "global.FAULT") return kFaultBits;
    if (name == "global.WARN") return kWarnBits;
    if (name == "global.CMD_STATE") return kCommandStates;
    if (name == "global.CMD_RESULT") return kCommandResults;
    if (name == "global.WEIGHT_STATE") return kWeightStates;
    if (name == "sensor.STATUS") return kSensorStatusBits;
    if (name == "sensor.FAULT") return kSensorFaultNames;
    return {};
}

std::uint16_t fault_of(std::uint32_t reasons) {
    for (const Fault& fault : kSensorFaults)
        if ((reasons & fault.reason) != 0) return fault.name.value;
    return 0;
}

}  // namespace tactiled::modbus
