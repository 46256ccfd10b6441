// Bounds the age of the frames of one link, separately for each device (drivers/wire/stream_age.hpp), and asks for an
// opening of the link where that proves the age.
#pragma once
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/wire/stream_age.hpp"

namespace tactiled {

class LinkAge {
public:
    // Adds a sensor that reads `device`. setup
    void add(std::uint16_t device, std::uint64_t stale_ns) {
        devices_.push_back(std::make_unique<Device>(device, stale_ns));
    }

    // The link was opened at `now_ns`, and no frame has been read since. Only an opening that asks_for_reopening() wanted
    // may be a proof: its path kept at most the frames of closed_ns(). rt: wait-free
    void opened(std::uint64_t now_ns, bool is_wanted) noexcept { opened_ns_ = is_wanted ? host_ns(now_ns) : 0; }

    // Sets the age of a frame of `driver` that has just been read. rt: wait-free
    void judge(Frame& frame, const Driver& driver) noexcept {
        if (const std::uint32_t opened = driver.counts[TACTILED_LINK_OPENED]; opened != opened_) {
            opened_ = opened;
            for (auto& each : devices_) each->age.open(driver.route(), opened_ns_);
        }
        frame.age = Frame::Age::proved;
        frame.late_ns = 0;
        for (auto& each : devices_) {
            if (each->number != frame.device) continue;
            const std::uint64_t taken_ns = std::max(frame.taken_ns, frame.t_ns);
            const bool by_host = each->age.uses_host_time(frame);
            each->age.judge(frame, by_host ? host_ns(taken_ns) : taken_ns,
                            frame.asked_ns == 0 ? 0 : host_ns(frame.asked_ns));
            each->proof.store(std::uint32_t(each->age.proof()), std::memory_order_relaxed);
            each->bound_ns.store(frame.bound_ns, std::memory_order_relaxed);
            each->read_ns.store(taken_ns, std::memory_order_relaxed);
            if (each->age.trouble_ns() != 0) {
                each->rate_error.store(each->age.rate_of_arrivals(), std::memory_order_relaxed);
                each->clock_ppm.store(each->age.route().clock_ppm, std::memory_order_relaxed);
            }
            each->trouble_ns.store(each->age.trouble_ns(), std::memory_order_release);
            return;  // two sensors of one device share one state
        }
    }

    // Returns true once if a proof is due and an opening of the link may be one. `is_busy`: it can wait while the bound
    // allows. The limit is one opening per second, and less for a device whose last one proved nothing. rt: wait-free
    [[nodiscard]] bool asks_for_reopening(bool is_busy) noexcept {
        bool is_granted = false;
        std::uint64_t now = 0;
        for (const auto& each : devices_) {
            if (!each->age.may_ask()) continue;
            if (now == 0) now = host_ns(now_ns());
            if (now < asked_ns_ + (each->age.keeps() ? kKeepsPause_ns : each->pause_ns) ||
                !each->age.asks_for_reopening(now, is_busy))
                continue;
            const bool helped = each->age.proofs() != each->proofs;
            each->pause_ns = helped ? kMinPause_ns : std::min(2 * each->pause_ns, kMaxPause_ns);
            each->proofs = each->age.proofs();
            is_granted = true;
        }
        if (is_granted) asked_ns_ = now;
        return is_granted;
    }

    // Returns the time for which the link should stay closed before it is reopened. rt: wait-free
    [[nodiscard]] std::uint64_t closed_ns() const noexcept {
        std::uint64_t longest_ns = 0;
        for (const auto& each : devices_) longest_ns = std::max(longest_ns, each->age.closed_ns());
        return longest_ns;
    }

    // Returns how the age of the frames of `device` is bounded. rt: wait-free; from any thread
    [[nodiscard]] std::uint32_t proof(std::uint16_t device) const noexcept {
        for (const auto& each : devices_)
            if (each->number == device) return each->proof.load(std::memory_order_relaxed);
        return 0;
    }

    // Returns the largest possible age of the last frame of `device` at `now_ns`, in ns. rt: wait-free; from any thread
    [[nodiscard]] double bound_ns(std::uint16_t device, std::uint64_t now_ns) const noexcept {
        for (const auto& each : devices_) {
            if (each->number != device) continue;
            const std::uint64_t read_ns = each->read_ns.load(std::memory_order_relaxed);
            return each->bound_ns.load(std::memory_order_relaxed) + double(now_ns - std::min(read_ns, now_ns));
        }
        return 0;
    }

    // The longest doubt of a device's age: the bound is above stale_ms. rt: wait-free; from any thread
    struct Trouble {
        std::uint64_t lasts_ns = 0;
        double rate_error = 0;  // error of the device's clock as its frames arrive; > 0: slow
        double clock_ppm = 0;
    };
    [[nodiscard]] Trouble trouble() const noexcept {
        Trouble longest;
        for (const auto& each : devices_) {
            const std::uint64_t since_ns = each->trouble_ns.load(std::memory_order_acquire);
            if (since_ns == 0) continue;
            const std::uint64_t now = host_ns(now_ns()), lasts_ns = now - std::min(since_ns, now) + 1;
            if (lasts_ns > longest.lasts_ns)
                longest = {lasts_ns, each->rate_error.load(std::memory_order_relaxed),
                           each->clock_ppm.load(std::memory_order_relaxed)};
        }
        return longest;
    }

private:
    static constexpr std::uint64_t kMinPause_ns = 1'000'000'000;
    static constexpr std::uint64_t kMaxPause_ns = 8'000'000'000;     // a doubt ends within 10 s of its cause
    static constexpr std::uint64_t kKeepsPause_ns = 60'000'000'000;  // a queue of 50 ms more in a minute

    struct Device {
        Device(std::uint16_t n, std::uint64_t stale_ns) : number(n), age(stale_ns) {}
        std::uint16_t number;
        StreamAge age;
        std::uint32_t proofs = 0;               // as of its last request for an opening
        std::uint64_t pause_ns = kMinPause_ns;  // from the last request of the link to its next one
        std::atomic<std::uint32_t> proof{0};    // these are written by the link's thread, and read by the pipeline
        std::atomic<double> bound_ns{0};
        std::atomic<std::uint64_t> read_ns{0};  // when the frame of bound_ns was read
        std::atomic<std::uint64_t> trouble_ns{0};
        std::atomic<double> rate_error{0}, clock_ppm{0};
    };
    std::vector<std::unique_ptr<Device>> devices_;
    std::uint32_t opened_ = ~0u;
    std::uint64_t opened_ns_ = 0;  // host time of an opening that was wanted; 0: of another one
    std::uint64_t asked_ns_ = 0;   // last request
};

}  // namespace tactiled
