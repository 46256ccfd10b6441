// CAN messages -> frames of devices, pure. A frame is whole or is none: where a device spreads a sample over several
// messages, they are put together by a counter that each of them carries, or else by order and time. The rule:
// drivers/README.md, "can".
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/driver.hpp"
#include "drivers/frame.hpp"
#include "drivers/wire/can_signal.hpp"
#include "drivers/wire/sequence_tracker.hpp"

namespace tactiled {

inline constexpr std::uint32_t kCanExtended = 0x8000'0000u;  // in an id: 29 bits; as the kernel and DBC files write it
inline constexpr std::size_t kCanMaxParts = 32;              // messages of a sample: each brings a channel or more

// One message's share of a device's sample.
struct CanPart {
    struct Channel {
        std::uint8_t index;
        CanSignal signal;
    };
    std::uint32_t id = 0;  // with kCanExtended
    bool multiplexed = false;
    CanSignal selector;  // multiplexed: this part is there when the selector's raw value is `selected`
    std::uint64_t selected = 0;
    std::vector<Channel> channels;
    std::optional<CanSignal> sequence;
    std::size_t bytes = 0;  // that all of its signals need
};

struct CanDevice {
    std::uint16_t device = 0;
    std::uint8_t n_channels = 0;
    std::vector<CanPart> parts;   // the first begins a sample where no counter says so
    std::uint64_t window_ns = 0;  // several parts: all of them come within this time

    [[nodiscard]] bool has_sequence() const noexcept;
    [[nodiscard]] bool is_assembled_by_counter() const noexcept;  // every part carries it
};

struct CanArrival {
    std::uint32_t id = 0;  // with kCanExtended
    std::span<const std::uint8_t> bytes;
    std::uint64_t t_ns = 0, device_time_us = 0;
};

class CanSamples {
public:
    // setup
    CanSamples(std::vector<CanDevice> devices, LinkCounts& counts);

    // Takes a message. Before the next one, next() must have returned false. rt: wait-free
    void take(const CanArrival& arrival) noexcept;
    // The next frame that the message completed: one for each device that it ends a sample of. rt: wait-free
    [[nodiscard]] bool next(Frame& frame) noexcept;

    // Counts `samples` that began with message `id` and never became whole; the number is reported with the next whole
    // sample. rt: wait-free
    void lost(std::uint32_t id, std::uint32_t samples) noexcept;

    // Forgets what is incomplete and where counters stood: the bus was opened anew.
    void reset() noexcept;

private:
    struct Pending {                // a device's sample in the making
        Frame frame;                // t_ns is that of its first part: a force is never younger than the oldest number in it
        std::uint32_t parts = 0;    // bit n: part n is in it; 0: there is none
        std::uint32_t count = 0;    // of the counter
        std::uint32_t orphans = 0;  // bit n: part n came of the sample that is lost already
        std::uint64_t orphans_ns = 0;  // since when
        std::uint32_t lost = 0;        // to be told with the next whole one
        bool begun = false;            // since reset(); before, a part without its first is nobody's fault
        SequenceTracker sequence;
    };
    struct Route {  // where a message goes
        std::uint32_t id;
        std::uint16_t device, part;  // indices
    };

    // True when the message completed the device's sample. rt: bounded by kMaxChannels
    bool give(const Route& route) noexcept;
    bool reject(tactiled_link_count kind) noexcept;
    bool belongs_by_counter(const CanDevice& device, Pending& pending, unsigned part, std::uint32_t count,
                            std::span<const double> values) noexcept;
    bool belongs_by_order(const CanDevice& device, Pending& pending, unsigned part, std::span<const double> values) noexcept;
    [[nodiscard]] static bool is_again(const CanPart& part, const Pending& pending, std::span<const double> values) noexcept;
    void begin(const CanDevice& device, Pending& pending) noexcept;
    [[nodiscard]] bool is_within(unsigned windows, const CanDevice& device, std::uint64_t since_ns) const noexcept;
    void lose(Pending& pending) noexcept;
    bool finish(const CanDevice& device, Pending& pending) noexcept;

    std::vector<CanDevice> devices_;
    LinkCounts& counts_;
    std::vector<Pending> pending_;
    std::vector<Route> routes_;  // sorted by id
    CanArrival arrival_;
    std::size_t route_ = 0, routes_end_ = 0;
    bool used_ = true, rejected_ = false;  // the message, so far
};

}  // namespace tactiled
