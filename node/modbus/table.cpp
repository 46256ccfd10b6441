#include "node/modbus/table.hpp"

#include <algorithm>

namespace tactiled::modbus {
namespace {

constexpr Register kGlobal[] = {
    {kMagic0, "MAGIC0", Type::text, "", "0x5441 \"TA\"; a client that reads 0x4354 here is off by one address"},
    {kMagic1, "MAGIC1", Type::text, "", "0x4354 \"CT\""},
    {kMapVersion, "MAP_VER", Type::text, "", "256 * major + minor; a minor version only adds registers"},
    {kSensors, "N_SENSORS", Type::u16, "", "1 .. 16"},
    {kSeq, "SEQ", Type::count, "", "number of the published frame, wraps"},
    {kHeartbeat, "HEARTBEAT", Type::count, "1 / 100 ms", "stops when acquisition, the loop or every sensor stops"},
    {kAgeMs, "AGE_MS", Type::u16, "ms", "age of the newest sensor frame when the answer was built; 65534 = that or more"},
    {kStatus, "STATUS", Type::bits, "", "state of the node"},
    {kFault, "FAULT", Type::bits, "", "latched"},
    {kWarn, "WARN", Type::bits, "", "true now"},
    {kOk, "OK", Type::mask, "", "the sensor's value is GOOD"},
    {kContact, "CONTACT", Type::mask, "", "the magnitude has passed CONTACT_ON, and not fallen below CONTACT_OFF since"},
    {kSlip, "SLIP", Type::mask, "", "gross slip now"},
    {kSlipLatch, "SLIP_LATCH", Type::mask, "", "gross slip since the last CLEAR_SLIP, CLEAR_ALL or CLEAR_LATCH"},
    {kOverload, "OVERLOAD", Type::mask, "",
     "a channel is saturated, a register saturates, or the magnitude is above OVERLOAD_AT"},
    {kStale, "STALE", Type::mask, "", "the sensor delivers nothing"},
    {kGripForce, "GRIP_FORCE", Type::u16, "0.01 N", "normal force of a jaw, mean of those with a sensor"},
    {kGripState, "GRIP_STATE", Type::enumeration, "",
     "0xFFFF: not known; no [grasp] is configured, or a jaw's sensor has no value"},
    {kWeightG, "WEIGHT_G", Type::u16, "1 g", "WEIGHT, for clients of one register; a negative weight reads 0"},
    {kWeightState, "WEIGHT_STATE", Type::enumeration, "", "state of WEIGHT"},
    {kWeight, "WEIGHT", Type::i32, "0.1 g", "net, of the object alone"},
    {kWeightSd, "WEIGHT_SD", Type::u16, "0.1 g", "its standard deviation"},
    {kRecGrip, "REC_GRIP", Type::u16, "0.01 N", "recommended GRIP_FORCE: the minimum that holds, with a margin"},
    {kSlipCount, "SLIP_COUNT", Type::count, "",
     "gross slips of all jaws: counted in the loop, so that none is missed between two scans"},
    {kCmdSeqAck, "CMD_SEQ_ACK", Type::count, "",
     "the CMD_SEQ last taken from this client's address; 0 = none since the daemon's start. Write this + 1 for a command"},
    {kCmdState, "CMD_STATE", Type::enumeration, "", "state of this client's last command in the block 5000 .. 5004"},
    {kCmdResult, "CMD_RESULT", Type::enumeration, "", "result of that command"},
    {kCalId, "CAL_ID", Type::text, "", "CRC-16 of configuration and calibrations: changes when either does"},
    {kPlcHbEcho, "PLC_HB_ECHO", Type::count, "", "echo of PLC_HEARTBEAT"},
    {kCycleWorst, "CYCLE_WORST", Type::u16, "us", "worst cycle of the pipeline within the last second"},
    {kSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kGraspBlock[] = {
    {kGraspSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kObjectId, "OBJECT_ID", Type::u16, "", "id of the taught object with this WEIGHT; 0 = unknown, or no weight"},
    {kObjectProbability, "OBJECT_PROB", Type::u16, "0.1 %",
     "probability of OBJECT_ID, against the other objects and an unknown one"},
    {kFriction, "FRICTION", Type::u16, "0.001", "coefficient: learnt in this grasp, or as configured"},
    {kFrictionSd, "FRICTION_SD", Type::u16, "0.001", "its standard deviation; 0xFFFF where it is as configured"},
    {kGrasps, "GRASPS", Type::count, "", "one more each time that GRIP_STATE becomes grasped"},
    {kSinceLiftOff, "SINCE_LIFT", Type::u16, "ms", "time since lift-off while an object is held; 65534 = that or more"},
    {kGraspSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kCommandsBlock[] = {
    {kCmdRepeats, "CMD_REPEATS", Type::count, "", "later writes of the same CMD_SEQ, which ran nothing"},
    {kDirectCmd, "DIRECT_CMD", Type::enumeration, "",
     "last command of this client by one register (5010 .. 5017) or by coils; 0 = none"},
    {kDirectState, "DIRECT_STATE", Type::enumeration, "", "state of that command"},
    {kDirectResult, "DIRECT_RESULT", Type::enumeration, "", "result of that command, as CMD_RESULT"},
    {kDirectCount, "DIRECT_COUNT", Type::count, "", "one more with each of these commands"},
};

constexpr Register kToolBlock[] = {
    {kToolSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kToolStatus, "STATUS", Type::bits, "", "state of this wrench, which is what the world exerts on the gripper"},
    {kToolForce, "FX", Type::i16, "0.01 N", "force in G, less the weight of the hand: sum of all sensors of [tool]"},
    {kToolForce + 1, "FY", Type::i16, "0.01 N", ""},
    {kToolForce + 2, "FZ", Type::i16, "0.01 N", "z out of the palm"},
    {kToolTorque, "TX", Type::i16, "0.001 Nm", "torque about the origin of G"},
    {kToolTorque + 1, "TY", Type::i16, "0.001 Nm", ""},
    {kToolTorque + 2, "TZ", Type::i16, "0.001 Nm", ""},
    {kToolSdForce, "SD_FX", Type::u16, "0.01 N", "standard deviation of FX"},
    {kToolSdForce + 1, "SD_FY", Type::u16, "0.01 N", ""},
    {kToolSdForce + 2, "SD_FZ", Type::u16, "0.01 N", ""},
    {kToolSdTorque, "SD_TX", Type::u16, "0.001 Nm", "standard deviation of TX"},
    {kToolSdTorque + 1, "SD_TY", Type::u16, "0.001 Nm", ""},
    {kToolSdTorque + 2, "SD_TZ", Type::u16, "0.001 Nm", ""},
    {kToolSensors, "SENSORS", Type::mask, "", "the sensors of the sum"},
    {kToolNoValue, "NO_VALUE", Type::mask, "", "sensors without a value: then the sum has none"},
    {kToolAgeMs, "AGE_MS", Type::u16, "ms", "age of the oldest frame in the sum; 65534 = that or more"},
    {kToolMass, "MASS", Type::u16, "1 g", "compensated mass of the hand"},
    {kToolSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kDoubtsBlock[] = {
    {kDoubtsSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kWeightWhy, "WEIGHT_WHY", Type::bits, "", "why WEIGHT is not stable while an object is held; 0 where it is stable"},
    {kWeightJaws, "WEIGHT_JAWS", Type::mask, "", "the jaws that cause WEIGHT_WHY, as far as the forces show them"},
    {kDoubtsSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kSensor[] = {
    {kSensorSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kSensorStatus, "STATUS", Type::bits, "", "state of this sensor"},
    {kSensorFault, "FAULT", Type::enumeration, "", "the most serious reason why the value is not GOOD"},
    {kSensorAgeMs, "AGE_MS", Type::u16, "ms", "time since the last byte of its frame; 65534 = that or more"},
    {kFx, "FX", Type::i16, "0.01 N", "force on the sensor, frame S: x along the connector"},
    {kFy, "FY", Type::i16, "0.01 N", ""},
    {kFz, "FZ", Type::i16, "0.01 N", "z out of the skin: a press is negative"},
    {kTx, "TX", Type::i16, "0.001 Nm", "torque on the sensor, frame S"},
    {kTy, "TY", Type::i16, "0.001 Nm", ""},
    {kTz, "TZ", Type::i16, "0.001 Nm", ""},
    {kFTang, "F_TANG", Type::u16, "0.01 N", "magnitude of (FX, FY); not available where one of them is not"},
    {kFMag, "F_MAG", Type::u16, "0.01 N", "magnitude of (FX, FY, FZ); not available where one of them is not"},
    {kCopX, "COP_X", Type::i16, "0.01 mm", "centre of pressure"},
    {kCopY, "COP_Y", Type::i16, "0.01 mm", ""},
    {kFrictionUse, "FRICTION_USE", Type::u16, "0.1 %", "shear / (friction * press): 100 % slides; 0xFFFF without contact"},
    {kSlipState, "SLIP_STATE", Type::enumeration, "", "0xFFFF: not known"},
    {kSensorSlipCount, "SLIP_COUNT", Type::count, "", "gross slips of this sensor"},
    {kPeak, "PEAK", Type::u16, "0.01 N", "largest magnitude of the components seen, since the start or the last reset"},
    {kTemp, "TEMP", Type::i16, "0.1 degC", "0x8000: the sensor has none"},
    {kScale, "SCALE", Type::i16, "",
     "power of ten of one count of FX, FY, FZ, F_TANG, F_MAG and PEAK, in N: -2 unless register_N of the sensor sets "
     "another"},
    {kTareCount, "TARE_COUNT", Type::count, "", "finished tares; 0 = none in force"},
    {kRate, "RATE", Type::u16, "Hz", "measured over a second"},
    {kLost, "LOST", Type::count, "", "frames known to be lost"},
    {kRawState, "RAW_STATE", Type::bits, "", "bit n: channel n is missing or saturated (channels 0 .. 15)"},
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

constexpr Register kFloat[] = {
    {kFloatSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kFloatWeight, "WEIGHT", Type::f32, "kg", "net, of the object alone"},
    {kFloatWeightSd, "WEIGHT_SD", Type::f32, "kg", "its standard deviation"},
    {kFloatGrip, "GRIP_FORCE", Type::f32, "N", "normal force of a jaw, mean"},
    {kFloatRecGrip, "REC_GRIP", Type::f32, "N", "the minimum that holds, with a margin"},
    {kFloatFriction, "FRICTION", Type::f32, "", "coefficient"},
    {kFloatTime, "TIME", Type::f32, "s", "time of the frame on the daemon's clock, modulo 4096"},
    {kFloatFrictionSd, "FRICTION_SD", Type::f32, "", "NaN where FRICTION is as configured"},
    {kFloatObjectProbability, "OBJECT_PROB", Type::f32, "", "probability 0 .. 1, as in the grasp block"},
    {kFloatSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kToolFloat[] = {
    {kToolFloatSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kToolFloatStatus, "STATUS", Type::bits, "", "see the block of the wrench"},
    {kToolFloatForce, "FX", Type::f32, "N", "force in G, less the weight of the hand"},
    {kToolFloatForce + 2, "FY", Type::f32, "N", ""},
    {kToolFloatForce + 4, "FZ", Type::f32, "N", "z out of the palm"},
    {kToolFloatTorque, "TX", Type::f32, "Nm", "torque about the origin of G"},
    {kToolFloatTorque + 2, "TY", Type::f32, "Nm", ""},
    {kToolFloatTorque + 4, "TZ", Type::f32, "Nm", ""},
    {kToolFloatSdForce, "SD_FX", Type::f32, "N", "standard deviation of FX"},
    {kToolFloatSdForce + 2, "SD_FY", Type::f32, "N", ""},
    {kToolFloatSdForce + 4, "SD_FZ", Type::f32, "N", ""},
    {kToolFloatSdTorque, "SD_TX", Type::f32, "Nm", "standard deviation of TX"},
    {kToolFloatSdTorque + 2, "SD_TY", Type::f32, "Nm", ""},
    {kToolFloatSdTorque + 4, "SD_TZ", Type::f32, "Nm", ""},
    {kToolFloatSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Register kSensorFloat[] = {
    {kFloatSensorSeq, "SEQ", Type::count, "", "number of the published frame, as in the global block"},
    {kFloatStatus, "STATUS", Type::bits, "", "STATUS of the sensor block"},
    {kFloatForce, "FX", Type::f32, "N", "force on the sensor, frame S"},
    {kFloatForce + 2, "FY", Type::f32, "N", ""},
    {kFloatForce + 4, "FZ", Type::f32, "N", "a press is negative"},
    {kFloatTorque, "TX", Type::f32, "Nm", "torque on the sensor, frame S"},
    {kFloatTorque + 2, "TY", Type::f32, "Nm", ""},
    {kFloatTorque + 4, "TZ", Type::f32, "Nm", ""},
    {kFloatCop, "COP_X", Type::f32, "mm", "centre of pressure"},
    {kFloatCop + 2, "COP_Y", Type::f32, "mm", ""},
    {kFloatMag, "F_MAG", Type::f32, "N", "magnitude of (FX, FY, FZ)"},
    {kFloatTang, "F_TANG", Type::f32, "N", "magnitude of (FX, FY)"},
    {kFloatTemp, "TEMP", Type::f32, "degC", ""},
    {kFloatSensorSeqEnd, "SEQ_END", Type::count, "", "= SEQ"},
};

constexpr Limits kAny{0, 65535, false};
constexpr Register kControl[] = {
    {kCmd, "CMD", Type::enumeration, "", "the command; runs when CMD_SEQ is written with another value", kAny},
    {kCmdMask, "MASK", Type::mask, "", "the sensors that it is for", kAny},
    {kCmdParamHigh, "PARAM_H", Type::u16, "", "parameter, high word; known weight: in 0.1 g, teach: the object's id", kAny},
    {kCmdParamLow, "PARAM_L", Type::u16, "", "parameter, low word", kAny},
    {kCmdSeq, "CMD_SEQ", Type::count, "",
     "any value but the last of this client: CMD_SEQ_ACK repeats it, and CMD_STATE and CMD_RESULT report the command. The "
     "first one after a "
     "start of the daemon is adopted and not run (CMD_RESULT 11): write another one. The block may be written in every "
     "cycle",
     kAny},
    {kTareCell, "TARE", Type::mask, "",
     "tares these sensors at once; reads 0. Every write of 5010 .. 5017 runs: never write these registers cyclically; "
     "DIRECT_RESULT reports the command",
     kAny},
    {kUntareCell, "UNTARE", Type::mask, "", "goes back to the calibration's zero; reads 0", kAny},
    {kClearLatchCell, "CLEAR_LATCH", Type::mask, "", "clears latched faults, and the slip latches of these sensors; reads 0",
     kAny},
    {kWeighCell, "WEIGH", Type::mask, "",
     "any sensor: weighs from now on, in any state of the grasp; coil WEIGH and CMD 5 stop; reads 0", kAny},
    {kResetPeakCell, "RESET_PEAK", Type::mask, "", "PEAK starts again; reads 0", kAny},
    {kTeachCell,
     "TEACH",
     Type::u16,
     "",
     "an object's id: counts the stable WEIGHT as one more grasp of it, and a new id adds an object; kept in the file of "
     "[grasp]. A WEIGHT of at most 3 WEIGHT_SD is refused; a later failure sets FAULT bit 6 until a TEACH succeeds. Reads 0",
     {0, 65534}},
    {kZeroWeightCell, "ZERO_WEIGHT", Type::u16, "", "1: tares the stable weight, until this grasp ends; reads 0", {0, 1}},
    {kKnownWeightCell,
     "KNOWN_WEIGHT",
     Type::u16,
     "1 g",
     "mass of the stable load, which has no tare and read as at most 5 % of it in the grip before its lift: sets the scale "
     "of WEIGHT until the daemon ends, [grasp] is reloaded, or `tactilectl weigh forget`; 0 does nothing. With a scale, "
     "only the objects that were taught with one are recognised, and without it only the others; reads 0",
     {0, 65534}},
    {kPlcHeartbeat, "PLC_HEARTBEAT", Type::count, "", "any changing value", kAny},
    {kPlcWatchdog,
     "PLC_WATCHDOG",
     Type::u16,
     "ms",
     "0 = off, else 10 .. 60000: STATUS bit 12 when PLC_HEARTBEAT does not change for longer",
     {0, 60000}},
    {kGripperState,
     "GRIPPER_STATE",
     Type::enumeration,
     "",
     "a hint for the grasp estimate, from the first write on until PLC_WATCHDOG expires",
     {0, 5}},
    {kGripperForce, "GRIPPER_FORCE", Type::u16, "0.01 N", "commanded force, a hint: kept, without effect yet", kAny},
    {kFilterHz, "FILTER_HZ", Type::u16, "Hz", "low pass on force and torque, 0 = off", {0, 1000, true}},
    {kContactOn,
     "CONTACT_ON",
     Type::u16,
     "0.01 N",
     "magnitude at which the sensor's contact begins; the grasp keeps the configured one",
     {1, 30000, true}},
    {kContactOff,
     "CONTACT_OFF",
     Type::u16,
     "0.01 N",
     "magnitude below which the sensor's contact ends; the grasp keeps the configured one",
     {0, 30000, true}},
    {kOverloadAt,
     "OVERLOAD_AT",
     Type::u16,
     "0.01 N",
     "magnitude above which the sensor is overloaded, 0 = never",
     {0, 65534, true}},
    {kSlipSensitivity,
     "SLIP_SENSITIVITY",
     Type::u16,
     "",
     "100 detects the smallest slips, and false ones as well",
     {0, 100, true}},
    {kWeighWindow,
     "WEIGH_WINDOW",
     Type::u16,
     "ms",
     "WEIGHT is a mean over this time; values above 1000 count as 1000",
     {10, 10000, true}},
    {kGravityX, "GRAVITY_X", Type::i16, "0.001 m/s2",
     "gravity in the gripper's frame G; all three count when Z is written, and must be 9.7 .. 9.9 m/s2 together", kAny},
    {kGravityX + 1, "GRAVITY_Y", Type::i16, "0.001 m/s2", "", kAny},
    {kGravityX + 2, "GRAVITY_Z", Type::i16, "0.001 m/s2",
     "the configured gravity until it is written after a start; not known after PLC_WATCHDOG has expired", kAny},
    {kAccelX, "ACCEL_X", Type::i16, "0.001 m/s2", "acceleration of the hand, frame G, without gravity", kAny},
    {kAccelX + 1, "ACCEL_Y", Type::i16, "0.001 m/s2", "", kAny},
    {kAccelX + 2, "ACCEL_Z", Type::i16, "0.001 m/s2", "", kAny},
    {kAccelCount, "ACCEL_COUNT", Type::count, "",
     "a new value confirms ACCEL_X .. ACCEL_Z; 100 ms without a new value make them unknown", kAny},
    {kUnlock, "UNLOCK", Type::u16, "",
     "0x5AFE opens the settings 5030 .. 5035 for 30 s on this connection, 0 closes; reads 1 while open", kAny},
    {kSave,
     "SAVE",
     Type::enumeration,
     "",
     "0x7361 stores the settings; exception 6 until it has finished",
     {kSaveWord, kSaveWord}},
};

constexpr std::uint16_t kToolSensorsEnd = kToolFloatSize * kSensorBlocks;
constexpr std::uint16_t kFloatsEnd = kSensorFloatSize * kSensorBlocks;
constexpr Area kAreas[] = {
    {kGlobalAt, kGlobalSize, Block::global, 0, false, "Global block", "global", kGlobal},
    {kGraspAt, kGraspSize, Block::grasp, 0, false, "Grasp, further registers", "grasp", kGraspBlock},
    {kCommandsAt, kCommandsSize, Block::commands, 0, false, "Commands of this client, further registers", "command",
     kCommandsBlock},
    {kToolAt, kToolSize, Block::tool, 0, false, "Wrench on the gripper", "tool", kToolBlock},
    {kDoubtsAt, kDoubtsSize, Block::doubts, 0, false, "Doubts of the weight", "doubt", kDoubtsBlock},
    {kSensorsAt, kSensorSize* kSensorBlocks, Block::sensor, kSensorSize, false, "Sensor blocks", "sensor", kSensor},
    {kFloatsAt, kFloatSize, Block::floats, 0, false, "Floats, high word first", "float", kFloat},
    {kToolFloatsAt, kToolFloatSize, Block::tool_floats, 0, false, "Wrench on the gripper, high word first", "tool_float",
     kToolFloat},
    {kSensorFloatsAt, kFloatsEnd, Block::sensor_floats, kSensorFloatSize, false, "Floats of sensors, high word first",
     "sensor_float", kSensorFloat},
    {kToolSensorsAt, kToolSensorsEnd, Block::tool_sensors, kToolFloatSize, false,
     "Parts of that wrench by sensor, high word first", "tool_float", kToolFloat},
    {kFloatsAt + kSwapped, kFloatSize, Block::floats, 0, true, "Floats, low word first", "float", kFloat},
    {kToolFloatsAt + kSwapped, kToolFloatSize, Block::tool_floats, 0, true, "Wrench on the gripper, low word first",
     "tool_float", kToolFloat},
    {kSensorFloatsAt + kSwapped, kFloatsEnd, Block::sensor_floats, kSensorFloatSize, true,
     "Floats of sensors, low word first", "sensor_float", kSensorFloat},
    {kToolSensorsAt + kSwapped, kToolSensorsEnd, Block::tool_sensors, kToolFloatSize, true,
     "Parts of that wrench by sensor, low word first", "tool_float", kToolFloat},
    {kControlsAt, kControlsSize, Block::controls, 0, false, "Commands and settings", "control", kControl},
    {kScratchAt, kScratchSize, Block::scratch, 0, false, "Scratch: free registers, to try a client", "scratch", {}},
    {kConstantsAt, kConstantsSize, Block::constants, 0, false, "Constants, to check base, sign and word order", "constant",
     kConstant},
};

constexpr Bits kCoilRuns[] = {
    {kTareCoils, 16, "TARE",
     "1 tares sensor n; reads 1 during the tare. Every write of a 1 runs: never write these coils cyclically"},
    {kSlipCoils, 16, "CLEAR_SLIP", "1 clears the slip latch of sensor n"},
    {kClearAllCoil, 1, "CLEAR_ALL", "1 clears all latches"},
    {kWeighCoil, 1, "WEIGH", "1 starts weighing; 0, written alone, stops; reads 1 while there is a weight"},
};
constexpr Bits kInputRuns[] = {
    {kContactInputs, 16, "CONTACT", "contact of sensor n"},
    {kSlipInputs, 16, "SLIP_LATCH", "slip latch of sensor n"},
    {kOkInputs, 16, "OK", "the value of sensor n is GOOD"},
    {kOverloadInputs, 16, "OVERLOAD", "overload of sensor n"},
    {kGraspedInput, 1, "GRASPED", "STATUS bit 2"},
    {kStableInput, 1, "WEIGHT_STABLE", "STATUS bit 6"},
    {kBlinkInput, 1, "BLINK", "1 s on, 1 s off, from the heartbeat: constant while the heartbeat is constant"},
    {kFaultInput, 1, "FAULT", "STATUS bit 15"},
};

constexpr std::uint16_t kConstantValues[kConstantsSize] = {0x1234, 0xFB2E, 0x1234, 0x5678, 0x449A, 0x5000,
                                                           0x5000, 0x449A, 0x4142, 0x4344, 0x4546, 0x4748};

}  // namespace

std::span<const Area> areas() { return kAreas; }
std::span<const Bits> coils() { return kCoilRuns; }
std::span<const Bits> discrete_inputs() { return kInputRuns; }
std::span<const std::uint16_t> constants() { return kConstantValues; }

const Area* area_of(std::uint32_t at, std::uint32_t count) {
    for (const Area& area : kAreas)
        if (at >= area.at && at + count <= std::uint32_t(area.at) + area.size) return &area;
    return nullptr;
}

const Register* writable_at(std::uint32_t at) {
    const auto found = std::find_if(std::begin(kControl), std::end(kControl), [&](const Register& r) { return r.at == at; });
    return found != std::end(kControl) ? found : nullptr;
}

}  // namespace tactiled::modbus
