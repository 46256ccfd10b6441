#include "node/modbus/encode.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "node/modbus/rows.hpp"

namespace tactiled::modbus {
namespace {

constexpr std::uint32_t kSilent = TACTILED_REASONS_OF_OLD;

// One count of a register in the unit of its value.
double count_of(const Register& r, const Source& s) noexcept {
    return r.unit.configurable ? force_unit_N(s.view, s.sensor) : r.unit.scale;
}

// Encodes a register of one or two words; sets `saturated` if the value exceeds its range.
void put(const Register& r, const Source& s, bool low_word_first, std::uint16_t* out, bool& saturated) noexcept {
    const double value = r.value.of(s);
    switch (r.type) {
        case Type::i16: *out = i16_of(value, count_of(r, s), saturated); return;
        case Type::u16: *out = u16_of(value, count_of(r, s), saturated); return;
        case Type::f32: return put_float(value, low_word_first, out);
        case Type::i32:
            out[0] = std::uint16_t(i32_of(value, r.unit.scale) >> 16);
            out[1] = std::uint16_t(i32_of(value, r.unit.scale) & 0xFFFFu);
            return;
        case Type::bits:
        case Type::mask:
        case Type::enumeration:
        case Type::count:
        case Type::text: *out = std::uint16_t(std::uint32_t(value)); return;  // the low word; counters wrap
    }
}

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

std::uint32_t i32_of(double value, double scale) noexcept {
    if (std::isnan(value)) return kNoI32;
    return std::uint32_t(std::int32_t(std::clamp(std::nearbyint(value / scale), -2147483647.0, 2147483647.0)));
}

void put_float(double value, bool low_word_first, std::uint16_t* out) noexcept {
    auto bits = std::bit_cast<std::uint32_t>(float(value));
    if (!std::isfinite(float(value))) bits = 0x7FC00000;
    out[low_word_first ? 1 : 0] = std::uint16_t(bits >> 16);
    out[low_word_first ? 0 : 1] = std::uint16_t(bits & 0xFFFFu);
}

double decode(const Register& of, std::uint16_t word) noexcept {
    if (of.type == Type::i16) return word == kNoI16 ? kNaN : std::int16_t(word) * of.unit.scale;
    return of.limits.locked && word == kAsConfigured ? kNaN : word * of.unit.scale;
}

bool is_grasped(const tactiled_grasp& g) noexcept {
    return g.state >= TACTILED_GRIP_GRASPED && g.state <= TACTILED_GRIP_SLIPPING;
}

bool has_weight(const tactiled_grasp& g) noexcept {
    return (g.weight_state == TACTILED_WEIGHT_ESTIMATING || g.weight_state == TACTILED_WEIGHT_STABLE) &&
           std::isfinite(g.weight_kg);
}

bool is_stable(const tactiled_grasp& g) noexcept {
    return g.weight_state == TACTILED_WEIGHT_STABLE && g.weight_doubts == 0 && std::isfinite(g.weight_kg);
}

bool is_silent(std::uint32_t reasons) noexcept { return (reasons & kSilent) != 0; }

// Returns the double that is written as 1e-2 in a program, and not a product of rounded tenths.
double force_unit_N(const View& view, unsigned sensor) noexcept {
    constexpr double kPowers[] = {1e-6, 1e-5, 1e-4, 1e-3, kForceUnit_N, 0.1, 1, 10};
    return kPowers[std::clamp(view.force_scale(sensor) + 6, 0, 7)];
}

unsigned sensors_of(const View& view) noexcept { return view.segment != nullptr ? view.segment->n_sensors() : 0; }
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
        if (!view.alive || !has_value(s.quality))
            tactiled_invalidate(&s, view.alive ? 0u : unsigned(TACTILED_DAEMON_STOPPED));
    }
    return view;
}

bool exceeds_range(std::span<const Register> rows, const Source& s) noexcept {
    std::uint16_t unused[2];
    bool exceeds = false;
    for (const Register& r : rows)
        if (r.value.reports_range) put(r, s, false, unused, exceeds);
    return exceeds;
}

void encode(const Area& area, std::span<std::uint16_t> out, const View& view, unsigned n,
            const ClientReport& client) noexcept {
    const Source source(view, client, area.repeats != 0 ? n : kWholeNode);
    bool unused = false;
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    for (const Register& r : area.registers) put(r, source, area.low_word_first, &out[r.at], unused);
}

void encode_inputs(std::span<const std::uint16_t, kGlobalSize> global, std::span<std::uint8_t, kInputs> out) noexcept {
    for (const Bits& run : discrete_inputs())
        for (unsigned i = 0; i < run.count; ++i) out[run.at + i] = std::uint8_t(global[run.from] >> (run.bit + i) & 1);
    out[kBlinkInput] = std::uint8_t(global[kHeartbeat] / 10 & 1);
}

}  // namespace tactiled::modbus
