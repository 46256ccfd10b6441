// The devices of the simulated world and their cables: the true measurements, their arrival times, and possible
// faults in between. Bytes pass through the product's decoders.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "drivers/wire/decoder.hpp"

namespace tactiled::faults {

using Random = std::mt19937_64;

inline constexpr unsigned kSensors = 4, kLinks = 3, kChannels = 3;
inline constexpr unsigned kFrozenAfter = 10;
// For two compared sensors: agree_ms, and the readings until then: one that may be a step, 5 in 20 ms, and a late one
// of the other sensor.
inline constexpr unsigned kDifferAfter = 8;
inline constexpr int kAgreeMs = 20;
inline constexpr std::uint64_t kMs = 1'000'000, kPeriodNs = 4 * kMs, kStaleMs = 20;

// Channel k of a sensor's frame: its own offset, the event, and noise, so that an older frame, a neighbour's frame or
// a mixture of two can be recognised. Sensors 0 and 1 measure a slow wave; 2 and 3, the jaws, an object of 0.6 kg
// that is grasped, lifted, held, put down and released again, all within 512 frames.
int count_of(unsigned sensor, std::uint32_t sequence, unsigned k);
// Returns the same without the noise.
int level_of(unsigned sensor, std::uint32_t sequence, unsigned k);
// Its own offset: the reading without load.
constexpr int place_of(unsigned sensor, unsigned k) { return int(20'000 * (sensor + 1) + 1000 * k); }
inline constexpr double kN_per_count = 0.001;
inline constexpr unsigned kRecalibrated = 2;  // the sensor that a reload calibrates again
inline constexpr double kTareLimit_N = 1;     // for the jaws
// Returns true if the object hangs on the jaws, and has for at least 50 ms.
constexpr bool is_held(std::uint32_t sequence) { return sequence % 512 >= 255 && sequence % 512 <= 412; }
constexpr bool is_jaw(unsigned sensor) { return sensor >= 2; }

// The cable. Data that the device sends wait in `chunks` until they are readable, as in a kernel's buffer.
class Cable final : public Driver {
public:
    explicit Cable(bool text);
    std::string open() override;
    Status read(Frame& frame, int timeout_ms) noexcept override;
    void close() noexcept override { decoder_->reset(); }
    bool has_more() const noexcept override { return decoder_->is_ready(); }

    void carry(std::uint64_t sent_ns, std::vector<std::uint8_t> bytes);
    [[nodiscard]] std::uint64_t arrival_ns(std::uint64_t sent_ns) const { return std::max(sent_ns, hold_until_ns); }
    bool is_readable() const;

    bool is_text;
    bool plugged = true, opens = true;
    std::uint64_t hold_until_ns = 0;                       // data sent from now on do not arrive before
    unsigned chop = 0;                                     // bytes per read, 0 = all that wait
    static constexpr std::uint64_t kStoppedNs = 30 * kMs;  // the limit of drivers/uart.cpp for a stopped process

private:
    struct Chunk {
        std::uint64_t ready_ns;
        std::vector<std::uint8_t> bytes;
    };
    std::deque<Chunk> chunks_;
    std::unique_ptr<StreamDecoder> decoder_;
    mutable std::uint64_t empty_ns_ = 0;  // the last time at which no byte waited
    std::uint64_t since_ns_ = 0;
};

// A device with one sensor, as its manufacturer knows it. The faults are switches; `rate` is the share of affected
// frames, 0 .. 1.
class Device {
public:
    Device(unsigned sensor, unsigned number, Cable& cable, std::uint32_t first_sequence, std::uint64_t first_ns);

    // Sends all frames that are due until `until_ns`.
    void send(std::uint64_t until_ns, Random& random);
    // Continues the counter from here: 0 as after a restart.
    void jump_to(std::uint32_t sequence);
    [[nodiscard]] bool is_text() const { return cable_.is_text; }

    // The truth, by sequence modulo 65536.
    struct Truth {
        std::uint64_t arrived_ns = 0;
        // The device sent another value than it measured. The product may need several such readings in a row to
        // detect it, so each run of them has a number, 0 = right; a single spike has none.
        std::uint32_t undetected = 0;
        bool beside = false;  // only the other sensor of the pair can show it
        bool spike = false;
        bool second = false;  // measured by the second device with the same number
    };
    [[nodiscard]] const Truth& truth(std::uint32_t sequence) const { return truth_[sequence & 0xFFFF]; }
    // The sequence number of the frame `back` before the next one, 1 .. 64.
    [[nodiscard]] std::uint32_t sent(std::uint32_t back) const { return sent_[(n_sent_ - back) % sent_.size()]; }

    bool silent = false, frozen = false, zeros = false, saturate = false, nan = false, missing = false, other_shape = false,
         foreign = false, garbage = false, wrong_length = false;
    bool doubled = false;  // a second device counts and measures with its number
    int offset = 0;        // added to every channel: an undetected wrong value for this sensor alone
    double flips = 0, cuts = 0, drops = 0, repeats = 0, swaps = 0, spikes = 0;  // rates
    std::uint64_t period_ns = kPeriodNs;
    std::uint64_t jumped_ns = 0;   // time of the counter's jump
    std::uint64_t doubled_ns = 0;  // time of the second device's last frame
    // The daemon was stopped between these times: waiting data have the time at which they may have arrived.
    std::uint64_t stopped_ns = 0, stopped_until_ns = 0;

private:
    std::vector<std::uint8_t> encode(const Frame& frame) const;
    void send_one(std::uint64_t t_ns, Random& random);
    void send_of_the_second(std::uint64_t t_ns);

    unsigned sensor_, number_;
    Cable& cable_;
    std::uint32_t sequence_;
    std::optional<std::uint32_t> second_sequence_;
    std::uint64_t next_ns_;
    std::array<std::uint32_t, 64> sent_{};
    std::uint32_t n_sent_ = 0;
    bool spiked_ = false;
    std::uint32_t undetected_ = 0;
    int undetected_before_ = 0;
    std::array<double, kChannels> frozen_at_{};
    std::vector<std::uint8_t> held_back_;  // to be swapped with the next
    std::uint32_t held_back_sequence_ = 0;
    std::vector<Truth> truth_;
};

}  // namespace tactiled::faults
