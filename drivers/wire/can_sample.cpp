#include "drivers/wire/can_sample.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <limits>
#include <string_view>
#include <utility>

namespace tactiled {

bool CanDevice::has_sequence() const noexcept {
    return std::any_of(parts.begin(), parts.end(), [](const CanPart& part) { return part.sequence.has_value(); });
}

bool CanDevice::is_assembled_by_counter() const noexcept {
    return std::all_of(parts.begin(), parts.end(), [](const CanPart& part) { return part.sequence.has_value(); });
}

CanSamples::CanSamples(std::vector<CanDevice> devices, LinkCounts& counts)
    : devices_(std::move(devices)), counts_(counts), pending_(devices_.size()) {
    for (std::size_t d = 0; d < devices_.size(); ++d) {
        assert(devices_[d].n_channels <= kMaxChannels && devices_[d].parts.size() <= kCanMaxParts);
        for (std::size_t p = 0; p < devices_[d].parts.size(); ++p)
            routes_.push_back({devices_[d].parts[p].id, std::uint16_t(d), std::uint16_t(p)});
    }
    std::stable_sort(routes_.begin(), routes_.end(), [](const Route& a, const Route& b) { return a.id < b.id; });
}

void CanSamples::take(const CanArrival& arrival) noexcept {
    assert(route_ == routes_end_);
    arrival_ = arrival;
    const auto first = std::lower_bound(routes_.begin(), routes_.end(), arrival.id,
                                        [](const Route& r, std::uint32_t id) { return r.id < id; });
    const auto end =
        std::upper_bound(first, routes_.end(), arrival.id, [](std::uint32_t id, const Route& r) { return id < r.id; });
    route_ = std::size_t(first - routes_.begin());
    routes_end_ = std::size_t(end - routes_.begin());
    used_ = rejected_ = false;
    counts_[TACTILED_LINK_BYTES] += std::uint32_t(arrival.bytes.size());
    if (route_ == routes_end_) counts_[TACTILED_LINK_SKIPPED] += std::uint32_t(arrival.bytes.size());
}

bool CanSamples::next(Frame& frame) noexcept {
    while (route_ != routes_end_) {
        const Route& route = routes_[route_++];
        const bool complete = give(route);
        if (complete) frame = pending_[route.device].frame;
        if (route_ == routes_end_ && !used_) counts_[TACTILED_LINK_SKIPPED] += std::uint32_t(arrival_.bytes.size());
        if (complete) return true;
    }
    return false;
}

void CanSamples::lost(std::uint32_t id, std::uint32_t samples) noexcept {
    for (const Route& route : routes_)
        if (route.id == id && samples != 0) {
            pending_[route.device].lost += samples;
            counts_[TACTILED_LINK_LOST] += samples;
            return;  // an id of one device
        }
}

void CanSamples::reset() noexcept {
    for (auto& pending : pending_) {
        pending.parts = pending.orphans = pending.lost = 0;
        pending.begun = false;
        pending.sequence.reset();
    }
    route_ = routes_end_ = 0;
}

bool CanSamples::reject(tactiled_link_count kind) noexcept {
    if (!std::exchange(rejected_, true)) ++counts_[kind];  // counted once per message, for any number of signals
    return false;
}

bool CanSamples::give(const Route& route) noexcept {
    const CanDevice& device = devices_[route.device];
    const CanPart& part = device.parts[route.part];
    Pending& pending = pending_[route.device];
    const auto bytes = arrival_.bytes;
    if (part.multiplexed) {
        if (bytes.size() < bytes_needed(part.selector)) return reject(TACTILED_LINK_BAD_LENGTH);
        if (raw_of(part.selector, bytes) != part.selected) return false;
    }
    if (bytes.size() < part.bytes) return reject(TACTILED_LINK_BAD_LENGTH);
    std::array<double, kMaxChannels> values;
    for (std::size_t k = 0; k < part.channels.size(); ++k) {
        values[k] = value_of(part.channels[k].signal, bytes);
        if (std::isinf(values[k])) return reject(TACTILED_LINK_BAD_VALUE);
    }
    used_ = true;

    const auto count = part.sequence ? std::uint32_t(raw_of(*part.sequence, bytes)) : 0u;
    const bool belongs = device.is_assembled_by_counter() ? belongs_by_counter(device, pending, route.part, count, values)
                                                          : belongs_by_order(device, pending, route.part, values);
    if (!belongs) return false;
    pending.parts |= 1u << route.part;
    if (part.sequence) pending.count = count;
    for (std::size_t k = 0; k < part.channels.size(); ++k) {
        const unsigned index = part.channels[k].index;
        const bool missing = std::isnan(values[k]);
        pending.frame.channel[index] = missing ? std::numeric_limits<double>::quiet_NaN() : values[k];
        if (missing) pending.frame.missing |= 1u << index;
    }
    const auto all = std::uint32_t((std::uint64_t{1} << device.parts.size()) - 1);
    return pending.parts == all && finish(device, pending);
}

// A message of a part that the sample already has, with the same content, was sent twice.
bool CanSamples::is_again(const CanPart& part, const Pending& pending, std::span<const double> values) noexcept {
    bool same = true;
    for (std::size_t k = 0; k < part.channels.size(); ++k) {
        const double before = pending.frame.channel[part.channels[k].index];
        same = same && (values[k] == before || (std::isnan(values[k]) && std::isnan(before)));
    }
    return same;
}

// The parts of a sample have the same count. They may come in any order.
bool CanSamples::belongs_by_counter(const CanDevice& device, Pending& pending, unsigned part, std::uint32_t count,
                                    std::span<const double> values) noexcept {
    if (pending.parts != 0 && (pending.count != count || !is_within(1, device, pending.frame.t_ns))) lose(pending);
    if (pending.parts == 0) begin(device, pending);
    if ((pending.parts >> part & 1u) == 0) return true;
    if (!is_again(device.parts[part], pending, values)) pending.sequence.suspect();
    ++counts_[TACTILED_LINK_REPEATED];
    return false;
}

// A sample begins with the first part; the others follow in any order, each once. A message that does not fit
// discards the sample that it would belong to.
bool CanSamples::belongs_by_order(const CanDevice& device, Pending& pending, unsigned part,
                                  std::span<const double> values) noexcept {
    const std::uint32_t bit = 1u << part;
    if (part == 0) {
        if (pending.parts != 0) {
            // A second device may have begun its sample within this one, so that the parts of both would be combined.
            if (is_within(1, device, pending.frame.t_ns) && !is_again(device.parts[0], pending, values))
                pending.sequence.suspect();
            lose(pending);
        }
        begin(device, pending);
        return true;
    }
    const bool is_new = (pending.parts & bit) == 0;
    if (pending.parts != 0 && is_new && is_within(1, device, pending.frame.t_ns)) return true;
    const bool is_late = pending.parts != 0 && is_new && is_within(2, device, pending.frame.t_ns);
    if (pending.parts != 0) {
        lose(pending);
        pending.orphans = is_late ? bit : 0;
        pending.orphans_ns = pending.frame.t_ns;
        if (is_late) return false;
    }
    // The next sample begins at least two windows after the last one. A sample whose first part was lost is counted
    // when its first other part arrives.
    const bool counted = pending.orphans != 0 && (pending.orphans & bit) == 0 && is_within(2, device, pending.orphans_ns);
    if (!counted) {
        if (pending.begun) lose(pending);
        pending.orphans = 0;
        pending.orphans_ns = arrival_.t_ns;
    }
    pending.orphans |= bit;
    return false;
}

void CanSamples::begin(const CanDevice& device, Pending& pending) noexcept {
    pending.frame = Frame{};
    pending.frame.t_ns = arrival_.t_ns;
    pending.frame.device = device.device;
    pending.frame.n_channels = device.n_channels;
    pending.orphans = 0;
    pending.begun = true;
}

bool CanSamples::is_within(unsigned windows, const CanDevice& device, std::uint64_t since_ns) const noexcept {
    return arrival_.t_ns <= since_ns + windows * device.window_ns;
}

void CanSamples::lose(Pending& pending) noexcept {
    pending.parts = 0;
    ++pending.lost;
    ++counts_[TACTILED_LINK_LOST];
}

bool CanSamples::finish(const CanDevice& device, Pending& pending) noexcept {
    Frame& frame = pending.frame;
    pending.parts = 0;
    if (device.has_sequence()) {
        const auto part =
            std::find_if(device.parts.begin(), device.parts.end(), [](const CanPart& p) { return p.sequence.has_value(); });
        const std::string_view numbers(reinterpret_cast<const char*>(frame.channel.data()),
                                       frame.n_channels * sizeof(double));
        const auto content = std::uint32_t(std::hash<std::string_view>{}(numbers));
        const auto verdict = pending.sequence.next(pending.count, part->sequence->length, content, false);
        if (!verdict.accept) {
            ++counts_[TACTILED_LINK_REPEATED];
            return false;
        }
        // losses that were not counted as incomplete samples
        const std::uint32_t unseen = verdict.lost - std::min(verdict.lost, pending.lost);
        counts_[TACTILED_LINK_LOST] += unseen;
        pending.lost += unseen;
        put_number(frame, pending.count, part->sequence->length, verdict);
    }
    frame.lost = std::exchange(pending.lost, 0);
    ++counts_[TACTILED_LINK_FRAMES];
    return true;
}

}  // namespace tactiled
