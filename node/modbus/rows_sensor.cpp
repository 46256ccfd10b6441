// The registers of one sensor, of its array, the bound of its age, and the wrench on the gripper, which is the sum of all
// sensors or the part of one.
#include <cmath>

#include "node/modbus/rows.hpp"
#include "tactiled/uncertainty.h"

namespace tactiled::modbus {
namespace {

using S = const Source&;
using Sample = tactiled_sample;

template <auto member, int axis>
double sample(S s) noexcept {
    return (s.sample.*member)[axis];
}

double tangential_force(S s) noexcept { return std::hypot(s.sample.force_S_N[0], s.sample.force_S_N[1]); }
double magnitude(S s) noexcept { return std::hypot(s.sample.force_S_N[0], s.sample.force_S_N[1], s.sample.force_S_N[2]); }
double temperature(S s) noexcept { return has_value(s.sample.quality) ? double(s.sample.temperature_C) : kNaN; }

std::uint16_t slip_state(S s) noexcept {
    return has_value(s.sample.quality) ? s.grasp.slip_state[s.sensor] : std::uint16_t(TACTILED_SLIP_UNKNOWN);
}

double status(S s) noexcept {
    const Sample& now = s.sample;
    const auto bit = [](unsigned number, bool is_set) { return is_set ? 1u << number : 0u; };
    return bit(0, now.quality == TACTILED_GOOD) | bit(1, (now.state & TACTILED_CONTACT) != 0) |
           bit(2, slip_state(s) == TACTILED_SLIP_INCIPIENT) | bit(3, slip_state(s) == TACTILED_SLIP_GROSS) |
           bit(4, (now.state & TACTILED_OVERLOAD) != 0 || exceeds_range(sensor_rows(), s)) |
           bit(5, (now.reasons & TACTILED_SATURATED) != 0) | bit(6, is_silent(now.reasons)) |
           bit(7, (now.reasons & TACTILED_TARING) != 0) | bit(8, now.tare_count != 0) |
           bit(9, (now.reasons & TACTILED_UNCALIBRATED) != 0) | bit(10, (now.state & TACTILED_LOW_PASS) != 0) |
           bit(11, (now.state & (TACTILED_STEPPED_DOWN | TACTILED_OVER_BUDGET)) != 0) |
           bit(12, now.quality == TACTILED_UNCERTAIN) | bit(13, (now.reasons & TACTILED_WRONG_RATE) != 0) |
           bit(14, (now.reasons & TACTILED_DRIFTED) != 0) | bit(15, !has_value(now.quality));
}

// Never 0 if the value is not GOOD.
double fault(S s) noexcept {
    if (s.sample.quality == TACTILED_GOOD) return 0;
    const std::uint16_t why = fault_of(s.sample.reasons);
    return why != 0 ? why : s.exists() ? kFaultUnknown : kFaultNoSensor;
}

double sample_age_ms(S s) noexcept {
    if (!s.exists()) return kNaN;
    return (s.sample.reasons & TACTILED_NO_DATA_YET) != 0 ? kMaxU16 : age_ms(s, s.sample.t_ns);
}

double friction_use(S s) noexcept { return has_value(s.sample.quality) ? double(s.grasp.friction_use[s.sensor]) : kNaN; }

double peak(S s) noexcept {
    return s.exists() && (s.sample.reasons & TACTILED_DAEMON_STOPPED) == 0 ? double(s.sample.peak_N) : kNaN;
}

double rate(S s) noexcept { return s.exists() && !is_silent(s.sample.reasons) ? double(s.sample.rate_Hz) : kNaN; }

using enum Type;

constexpr Register kSensor[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {kSensorStatus, "STATUS", bits, kNoUnit, "state of this sensor", unread(kFaultAlone, status)},
    {2, "FAULT", enumeration, kNoUnit, "the most serious reason why the value is not GOOD", fault},
    {3, "AGE_MS", u16, kMilliseconds, "time since the last byte of its frame; 65534 = that or more", sample_age_ms},
    {4, "FX", i16, kSensorForce, "force on the sensor, frame S: x along the connector",
     reported(sample<&Sample::force_S_N, 0>)},
    {5, "FY", i16, kSensorForce, "", reported(sample<&Sample::force_S_N, 1>)},
    {6, "FZ", i16, kSensorForce, "z out of the skin: a press is negative", reported(sample<&Sample::force_S_N, 2>)},
    {7, "TX", i16, kTorque, "torque on the sensor, frame S", reported(sample<&Sample::torque_S_Nm, 0>)},
    {8, "TY", i16, kTorque, "", reported(sample<&Sample::torque_S_Nm, 1>)},
    {9, "TZ", i16, kTorque, "", reported(sample<&Sample::torque_S_Nm, 2>)},
    {10, "F_TANG", u16, kSensorForce, "magnitude of (FX, FY); not available where one of them is not",
     reported(tangential_force)},
    {11, "F_MAG", u16, kSensorForce, "magnitude of (FX, FY, FZ); not available where one of them is not",
     reported(magnitude)},
    {12, "COP_X", i16, kLength, "centre of pressure", reported(sample<&Sample::cop_S_m, 0>)},
    {13, "COP_Y", i16, kLength, "", reported(sample<&Sample::cop_S_m, 1>)},
    {14, "FRICTION_USE", u16, kPermille, "shear / (friction * press): 100 % slides; 0xFFFF without contact", friction_use},
    {15, "SLIP_STATE", enumeration, kNoUnit, "0xFFFF: not known", [](S s) { return slip_state(s); }},
    {16, "SLIP_COUNT", count, kNoUnit, "gross slips of this sensor", [](S s) { return s.grasp.slip_count[s.sensor]; }},
    {17, "PEAK", u16, kSensorForce, "largest magnitude of the components seen, since the start or the last reset", peak},
    {18, "TEMP", i16, kTemperature, "0x8000: the sensor has none", temperature},
    {kScale, "SCALE", i16, kNoUnit,
     "power of ten of one count of FX, FY, FZ, F_TANG, F_MAG and PEAK, in N: -2 unless register_N of the sensor sets "
     "another",
     [](S s) { return s.view.force_scale(s.sensor); }},
    {20, "TARE_COUNT", count, kNoUnit, "finished tares; 0 = none in force", [](S s) { return s.sample.tare_count; }},
    {21, "RATE", u16, kHertz, "measured over a second", rate},
    {22, "LOST", count, kNoUnit, "frames known to be lost", [](S s) { return s.sample.lost; }},
    {23, "RAW_STATE", bits, kNoUnit, "bit n: channel n is missing or saturated (channels 0 .. 15)",
     [](S s) { return s.sample.missing | s.sample.saturated; }},
    {kSensorSeqEnd, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

constexpr Register kSensorFloats[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {1, "STATUS", bits, kNoUnit, "STATUS of the sensor block", status},
    {2, "FX", f32, kFloatN, "force on the sensor, frame S", sample<&Sample::force_S_N, 0>},
    {4, "FY", f32, kFloatN, "", sample<&Sample::force_S_N, 1>},
    {6, "FZ", f32, kFloatN, "a press is negative", sample<&Sample::force_S_N, 2>},
    {8, "TX", f32, kFloatNm, "torque on the sensor, frame S", sample<&Sample::torque_S_Nm, 0>},
    {10, "TY", f32, kFloatNm, "", sample<&Sample::torque_S_Nm, 1>},
    {12, "TZ", f32, kFloatNm, "", sample<&Sample::torque_S_Nm, 2>},
    {14, "COP_X", f32, kFloatMm, "centre of pressure", [](S s) { return s.sample.cop_S_m[0] * 1000; }},
    {16, "COP_Y", f32, kFloatMm, "", [](S s) { return s.sample.cop_S_m[1] * 1000; }},
    {18, "F_MAG", f32, kFloatN, "magnitude of (FX, FY, FZ)", magnitude},
    {20, "F_TANG", f32, kFloatN, "magnitude of (FX, FY)", tangential_force},
    {22, "TEMP", f32, kFloatDegC, "", temperature},
    {24, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

tactiled_value magnitude_with_sd(S s) noexcept {
    tactiled_placed placed{s.sample, {}, {}};
    if (s.exists()) placed.budget = s.view.snapshot.budget[s.sensor];
    return tactiled_magnitude(&placed);
}
double magnitude_sd(S s) noexcept { return magnitude_with_sd(s).sd; }
double magnitude_bound(S s) noexcept {
    const tactiled_value magnitude = magnitude_with_sd(s);
    return magnitude.value + (magnitude.is_bound != 0 ? 0 : TACTILED_WITHIN * magnitude.sd);
}
std::uint16_t largest_part(S s) noexcept {
    if (!s.exists() || !has_value(s.sample.quality)) return kNoU16;
    const tactiled_placed placed = s.view.snapshot.placed(s.sensor);
    const unsigned part = tactiled_largest_part(&placed);
    return part < TACTILED_PARTS ? std::uint16_t(part) : kNoU16;
}

constexpr Register kSensorSds[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {1, "STATUS", bits, kNoUnit, "STATUS of the sensor block", status},
    {2, "SD_FX", f32, kFloatN, "one standard deviation of FX", sample<&Sample::sd_force_N, 0>},
    {4, "SD_FY", f32, kFloatN, "", sample<&Sample::sd_force_N, 1>},
    {6, "SD_FZ", f32, kFloatN, "", sample<&Sample::sd_force_N, 2>},
    {8, "SD_TX", f32, kFloatNm, "one standard deviation of TX", sample<&Sample::sd_torque_Nm, 0>},
    {10, "SD_TY", f32, kFloatNm, "", sample<&Sample::sd_torque_Nm, 1>},
    {12, "SD_TZ", f32, kFloatNm, "", sample<&Sample::sd_torque_Nm, 2>},
    {14, "SD_F_MAG", f32, kFloatN,
     "one standard deviation of F_MAG; NaN below three of them, where noise alone has a length", magnitude_sd},
    {16, "F_MAX", f32, kFloatN, "at least 95 % of the true magnitudes are below it, with and without SD_F_MAG",
     magnitude_bound},
    {18, "PART", enumeration, kNoUnit, "the largest part of the variance of the force", [](S s) { return largest_part(s); }},
    {19, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

// Rounded up, so that the register is a bound, too.
double age_bound_ms(S s) noexcept {
    return s.exists() ? std::ceil(tactiled_age_bound_us_of(s.view.segment->c(), s.sensor) / 1e3) : kNaN;
}

constexpr Register kAgeBounds[] = {
    {0, "AGE_BOUND", u16, kMilliseconds,
     "largest possible age of the newest frame of sensor n, with the delay of its path; 65534 = that or "
     "more, or no frame yet",
     age_bound_ms},
};

double array_status(S s) noexcept {
    return std::uint32_t(status(s)) | (s.view.latched != nullptr && s.view.latched->saturates ? 1u << 4 : 0u);
}

// Returns what `get` returns for the array; 0 if the sensor has none.
template <auto get>
double latched(S s) noexcept {
    return s.view.latched != nullptr ? double(get(*s.view.latched)) : 0;
}

constexpr Register kHead[] = {
    {kToken, "TOKEN", count, kNoUnit,
     "number of the snapshot, also in each of its pages; 0: the sensor has no array. A read that includes this register "
     "latches a new snapshot",
     latched<[](const LatchedArray& a) { return a.token; }>},
    {1, "SEQ", count, kNoUnit, "number of the sensor's sample, wraps", [](S s) { return std::uint16_t(s.sample.sequence); }},
    {kArrayStatus, "STATUS", bits, kNoUnit, "STATUS of the sensor block, for this snapshot; bit 4 also if a value saturates",
     array_status},
    {3, "FAULT", enumeration, kNoUnit, "FAULT of the sensor block, for this snapshot", fault},
    {4, "AGE_MS", u16, kMilliseconds, "age of the snapshot when it was latched; 65534 = that or more", sample_age_ms},
    {5, "SCALE", i16, kNoUnit, "power of ten of one count of a value, in N: SCALE of the sensor's block",
     [](S s) { return s.view.force_scale(s.sensor); }},
    {6, "N_TAXELS", u16, kNoUnit, "0: the sensor has no array",
     latched<[](const LatchedArray& a) { return a.array.n_taxels(); }>},
    {7, "COMPONENTS", bits, kNoUnit, "the values of each taxel, in this order",
     latched<[](const LatchedArray& a) { return a.array.components(); }>},
    {8, "N_OUT", u16, kNoUnit, "taxels without a value",
     latched<[](const LatchedArray& a) { return a.array.head().n_out; }>},
    {kArrayPages, "PAGES", u16, kNoUnit, "number of pages", latched<[](const LatchedArray& a) { return a.pages; }>},
};

constexpr Register kPage[] = {
    {kToken, "TOKEN", count, kNoUnit, "number of the snapshot"},
    {1, "VALUES", i16, kSensorForce,
     "124 values, those of a taxel together: 124n .. of the array; 0x8000 without a force and after the last one"},
};

// ---- the wrench on the gripper ---------------------------------------------------------------------------------------

// All NaN where there is no value.
struct Wrench {
    std::uint32_t quality, why;
    double force_N[3], torque_Nm[3], sd_force_N[3], sd_torque_Nm[3];
};
Wrench wrench_of(S s) noexcept {
    const bool is_sum = s.sensor == kWholeNode;
    const tactiled_tool& t = s.tool;
    const std::uint32_t of_part = s.exists() ? t.sensor_quality[s.sensor] : std::uint32_t(TACTILED_NO_VALUE);
    Wrench wrench{is_sum ? t.quality : of_part, is_sum ? t.why : 0u, {}, {}, {}, {}};
    const auto value = [&](const double(&sum)[3], const float(&parts)[TACTILED_MAX_SENSORS][3], int axis) {
        return !has_value(wrench.quality) ? kNaN : is_sum ? sum[axis] : double(parts[s.sensor][axis]);
    };
    for (int axis = 0; axis < 3; ++axis) {
        wrench.force_N[axis] = value(t.force_G_N, t.sensor_force_G_N, axis);
        wrench.torque_Nm[axis] = value(t.torque_G_Nm, t.sensor_torque_G_Nm, axis);
        wrench.sd_force_N[axis] = value(t.sd_force_N, t.sensor_sd_force_N, axis);
        wrench.sd_torque_Nm[axis] = value(t.sd_torque_Nm, t.sensor_sd_torque_Nm, axis);
    }
    return wrench;
}

template <auto member, int axis>
double wrench(S s) noexcept {
    return (wrench_of(s).*member)[axis];
}

// Bits 0 .. 6 are those of tactiled_tool.why.
std::uint32_t tool_status(S s) noexcept {
    const Wrench w = wrench_of(s);
    return (w.why & 0x7Fu) | (w.quality == TACTILED_GOOD ? 1u << 8 : 0u) | (w.quality == TACTILED_UNCERTAIN ? 1u << 9 : 0u) |
           (has_value(w.quality) ? 0u : 1u << 15);
}

double tool_age_ms(S s) noexcept { return s.tool.quality == TACTILED_NO_VALUE ? kNaN : age_ms(s, s.tool.t_ns); }
double hand_kg(S s) noexcept { return s.tool.quality == TACTILED_NO_VALUE ? kNaN : double(s.tool.mass_kg); }

constexpr Register kTool[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {1, "STATUS", bits, kNoUnit, "state of this wrench, which is what the world exerts on the gripper",
     unread(kFaultAlone, [](S s) { return tool_status(s) | (exceeds_range(tool_rows(), s) ? 1u << 10 : 0u); })},
    {2, "FX", i16, kForce, "force in G, less the weight of the hand: sum of all sensors of [tool]",
     reported(wrench<&Wrench::force_N, 0>)},
    {3, "FY", i16, kForce, "", reported(wrench<&Wrench::force_N, 1>)},
    {4, "FZ", i16, kForce, "z out of the palm", reported(wrench<&Wrench::force_N, 2>)},
    {5, "TX", i16, kTorque, "torque about the origin of G", reported(wrench<&Wrench::torque_Nm, 0>)},
    {6, "TY", i16, kTorque, "", reported(wrench<&Wrench::torque_Nm, 1>)},
    {7, "TZ", i16, kTorque, "", reported(wrench<&Wrench::torque_Nm, 2>)},
    {8, "SD_FX", u16, kForce, "standard deviation of FX", reported(wrench<&Wrench::sd_force_N, 0>)},
    {9, "SD_FY", u16, kForce, "", reported(wrench<&Wrench::sd_force_N, 1>)},
    {10, "SD_FZ", u16, kForce, "", reported(wrench<&Wrench::sd_force_N, 2>)},
    {11, "SD_TX", u16, kTorque, "standard deviation of TX", reported(wrench<&Wrench::sd_torque_Nm, 0>)},
    {12, "SD_TY", u16, kTorque, "", reported(wrench<&Wrench::sd_torque_Nm, 1>)},
    {13, "SD_TZ", u16, kTorque, "", reported(wrench<&Wrench::sd_torque_Nm, 2>)},
    {14, "SENSORS", mask, kNoUnit, "the sensors of the sum", unread(kNothingGood, [](S s) { return s.tool.sensors; })},
    {15, "NO_VALUE", mask, kNoUnit, "sensors without a value: then the sum has none", [](S s) { return s.tool.bad; }},
    {16, "AGE_MS", u16, kMilliseconds, "age of the oldest frame in the sum; 65534 = that or more", tool_age_ms},
    {17, "MASS", u16, kGrams, "compensated mass of the hand", hand_kg},
    {19, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

constexpr Register kToolFloats[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {1, "STATUS", bits, kNoUnit, "see the block of the wrench", [](S s) { return tool_status(s); }},
    {2, "FX", f32, kFloatN, "force in G, less the weight of the hand", wrench<&Wrench::force_N, 0>},
    {4, "FY", f32, kFloatN, "", wrench<&Wrench::force_N, 1>},
    {6, "FZ", f32, kFloatN, "z out of the palm", wrench<&Wrench::force_N, 2>},
    {8, "TX", f32, kFloatNm, "torque about the origin of G", wrench<&Wrench::torque_Nm, 0>},
    {10, "TY", f32, kFloatNm, "", wrench<&Wrench::torque_Nm, 1>},
    {12, "TZ", f32, kFloatNm, "", wrench<&Wrench::torque_Nm, 2>},
    {14, "SD_FX", f32, kFloatN, "standard deviation of FX", wrench<&Wrench::sd_force_N, 0>},
    {16, "SD_FY", f32, kFloatN, "", wrench<&Wrench::sd_force_N, 1>},
    {18, "SD_FZ", f32, kFloatN, "", wrench<&Wrench::sd_force_N, 2>},
    {20, "SD_TX", f32, kFloatNm, "standard deviation of TX", wrench<&Wrench::sd_torque_Nm, 0>},
    {22, "SD_TY", f32, kFloatNm, "", wrench<&Wrench::sd_torque_Nm, 1>},
    {24, "SD_TZ", f32, kFloatNm, "", wrench<&Wrench::sd_torque_Nm, 2>},
    {26, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

}  // namespace

std::span<const Register> sensor_rows() { return kSensor; }
std::span<const Register> sensor_float_rows() { return kSensorFloats; }
std::span<const Register> sensor_sd_rows() { return kSensorSds; }
std::span<const Register> age_bound_rows() { return kAgeBounds; }
std::span<const Register> head_rows() { return kHead; }
std::span<const Register> page_rows() { return kPage; }
std::span<const Register> tool_rows() { return kTool; }
std::span<const Register> tool_float_rows() { return kToolFloats; }

}  // namespace tactiled::modbus
