// The registers that may be written. Controls keeps their words, and decode() gives their values.
#include "node/modbus/rows.hpp"

namespace tactiled::modbus {
namespace {

constexpr Value kKept{};
constexpr Limits kAny{0, 65535};

// Values of a register, and of a setting, which needs UNLOCK.
constexpr Limits range(std::uint16_t min, std::uint16_t max) { return {min, max, false}; }
constexpr Limits range_or_none(std::uint16_t min, std::uint16_t max) { return {min, max, false, true}; }
constexpr Limits locked(std::uint16_t min, std::uint16_t max) { return {min, max, true}; }

using enum Type;

constexpr Register kControls[] = {
    {kCmd, "CMD", enumeration, kNoUnit, "the command; runs when CMD_SEQ is written with another value", kKept, kAny},
    {kCmdMask, "MASK", mask, kNoUnit, "the sensors that it is for", kKept, kAny},
    {kCmdParamHigh, "PARAM_H", u16, kNoUnit, "parameter, high word; known weight: in 0.1 g, teach: the object's id", kKept,
     kAny},
    {kCmdParamLow, "PARAM_L", u16, kNoUnit, "parameter, low word", kKept, kAny},
    {kCmdSeq, "CMD_SEQ", count, kNoUnit,
     "any value but the last of this client: CMD_SEQ_ACK repeats it, and CMD_STATE and CMD_RESULT report the command. The "
     "first one after a start of the daemon is adopted and not run (CMD_RESULT 11): write another one. The block may be "
     "written in every cycle",
     kKept, kAny},
    {kTareCell, "TARE", mask, kNoUnit,
     "tares these sensors at once; reads 0. Every write of 5010 .. 5017 runs: never write these registers cyclically; "
     "DIRECT_RESULT reports the command",
     kKept, kAny},
    {kUntareCell, "UNTARE", mask, kNoUnit, "goes back to the calibration's zero; reads 0", kKept, kAny},
    {kClearLatchCell, "CLEAR_LATCH", mask, kNoUnit, "clears latched faults, and the slip latches of these sensors; reads 0",
     kKept, kAny},
    {kWeighCell, "WEIGH", mask, kNoUnit,
     "any sensor: weighs from now on, in any state of the grasp; coil WEIGH and CMD 5 stop; reads 0", kKept, kAny},
    {kResetPeakCell, "RESET_PEAK", mask, kNoUnit, "PEAK starts again; reads 0", kKept, kAny},
    {kTeachCell, "TEACH", u16, kNoUnit,
     "an object's id: counts the stable WEIGHT as one more grasp of it, and a new id adds an object; kept in the file of "
     "[grasp]. A WEIGHT of at most 3 WEIGHT_SD is refused; a later failure sets FAULT bit 6 until a TEACH succeeds. Reads 0",
     kKept, range(0, 65534)},
    {kZeroWeightCell, "ZERO_WEIGHT", u16, kNoUnit, "1: tares the stable weight, until this grasp ends; reads 0", kKept,
     range(0, 1)},
    {kKnownWeightCell, "KNOWN_WEIGHT", u16, kGrams,
     "mass of the stable load, which has no tare and read as at most 5 % of it in the grip before its lift: sets the scale "
     "of WEIGHT until the daemon ends, [grasp] is reloaded, or `tactilectl weigh forget`; 0 does nothing. With a scale, "
     "only the objects that were taught with one are recognised, and without it only the others; reads 0",
     kKept, range(0, 65534)},
    {kPlcHeartbeat, "PLC_HEARTBEAT", count, kNoUnit,
     "any changing value. A write that contains it unchanged is no sign of life, and its hints expire", kKept, kAny},
    {kPlcWatchdog, "PLC_WATCHDOG", u16, kMilliseconds,
     "time limit of the client that writes it: 0 = off, else 10 .. 60000; hints_expire_ms of [modbus] after a start. "
     "Without a new "
     "PLC_HEARTBEAT and without a write of a hint (5022, 5023, 5040 .. 5046) for longer, the hints of this client are not "
     "known (WARN bit 9) until they are written again or withdrawn",
     kKept, range(0, 60000)},
    {kGripperState, "GRIPPER_STATE", enumeration, kNoUnit,
     "a hint for the grasp estimate, from the first write on until PLC_WATCHDOG expires; 65535 = no hint", kKept,
     range_or_none(0, 5)},
    {kGripperForce, "GRIPPER_FORCE", u16, kForce, "commanded force, a hint of each client: kept, without effect yet", kKept,
     kAny},
    {kFilterHz, "FILTER_HZ", u16, kHertz, "low pass on force and torque, 0 = off", kKept, locked(0, 1000)},
    {kContactOn, "CONTACT_ON", u16, kForce,
     "magnitude at which the sensor's contact begins; the grasp keeps the configured one", kKept, locked(1, 30000)},
    {kContactOff, "CONTACT_OFF", u16, kForce,
     "magnitude below which the sensor's contact ends; the grasp keeps the configured one", kKept, locked(0, 30000)},
    {kOverloadAt, "OVERLOAD_AT", u16, kForce, "magnitude above which the sensor is overloaded, 0 = never", kKept,
     locked(0, 65534)},
    {kSlipSensitivity, "SLIP_SENSITIVITY", u16, kNoUnit, "100 detects the smallest slips, and false ones as well", kKept,
     locked(0, 100)},
    {kWeighWindow, "WEIGH_WINDOW", u16, kMilliseconds, "WEIGHT is a mean over this time; values above 1000 count as 1000",
     kKept, locked(10, 10000)},
    {kGravityX, "GRAVITY_X", i16, kAcceleration,
     "gravity in the gripper's frame G; all three count when Z is written, after X and Y, and must be 9.7 .. 9.9 m/s2 "
     "together; 0, 0, 0 says nothing, and 0x8000 is not known. They read as in force",
     kKept, kAny},
    {kGravityX + 1, "GRAVITY_Y", i16, kAcceleration, "", kKept, kAny},
    {kGravityX + 2, "GRAVITY_Z", i16, kAcceleration,
     "the configured gravity until it is written after a start; not known after PLC_WATCHDOG has expired", kKept, kAny},
    {kAccelX, "ACCEL_X", i16, kAcceleration, "acceleration of the hand, frame G, without gravity", kKept, kAny},
    {kAccelX + 1, "ACCEL_Y", i16, kAcceleration, "", kKept, kAny},
    {kAccelX + 2, "ACCEL_Z", i16, kAcceleration, "", kKept, kAny},
    {kAccelCount, "ACCEL_COUNT", count, kNoUnit,
     "a new value confirms ACCEL_X .. ACCEL_Z, written in this order, but not the first one of a client after a start or a "
     "silence; 100 ms without a new value make them unknown",
     kKept, kAny},
    {kUnlock, "UNLOCK", u16, kNoUnit,
     "0x5AFE opens the settings 5030 .. 5035 for 30 s on this connection, 0 closes; reads 1 while open", kKept, kAny},
    {kSave, "SAVE", enumeration, kNoUnit, "0x7361 stores the settings; exception 6 until it has finished", kKept,
     range(kSaveWord, kSaveWord)},
};

}  // namespace

std::span<const Register> control_rows() { return kControls; }

Words::Words() noexcept {
    for (const Register& r : kControls)
        if (r.limits.locked) (*this)[r.at] = kAsConfigured;
}

}  // namespace tactiled::modbus
