#include "node/pipeline.hpp"

#include <algorithm>
#include <utility>

#include "node/shm/frame_record.hpp"

namespace tactiled {
namespace {

constexpr std::uint64_t kMs = 1'000'000;
constexpr std::uint64_t kHeartbeatNs = 100 * kMs;
constexpr std::uint64_t kNodeRecordNs = 10 * kMs;  // at least this often, so that readers see the loop alive
constexpr std::uint64_t kSecond = 1000 * kMs;

// Frames that the ring refused are lost for their sensor: told with the next frame of the same device that gets through.
void note_refused(Link& link, std::uint16_t device, std::uint32_t lost_before) noexcept {
    for (auto& refused : link.refused)
        if (refused.frames == 0 || refused.device == device) {
            refused.device = device;
            refused.frames += 1 + lost_before;
            return;
        }
}

std::uint32_t take_refused(Link& link, std::uint16_t device) noexcept {
    std::uint32_t frames = 0;
    for (auto& refused : link.refused)
        if (refused.device == device) frames += std::exchange(refused.frames, 0);
    return frames;
}

tactiled_command_result result_of(Sensor::Tare ended) noexcept {
    switch (ended) {
        case Sensor::Tare::done: return TACTILED_COMMAND_OK;
        case Sensor::Tare::moved: return TACTILED_COMMAND_MOVING;
        case Sensor::Tare::loaded: return TACTILED_COMMAND_UNDER_LOAD;
        default: return TACTILED_COMMAND_FAILED;
    }
}

}  // namespace

// ---- link -> frame -> ring -------------------------------------------------------------------------------------------

bool acquire(Link& link, SegmentWriter& segment, int timeout_ms) noexcept {
    Frame* slot = link.ring.claim();
    Frame& frame = slot != nullptr ? *slot : link.spare;
    Driver& driver = *link.driver;

    const Status status = driver.read(frame, timeout_ms);
    if (status == Status::frame && slot == nullptr && (slot = link.ring.claim()) != nullptr) *slot = frame;  // room by now
    if (status == Status::frame && slot != nullptr) {
        slot->lost += take_refused(link, slot->device);
        slot->opening = driver.counts[TACTILED_LINK_OPENED];
        link.ring.push();
    } else if (status == Status::frame) {
        note_refused(link, frame.device, frame.lost);
        link.ring_full.store(++driver.counts[TACTILED_LINK_RING_FULL], std::memory_order_relaxed);
    }
    if (status != Status::frame || !driver.has_more()) {  // once a burst, not once a frame
        link.ring.commit();
        for (int kind = 0; kind < TACTILED_LINK_COUNTS; ++kind)
            if (kind != TACTILED_LINK_UNBOUND)
                segment.set_link_count(link.index, tactiled_link_count(kind), driver.counts.count[kind]);
    }
    return status != Status::disconnected;
}

// ---- ring -> decouple -> grasp -> publish ------------------------------------------------------------------------------

Pipeline::Pipeline(std::vector<std::unique_ptr<Link>>& links, std::vector<Sensor>& sensors, SegmentWriter& segment,
                   std::uint32_t status, const std::optional<Grasping::Setup>& grasp)
    : links_(links),
      sensors_(sensors),
      segment_(segment),
      link_of_sensor_(sensors.size(), nullptr),
      grasping_(std::make_unique<Grasping>(grasp)),
      fixed_status_(status) {
    for (auto& link : links_)
        for (const auto& binding : link->bindings) link_of_sensor_[binding.sensor] = link.get();
}

void Pipeline::start(std::uint64_t now_ns) noexcept {
    for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
        sensors_[i].start(segment_.epoch(), now_ns);
        publish_discontinuity(i, sensors_[i].marker(now_ns));
    }
    heartbeat_ns_ = worst_since_ns_ = now_ns;
    publish_node(now_ns);
}

bool Pipeline::deliver(std::uint64_t now_ns) noexcept {
    if (replacement_.load(std::memory_order_relaxed) != nullptr) {  // nearly never: no exchange each turn
        if (Replacement* const offered = replacement_.exchange(nullptr, std::memory_order_acquire)) {
            take(*offered, now_ns);
            taken_.store(true, std::memory_order_release);  // pairs with the acquire in replace()
        }
    }
    for (std::size_t commander = 0; commander < commands.size(); ++commander)
        while (const Command* command = commands[commander].front()) {
            carry_out(commander, *command, now_ns);
            commands[commander].pop();
        }
    for (auto& link : links_) {
        // Looked at before the ring: what arrived before the link broke is delivered before the break is.
        link->was_connected = link->connected.load(std::memory_order_acquire);
        const std::size_t max = link->ring.capacity();  // a flood of one link does not starve the others
        for (std::size_t n = 0; n < max; ++n) {
            const Frame* const frame = link->ring.front();
            if (frame == nullptr) break;
            deliver(*link, *frame, now_ns);
            link->ring.pop();
        }
    }
    mark_discontinuities(now_ns);
    follow_tares(now_ns);
    if (now_ns - heartbeat_ns_ >= kHeartbeatNs) {
        heartbeat_ns_ += (now_ns - heartbeat_ns_) / kHeartbeatNs * kHeartbeatNs;
        const bool acquiring =
            std::any_of(sensors_.begin(), sensors_.end(), [](const Sensor& s) { return s.is_delivering(); });
        if (acquiring) {
            ++node_.heartbeat;
            news_ = true;
        }
    }
    if (!news_ && now_ns - last_node_ns_ < kNodeRecordNs) return false;
    publish_node(now_ns);
    return true;
}

void Pipeline::deliver(Link& link, const Frame& frame, std::uint64_t now_ns) noexcept {
    segment_.publish(link.index, link.delivered++, as_published(frame));
    bool bound = false;
    for (const auto& binding : link.bindings) {
        if (binding.device != frame.device) continue;
        bound = true;
        Sensor& sensor = sensors_[binding.sensor];
        tactiled_sample sample = sensor.sample(frame, now_ns);
        if (const int other = sensor.agrees_with(); other >= 0) sample = sensor.compare(sensors_[std::size_t(other)].last());
        grasping_->observe(binding.sensor, sample, sensor.zero_S());
        publish(binding.sensor, sample);
    }
    if (!bound) segment_.set_link_count(link.index, TACTILED_LINK_UNBOUND, ++link.unbound);
}

void Pipeline::publish(std::uint32_t index, const tactiled_sample& sample) noexcept {
    segment_.publish(index, sample);
    node_.count[index] = sample.sequence + 1;
    news_ = true;
    if (sample.reasons == 0) return;
    segment_.count_reasons(index, sample.reasons);
    if ((sample.reasons & TACTILED_SATURATED) != 0) node_.fault |= TACTILED_FAULT_OVERRANGE;
    if ((sample.reasons & TACTILED_MISSING_CHANNEL) != 0) node_.fault |= TACTILED_FAULT_OPEN_GAUGE;
    if ((sample.reasons & TACTILED_UNCALIBRATED) != 0) node_.fault |= TACTILED_FAULT_CALIBRATION;
    if ((sample.reasons & TACTILED_NOT_FINITE) != 0) node_.fault |= TACTILED_FAULT_INTERNAL;
    if ((sample.reasons & (TACTILED_FROZEN | TACTILED_IDLE_BUS | TACTILED_WRONG_DEVICE)) != 0)
        node_.fault |= TACTILED_FAULT_SENSOR_LOST;
}

void Pipeline::publish_discontinuity(std::uint32_t index, const tactiled_sample& marker) noexcept {
    grasping_->observe(index, marker, sensors_[index].zero_S());
    publish(index, marker);
}

void Pipeline::mark_discontinuities(std::uint64_t now_ns) noexcept {
    for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
        const bool had_data = sensors_[i].is_delivering();
        const bool connected = link_of_sensor_[i]->was_connected;
        if (!sensors_[i].has_discontinuity(connected, now_ns)) continue;
        publish_discontinuity(i, sensors_[i].marker(now_ns));
        if (had_data) node_.fault |= TACTILED_FAULT_SENSOR_LOST | (connected ? 0u : std::uint32_t(TACTILED_FAULT_BUS));
    }
}

void Pipeline::carry_out(std::size_t commander, const Command& command, std::uint64_t now_ns) noexcept {
    using Kind = Command::Kind;
    const auto reject = [&](tactiled_command_result why) { finish_command(commander, TACTILED_COMMAND_REJECTED, why); };
    const auto done = [&](bool good = true) {
        finish_command(commander, TACTILED_COMMAND_DONE, good ? TACTILED_COMMAND_OK : TACTILED_COMMAND_FAILED);
    };
    if (command.kind >= Kind::set) {  // nobody waits for it: the registers say what is set
        if (command.kind == Kind::set) {
            for (auto& sensor : sensors_) sensor.set(command.settable);
            grasping_->set(command.grasp);
        } else {
            grasping_->carry_out(command);
        }
        return;
    }
    node_.command[commander].acknowledged = command.number;
    news_ = true;
    if (now_ns > command.until_ns) return reject(TACTILED_COMMAND_TIMED_OUT);
    const auto all = std::uint32_t((1u << sensors_.size()) - 1);
    const bool needs_sensors = command.kind == Kind::tare || command.kind == Kind::untare ||
                               command.kind == Kind::reset_peaks || command.kind == Kind::self_test ||
                               command.kind == Kind::clear_slips;
    if ((command.mask & ~all) != 0 || (command.mask == 0 && needs_sensors)) return reject(TACTILED_COMMAND_BAD_MASK);
    const auto each = [&](auto&& what) {
        for (std::uint32_t i = 0; i < sensors_.size(); ++i)
            if ((command.mask >> i & 1u) != 0) what(sensors_[i]);
    };
    switch (command.kind) {
        case Kind::tare:
        case Kind::untare:
            if (taring_ != 0) follow_tares(now_ns);
            if (taring_ != 0 || !begin_tares(command, now_ns)) return reject(TACTILED_COMMAND_NOT_NOW);
            tare_commander_ = commander;
            tare_number_ = command.number;
            return finish_command(commander, TACTILED_COMMAND_RUNNING, TACTILED_COMMAND_OK);
        case Kind::clear_latches:
            node_.fault = 0;
            grasping_->carry_out(command);
            return done();
        case Kind::clear_slips: grasping_->carry_out(command); return done();
        case Kind::reset_peaks: each([](Sensor& s) { s.reset_peak(); }); return done();
        case Kind::self_test: return done(all_have_values(command.mask));
        case Kind::start_weighing:
        case Kind::stop_weighing:
        case Kind::zero_weight:
        case Kind::known_weight:
        case Kind::objects: return grasping_->carry_out(command) ? done() : reject(TACTILED_COMMAND_NOT_NOW);
        case Kind::set:
        case Kind::hint:
        case Kind::gravity:
        case Kind::acceleration: break;
    }
    reject(TACTILED_COMMAND_UNKNOWN);
}

// Of all that are asked for, or of none: half a tare is nobody's wish. Those that then rest take their zero, each for
// itself.
bool Pipeline::begin_tares(const Command& command, std::uint64_t now_ns) noexcept {
    const bool tare = command.kind == Command::Kind::tare;
    const auto asked = [&](std::size_t i) { return (command.mask >> i & 1u) != 0; };
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if (tare && asked(i) && !sensors_[i].can_tare()) return false;
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if (asked(i)) tare ? sensors_[i].begin_tare(now_ns) : sensors_[i].begin_untare();
    taring_ = command.mask;
    tare_result_ = TACTILED_COMMAND_OK;
    has_new_zero_ = false;
    return true;
}

bool Pipeline::all_have_values(std::uint32_t mask) const noexcept {
    for (std::uint32_t i = 0; i < sensors_.size(); ++i)
        if ((mask >> i & 1u) != 0 && (!sensors_[i].is_delivering() || sensors_[i].last().quality == TACTILED_BAD))
            return false;
    return true;
}

void Pipeline::finish_command(std::size_t commander, tactiled_command_state state, tactiled_command_result result) noexcept {
    node_.command[commander].state = state;
    node_.command[commander].result = result;
    news_ = true;
}

void Pipeline::follow_tares(std::uint64_t now_ns) noexcept {
    if (taring_ == 0) return;
    for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
        if ((taring_ >> i & 1u) == 0) continue;
        const auto tare = sensors_[i].poll_tare(now_ns);
        if (tare == Sensor::Tare::running || tare == Sensor::Tare::removing) continue;
        taring_ &= ~(1u << i);
        if (tare_result_ == TACTILED_COMMAND_OK) tare_result_ = result_of(tare);
        has_new_zero_ |= tare == Sensor::Tare::done;
    }
    if (taring_ != 0 || node_.command[tare_commander_].acknowledged != tare_number_) return;  // a later one stands there
    const bool refused = tare_result_ == TACTILED_COMMAND_MOVING || tare_result_ == TACTILED_COMMAND_UNDER_LOAD;
    finish_command(tare_commander_, refused && !has_new_zero_ ? TACTILED_COMMAND_REJECTED : TACTILED_COMMAND_DONE,
                   tare_result_);
}

void Pipeline::publish_node(std::uint64_t now_ns) noexcept {
    bool ready = true, stale = false, contact = false, budget = false;
    std::uint32_t lost = 0, reasons = 0;
    for (const auto& sensor : sensors_) {
        ready &= sensor.is_delivering() && sensor.last().quality != TACTILED_BAD;
        stale |= !sensor.is_delivering();
        reasons |= sensor.last().reasons;
        contact |= (sensor.last().state & TACTILED_CONTACT) != 0;
        budget |= (sensor.last().state & (TACTILED_STEPPED_DOWN | TACTILED_OVER_BUDGET)) != 0;
        lost += sensor.last().lost;
    }
    for (auto& link : links_) {
        const std::uint32_t full = link->ring_full.load(std::memory_order_relaxed);
        if (full != std::exchange(link->ring_full_seen, full)) node_.fault |= TACTILED_FAULT_OVERRUN;
    }
    if (lost != std::exchange(lost_seen_, lost)) lost_until_ns_ = now_ns + kSecond;
    const auto bit = [](bool on, auto value) { return on ? std::uint32_t(value) : 0u; };
    node_.warning = bit((reasons & TACTILED_DRIFTED) != 0, TACTILED_WARN_DRIFT) |
                    bit(now_ns < lost_until_ns_, TACTILED_WARN_LOST) |
                    bit(tare_result_ != TACTILED_COMMAND_OK, TACTILED_WARN_TARE) | bit(budget, TACTILED_WARN_BUDGET) |
                    bit((reasons & TACTILED_WRONG_RATE) != 0, TACTILED_WARN_RATE) |
                    bit(reload_refused_.load(std::memory_order_relaxed), TACTILED_WARN_RELOAD);
    node_.status = fixed_status_ | bit(ready, TACTILED_READY) | bit(contact, TACTILED_ANY_CONTACT) |
                   bit(stale, TACTILED_ANY_STALE) | bit((reasons & TACTILED_UNCALIBRATED) != 0, TACTILED_ANY_UNCALIBRATED) |
                   bit(taring_ != 0, TACTILED_ANY_TARING) | bit(node_.warning != 0, TACTILED_WARNING) |
                   bit(node_.fault != 0, TACTILED_FAULT);
    node_.grasp = grasping_->state();
    node_.t_ns = now_ns;
    segment_.publish(node_);
    ++node_.sequence;
    last_node_ns_ = now_ns;
    news_ = false;
}

void Pipeline::account(std::uint64_t cycle_ns, std::uint64_t missed) noexcept {
    ++node_.cycles;
    node_.missed_cycles += missed;
    worst_ns_ = std::max(worst_ns_, std::uint32_t(std::min<std::uint64_t>(cycle_ns, UINT32_MAX)));
    if (last_node_ns_ - worst_since_ns_ >= kSecond) {
        node_.worst_cycle_us = (worst_ns_ + 999) / 1000;
        worst_since_ns_ = last_node_ns_;
        worst_ns_ = 0;
    }
}

void Pipeline::stop(std::uint64_t now_ns) noexcept {
    for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
        tactiled_sample last = sensors_[i].marker(now_ns);
        tactiled_invalidate(&last, TACTILED_DAEMON_STOPPED);
        publish_discontinuity(i, last);
    }
    publish_node(now_ns);
}

}  // namespace tactiled
