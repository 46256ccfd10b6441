// The offsets of the registers that tests read, as the published map states them. They are not taken from the table,
// so that a row that moves fails a test.
#pragma once
#include <cstdint>

namespace tactiled::modbus {

// clang-format off
// Global block.
enum : std::uint16_t {
    kAgeMs = 6, kFault = 8, kWarn = 9, kSlip = 12, kStale = 15, kGripForce = 16, kGripState = 17,
    kWeightG = 18, kWeightState = 19, kWeight = 20, kWeightSd = 22, kRecGrip = 23, kSlipCount = 24, kCycleWorst = 30
};
// Grasp block.
enum : std::uint16_t {
    kObjectId = 1, kObjectProbability = 2, kFriction = 3, kFrictionSd = 4, kGrasps = 5, kSinceLiftOff = 6
};
// Block of commands.
enum : std::uint16_t {
    kCmdRepeats = 0, kDirectCmd = 1, kDirectState = 2, kDirectResult = 3, kDirectCount = 4
};
// Wrench on the gripper.
enum : std::uint16_t {
    kToolSeq = 0, kToolStatus = 1, kToolForce = 2, kToolTorque = 5, kToolSdForce = 8, kToolSdTorque = 11,
    kToolSensors = 14, kToolAgeMs = 16, kToolMass = 17, kToolSeqEnd = 19
};
// Wrench as floats, and its parts.
enum : std::uint16_t { kToolFloatStatus = 1, kToolFloatForce = 2 };
// Doubts of the weight.
enum : std::uint16_t { kDoubtsSeq = 0, kWeightWhy = 1, kWeightJaws = 2, kDoubtsSeqEnd = 7 };
// Block of a sensor.
enum : std::uint16_t {
    kSensorFault = 2, kSensorAgeMs = 3, kFx = 4, kFy = 5, kFz = 6, kTx = 7, kTz = 9, kFTang = 10, kFMag = 11,
    kCopX = 12, kCopY = 13, kFrictionUse = 14, kSlipState = 15, kSensorSlipCount = 16, kPeak = 17, kTemp = 18,
    kTareCount = 20, kRate = 21, kLost = 22, kRawState = 23
};
// Floats.
enum : std::uint16_t {
    kFloatWeight = 2, kFloatWeightSd = 4, kFloatGrip = 6, kFloatRecGrip = 8, kFloatFriction = 10,
    kFloatTime = 12, kFloatFrictionSd = 14, kFloatObjectProbability = 16
};
// Floats of a sensor.
enum : std::uint16_t {
    kFloatSensorSeq = 0, kFloatStatus = 1, kFloatForce = 2, kFloatTorque = 8, kFloatCop = 14,
    kFloatSensorSeqEnd = 24
};
// clang-format on

}  // namespace tactiled::modbus
