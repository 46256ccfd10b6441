// Converts CAN messages to frames of devices, pure. A frame is complete or is not delivered: if a device spreads a
// sample over several messages, they are combined by a counter in each of them, or else by order and time.
// drivers/README.md, "can", has the rule.
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

// marks an id of 29 bits, as the kernel and DBC files write it
inline constexpr std::uint32_t kCanExtended = 0x8000'0000u;
inline constexpr std::size_t kCanMaxParts = 32;  // messages of a sample: each has at least one channel

// One message's share of a device's sample.
struct CanPart {
    struct Channel {
        std::uint8_t index;
        CanSignal signal;
    };
    std::uint32_t id = 0;  // with kCanExtended
    bool multiplexed = false;
    CanSignal selector;  // multiplexed: this part is present if the selector's raw value is `selected`
    std::uint64_t selected = 0;
    std::vector<Channel> channels;
    std::optional<CanSignal> sequence;
    std::size_t bytes = 0;  // length that all of its signals need
};

struct CanDevice {
    std::uint16_t device = 0;
    std::uint8_t n_channels = 0;
    std::vector<CanPart> parts;   // the first part begins a sample if there is no counter
    std::uint64_t window_ns = 0;  // several parts: all of them arrive within this time

    [[nodiscard]] bool has_sequence() const noexcept;
    [[nodiscard]] bool is_assembled_by_counter() const noexcept;  // every part has the counter
};

struct CanArrival {
    std::uint32_t id = 0;  // with kCanExtended
    std::span<const std::uint8_t> bytes;
    std::uint64_t t_ns = 0;
};

class CanSamples {
public:
    // setup
    CanSamples(std::vector<CanDevice> devices, LinkCounts& counts);

    // Takes a message. Call next() until it returns false before the next take(). rt: wait-free
    void take(const CanArrival& arrival) noexcept;
    // Returns the next frame that the message completed: one for each device whose sample it ends. rt: wait-free
    [[nodiscard]] bool next(Frame& frame) noexcept;

    // Counts `samples` that began with message `id` and were not completed; the number is reported with the next
    // complete sample. rt: wait-free
    void lost(std::uint32_t id, std::uint32_t samples) noexcept;

    // Forgets incomplete samples and the counters, after the bus was opened again.
    void reset() noexcept;

private:
    struct Pending {                   // an incomplete sample of a device
        Frame frame;                   // t_ns is that of its first part, which has the oldest numbers
        std::uint32_t parts = 0;       // bit n: the sample has part n; 0: no sample has begun
        std::uint32_t count = 0;       // value of the counter
        std::uint32_t orphans = 0;     // bit n: part n arrived of a sample that is lost already
        std::uint64_t orphans_ns = 0;  // time of the first orphan
        std::uint32_t lost = 0;        // samples lost since the last complete one
        bool begun = false;            // a first part has come since reset(); before, a missing one does not count
        SequenceTracker sequence;
    };
    struct Route {  // destination of a message
        std::uint32_t id;
        std::uint16_t device, part;  // indices
    };

    // Adds the message. Returns true if it completed the device's sample. rt: bounded by kMaxChannels
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
    bool used_ = true, rejected_ = false;  // about the present message
};

}  // namespace tactiled
