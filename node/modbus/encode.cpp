#include "node/modbus/encode.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace tactiled::modbus {
namespace {

constexpr double kTorque = 0.001, kLength_m = 1e-5, kTemperature = 0.1;
constexpr std::uint16_t kMostU16 = 65534;

constexpr std::uint32_t kSilent = TACTILED_STALE | TACTILED_DISCONNECTED | TACTILED_NO_DATA_YET | TACTILED_DAEMON_STOPPED;
// What remains true of the node when its loop has stopped; what its sensors do now is no longer known.
constexpr std::uint32_t kOutlivesLoop = TACTILED_SIMULATED | TACTILED_ANY_UNCALIBRATED | TACTILED_WARNING | TACTILED_FAULT;

bool has_value(const tactiled_sample& s) noexcept { return s.quality == TACTILED_GOOD || s.quality == TACTILED_UNCERTAIN; }

std::uint16_t age_ms(const tactiled_sample& s, std::uint64_t now_ns) noexcept {
    if (s.t_ns == 0 || (s.reasons & TACTILED_NO_DATA_YET) != 0)
        return kMostU16;  // no frame ever: not as young as the machine
    const std::uint64_t age = now_ns > s.t_ns ? (now_ns - s.t_ns) / 1'000'000u : 0;
    return std::uint16_t(std::min<std::uint64_t>(age, kMostU16));
}

std::uint16_t clamped(std::uint32_t value) noexcept { return std::uint16_t(std::min<std::uint32_t>(value, kMostU16)); }

// The forces of a sensor block, and whether one of them left the range of its register.
bool encode_wrench(const tactiled_sample& s, std::span<std::uint16_t, kSensorSize> out) noexcept {
    bool beyond = false;
    for (unsigned i = 0; i < 3; ++i) {
        out[kFx + i] = i16_of(s.force_S_N[i], kForceUnit_N, beyond);
        out[kTx + i] = i16_of(s.torque_S_Nm[i], kTorque, beyond);
    }
    const double* f = s.force_S_N;
    out[kFTang] = u16_of(std::hypot(f[0], f[1]), kForceUnit_N, beyond);
    out[kFMag] = u16_of(std::hypot(f[0], f[1], f[2]), kForceUnit_N, beyond);
    out[kCopX] = i16_of(s.cop_S_m[0], kLength_m, beyond);
    out[kCopY] = i16_of(s.cop_S_m[1], kLength_m, beyond);
    return beyond;
}

bool overloads(const tactiled_sample& s) noexcept {
    std::uint16_t unused[kSensorSize];
    return (s.reasons & TACTILED_SATURATED) != 0 || (s.state & TACTILED_OVERLOAD) != 0 || encode_wrench(s, unused);
}

std::uint16_t sensor_status(const tactiled_sample& s, bool beyond) noexcept {
    unsigned bits = 0;
    bits |= s.quality == TACTILED_GOOD ? 1u << 0 : 0u;
    bits |= (s.state & TACTILED_CONTACT) != 0 ? 1u << 1 : 0u;
    bits |= beyond || (s.state & TACTILED_OVERLOAD) != 0 ? 1u << 4 : 0u;
    bits |= (s.reasons & TACTILED_SATURATED) != 0 ? 1u << 5 : 0u;
    bits |= (s.reasons & kSilent) != 0 ? 1u << 6 : 0u;
    bits |= (s.reasons & TACTILED_TARING) != 0 ? 1u << 7 : 0u;
    bits |= s.tare_count != 0 ? 1u << 8 : 0u;
    bits |= (s.reasons & TACTILED_UNCALIBRATED) != 0 ? 1u << 9 : 0u;
    bits |= (s.state & TACTILED_LOW_PASS) != 0 ? 1u << 10 : 0u;
    bits |= s.quality == TACTILED_UNCERTAIN ? 1u << 12 : 0u;
    bits |= !has_value(s) ? 1u << 15 : 0u;
    return std::uint16_t(bits);
}

unsigned sensors_of(const View& view) noexcept { return view.segment != nullptr ? view.segment->n_sensors() : 0; }

}  // namespace

std::uint16_t i16_of(double value, double scale, bool& saturated) noexcept {
    if (std::isnan(value)) return kNoI16;
    const double scaled = std::nearbyint(value / scale);
    saturated |= std::abs(scaled) > kMostI16;
    return std::uint16_t(std::int16_t(std::clamp(scaled, -double(kMostI16), double(kMostI16))));
}

std::uint16_t u16_of(double value, double scale, bool& saturated) noexcept {
    if (std::isnan(value)) return kNoU16;
    const double scaled = std::nearbyint(value / scale);
    saturated |= scaled > kMostU16;
    return std::uint16_t(std::clamp(scaled, 0.0, double(kMostU16)));
}

void put_float(double value, bool low_word_first, std::uint16_t* out) noexcept {
    auto bits = std::bit_cast<std::uint32_t>(float(value));
    if (!std::isfinite(float(value))) bits = 0x7FC00000;
    out[low_word_first ? 1 : 0] = std::uint16_t(bits >> 16);
    out[low_word_first ? 0 : 1] = std::uint16_t(bits & 0xFFFFu);
}

View view_of_nothing(std::uint32_t reason) noexcept {
    View view;
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
        if (!view.alive) s.reasons = 0;  // they were true once
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
        stale |= (sensor_status(s, false) >> 6 & 1u) != 0 ? bit : 0u;
        overload |= overloads(s) ? bit : 0u;
        contact |= (s.state & TACTILED_CONTACT) != 0 ? bit : 0u;
    }
    std::uint32_t status = node.status & 0xFFFFu;
    if (!view.alive) status = (status & kOutlivesLoop) | TACTILED_FAULT | TACTILED_ANY_STALE;
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
    for (const auto at : {kGripForce, kGripState, kWeightG, kWeightSd, kRecGrip}) out[at] = kNoU16;
    out[kWeight] = std::uint16_t(kNoI32 >> 16);
    out[kWeight + 1] = std::uint16_t(kNoI32 & 0xFFFFu);
    out[kCalId] = view.segment != nullptr ? std::uint16_t(view.segment->header().calibration_id) : std::uint16_t(0);
    out[kCycleWorst] = view.alive ? clamped(node.worst_cycle_us) : kNoU16;
}

void encode_sensor(const View& view, unsigned index, std::span<std::uint16_t, kSensorSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    tactiled_sample s = view.snapshot.sensor[index];
    const bool exists = index < sensors_of(view);
    if (!exists) tactiled_invalidate(&s, 0);  // a block of no sensor: sentinels, and no bit of STATUS but fault
    const bool beyond = encode_wrench(s, out);
    out[kSensorSeq] = out[kSensorSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    out[kSensorStatus] = sensor_status(s, beyond);
    const std::uint16_t why = fault_of(s.reasons);
    const std::uint16_t none = exists ? kFaultUnknown : kFaultNoSensor;  // never 0 where the value is not GOOD
    out[kSensorFault] = s.quality == TACTILED_GOOD ? std::uint16_t(0) : why != 0 ? why : none;
    out[kSensorAgeMs] = exists ? age_ms(s, view.snapshot.taken_ns) : kNoU16;
    for (const auto at : {kFrictionUse, kSlipState}) out[at] = kNoU16;
    bool unused = false;
    out[kPeak] =
        exists && (s.reasons & TACTILED_DAEMON_STOPPED) == 0 ? u16_of(double(s.peak_N), kForceUnit_N, unused) : kNoU16;
    out[kTemp] = exists && has_value(s) ? i16_of(double(s.temperature_C), kTemperature, unused) : kNoI16;
    out[kScale] = std::uint16_t(std::int16_t(-2));
    out[kTareCount] = std::uint16_t(s.tare_count);
    out[kRate] = exists && (s.reasons & kSilent) == 0 ? u16_of(double(s.rate_Hz), 1, unused) : kNoU16;
    out[kLost] = std::uint16_t(s.lost);
    out[kRawState] = std::uint16_t(s.missing | s.saturated);
}

void encode_floats(const View& view, bool low_word_first, std::span<std::uint16_t, kFloatSize> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    out[kFloatSeq] = out[kFloatSeqEnd] = std::uint16_t(view.snapshot.node.sequence);
    for (const auto at : {kFloatWeight, kFloatWeightSd, kFloatGrip, kFloatRecGrip, kFloatFriction})
        put_float(std::numeric_limits<double>::quiet_NaN(), low_word_first, &out[at]);
    put_float(std::fmod(double(view.snapshot.node.t_ns) * 1e-9, 4096), low_word_first, &out[kFloatTime]);
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
    put(kFloatTemp, has_value(s) ? double(s.temperature_C) : std::numeric_limits<double>::quiet_NaN());
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
    out[kBlinkInput] = std::uint8_t(global[kHeartbeat] / 10 & 1);
    out[kFaultInput] = std::uint8_t(global[kStatus] >> 15);
}

}  // namespace tactiled::modbus
