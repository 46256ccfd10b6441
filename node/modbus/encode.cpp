#include "node/modbus/encode.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace tactiled::modbus {
namespace {

constexpr double kTorque = 0.001, kLength_m = 1e-5, kTemperature = 0.1, kMass_kg = 1e-4, kThousandth = 1e-3;
constexpr std::uint16_t kMaxU16 = 65534;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

constexpr std::uint32_t kSilent = TACTILED_REASONS_OF_OLD;
// The part of the node's state that remains valid when its loop has stopped; the present state of its sensors is then
// unknown.
constexpr std::uint32_t kOutlivesLoop = TACTILED_SIMULATED | TACTILED_ANY_UNCALIBRATED | TACTILED_WARNING | TACTILED_FAULT;

bool has_value(const tactiled_sample& s) noexcept { return s.quality == TACTILED_GOOD || s.quality == TACTILED_UNCERTAIN; }

std::uint16_t age_ms(const tactiled_sample& s, std::uint64_t now_ns) noexcept {
    if (s.t_ns == 0 || (s.reasons & TACTILED_NO_DATA_YET) != 0)
        return kMaxU16;  // no frame so far: must not seem as young as the machine
    const std::uint64_t age = now_ns > s.t_ns ? (now_ns - s.t_ns) / 1'000'000u : 0;
    return std::uint16_t(std::min<std::uint64_t>(age, kMaxU16));
}

std::uint16_t clamped(std::uint32_t value) noexcept { return std::uint16_t(std::min<std::uint32_t>(value, kMaxU16)); }

// Returns the double that is written as 1e-2 in a program, and not a product of rounded tenths.
double unit_N(int scale) noexcept {
    constexpr double kPowers[] = {1e-6, 1e-5, 1e-4, 1e-3, kForceUnit_N, 0.1, 1, 10};
    return kPowers[std::clamp(scale + 6, 0, 7)];
}

// Encodes the forces of a sensor block; returns whether one of them exceeded the range of its register.
bool encode_wrench(const tactiled_sample& s, int scale, std::span<std::uint16_t, kSensorSize> out) noexcept {
    bool beyond = false;
    const double count_N = unit_N(scale);
    for (unsigned i = 0; i < 3; ++i) {
        out[kFx + i] = i16_of(s.force_S_N[i], count_N, beyond);
        out[kTx + i] = i16_of(s.torque_S_Nm[i], kTorque, beyond);
    }
    const double* f = s.force_S_N;
    out[kFTang] = u16_of(std::hypot(f[0], f[1]), count_N, beyond);
    out[kFMag] = u16_of(std::hypot(f[0], f[1], f[2]), count_N, beyond);
    out[kCopX] = i16_of(s.cop_S_m[0], kLength_m, beyond);
    out[kCopY] = i16_of(s.cop_S_m[1], kLength_m, beyond);
    return beyond;
}

bool overloads(const tactiled_sample& s, int scale) noexcept {
    std::uint16_t unused[kSensorSize];
    return (s.reasons & TACTILED_SATURATED) != 0 || (s.state & TACTILED_OVERLOAD) != 0 || encode_wrench(s, scale, unused);
}

// Returns bits 2 .. 6 of the node's STATUS.
std::uint32_t grasp_status(const tactiled_grasp& g) noexcept {
    return (is_grasped(g) ? 1u << 2 : 0u) | (g.slip_mask != 0 ? 1u << 3 : 0u) | (g.slip_latch != 0 ? 1u << 4 : 0u) |
           (has_weight(g) ? 1u << 5 : 0u) | (is_stable(g) ? 1u << 6 : 0u);
}

std::uint16_t sensor_status(const tactiled_sample& s, bool beyond, std::uint16_t slip) noexcept {
    unsigned bits = 0;
    bits |= s.quality == TACTILED_GOOD ? 1u << 0 : 0u;
    bits |= (s.state & TACTILED_CONTACT) != 0 ? 1u << 1 : 0u;
    bits |= slip == TACTILED_SLIP_INCIPIENT ? 1u << 2 : 0u;
    bits |= slip == TACTILED_SLIP_GROSS ? 1u << 3 : 0u;
    bits |= beyond || (s.state & TACTILED_OVERLOAD) != 0 ? 1u << 4 : 0u;
    bits |= (s.reasons & TACTILED_SATURATED) != 0 ? 1u << 5 : 0u;
    bits |= (s.reasons & kSilent) != 0 ? 1u << 6 : 0u;
    bits |= (s.reasons & TACTILED_TARING) != 0 ? 1u << 7 : 0u;
    bits |= s.tare_count != 0 ? 1u << 8 : 0u;
    bits |= (s.reasons & TACTILED_UNCALIBRATED) != 0 ? 1u << 9 : 0u;
    bits |= (s.state & TACTILED_LOW_PASS) != 0 ? 1u << 10 : 0u;
    bits |= (s.state & (TACTILED_STEPPED_DOWN | TACTILED_OVER_BUDGET)) != 0 ? 1u << 11 : 0u;
    bits |= s.quality == TACTILED_UNCERTAIN ? 1u << 12 : 0u;
    bits |= (s.reasons & TACTILED_WRONG_RATE) != 0 ? 1u << 13 : 0u;
    bits |= (s.reasons & TACTILED_DRIFTED) != 0 ? 1u << 14 : 0u;
    bits |= !has_value(s) ? 1u << 15 : 0u;
    return std::uint16_t(bits);
}

bool has_value(std::uint32_t quality) noexcept { return quality == TACTILED_GOOD || quality == TACTILED_UNCERTAIN; }

// STATUS of the wrench on the gripper: the low bits are those of tactiled_tool.why.
std::uint32_t tool_status(std::uint32_t quality, std::uint32_t why) noexcept {
    return (why & 0x7Fu) | (quality == TACTILED_GOOD ? 1u << 8 : 0u) | (quality == TACTILED_UNCERTAIN ? 1u << 9 : 0u) |
           (has_value(quality) ? 0u : 1u << 15);
}

unsigned sensors_of(const View& view) noexcept { return view.segment != nullptr ? view.segment->n_sensors() : 0; }

}  // namespace

std::uint16_t i16_of(double value, double scale, bool& saturated) noexcept {
    if (std::isnan(value)) return kNoI16;
    const double scaled = std::nearbyint(value / scale);
    saturated |= std::abs(scaled) > kMaxI16;
    return std::uint16_t(std::int16_t(std::clamp(scaled, -double(kMaxI16), double(kMaxI16))));
}

std::uint16_t u16_of(double value, double scale, bool& saturated) noexcept {
    if (std::isnan(value)) return kNoU16;
    const double scaled = std::nearbyint(value / scale);
    saturated |= scaled > kMaxU16;
    return std::uint16_t(std::clamp(scaled, 0.0, double(kMaxU16)));
}

void put_float(double value, bool low_word_first, std::uint16_t* out) noexcept {
    auto bits = std::bit_cast<std::uint32_t>(float(value));
    if (!std::isfinite(float(value))) bits = 0x7FC00000;
    out[low_word_first ? 1 : 0] = std::uint16_t(bits >> 16);
    out[low_word_first ? 0 : 1] = std::uint16_t(bits & 0xFFFFu);
}

namespace {
template <typename Number>
void put_tool(const View& view, bool low_word_first, std::uint32_t status, bool valued, const Number (&force_N)[3],
              const Number (&torque_Nm)[3], const Number (&sd_force_N)[3], const Number (&sd_torque_Nm)[3],
              std::span<std::uint16_t, kToolFloatSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    out[kToolFloatSeq] = out[kToolFloatSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    out[kToolFloatStatus] = std::uint16_t(status);
    const auto put = [&](unsigned at, Number value) { put_float(valued ? double(value) : kNaN, low_word_first, &out[at]); };
    for (unsigned i = 0; i < 3; ++i) {
        put(kToolFloatForce + 2 * i, force_N[i]);
        put(kToolFloatTorque + 2 * i, torque_Nm[i]);
        put(kToolFloatSdForce + 2 * i, sd_force_N[i]);
        put(kToolFloatSdTorque + 2 * i, sd_torque_Nm[i]);
    }
}
}  // namespace

std::uint32_t i32_of(double value, double scale) noexcept {
    if (std::isnan(value)) return kNoI32;
    return std::uint32_t(std::int32_t(std::clamp(std::nearbyint(value / scale), -2147483647.0, 2147483647.0)));
}

bool is_grasped(const tactiled_grasp& g) noexcept {
    return g.state >= TACTILED_GRIP_GRASPED && g.state <= TACTILED_GRIP_SLIPPING;
}

bool has_weight(const tactiled_grasp& g) noexcept {
    return (g.weight_state == TACTILED_WEIGHT_ESTIMATING || g.weight_state == TACTILED_WEIGHT_STABLE) &&
           std::isfinite(g.weight_kg);
}

bool is_stable(const tactiled_grasp& g) noexcept {
    return g.weight_state == TACTILED_WEIGHT_STABLE && std::isfinite(g.weight_kg);
}

std::uint32_t sensor_mask_of(const View& view) noexcept { return (1u << sensors_of(view)) - 1; }

View view_of_nothing(std::uint32_t reason) noexcept {
    View view;
    tactiled_forget_grasp(&view.snapshot.node.grasp);
    tactiled_forget_tool(&view.snapshot.node.tool);
    view.snapshot.taken_ns = monotonic_ns();
    for (auto& s : view.snapshot.sensor) tactiled_invalidate(&s, reason);
    return view;
}

View view_of(const Segment& segment) noexcept {
    View view;
    if (!segment.snapshot(view.snapshot)) {
        view = view_of_nothing(segment.is_current() ? TACTILED_READER_OVERRUN : TACTILED_DAEMON_STOPPED);
        view.segment = &segment;
        return view;
    }
    view.segment = &segment;
    view.alive = segment.is_current() &&
                 tactiled_is_fresh(view.snapshot.node.t_ns, view.snapshot.taken_ns, segment.header().watchdog_ms) != 0;
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        tactiled_sample& s = view.snapshot.sensor[i];
        if (!view.alive) s.reasons = 0;  // they are no longer valid
        if (!view.alive || !has_value(s)) tactiled_invalidate(&s, view.alive ? 0u : unsigned(TACTILED_DAEMON_STOPPED));
    }
    return view;
}

void encode_global(const View& view, std::span<std::uint16_t, kGlobalSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    const tactiled_node& node = view.snapshot.node;
    const auto seq = std::uint16_t(node.sequence);
    std::uint64_t newest_ns = 0;
    unsigned ok = 0, contact = 0, stale = 0, overload = 0;
    for (unsigned i = 0; i < sensors_of(view); ++i) {
        const tactiled_sample& s = view.snapshot.sensor[i];
        if ((s.reasons & TACTILED_NO_DATA_YET) == 0) newest_ns = std::max(newest_ns, s.t_ns);
        const unsigned bit = 1u << i;
        ok |= s.quality == TACTILED_GOOD ? bit : 0u;
        stale |= (s.reasons & kSilent) != 0 ? bit : 0u;
        overload |= overloads(s, view.force_scale(i)) ? bit : 0u;
        contact |= (s.state & TACTILED_CONTACT) != 0 ? bit : 0u;
    }
    std::uint32_t status = node.status & 0xFFFFu;
    if (!view.alive) status = (status & kOutlivesLoop) | TACTILED_FAULT | TACTILED_ANY_STALE;
    const tactiled_grasp& grasp = node.grasp;
    status |= grasp_status(grasp);
    if (overload != 0) status |= 1u << 7;
    status = (status & ~std::uint32_t(TACTILED_ANY_CONTACT)) | (contact != 0 ? std::uint32_t(TACTILED_ANY_CONTACT) : 0u);
    if (stale != 0) status = (status & ~std::uint32_t(TACTILED_READY)) | TACTILED_ANY_STALE;

    out[kMagic0] = 0x5441;
    out[kMagic1] = 0x4354;
    out[kMapVersion] = std::uint16_t(kMapMajor << 8 | kMapMinor);
    out[kSensors] = std::uint16_t(sensors_of(view));
    out[kSeq] = out[kSeqEnd] = seq;
    out[kHeartbeat] = std::uint16_t(node.heartbeat);
    tactiled_sample newest{};
    newest.t_ns = newest_ns;
    out[kAgeMs] = age_ms(newest, view.snapshot.taken_ns);
    out[kStatus] = std::uint16_t(status);
    out[kFault] = std::uint16_t(node.fault | (view.alive ? 0u : std::uint32_t(TACTILED_FAULT_INTERNAL)));
    out[kWarn] = std::uint16_t(node.warning);
    out[kOk] = std::uint16_t(ok);
    out[kContact] = std::uint16_t(contact);
    out[kStale] = std::uint16_t(stale);
    out[kOverload] = std::uint16_t(overload);
    out[kSlip] = std::uint16_t(grasp.slip_mask);
    out[kSlipLatch] = std::uint16_t(grasp.slip_latch);
    out[kSlipCount] = std::uint16_t(grasp.slips);
    out[kGripState] = std::uint16_t(grasp.state);
    out[kWeightState] = std::uint16_t(grasp.weight_state);
    bool unused = false;
    out[kGripForce] = u16_of(double(grasp.grip_N), kForceUnit_N, unused);
    out[kRecGrip] = u16_of(double(grasp.recommended_grip_N), kForceUnit_N, unused);
    const double weight_kg = has_weight(grasp) ? grasp.weight_kg : kNaN;
    const std::uint32_t weight = i32_of(weight_kg, kMass_kg);
    out[kWeight] = std::uint16_t(weight >> 16);
    out[kWeight + 1] = std::uint16_t(weight & 0xFFFFu);
    out[kWeightG] = u16_of(weight_kg, 10 * kMass_kg, unused);
    out[kWeightSd] = u16_of(has_weight(grasp) ? grasp.weight_sd_kg : kNaN, kMass_kg, unused);
    out[kCalId] = view.segment != nullptr ? std::uint16_t(view.segment->calibration_id()) : std::uint16_t(0);
    out[kCycleWorst] = view.alive ? clamped(node.worst_cycle_us) : kNoU16;
}

void encode_grasp(const View& view, std::span<std::uint16_t, kGraspSize> out) noexcept {
    const tactiled_grasp& g = view.snapshot.node.grasp;
    out[kGraspSeq] = out[kGraspSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    bool unused = false;
    out[kObjectId] = clamped(g.object_id);
    out[kObjectProbability] = u16_of(double(g.object_probability), kThousandth, unused);
    out[kFriction] = u16_of(double(g.friction), kThousandth, unused);
    out[kFrictionSd] = u16_of(double(g.friction_sd), kThousandth, unused);
    out[kGrasps] = std::uint16_t(g.grasps);
    const std::uint64_t taken_ns = view.snapshot.taken_ns;
    const bool held = is_grasped(g) && g.state != TACTILED_GRIP_GRASPED && g.t_lift_off_ns != 0;
    const double since_ms = taken_ns > g.t_lift_off_ns ? double(taken_ns - g.t_lift_off_ns) / 1e6 : 0;
    out[kSinceLiftOff] = held ? u16_of(std::floor(since_ms), 1, unused) : kNoU16;
}

void encode_doubts(const View& view, std::span<std::uint16_t, kDoubtsSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    const tactiled_grasp& g = view.snapshot.node.grasp;
    out[kDoubtsSeq] = out[kDoubtsSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    out[kWeightWhy] = std::uint16_t(g.weight_doubts);
    out[kWeightJaws] = std::uint16_t(g.doubtful);
}

void encode_tool(const View& view, std::span<std::uint16_t, kToolSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    const tactiled_tool& t = view.snapshot.node.tool;
    const bool valued = has_value(t.quality);
    bool beyond = false, unused = false;
    for (unsigned i = 0; i < 3; ++i) {
        out[kToolForce + i] = i16_of(valued ? t.force_G_N[i] : kNaN, kForceUnit_N, beyond);
        out[kToolTorque + i] = i16_of(valued ? t.torque_G_Nm[i] : kNaN, kTorque, beyond);
        out[kToolSdForce + i] = u16_of(valued ? t.sd_force_N[i] : kNaN, kForceUnit_N, beyond);
        out[kToolSdTorque + i] = u16_of(valued ? t.sd_torque_Nm[i] : kNaN, kTorque, beyond);
    }
    out[kToolSeq] = out[kToolSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    out[kToolStatus] = std::uint16_t(tool_status(t.quality, t.why) | (beyond ? 1u << 10 : 0u));
    out[kToolSensors] = std::uint16_t(t.sensors);
    out[kToolNoValue] = std::uint16_t(t.bad);
    tactiled_sample oldest{};
    oldest.t_ns = t.t_ns;
    out[kToolAgeMs] = t.quality == TACTILED_NO_VALUE ? kNoU16 : age_ms(oldest, view.snapshot.taken_ns);
    out[kToolMass] = t.quality == TACTILED_NO_VALUE ? kNoU16 : u16_of(double(t.mass_kg), 10 * kMass_kg, unused);
}

void encode_tool_floats(const View& view, bool low_word_first, std::span<std::uint16_t, kToolFloatSize> out) noexcept {
    const tactiled_tool& t = view.snapshot.node.tool;
    put_tool(view, low_word_first, tool_status(t.quality, t.why), has_value(t.quality), t.force_G_N, t.torque_G_Nm,
             t.sd_force_N, t.sd_torque_Nm, out);
}

void encode_tool_sensor(const View& view, unsigned index, bool low_word_first,
                        std::span<std::uint16_t, kToolFloatSize> out) noexcept {
    const tactiled_tool& t = view.snapshot.node.tool;
    const std::uint32_t quality = index < sensors_of(view) ? t.sensor_quality[index] : std::uint32_t(TACTILED_NO_VALUE);
    put_tool(view, low_word_first, tool_status(quality, 0), has_value(quality), t.sensor_force_G_N[index],
             t.sensor_torque_G_Nm[index], t.sensor_sd_force_N[index], t.sensor_sd_torque_Nm[index], out);
}

void encode_sensor(const View& view, unsigned index, std::span<std::uint16_t, kSensorSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    tactiled_sample s = view.snapshot.sensor[index];
    const bool exists = index < sensors_of(view);
    if (!exists) tactiled_invalidate(&s, 0);  // block of a missing sensor: sentinels, and only the fault bit of STATUS
    const int scale = view.force_scale(index);
    const bool beyond = encode_wrench(s, scale, out);
    out[kSensorSeq] = out[kSensorSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    const tactiled_grasp& grasp = view.snapshot.node.grasp;
    const bool valued = exists && has_value(s);
    const std::uint16_t slip = valued ? grasp.slip_state[index] : std::uint16_t(TACTILED_SLIP_UNKNOWN);
    out[kSensorStatus] = sensor_status(s, beyond, slip);
    const std::uint16_t why = fault_of(s.reasons);
    const std::uint16_t none = exists ? kFaultUnknown : kFaultNoSensor;  // never 0 if the value is not GOOD
    out[kSensorFault] = s.quality == TACTILED_GOOD ? std::uint16_t(0) : why != 0 ? why : none;
    out[kSensorAgeMs] = exists ? age_ms(s, view.snapshot.taken_ns) : kNoU16;
    bool unused = false;
    out[kSlipState] = slip;
    out[kFrictionUse] = valued ? u16_of(double(grasp.friction_use[index]), kThousandth, unused) : kNoU16;
    out[kSensorSlipCount] = grasp.slip_count[index];
    out[kPeak] =
        exists && (s.reasons & TACTILED_DAEMON_STOPPED) == 0 ? u16_of(double(s.peak_N), unit_N(scale), unused) : kNoU16;
    out[kTemp] = exists && has_value(s) ? i16_of(double(s.temperature_C), kTemperature, unused) : kNoI16;
    out[kScale] = std::uint16_t(std::int16_t(scale));
    out[kTareCount] = std::uint16_t(s.tare_count);
    out[kRate] = exists && (s.reasons & kSilent) == 0 ? u16_of(double(s.rate_Hz), 1, unused) : kNoU16;
    out[kLost] = std::uint16_t(s.lost);
    out[kRawState] = std::uint16_t(s.missing | s.saturated);
}

void encode_floats(const View& view, bool low_word_first, std::span<std::uint16_t, kFloatSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    out[kFloatSeq] = out[kFloatSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    const tactiled_grasp& g = view.snapshot.node.grasp;
    const auto put = [&](unsigned at, double value) { put_float(value, low_word_first, &out[at]); };
    put(kFloatWeight, has_weight(g) ? g.weight_kg : kNaN);
    put(kFloatWeightSd, has_weight(g) ? g.weight_sd_kg : kNaN);
    put(kFloatGrip, double(g.grip_N));
    put(kFloatRecGrip, double(g.recommended_grip_N));
    put(kFloatFriction, double(g.friction));
    put(kFloatFrictionSd, double(g.friction_sd));
    put(kFloatObjectProbability, double(g.object_probability));
    put(kFloatTime, std::fmod(double(view.snapshot.node.t_ns) * 1e-9, 4096));
}

void encode_sensor_floats(const View& view, unsigned index, bool low_word_first,
                          std::span<std::uint16_t, kSensorFloatSize> out) noexcept {
    std::uint16_t block[kSensorSize];
    encode_sensor(view, index, block);
    tactiled_sample s = view.snapshot.sensor[index];
    if (index >= sensors_of(view)) tactiled_invalidate(&s, 0);
    out[kFloatSensorSeq] = out[kFloatSensorSeqEnd] = block[kSensorSeq];
    out[kFloatStatus] = block[kSensorStatus];
    const auto put = [&](unsigned at, double value) { put_float(value, low_word_first, &out[at]); };
    for (unsigned i = 0; i < 3; ++i) {
        put(kFloatForce + 2 * i, s.force_S_N[i]);
        put(kFloatTorque + 2 * i, s.torque_S_Nm[i]);
    }
    put(kFloatCop, s.cop_S_m[0] * 1000);
    put(kFloatCop + 2u, s.cop_S_m[1] * 1000);
    put(kFloatMag, std::hypot(s.force_S_N[0], s.force_S_N[1], s.force_S_N[2]));
    put(kFloatTang, std::hypot(s.force_S_N[0], s.force_S_N[1]));
    put(kFloatTemp, has_value(s) ? double(s.temperature_C) : kNaN);
}

void encode_inputs(std::span<const std::uint16_t, kGlobalSize> global, std::span<std::uint8_t, kInputs> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint8_t(0));
    for (unsigned i = 0; i < kSensorBlocks; ++i) {
        const auto bit = [&](std::uint16_t mask) { return std::uint8_t(mask >> i & 1u); };
        out[kContactInputs + i] = bit(global[kContact]);
        out[kSlipInputs + i] = bit(global[kSlipLatch]);
        out[kOkInputs + i] = bit(global[kOk]);
        out[kOverloadInputs + i] = bit(global[kOverload]);
    }
    out[kGraspedInput] = std::uint8_t(global[kStatus] >> 2 & 1);
    out[kStableInput] = std::uint8_t(global[kStatus] >> 6 & 1);
    out[kBlinkInput] = std::uint8_t(global[kHeartbeat] / 10 & 1);
    out[kFaultInput] = std::uint8_t(global[kStatus] >> 15);
}

}  // namespace tactiled::modbus
