#include "node/modbus/table.hpp"

#include <algorithm>

#include "node/modbus/rows.hpp"

namespace tactiled::modbus {
namespace {

using enum Type;

constexpr Register kConstant[] = {
    {9000, "CONST_U16", text, kNoUnit, "0x1234"},
    {9001, "CONST_I16", text, kNoUnit, "-1234"},
    {9002, "CONST_I32", text, kNoUnit, "0x12345678, high word first"},
    {9004, "CONST_F32_ABCD", text, kNoUnit, "1234.5, high word first"},
    {9006, "CONST_F32_CDAB", text, kNoUnit, "1234.5, low word first"},
    {9008, "CONST_TEXT", text, kNoUnit, "\"ABCDEFGH\""},
};

constexpr std::uint16_t kToolSensorsEnd = kToolFloatSize * kSensorBlocks;
constexpr std::uint16_t kFloatsEnd = kSensorFloatSize * kSensorBlocks;
constexpr std::uint16_t kSdsEnd = kSensorSdSize * kSensorBlocks;

constexpr Bits kCoilRuns[] = {
    {kTareCoils, 16, "TARE",
     "1 tares sensor n; reads 1 during the tare. Every write of a 1 runs: never write these coils cyclically"},
    {kSlipCoils, 16, "CLEAR_SLIP", "1 clears the slip latch of sensor n"},
    {kClearAllCoil, 1, "CLEAR_ALL", "1 clears all latches"},
    {kWeighCoil, 1, "WEIGH", "1 starts weighing; 0, written alone, stops; reads 1 while there is a weight"},
};
constexpr Bits kInputRuns[] = {
    {kContactInputs, 16, "CONTACT", "contact of sensor n", kContact},
    {kSlipInputs, 16, "SLIP_LATCH", "slip latch of sensor n", kSlipLatch},
    {kOkInputs, 16, "OK", "the value of sensor n is GOOD", kOk},
    {kOverloadInputs, 16, "OVERLOAD", "overload of sensor n", kOverload},
    {kGraspedInput, 1, "GRASPED", "STATUS bit 2", kStatus, 2},
    {kStableInput, 1, "WEIGHT_STABLE", "STATUS bit 6", kStatus, 6},
    {kBlinkInput, 1, "BLINK", "1 s on, 1 s off, from the heartbeat: constant while the heartbeat is constant", kHeartbeat},
    {kFaultInput, 1, "FAULT", "STATUS bit 15", kStatus, 15},
};

constexpr Register kView[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {kViewSize - 1, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};
constexpr Copy kOfView[] = {
    {1, kGlobalAt, kGlobalSize}, {33, kGraspAt, kGraspSize},        {41, kDoubtsAt, kDoubtsSize},
    {49, kToolAt, kToolSize},    {69, kSensorsAt, 2 * kSensorSize}, {119, kAgeBoundsAt, 2},
};
// The hints are last, so that a shorter write can leave them out.
constexpr Copy kOfCycle[] = {{0, kCmd, 5}, {5, kPlcHeartbeat, 1}, {6, kGripperState, 2}, {8, kGravityX, 7}};

// True if the copies follow each other from the offset `at` on, and end by `end`.
constexpr bool are_in_order(std::span<const Copy> copies, unsigned at, unsigned end) {
    for (const Copy& copy : copies) {
        if (copy.at != at) return false;
        at += copy.count;
    }
    return at <= end;
}
static_assert(are_in_order(kOfView, 1, kViewSize - 1) && are_in_order(kOfCycle, 0, kCycleSize));

constexpr std::uint16_t kConstantValues[kConstantsSize] = {0x1234, 0xFB2E, 0x1234, 0x5678, 0x449A, 0x5000,
                                                           0x5000, 0x449A, 0x4142, 0x4344, 0x4546, 0x4748};

}  // namespace

std::span<const Area> areas() {
    static const Area all[] = {
        {kGlobalAt, kGlobalSize, Block::global, 0, false, "Global block", "global", global_rows()},
        {kGraspAt, kGraspSize, Block::grasp, 0, false, "Grasp, further registers", "grasp", grasp_rows()},
        {kCommandsAt, kCommandsSize, Block::commands, 0, false, "Commands of this client, further registers", "command",
         command_rows()},
        {kToolAt, kToolSize, Block::tool, 0, false, "Wrench on the gripper", "tool", tool_rows()},
        {kDoubtsAt, kDoubtsSize, Block::doubts, 0, false, "Doubts of the weight", "doubt", doubt_rows()},
        {kSensorsAt, kSensorSize * kSensorBlocks, Block::sensor, kSensorSize, false, "Sensor blocks", "sensor",
         sensor_rows()},
        {kViewAt, kViewSize, Block::view, 0, false, "View of a two-jaw gripper: one read in each cycle", "view", kView,
         kOfView},
        {kFloatsAt, kFloatSize, Block::floats, 0, false, "Floats, high word first", "float", float_rows()},
        {kToolFloatsAt, kToolFloatSize, Block::tool_floats, 0, false, "Wrench on the gripper, high word first", "tool_float",
         tool_float_rows()},
        {kSensorFloatsAt, kFloatsEnd, Block::sensor_floats, kSensorFloatSize, false, "Floats of sensors, high word first",
         "sensor_float", sensor_float_rows()},
        {kToolSensorsAt, kToolSensorsEnd, Block::tool_sensors, kToolFloatSize, false,
         "Parts of that wrench by sensor, high word first", "tool_float", tool_float_rows()},
        {kFloatsAt + kSwapped, kFloatSize, Block::floats, 0, true, "Floats, low word first", "float", float_rows()},
        {kToolFloatsAt + kSwapped, kToolFloatSize, Block::tool_floats, 0, true, "Wrench on the gripper, low word first",
         "tool_float", tool_float_rows()},
        {kSensorFloatsAt + kSwapped, kFloatsEnd, Block::sensor_floats, kSensorFloatSize, true,
         "Floats of sensors, low word first", "sensor_float", sensor_float_rows()},
        {kToolSensorsAt + kSwapped, kToolSensorsEnd, Block::tool_sensors, kToolFloatSize, true,
         "Parts of that wrench by sensor, low word first", "tool_float", tool_float_rows()},
        {kControlsAt, kControlsSize, Block::controls, 0, false, "Commands and settings", "control", control_rows()},
        {kScratchAt, kScratchSize, Block::scratch, 0, false, "Scratch: free registers, to try a client", "scratch", {}},
        {kCycleAt, kCycleSize, Block::cycle, 0, false, "Command and hints: one write in each cycle", "cycle", {}, kOfCycle},
        {kSensorSdsAt, kSdsEnd, Block::sensor_sds, kSensorSdSize, false, "Standard deviations of sensors, high word first",
         "sensor_sd", sensor_sd_rows()},
        {kSensorSdsAt + kSwapped, kSdsEnd, Block::sensor_sds, kSensorSdSize, true,
         "Standard deviations of sensors, low word first", "sensor_sd", sensor_sd_rows()},
        {kConstantsAt, kConstantsSize, Block::constants, 0, false, "Constants, to check base, sign and word order",
         "constant", kConstant},
        {kAgeBoundsAt, kSensorBlocks, Block::age_bounds, 1, false, "Bound of the age, by sensor", "age", age_bound_rows()},
        {kHeadsAt, kHeadSize * kSensorBlocks, Block::heads, kHeadSize, false, "Heads of arrays", "head", head_rows()},
        {kPagesAt, kPageSize * kPages, Block::pages, kPageSize, false, "Pages of the latched array", "page", page_rows()},
    };
    return all;
}

const Area& area_with(Block block, bool low_word_first) {
    const auto all = areas();
    return *std::find_if(all.begin(), all.end(),
                         [&](const Area& a) { return a.block == block && a.low_word_first == low_word_first; });
}

std::span<const Bits> coils() { return kCoilRuns; }
std::span<const Bits> discrete_inputs() { return kInputRuns; }
std::span<const std::uint16_t> constants() { return kConstantValues; }

const Area* area_of(std::uint32_t at, std::uint32_t count) {
    for (const Area& area : areas())
        if (at >= area.at && at + count <= std::uint32_t(area.at) + area.size) {
            const bool is_cut = area.is_latched() && (at - area.at) % area.repeats + count > area.repeats;
            return is_cut ? nullptr : &area;
        }
    return nullptr;
}

std::span<const Area> areas_in(std::uint32_t at, std::uint32_t count) {
    const auto all = areas();
    const auto first = std::find_if(all.begin(), all.end(), [&](const Area& a) { return a.at + a.size > at; });
    const auto last = std::find_if(first, all.end(), [&](const Area& a) { return a.at >= at + count; });
    return {first, last};
}

std::uint16_t origin_of(std::uint16_t at) {
    const Area* const area = area_of(at, 1);
    if (area == nullptr) return at;
    for (const Copy& copy : area->copies)
        if (const int i = at - area->at - copy.at; i >= 0 && i < copy.count) return std::uint16_t(copy.from + i);
    return at;
}

const Register* writable_at(std::uint32_t address) {
    const unsigned at = origin_of(std::uint16_t(address));
    for (const Register& r : control_rows())
        if (r.at == at) return &r;
    return nullptr;
}

}  // namespace tactiled::modbus
