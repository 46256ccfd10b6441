#include "node/modbus/table.hpp"

#include <array>

#include "tactiled/layout.h"

namespace tactiled::modbus {
namespace {

// ---- names of bits and values ------------------------------------------------------------------------------------

constexpr Name kStatusBits[] = {
    {0, "ready: every sensor has a value"},
    {7, "overload: a sensor of OVERLOAD"},
    {8, "taring"},
    {9, "simulated or replayed data"},
    {10, "stale: a sensor of STALE"},
    {11, "uncalibrated"},
    {14, "warning: see WARN"},
    {15, "fault: see FAULT"},
};
constexpr Name kFaultBits[] = {
    {0, "sensor lost"},         {1, "overrange"}, {2, "open gauge"}, {3, "pipeline overrun"},
    {4, "calibration missing"}, {7, "bus error"}, {8, "internal"},
};
constexpr Name kWarnBits[] = {{2, "lost samples"}};
constexpr Name kCommandStates[] = {{0, "idle"}, {1, "running"}, {2, "done"}, {3, "rejected"}};
constexpr Name kCommandResults[] = {
    {0, "ok"},      {1, "unknown"}, {2, "bad mask"}, {3, "bad parameter"},
    {4, "not now"}, {5, "locked"},  {6, "failed"},   {7, "timed out"},
};
constexpr Name kWeightStates[] = {{0, "none"}, {1, "estimating"}, {2, "stable"}, {3, "overload"}, {4, "not observable"}};
constexpr Name kGripStates[] = {
    {0, "open"}, {1, "contact"}, {2, "grasped"}, {3, "lifting"}, {4, "holding"}, {5, "slipping"}, {6, "lost"},
};
constexpr Name kSlipStates[] = {{0, "none"}, {1, "incipient"}, {2, "gross"}};
constexpr Name kSensorStatusBits[] = {
    {0, "ok: the value is GOOD"},
    {4, "overload: a value left the range of its register"},
    {5, "saturated: a channel is at its rail"},
    {6, "stale: no data"},
    {7, "taring"},
    {8, "tared"},
    {9, "uncalibrated"},
    {12, "uncertain: a value with a weakness that FAULT names"},
    {15, "fault: no value; FAULT says why"},
};

// Gravest first. The numbers are the map's: they do not follow enum tactiled_reason, and none is ever used again.
struct Fault {
    std::uint32_t reason;
    Name name;
};
constexpr Fault kReasons[] = {
    {TACTILED_DAEMON_STOPPED, {1, "daemon stopped or hangs"}},
    {TACTILED_DISCONNECTED, {2, "disconnected"}},
    {TACTILED_NO_DATA_YET, {3, "no data yet"}},
    {TACTILED_STALE, {4, "stale"}},
    {TACTILED_WRONG_DEVICE, {5, "wrong device: its frames have too few channels"}},
    {TACTILED_NOT_FINITE, {6, "result is no number"}},
    {TACTILED_MISSING_CHANNEL, {7, "missing channel"}},
    {TACTILED_SATURATED, {9, "saturated channel"}},
    {TACTILED_DISAGREEMENT, {10, "channels contradict each other"}},
    {TACTILED_OUTSIDE_DOMAIN, {11, "outside the calibrated domain"}},
    {TACTILED_UNCALIBRATED, {8, "uncalibrated"}},
    {TACTILED_UNKNOWN_UNCERTAINTY, {12, "uncertainty unknown"}},
    {TACTILED_READER_OVERRUN, {13, "read overrun: ask again"}},
    {TACTILED_TARING, {14, "taring"}},
};

constexpr auto kSensorFaults = [] {
    std::array<Name, std::size(kReasons) + 3> names{};
    names[0] = {0, "none: the value is GOOD"};
    for (const Fault& fault : kReasons) names[fault.name.value] = fault.name;
    names[kFaultNoSensor] = {kFaultNoSensor, "no sensor has this block"};
    names[kFaultUnknown] = {kFaultUnknown, "a reason that this version does not know"};
    return names;
}();

// ---- registers -----------------------------------------------------------------------------------------------------

constexpr Register kGlobal[] = {
    {kMagic0, "MAGIC0", Type::constant, "", "0x5441 \"TA\"; who reads 0x4354 here is off by one"},
    {kMagic1, "MAGIC1", Type::constant, "", "0x4354 \"CT\""},
    {kMapVersion, "MAP_VER", Type::constant, "", "major << 8 | minor; a minor version only adds"},
    {kSensors, "N_SENSORS", Type::u16, "", "1 .. 16; 0xFFFF: no daemon's data can be read"},
    {kSeq, "SEQ", Type::count, "", "number of the published frame, wraps"},
    {kHeartbeat, "HEARTBEAT", Type::count, "1 / 100 ms", "stops when acquisition, the loop or every sensor stops"},
    {kAgeMs, "AGE_MS", Type::u16, "ms", "age of the newest sensor frame when the answer was built; 65534 = that or more"},
    {kStatus, "STATUS", Type::bits, "", "of the node", kStatusBits},
    {kFault, "FAULT", Type::bits, "", "latched", kFaultBits},
    {kWarn, "WARN", Type::bits, "", "true now", kWarnBits},
    {kOk, "OK", Type::mask, "", "the sensor's value is GOOD; UNCERTAIN is not: see the sensor's STATUS"},
    {kContact, "CONTACT", Type::mask, "", "not yet measured: 0"},
    {kSlip, "SLIP", Type::mask, "", "not yet measured: 0"},
    {kSlipLatch, "SLIP_LATCH", Type::mask, "", "not yet measured: 0"},
    {kOverload, "OVERLOAD", Type::mask, "", "a channel is at its rail, or a value left the range of its register"},
    {kStale, "STALE", Type::mask, "", "the sensor delivers nothing"},
    {kGripForce, "GRIP_FORCE", Type::u16, "0.01 N", "not yet measured: 0xFFFF"},
    {kGripState, "GRIP_STATE", Type::enumeration, "", "not yet measured: 0xFFFF", kGripStates},
    {kWeightG, "WEIGHT_G", Type::u16, "1 g", "not yet measured: 0xFFFF"},
    {kWeightState, "WEIGHT_STATE", Type::enumeration, "", "not yet measured: 0", kWeightStates},
    {kWeight, "WEIGHT", Type::i32, "0.1 g", "not yet measured: 0x80000000"},
    {kWeightSd, "WEIGHT_SD", Type::u16, "0.1 g", "not yet measured: 0xFFFF"},
    {kRecGrip, "REC_GRIP", Type::u16, "0.01 N", "not yet measured: 0xFFFF"},
    {kSlipCount, "SLIP_COUNT", Type::count, "", "not yet measured: 0"},
    {kCmdSeqAck, "CMD_SEQ_ACK", Type::count, "", "number of the last command taken"},
    {kCmdState, "CMD_STATE", Type::enumeration, "", "of that command", kCommandStates},
    {kCmdResult, "CMD_RESULT", Type::enumeration, "", "of that command", kCommandResults},
    {kCalId, "CAL_ID", Type::word, "", "CRC-16 of configuration and calibrations: changes when one of them does"},
    {kPlcHbEcho, "PLC_HB_ECHO", Type::count, "", "not yet writable: 0"},
    {kCycleWorst, "CYCLE_WORST", Type::u16, "us", "worst turn of the pipeline within the last second; 65534 = that or more"},
    {kSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kSensor[] = {
    {kSensorSeq, "SEQ", Type::count, "", "as in the global block: blocks of two requests with one SEQ are of one frame"},
    {kSensorStatus, "STATUS", Type::bits, "", "of this sensor", kSensorStatusBits},
    {kSensorFault, "FAULT", Type::enumeration, "", "why the value is not GOOD: the gravest reason", kSensorFaults},
    {kSensorAgeMs, "AGE_MS", Type::u16, "ms", "since the last byte of its frame; 65534 = that or more; no frame ever: 0xFFFF"},
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
    {kSlipState, "SLIP_STATE", Type::enumeration, "", "not yet measured: 0xFFFF", kSlipStates},
    {kSensorSlipCount, "SLIP_COUNT", Type::count, "", "not yet measured: 0"},
    {kPeak, "PEAK", Type::u16, "0.01 N", "not yet measured: 0xFFFF"},
    {kTemp, "TEMP", Type::i16, "0.1 degC", "0x8000: the sensor has none"},
    {kScale, "SCALE", Type::i16, "", "power of ten of the forces in N: -2"},
    {kTareCount, "TARE_COUNT", Type::count, "", "finished tares; 0 = none in force"},
    {kRate, "RATE", Type::u16, "Hz", "measured over a second"},
    {kLost, "LOST", Type::count, "", "frames known to be lost"},
    {kRawState, "RAW_STATE", Type::word, "", "bit n: channel n is missing or at its rail (channels 0 .. 15)"},
    {kSensorSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kConstant[] = {
    {kConstantsAt + 0, "CONST_U16", Type::constant, "", "0x1234"},
    {kConstantsAt + 1, "CONST_I16", Type::constant, "", "-1234"},
    {kConstantsAt + 2, "CONST_I32", Type::constant, "", "0x12345678 in two registers, high word first"},
    {kConstantsAt + 4, "CONST_F32_ABCD", Type::constant, "", "1234.5 in two registers, high word first"},
    {kConstantsAt + 6, "CONST_F32_CDAB", Type::constant, "", "1234.5 in two registers, low word first"},
    {kConstantsAt + 8, "CONST_TEXT", Type::constant, "", "\"ABCDEFGH\" in four registers"},
};

constexpr std::uint16_t kConstantValues[kConstantsSize] = {0x1234, 0xFB2E, 0x1234, 0x5678, 0x449A, 0x5000,
                                                           0x5000, 0x449A, 0x4142, 0x4344, 0x4546, 0x4748};

constexpr Area kAreas[] = {
    {kGlobalAt, kGlobalSize, kGlobalSize, "global block", "One read of 32 registers is all that a scan needs.", kGlobal},
    {kSensorsAt, kSensorSize* kSensorBlocks, kSensorSize, "one block of 25 registers a sensor",
     "Sensor n = 0 .. 15 has its block at 100 + 25 n. Five blocks fit one read of 125 registers. A block without a sensor holds\n"
     "\"not available\" and FAULT 15.",
     kSensor},
    {kConstantsAt, kConstantsSize, kConstantsSize, "constants",
     "They check base address, sign and word order before anything moves.", kConstant},
};

constexpr Name kIdentification[] = {
    {0, "tactiled"},       // VendorName
    {1, "tactiled"},       // ProductCode
    {2, TACTILED_VERSION}, // MajorMinorRevision
    {4, "Tactile sensors: forces, torques, quality"},
    {5, "tactiled register map 1"},
};

}  // namespace

std::span<const Area> areas() { return kAreas; }
std::span<const std::uint16_t> constants() { return kConstantValues; }
std::span<const Name> identification() { return kIdentification; }

const Area* area_of(std::uint32_t at, std::uint32_t count) {
    for (const Area& area : kAreas)
        if (at >= area.at && at + count <= std::uint32_t(area.at) + area.size) return &area;
    return nullptr;
}

std::uint16_t fault_of(std::uint32_t reasons) {
    for (const Fault& fault : kReasons)
        if ((reasons & fault.reason) != 0) return fault.name.value;
    return kFaultUnknown;
}

}  // namespace tactiled::modbus
