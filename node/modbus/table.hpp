// The register map, defined once: the server, `tactilectl map`, the manual, the PLC code and the tests are all made
// from these tables.
#pragma once
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

#include "tactiled/layout.h"

namespace tactiled::modbus {

inline constexpr std::uint16_t kMapMajor = 1, kMapMinor = 10;

// "Not available" as in SunSpec; a measured value saturates one step before.
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
    f32,    // two registers, in the word order of the area; a quiet NaN = not available
    text,   // a constant
};

// Cells that other code refers to: offsets in a block, or addresses. All other rows state their number.
// clang-format off
enum Global : std::uint16_t {
    kMagic0 = 0, kMagic1 = 1, kMapVersion = 2, kSensors = 3, kSeq = 4, kHeartbeat = 5, kStatus = 7, kOk = 10, kContact = 11,
    kSlipLatch = 13, kOverload = 14, kCmdSeqAck = 25, kCmdState = 26, kCmdResult = 27, kPlcHbEcho = 29, kSeqEnd = 31
};
enum : std::uint16_t { kGraspSeq = 0, kGraspSeqEnd = 7 };
enum : std::uint16_t { kSensorStatus = 1, kScale = 19, kSensorSeqEnd = 24 };
enum : std::uint16_t { kToken = 0, kArrayStatus = 2, kArrayPages = 9 };
enum : std::uint16_t {
    kCmd = 5000, kCmdMask = 5001, kCmdParamHigh = 5002, kCmdParamLow = 5003, kCmdSeq = 5004, kTareCell = 5010, kUntareCell = 5011,
    kClearLatchCell = 5012, kWeighCell = 5013, kResetPeakCell = 5014, kTeachCell = 5015, kZeroWeightCell = 5016, kKnownWeightCell = 5017, kPlcHeartbeat = 5020, kPlcWatchdog = 5021, kGripperState = 5022,
    kGripperForce = 5023, kFilterHz = 5030, kContactOn = 5031, kContactOff = 5032, kOverloadAt = 5033, kSlipSensitivity = 5034,
    kWeighWindow = 5035, kGravityX = 5040, kAccelX = 5043, kAccelCount = 5046, kUnlock = 5090, kSave = 5091
};
enum CommandCode : std::uint16_t {
    kTare = 1, kUntare = 2, kClearLatches = 3, kStartWeighing = 4, kStopWeighing = 5, kResetPeaks = 6, kZeroWeight = 7, kSelfTest = 8,
    kKnownWeight = 9, kTeach = 10, kClearSlips = 11  // the last one by coils only
};
// clang-format on

inline constexpr std::uint16_t kGlobalAt = 0, kGlobalSize = 32;
inline constexpr std::uint16_t kGraspAt = 40, kGraspSize = 8;
inline constexpr std::uint16_t kCommandsAt = 50, kCommandsSize = 8;
inline constexpr std::uint16_t kToolAt = 60, kToolSize = 20;
inline constexpr std::uint16_t kDoubtsAt = 80, kDoubtsSize = 8;
inline constexpr std::uint16_t kSensorsAt = 100, kSensorSize = 25, kSensorBlocks = 16;
// The registers that a gripper with two jaws needs in each cycle: one request to read, one to write. They are copies.
inline constexpr std::uint16_t kViewAt = 600, kViewSize = 125, kCycleAt = 5300, kCycleSize = 15;
inline constexpr std::uint16_t kFloatsAt = 2000, kFloatSize = 26, kSensorFloatsAt = 2100, kSensorFloatSize = 25;
inline constexpr std::uint16_t kToolFloatsAt = 2030, kToolFloatSize = 28, kToolSensorsAt = 2500;
inline constexpr std::uint16_t kSensorSdsAt = 6000, kSensorSdSize = 20;
inline constexpr std::uint16_t kSwapped = 1000;  // from a float register to its copy with the low word first
inline constexpr std::uint16_t kControlsAt = 5000, kControlsSize = 100, kScratchAt = 5100, kScratchSize = 128;
inline constexpr std::uint16_t kConstantsAt = 9000, kConstantsSize = 12;
inline constexpr std::uint16_t kAgeBoundsAt = 9100;
// The taxels of an array: reading the token in the head of a sensor latches them for the connection; the pages are those of
// the array that was latched last. All pages of all sensors would exceed the addresses.
inline constexpr std::uint16_t kHeadsAt = 10000, kHeadSize = 16;
inline constexpr std::uint16_t kPagesAt = 11000, kPageSize = 125, kPageValues = kPageSize - 1;
inline constexpr std::uint16_t kPages = (TACTILED_MAX_TAXELS * 3 + kPageValues - 1) / kPageValues;
inline constexpr unsigned kExpires_s = 5;  // a snapshot, after the latch: see Taxels
inline constexpr std::uint16_t kMapEnd = kPagesAt + kPages * kPageSize;

inline constexpr std::uint16_t kUnlockWord = 0x5AFE, kSaveWord = 0x7361;
inline constexpr std::uint16_t kAsConfigured = 0xFFFF;  // a setting with this value uses the configuration

// The text of a unit, and one count of an integer register in the unit of its value: N, Nm, m, kg, degC, Hz, 1.
struct Unit {
    std::string_view text{};
    double scale = 1;
    bool configurable = false;  // true: the sensor's register_N replaces the scale
};

// The data that the blocks are encoded from: rows.hpp.
struct Source;

// The function that a register's value comes from; NaN = not available. It is made from a function or from a lambda
// without captures. Registers that may be written have none: Controls keeps their words.
struct Value {
    double (*of)(const Source&) noexcept = nullptr;
    bool reports_range = false;     // a bit of STATUS reports that the value exceeds the range of the register
    std::uint16_t unread = 0xFFFF;  // the PLC's text shows this for a word of bits without a fresh read: the worst

    constexpr Value() = default;
    constexpr Value(double (*function)(const Source&) noexcept) : of(function) {}
    template <class Lambda>
    requires std::is_empty_v<Lambda>
    constexpr Value(Lambda) : of([](const Source& s) noexcept { return double(Lambda{}(s)); }) {}
};

// Values that may be written into a register; `max` < `min`: none.
struct Limits {
    std::uint16_t min = 1, max = 0;
    bool locked = false;       // needs UNLOCK; kAsConfigured is allowed, too
    bool may_be_none = false;  // kNoU16 is allowed, too
};

struct Register {
    std::uint16_t at;  // address, or offset in its block
    std::string_view name;
    Type type;
    Unit unit;
    std::string_view meaning;
    Value value{};
    Limits limits{};

    [[nodiscard]] constexpr bool is_writable() const noexcept { return limits.max >= limits.min; }
};

struct Name {
    std::uint16_t value;  // bit number, or value of an enumeration
    std::string_view name;
    std::string_view id{};  // part of a constant's name in PLC code; "" = no constant
};

enum class Block {
    global,
    grasp,
    commands,
    tool,
    doubts,
    sensor,
    view,
    floats,
    tool_floats,
    sensor_floats,
    tool_sensors,
    controls,
    scratch,
    cycle,
    constants,
    age_bounds,
    sensor_sds,
    heads,
    pages
};

// Cells of an area that are those of other addresses: offset in the area, address of the first one, number.
struct Copy {
    std::uint16_t at, from, count;
};

// A run of addresses; cells without an entry read 0.
struct Area {
    std::uint16_t at, size;
    Block block;
    std::uint16_t repeats;  // number of registers per sensor or page, 0 = not repeated
    bool low_word_first;
    std::string_view title;
    std::string_view prefix;  // for names_of()
    std::span<const Register> registers;
    std::span<const Copy> copies{};

    [[nodiscard]] constexpr bool is_latched() const noexcept { return block == Block::heads || block == Block::pages; }
    // True for registers that may be written, which are no input registers (FC 4).
    [[nodiscard]] constexpr bool is_holding_only() const noexcept {
        return block == Block::controls || block == Block::scratch || block == Block::cycle;
    }
};

// Returns the areas in the order of addresses. Sensor blocks are one area, because they are contiguous.
std::span<const Area> areas();
// Returns the area of a block, in one of its word orders.
const Area& area_with(Block block, bool low_word_first = false);
// Returns the area that contains all of [at, at + count), which are of one head or page there, or nullptr: exception 2.
const Area* area_of(std::uint32_t at, std::uint32_t count);
// Returns the areas that share a cell with [at, at + count). Unnamed addresses between them read 0.
std::span<const Area> areas_in(std::uint32_t at, std::uint32_t count);
// Returns the address whose copy is at `at`: `at` itself, if it is no copy.
std::uint16_t origin_of(std::uint16_t at);
// Returns the register that may be written at an address or is copied there, or nullptr. Scratch registers have no entry.
const Register* writable_at(std::uint32_t at);

// Returns bit and value names of a register, by "global.NAME" or "sensor.NAME"; empty if it has none.
std::span<const Name> names_of(std::string_view register_name);

// Coils (may be written) and discrete inputs: runs of bits.
struct Bits {
    std::uint16_t at, count;
    std::string_view name;
    std::string_view meaning;
    Global from{};  // inputs: the register of the global block, and the bit of the first input; BLINK is its tens
    std::uint16_t bit = 0;
};
inline constexpr std::uint16_t kTareCoils = 0, kSlipCoils = 16, kClearAllCoil = 32, kWeighCoil = 33, kCoils = 34;
inline constexpr std::uint16_t kContactInputs = 0, kSlipInputs = 16, kOkInputs = 32, kOverloadInputs = 48,
                               kGraspedInput = 64, kStableInput = 65, kBlinkInput = 66, kFaultInput = 67, kInputs = 68;
std::span<const Bits> coils();
std::span<const Bits> discrete_inputs();

// Returns the constants of 9000, as they are on the wire.
std::span<const std::uint16_t> constants();

// Returns the reason why a sensor block has no valid value: SensorFault for the first reason that is set (enum
// tactiled_reason).
std::uint16_t fault_of(std::uint32_t reasons);
inline constexpr std::uint16_t kFaultNoSensor = 15, kFaultUnknown = 16;

}  // namespace tactiled::modbus
