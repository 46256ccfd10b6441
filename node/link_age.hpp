// Proves the age of the frames of one link, separately for each device (drivers/wire/stream_age.hpp), and requests that the
// link is reopened if delayed data cannot be discarded otherwise.
#pragma once
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <list>
#include <memory>
#include <vector>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/wire/reopening_pace.hpp"
#include "drivers/wire/stream_age.hpp"

namespace tactiled {

class LinkAge {
public:
    // The declared rate of a device, 0 = none, and its relative tolerance.
    struct Rate {
        double Hz = 0, tolerance = 0.2;
        bool operator==(const Rate&) const = default;
    };
    // Adds a sensor that reads `device`. setup
    void add(std::uint16_t device, const Rate& rate, std::uint64_t stale_ns) {
        devices_.push_back(std::make_unique<Device>(device, rate, stale_ns));
    }
    // Takes over the rates of `fresh`, which has the same devices. A new rate is in force from the next frame, and the pause
    // before the next reopening restarts. setup: from another thread than judge()
    void retune(LinkAge& fresh) noexcept {
        for (std::size_t i = 0; i < devices_.size(); ++i) {
            Device& device = *devices_[i];
            std::list<Rate>& rates = fresh.devices_[i]->rates;
            if (rates.back() == device.rates.back()) continue;
            device.rates.splice(device.rates.end(), rates);
            device.wanted.store(&device.rates.back(), std::memory_order_release);  // pairs with judge()
        }
    }

    // The link was opened at `now_ns`, and no frame has been read since. rt: wait-free
    void opened(std::uint64_t now_ns) noexcept { opened_ns_ = host_ns(now_ns); }

    // Sets the age of a frame of `driver` that has just been read. rt: wait-free
    void judge(Frame& frame, const Driver& driver) noexcept {
        if (const std::uint32_t opened = driver.counts[TACTILED_LINK_OPENED]; opened != opened_) {
            opened_ = opened;
            for (auto& each : devices_) each->age.open(driver.route(), opened_ns_);
        }
        for (auto& each : devices_) {
            const Rate* const wanted = each->wanted.load(std::memory_order_acquire);
            if (wanted == each->in_force) continue;
            each->in_force = wanted;
            each->age.set_rate(wanted->Hz, wanted->tolerance);
            pace_ = {};
        }
        frame.age = Frame::Age::proved;
        frame.late_ns = 0;
        bool is_first = true;
        for (auto& each : devices_) {
            if (each->number != frame.device || !is_first) continue;
            is_first = false;  // two sensors of one device share one state
            const std::uint64_t taken_ns = std::max(frame.taken_ns, frame.t_ns);
            each->age.judge(frame, each->age.uses_host_time(frame) ? host_ns(taken_ns) : taken_ns);
            each->proof.store(std::uint32_t(each->age.proof()), std::memory_order_relaxed);
        }
    }

    // Returns true once if the age has not been proved for a while, or has been too large, and opening the link again
    // discards the delayed data. rt: wait-free
    [[nodiscard]] bool asks_for_reopening() noexcept {
        if (std::none_of(devices_.begin(), devices_.end(), [](const auto& each) { return each->age.is_in_trouble(); }))
            return false;
        const std::uint64_t now = host_ns(now_ns());
        std::uint64_t since_ns = 0;
        for (const auto& each : devices_)
            if (each->age.asks_for_reopening(now)) since_ns = std::max(since_ns, each->age.trouble_ns());
        return since_ns != 0 && pace_.allows(now, since_ns);
    }

    // Returns the time for which the link should stay closed before it is reopened. rt: wait-free
    [[nodiscard]] std::uint64_t closed_ns() const noexcept {
        std::uint64_t longest_ns = 0;
        for (const auto& each : devices_)
            if (each->age.is_in_trouble()) longest_ns = std::max(longest_ns, each->age.closed_ns());
        return longest_ns;
    }

    // Returns how the age of the frames of `device` is proved. rt: wait-free; from any thread
    [[nodiscard]] std::uint32_t proof(std::uint16_t device) const noexcept {
        for (const auto& each : devices_)
            if (each->number == device) return each->proof.load(std::memory_order_relaxed);
        return 0;
    }

private:
    struct Device {
        Device(std::uint16_t n, const Rate& rate, std::uint64_t stale_ns)
            : number(n), rates{rate}, age(rate.Hz, rate.tolerance, stale_ns) {}
        std::uint16_t number;
        std::list<Rate> rates;  // old rates are kept, because the link's thread may read them
        std::atomic<const Rate*> wanted{&rates.back()};
        const Rate* in_force = &rates.back();
        StreamAge age;
        std::atomic<std::uint32_t> proof{0};  // written by the link's thread, read by the pipeline
    };
    std::vector<std::unique_ptr<Device>> devices_;
    std::uint32_t opened_ = ~0u;
    std::uint64_t opened_ns_ = 0;  // host time of the opening; 0: unknown
    ReopeningPace pace_;
};

}  // namespace tactiled
