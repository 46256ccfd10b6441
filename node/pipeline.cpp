#include "node/pipeline.hpp"

#include <algorithm>

#include "tactiled/reader.hpp"

namespace tactiled {

// ---- acquire: link -> frame -> ring ------------------------------------------------------------------------------------

Status acquire(Link& link, SegmentWriter& segment, int timeout_ms) noexcept {
    Driver& driver = *link.driver;
    Frame* slot = link.ring.claim();
    const Status status = driver.read(slot != nullptr ? *slot : link.spare, timeout_ms);
    if (status == Status::frame) {
        link.age.judge(slot != nullptr ? *slot : link.spare, driver);
        if (slot == nullptr && (slot = link.ring.claim()) != nullptr) *slot = link.spare;  // the pipeline has made room
        if (slot != nullptr) {
            slot->lost += link.refused.take(slot->device);
            slot->opening = link.stream;
            link.taxels.put(link.ring.slot_of(slot), driver.taxels());
            link.ring.push();
        } else {
            link.refused.add(link.spare.device, link.spare.lost + 1);
            link.ring_full.store(++driver.counts[TACTILED_LINK_RING_FULL], std::memory_order_relaxed);
        }
    }
    if (status != Status::frame || !driver.has_more()) {  // once per burst, not per frame
        link.ring.commit();
        segment.set_link_counts(link.index, driver.counts.count);
        if (status != Status::disconnected && link.age.asks_for_reopening(link.is_busy.load(std::memory_order_relaxed))) {
            link.is_proving = true;
            return Status::disconnected;
        }
    }
    return status;
}

// ---- deliver: ring -> sensor -> publish --------------------------------------------------------------------------------

void Pipeline::deliver(Link& link, std::uint64_t now_ns) noexcept {
    // Read before the ring: frames that arrived before the link disconnected are delivered before the discontinuity
    // is published.
    link.was_connected = link.connected.load(std::memory_order_acquire);
    for (std::size_t n = 0; n < link.ring.capacity(); ++n) {  // limited, so that no link starves the others
        const Frame* const frame = link.ring.front();
        if (frame == nullptr) return;
        const std::size_t slot = link.ring.slot_of(frame);
        if (!link.taxels.is_empty()) segment_.publish_taxels(link.index, link.delivered, link.taxels.record(slot));
        deliver(link, *frame, link.taxels.get(slot), now_ns);
        link.ring.pop();
    }
}

void Pipeline::deliver(Link& link, const Frame& frame, const Taxels& taxels, std::uint64_t now_ns) noexcept {
    segment_.publish(link.index, link.delivered++, frame);
    bool bound = false;
    for (const auto& binding : link.bindings) {
        if (binding.device != frame.device) continue;
        bound = true;
        Sensor& sensor = sensors_[binding.sensor];
        const bool had_data = sensor.is_delivering();
        if (const int other = sensor.temperature_of_sensor(); other >= 0)
            sensor.take_temperature(sensors_[std::size_t(other)].last());
        (void)sensor.sample(frame, now_ns, taxels);
        if (had_data && !sensor.is_delivering()) record_.latch_lost_sensor(true);
        if (const int other = sensor.agrees_with(); other >= 0) (void)sensor.compare(sensors_[std::size_t(other)].last());
        publish(binding.sensor);
    }
    if (!bound) segment_.set_link_count(link.index, TACTILED_LINK_UNBOUND, ++link.unbound);
}

// ---- publish: sample -> grasp, segment, node record ----------------------------------------------------------------------

void Pipeline::publish(std::uint32_t sensor) noexcept {
    const tactiled_placed& placed = sensors_[sensor].placed();
    const tactiled_sample& sample = placed.sample;
    grasping_->observe(sensor, placed, sensors_[sensor].zero_S());
    if (Patch* const patch = sensors_[sensor].patch())
        segment_.publish_array(sensor, sample.sequence, patch->record(sample));
    segment_.publish(sensor, placed);
    segment_.count_reasons(sensor, sample.reasons);
    record_.add(sensor, sample);
}

void Pipeline::publish_node(std::uint64_t now_ns) noexcept {
    for (const auto& link : links_)
        for (const auto& binding : link->bindings)
            segment_.set_age(binding.sensor, link->age.proof(binding.device), link->age.bound_ns(binding.device, now_ns));
    const tactiled_grasp grasp = grasping_->state();
    const bool is_busy = grasp.state >= TACTILED_GRIP_CONTACT && grasp.state <= TACTILED_GRIP_SLIPPING;
    for (const auto& link : links_) link->is_busy.store(is_busy, std::memory_order_relaxed);
    for (Sensor& sensor : sensors_) sensor.may_hold(grasping_->is_configured() && grasp.state != TACTILED_GRIP_OPEN);
    record_.publish(now_ns, commands.tares(), grasp, grasping_->tool(), grasping_->hints_expired());
}

// ---- the loop ----------------------------------------------------------------------------------------------------------

void Pipeline::run() noexcept {
    const bool done = runner_.run(kMaxCycles, [this] {
        const std::uint64_t now_ns = monotonic_ns();
        const bool published = cycle(now_ns);
        if (published && readers_ != nullptr) readers_->published();
        record_.account(monotonic_ns() - now_ns, missed_.exchange(0, std::memory_order_relaxed));
        deadline_ns_.store(next_deadline_ns(now_ns), std::memory_order_relaxed);
        const bool was_idle = is_idle_.exchange(!record_.is_delivering(), std::memory_order_relaxed);
        if (was_idle && record_.is_delivering()) wake();  // the pipeline's thread sleeps longer than the new time limits
        if (cycles_ != nullptr) cycles_->count();
    });
    if (!done) wake();
}

std::uint64_t Pipeline::next_deadline_ns(std::uint64_t now_ns) const noexcept {
    std::uint64_t next_ns = record_.deadline_ns();
    for (const auto& sensor : sensors_)
        if (sensor.is_delivering()) next_ns = std::min(next_ns, sensor.deadline_ns(now_ns));
    return next_ns;
}

bool Pipeline::cycle(std::uint64_t now_ns) noexcept {
    take_replacement(now_ns);
    commands.carry_out(*grasping_, record_, now_ns);
    for (auto& link : links_) deliver(*link, now_ns);
    mark_discontinuities(now_ns);
    commands.follow_tares(record_, now_ns);
    record_.beat(now_ns);
    if (!record_.is_due(now_ns)) return false;
    publish_node(now_ns);
    return true;
}

// Publishes a BAD sample of each sensor whose stream has a new discontinuity, or another reason for the present one.
void Pipeline::mark_discontinuities(std::uint64_t now_ns) noexcept {
    for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
        const bool had_data = sensors_[i].is_delivering(), connected = link_of_sensor_[i]->was_connected;
        if (!sensors_[i].has_discontinuity(connected, now_ns)) continue;
        (void)sensors_[i].marker(now_ns);
        publish(i);
        if (had_data) record_.latch_lost_sensor(connected);
    }
}

// ---- before and after the loop -----------------------------------------------------------------------------------------

Pipeline::Pipeline(std::vector<std::unique_ptr<Link>>& links, std::vector<Sensor>& sensors, SegmentWriter& segment,
                   std::uint32_t status, const std::optional<Grasping::Setup>& grasp, const std::optional<tool::Setup>& tool)
    : commands(sensors, wake_),
      links_(links),
      sensors_(sensors),
      segment_(segment),
      link_of_sensor_(sensors.size(), nullptr),
      grasping_(std::make_unique<Grasping>(grasp, tool)),
      record_(links, sensors, segment, status) {
    for (auto& link : links_)
        for (const auto& binding : link->bindings) link_of_sensor_[binding.sensor] = link.get();
}

void Pipeline::start(std::uint64_t now_ns) noexcept {
    for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
        sensors_[i].start(segment_.epoch(), now_ns);
        (void)sensors_[i].marker(now_ns);
        publish(i);
    }
    record_.start(now_ns);
    publish_node(now_ns);
}

void Pipeline::stop(std::uint64_t now_ns) noexcept {
    for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
        sensors_[i].stop(now_ns);
        publish(i);
    }
    publish_node(now_ns);
}

}  // namespace tactiled
