#include "node/modbus/taxels.hpp"

#include <algorithm>

namespace tactiled::modbus {
namespace {

constexpr std::uint16_t kNoValue = 0x8000;  // in STATUS of a head

// False if the snapshot is too old, or if it has values and its sensor has none now.
bool is_valid(const LatchedTaxels& latched, const View& view, std::uint64_t now_ns) noexcept {
    if (latched.sensor == kSensorBlocks || now_ns >= latched.until_ns) return false;
    return (latched.head[kArrayStatus] & kNoValue) != 0 || view.snapshot.sensor[latched.sensor].quality != TACTILED_BAD;
}

}  // namespace

Exception Taxels::read(Run run, const View& view, LatchedTaxels& latched, std::uint64_t now_ns,
                       std::span<std::uint16_t> out) {
    const Area& area = *area_of(run.at, run.count);
    const unsigned n = unsigned(run.at - area.at) / area.repeats, first = unsigned(run.at - area.at) % area.repeats;
    const bool is_head = area.block == Block::heads;
    if (is_head && first == kToken)
        latch(n, view, latched, now_ns);
    else if (!is_valid(latched, view, now_ns) || (is_head && latched.sensor != n))
        return kDeviceFailure;
    if (is_head) {
        std::copy_n(latched.head.begin() + first, run.count, out.begin());
        return kNone;
    }
    if (n >= latched.head[kArrayPages]) return kIllegalAddress;
    for (unsigned i = 0; i < run.count; ++i) {
        const std::size_t value = std::size_t(n) * kPageValues + first + i - 1;
        out[i] = first + i == kToken ? latched.head[kToken] : value < latched.values.size() ? latched.values[value] : kNoI16;
    }
    return kNone;
}

void Taxels::latch(unsigned sensor, const View& view, LatchedTaxels& latched, std::uint64_t now_ns) {
    latched.sensor = kSensorBlocks;  // stays so if an allocation fails
    latched.values.clear();
    View of_head = view;
    LatchedArray parts{0, 0, false, array_};
    if (sensor < sensors_of(view) && view.segment->has_array(sensor)) {
        (void)view.segment->latest(sensor, array_);
        const double unit_N = force_unit_N(view, sensor);
        latched.values.reserve(array_.force_span().size());
        for (const float force_N : array_.force_span())
            latched.values.push_back(i16_of(double(force_N), unit_N, parts.saturates));
        token_ = token_ == kMaxU16 ? 1 : std::uint16_t(token_ + 1);
        parts.token = token_;
        parts.pages = std::uint16_t((latched.values.size() + kPageValues - 1) / kPageValues);
        of_head.snapshot.sensor[sensor] = array_.head().sample;
        of_head.snapshot.taken_ns = monotonic_ns();
        of_head.latched = &parts;
    }
    encode(area_with(Block::heads), latched.head, of_head, sensor);
    latched.until_ns = now_ns + kExpiresNs;
    latched.sensor = sensor;
}

}  // namespace tactiled::modbus
