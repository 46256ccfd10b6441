// The fields by which each protocol marks a value: one row for each quality and for each reason, and the time until which a
// value may be used. Each bridge takes its field of quality, status and expiry from here.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "tactiled/reader.hpp"

namespace tactiled::bridges {

struct QualityEdge {
    const char* word;    // MQTT, Home Assistant
    std::uint8_t level;  // diagnostic_msgs/DiagnosticStatus: 0 OK, 1 WARN, 2 ERROR, 3 STALE
    bool healthy;        // an edge that cannot mark quality sends it; a dashboard shows it as available
};
// Each row is that of the enum tactiled_quality with its index.
inline constexpr std::array<QualityEdge, 4> kQualityEdges{{
    {"no-value", 3, false},
    {"good", 0, true},
    {"uncertain", 1, false},
    {"bad", 2, false},
}};
// An unknown quality is that of no value.
constexpr const QualityEdge& edge_of(std::uint32_t quality) {
    return kQualityEdges[quality < kQualityEdges.size() ? quality : std::uint32_t(TACTILED_NO_VALUE)];
}
constexpr bool is_healthy(std::uint32_t quality) { return edge_of(quality).healthy; }
// A value that has ended because there are no new frames has the level STALE in place of ERROR.
constexpr std::uint8_t diagnostic_level(std::uint32_t quality, std::uint32_t reasons) {
    return quality == TACTILED_BAD && (reasons & TACTILED_REASONS_OF_OLD) != 0 ? 3 : edge_of(quality).level;
}

// Reasons use these bits of the status word of an ATI Net F/T ("System Status Code" in ATI 9620-05-NET FT).
enum RdtBit : std::uint8_t {
    kWatchdogTimeout = 14,
    kSaturation = 17,  // transducer saturation, or an error of the converter
    kRdtCommunication = 20,
    kConfigurationAndCalibration = 23,  // the settings do not fit the calibration
    kSettings = 24,
    kSerialLink = 27,
    kAnalogBoard = 28,
    kError = 31,    // is set with each other error bit
    kNoBit = 0xFF,  // a note on a GOOD value
};
struct ReasonEdge {
    std::uint32_t reason;
    RdtBit rdt_bit;  // the documented bit that is closest
};
inline constexpr ReasonEdge kReasonEdges[] = {
    {TACTILED_DAEMON_STOPPED, kWatchdogTimeout},
    {TACTILED_DISCONNECTED, kSerialLink},
    {TACTILED_NO_DATA_YET, kSerialLink},
    {TACTILED_STALE, kSerialLink},
    {TACTILED_UNPROVED_AGE, kSerialLink},
    {TACTILED_READER_OVERRUN, kRdtCommunication},
    {TACTILED_WRONG_DEVICE, kConfigurationAndCalibration},
    {TACTILED_UNCALIBRATED, kConfigurationAndCalibration},
    {TACTILED_UNKNOWN_UNCERTAINTY, kConfigurationAndCalibration},
    {TACTILED_TOO_QUIET, kConfigurationAndCalibration},
    {TACTILED_NOT_REDUNDANT, kConfigurationAndCalibration},
    {TACTILED_TEMPERATURE, kConfigurationAndCalibration},
    {TACTILED_ZERO_UNKNOWN, kSettings},
    {TACTILED_ZERO_OLD, kSettings},
    {TACTILED_SATURATED, kSaturation},
    {TACTILED_OUTSIDE_DOMAIN, kSaturation},
    {TACTILED_NOT_FINITE, kAnalogBoard},
    {TACTILED_IDLE_BUS, kAnalogBoard},
    {TACTILED_FROZEN, kAnalogBoard},
    {TACTILED_MISSING_CHANNEL, kAnalogBoard},
    {TACTILED_DISAGREEMENT, kAnalogBoard},
    {TACTILED_SENSORS_DIFFER, kAnalogBoard},
    {TACTILED_STEPPED, kAnalogBoard},
    {TACTILED_GLITCHES, kAnalogBoard},
    {TACTILED_TARING, kNoBit},
    {TACTILED_WRONG_RATE, kNoBit},
    {TACTILED_DRIFTED, kNoBit},
    {TACTILED_ARRIVAL_ONLY, kNoBit},
};
// A reason that layout.h gains does not compile until it has a row here, and a bit unless a GOOD value may have it.
constexpr bool every_reason_has_its_row() {
#define TACTILED_EDGE_(reason, ...) | std::uint32_t(TACTILED_##reason)
    constexpr std::uint32_t all = 0u TACTILED_REASON_TABLE(TACTILED_EDGE_);
#undef TACTILED_EDGE_
    std::uint32_t found = 0;
    for (const ReasonEdge& row : kReasonEdges) {
        const bool note = (row.reason & std::uint32_t(TACTILED_REASONS_OF_GOOD)) != 0;
        if ((found & row.reason) != 0 || note != (row.rdt_bit == kNoBit)) return false;
        found |= row.reason;
    }
    return found == all;
}
static_assert(every_reason_has_its_row());

// The status is 0 for a healthy value. Each other value has the error bit and the bits of its reasons.
constexpr std::uint32_t rdt_status(std::uint32_t quality, std::uint32_t reasons) {
    if (is_healthy(quality)) return 0;
    std::uint32_t status = 1u << kError;
    for (const ReasonEdge& row : kReasonEdges)
        if ((reasons & row.reason) != 0 && row.rdt_bit != kNoBit) status |= 1u << row.rdt_bit;
    return status;
}

// The quality of the state of the gripper, of its grip and of its counts. It is BAD while the state is unknown, and
// UNCERTAIN while a sensor of the node is not GOOD, because the segment does not say which sensors are jaws.
std::uint32_t grasp_quality(const tactiled_grasp& grasp, std::uint32_t worst_of_sensors);
// The quality of the weight and of its state. It is GOOD where the weight is stable, without a doubt and in a GOOD grasp,
// and BAD where there is no weight.
std::uint32_t weight_quality(const tactiled_grasp& grasp, std::uint32_t worst_of_sensors);
// Returns the worse one of two qualities, where no value is as bad as BAD.
std::uint32_t worse(std::uint32_t a, std::uint32_t b);
// Returns the worst quality of the samples, and BAD without samples.
std::uint32_t worst_quality(std::span<const tactiled_sample> samples);
// Returns the worst quality of all sensors of the segment, judged now.
std::uint32_t worst_quality(const SegmentView& segment);

// Returns the time, CLOCK_MONOTONIC, at which a reader of the segment would call this sample BAD if the daemon published no
// other one.
std::uint64_t valid_until_ns(const SegmentView& segment, std::uint32_t sensor, const tactiled_sample& sample);
// Returns the time, CLOCK_MONOTONIC, at which a reader would call the grasp and the tool of this node record BAD.
std::uint64_t valid_until_ns(const SegmentView& segment, const tactiled_node& node);

}  // namespace tactiled::bridges
