// The register map, once: the server, `tactilectl map`, the manual and the tests are all made from these tables.
#pragma once
#include <cstdint>
#include <span>
#include <string_view>

namespace tactiled::modbus {

inline constexpr std::uint16_t kMapMajor = 1, kMapMinor = 0;

// Not available, as SunSpec has it; a measured value saturates one step before.
inline constexpr std::uint16_t kNoI16 = 0x8000, kNoU16 = 0xFFFF;
inline constexpr std::uint32_t kNoI32 = 0x80000000;

enum class Type {
    u16,   // a number; 0xFFFF = not available
    i16,   // two's complement; 0x8000 = not available
    bits,  // see the bit names
    mask,  // bit n = sensor n
    enumeration,
    count,  // wraps at 65536, has no "not available"
    i32,    // two registers, high word first; 0x80000000 = not available
    text,   // a constant
};

// Cells of the global block, by their address; of a sensor block, by their offset. The encoder fills them by these names.
// clang-format off
enum Global : std::uint16_t {
    kMagic0 = 0, kMagic1 = 1, kMapVersion = 2, kSensors = 3, kSeq = 4, kHeartbeat = 5, kAgeMs = 6, kStatus = 7, kFault = 8, kWarn = 9,
    kOk = 10, kContact = 11, kSlip = 12, kSlipLatch = 13, kOverload = 14, kStale = 15, kGripForce = 16, kGripState = 17, kWeightG = 18,
    kWeightState = 19, kWeight = 20, kWeightSd = 22, kRecGrip = 23, kSlipCount = 24, kCmdSeqAck = 25, kCmdState = 26, kCmdResult = 27,
    kCalId = 28, kPlcHbEcho = 29, kCycleWorst = 30, kSeqEnd = 31
};
enum PerSensor : std::uint16_t {
    kSensorSeq = 0, kSensorStatus = 1, kSensorFault = 2, kSensorAgeMs = 3, kFx = 4, kFy = 5, kFz = 6, kTx = 7, kTy = 8, kTz = 9,
    kFTang = 10, kFMag = 11, kCopX = 12, kCopY = 13, kFrictionUse = 14, kSlipState = 15, kSensorSlipCount = 16, kPeak = 17, kTemp = 18,
    kScale = 19, kTareCount = 20, kRate = 21, kLost = 22, kRawState = 23, kSensorSeqEnd = 24
};
// clang-format on

inline constexpr std::uint16_t kGlobalAt = 0, kGlobalSize = 32;
inline constexpr std::uint16_t kSensorsAt = 100, kSensorSize = 25, kSensorBlocks = 16;
inline constexpr std::uint16_t kConstantsAt = 9000, kConstantsSize = 12;

struct Register {
    std::uint16_t at;  // address, or offset in the sensor block
    std::string_view name;
    Type type;
    std::string_view unit;  // scale and unit, "" = none
    std::string_view meaning;
};

struct Name {
    std::uint16_t value;  // bit number, or value of an enumeration
    std::string_view name;
};

// A run of addresses that is readable as a whole; cells without an entry read 0.
struct Area {
    std::uint16_t at, size;
    std::string_view title;
    std::span<const Register> registers;
};

std::span<const Register> global_registers();
std::span<const Register> sensor_registers();
std::span<const Register> constant_registers();
// In the order of addresses. Sensor blocks are one area: they follow each other without a hole.
std::span<const Area> areas();
// The area that holds all of [at, at + count), or nullptr: exception 2.
const Area* area_of(std::uint32_t at, std::uint32_t count);

// Bit and value names of a register, by "global.NAME" or "sensor.NAME"; empty where it has none.
std::span<const Name> names_of(std::string_view register_name);

// The constants of 9000, as they stand on the wire.
std::span<const std::uint16_t> constants();

// Why a sensor block has no trustworthy value: SensorFault by the first reason that is set (enum tactiled_reason).
std::uint16_t fault_of(std::uint32_t reasons);
inline constexpr std::uint16_t kFaultNoSensor = 15, kFaultUnknown = 16;

}  // namespace tactiled::modbus
