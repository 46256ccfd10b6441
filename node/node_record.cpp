#include "node/node_record.hpp"

#include <utility>

namespace tactiled {
namespace {

constexpr std::uint64_t kMs = 1'000'000, kSecond = 1000 * kMs;
constexpr std::uint64_t kHeartbeatNs = 100 * kMs;
// Longest time between two records while a sensor delivers. Readers forget the grasp and the tool after 20 ms (reader.h), if
// a stale_ms is as short.
constexpr std::uint64_t kNodeRecordNs = 10 * kMs;
constexpr std::uint64_t kRecordsPerWatchdog = 3;  // readers take the daemon for dead after watchdog_ms without one

template <typename Bit>
std::uint32_t bit_if(bool on, Bit bit) noexcept {
    return on ? std::uint32_t(bit) : 0u;
}

}  // namespace

void NodeRecord::latch_faults_of(std::uint32_t reasons) noexcept {
    latch(
        bit_if((reasons & TACTILED_SATURATED) != 0, TACTILED_FAULT_OVERRANGE) |
        bit_if((reasons & TACTILED_MISSING_CHANNEL) != 0, TACTILED_FAULT_OPEN_GAUGE) |
        bit_if((reasons & TACTILED_UNCALIBRATED) != 0, TACTILED_FAULT_CALIBRATION) |
        bit_if((reasons & TACTILED_NOT_FINITE) != 0, TACTILED_FAULT_INTERNAL) |
        bit_if((reasons & (TACTILED_FROZEN | TACTILED_IDLE_BUS | TACTILED_WRONG_DEVICE)) != 0, TACTILED_FAULT_SENSOR_LOST));
}

// Returns the faults whose cause lasts without new samples.
std::uint32_t NodeRecord::lasting_faults(const Tares& tares) const noexcept {
    constexpr std::uint32_t kGone = TACTILED_STALE | TACTILED_DISCONNECTED;
    std::uint32_t reasons = 0;
    for (const auto& sensor : sensors_)  // a sensor that has never delivered causes no fault
        if ((sensor.last().reasons & TACTILED_NO_DATA_YET) == 0) reasons |= sensor.last().reasons;
    return bit_if((reasons & kGone) != 0, TACTILED_FAULT_SENSOR_LOST) |
           bit_if((reasons & TACTILED_DISCONNECTED) != 0, TACTILED_FAULT_BUS) |
           bit_if(!tares.can_keep(), TACTILED_FAULT_STORAGE);
}

// The absence of a cause is measured from the last record in which it was present.
void NodeRecord::follow_faults(std::uint64_t now_ns, const Tares& tares) noexcept {
    if (!tares.can_keep()) latch(TACTILED_FAULT_STORAGE);
    if (clear_after_ns_ == 0 || node_.fault == 0) return;
    seen_ |= lasting_faults(tares);
    for (std::size_t bit = 0; bit < kFaults; ++bit) {
        if ((seen_ >> bit & 1u) != 0) last_seen_ns_[bit] = now_ns;
        if (now_ns - last_seen_ns_[bit] >= clear_after_ns_) node_.fault &= ~(1u << bit);
    }
    seen_ = 0;
}

bool NodeRecord::is_delivering() const noexcept {
    return std::any_of(sensors_.begin(), sensors_.end(), [](const Sensor& s) { return s.is_delivering(); });
}

void NodeRecord::beat(std::uint64_t now_ns) noexcept {
    if (now_ns - heartbeat_ns_ < kHeartbeatNs) return;
    heartbeat_ns_ += (now_ns - heartbeat_ns_) / kHeartbeatNs * kHeartbeatNs;
    if (!is_delivering()) return;
    ++node_.heartbeat;
    has_news_ = true;
}

void NodeRecord::account(std::uint64_t cycle_ns, std::uint64_t missed) noexcept {
    ++node_.cycles;
    node_.missed_cycles += missed;
    worst_ns_ = std::max(worst_ns_, std::uint32_t(std::min<std::uint64_t>(cycle_ns, UINT32_MAX)));
    if (node_.t_ns - worst_since_ns_ < kSecond) return;
    node_.worst_cycle_us = (worst_ns_ + 999) / 1000;
    worst_since_ns_ = node_.t_ns;
    worst_ns_ = 0;
}

std::uint64_t NodeRecord::interval_ns() const noexcept {
    const std::uint64_t watchdog_ns = segment_.watchdog_ms() * kMs / kRecordsPerWatchdog;
    return std::min(watchdog_ns, is_delivering() ? kNodeRecordNs : kIdleNs);
}

bool NodeRecord::is_due(std::uint64_t now_ns) const noexcept { return has_news_ || now_ns - node_.t_ns >= interval_ns(); }

std::uint64_t NodeRecord::deadline_ns() const noexcept {
    const std::uint64_t record_ns = node_.t_ns + interval_ns();
    return is_delivering() ? std::min(record_ns, heartbeat_ns_ + kHeartbeatNs) : record_ns;
}

void NodeRecord::publish(std::uint64_t now_ns, const Tares& tares, const tactiled_grasp& grasp, const tactiled_tool& tool,
                         bool hints_expired) noexcept {
    bool all_have_values = true, all_deliver = true;
    std::uint32_t reasons = 0, states = 0, lost = 0, refused = 0;
    for (const auto& sensor : sensors_) {
        all_have_values &= sensor.last().quality != TACTILED_BAD;
        all_deliver &= sensor.is_delivering();
        reasons |= sensor.last().reasons;
        states |= sensor.last().state;
        lost += sensor.last().lost;
    }
    for (const auto& link : links_) refused += link->ring_full.load(std::memory_order_relaxed);
    if (refused != std::exchange(refused_seen_, refused)) latch(TACTILED_FAULT_OVERRUN);
    if (lost != std::exchange(lost_seen_, lost)) lost_until_ns_ = now_ns + kSecond;

    follow_faults(now_ns, tares);
    node_.warning = warnings(now_ns, tares, reasons, states) |
                    bit_if((grasp.weight_doubts & ~std::uint32_t(TACTILED_DOUBT_MOVES)) != 0, TACTILED_WARN_JAWS) |
                    bit_if(hints_expired, TACTILED_WARN_HINTS);
    node_.status = fixed_status_ | bit_if(all_deliver && all_have_values, TACTILED_READY) |
                   bit_if((states & TACTILED_CONTACT) != 0, TACTILED_ANY_CONTACT) |
                   bit_if(!all_deliver, TACTILED_ANY_STALE) |
                   bit_if((reasons & TACTILED_UNCALIBRATED) != 0, TACTILED_ANY_UNCALIBRATED) |
                   bit_if(tares.is_running(), TACTILED_ANY_TARING) | bit_if(node_.warning != 0, TACTILED_WARNING) |
                   bit_if(node_.fault != 0, TACTILED_FAULT);
    node_.grasp = grasp;
    node_.tool = tool;
    if (!is_delivering()) {  // readers do the same with a record that is older than a stale_ms
        tactiled_forget_grasp(&node_.grasp);
        tactiled_forget_tool(&node_.tool);
    }
    node_.t_ns = now_ns;
    segment_.publish(node_);
    ++node_.sequence;
    has_news_ = false;
}

std::uint32_t NodeRecord::warnings(std::uint64_t now_ns, const Tares& tares, std::uint32_t reasons,
                                   std::uint32_t states) const noexcept {
    return bit_if((reasons & TACTILED_DRIFTED) != 0, TACTILED_WARN_DRIFT) |
           bit_if(now_ns < lost_until_ns_, TACTILED_WARN_LOST) |
           bit_if(tares.result() != TACTILED_COMMAND_OK, TACTILED_WARN_TARE) |
           bit_if((states & (TACTILED_STEPPED_DOWN | TACTILED_OVER_BUDGET)) != 0, TACTILED_WARN_BUDGET) |
           bit_if((reasons & TACTILED_WRONG_RATE) != 0, TACTILED_WARN_RATE) |
           bit_if(reload_refused_.load(std::memory_order_relaxed), TACTILED_WARN_RELOAD);
}

}  // namespace tactiled
