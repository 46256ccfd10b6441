// A chip on an I2C bus: how it is set up and how a conversion is taken from it. It never waits and never looks at a clock:
// Station calls it when something is due. To add one: a file with an entry at its foot, and a line in CMakeLists.txt.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "config/registry.hpp"
#include "drivers/chips/port.hpp"
#include "drivers/frame.hpp"

namespace tactiled {

// Signals by which a chip reports a conversion.
enum class Pace : std::uint8_t {
    continuous,  // converts by itself and says when one is ready
    triggered,   // converts when it is told to, and says when it is done
    counted,     // converts by itself and numbers its conversions
    timed        // converts by itself and says nothing
};

class Chip {
public:
    virtual ~Chip() = default;

    struct Progress {
        Answer answer = Answer::ok;
        enum Kind : std::uint8_t { more, done, wrong } kind = more;  // wrong: this is another chip
        std::uint32_t wait_us = 0;                                   // before the next step, or the first conversion
        std::uint64_t found = 0;                                     // of a wrong one: what stands in place of expected()
    };
    // One step of bringing the chip from any state to converting; `step` counts from 0. At `done` a conversion has begun.
    // rt: blocks on the bus, for a few transfers
    [[nodiscard]] virtual Progress set_up(Port& port, unsigned step) noexcept = 0;

    struct Reading {
        Answer answer = Answer::ok;
        enum Kind : std::uint8_t {
            nothing,   // no conversion is ready
            part,      // one was taken; the frame wants more
            frame,     // the frame is complete
            bad,       // what came is not what the chip sent: a wrong checksum
            was_reset  // the chip has forgotten its settings
        } kind = nothing;
        bool began = false;      // this call has told the chip to begin the next conversion
        std::uint32_t lost = 0;  // Pace::counted: conversions that nobody took
        std::uint64_t taken_ns =
            0;  // Pace::continuous: when the value was, which may be another than the one said to be ready
    };
    // Takes a conversion if there is one. rt: blocks on the bus, for a few transfers
    [[nodiscard]] virtual Reading read(Port& port, Frame& frame) noexcept = 0;

    [[nodiscard]] virtual Pace pace() const noexcept = 0;
    // Level by which the chip's data-ready line shows that a conversion has ended; `none` where it has no such line.
    enum class ReadyEdge : std::uint8_t { none, rising, falling };
    [[nodiscard]] virtual ReadyEdge ready_edge() const noexcept { return ReadyEdge::none; }
    // True if its noise is more than a count with every setting, by the data sheet. setup
    [[nodiscard]] virtual bool is_noisy() const noexcept { return false; }
    // Number of electrodes that an analog switch leads to its input, one after the other; 0: there is no such switch.
    [[nodiscard]] virtual unsigned electrodes() const noexcept { return 0; }
    // From the beginning of the conversion that runs to its end, or between two of them, by the data sheet.
    [[nodiscard]] virtual std::uint64_t conversion_ns() const noexcept = 0;
    // One after the other for a frame. setup
    [[nodiscard]] virtual unsigned conversions() const noexcept { return 1; }
    // Identification of this chip: "its registers 0xFE and 0xFF read", 0x54491004. setup
    struct Identity {
        std::string_view what;
        std::uint64_t expected;
    };
    [[nodiscard]] virtual Identity identity() const noexcept = 0;
};

struct ChipEntry {
    std::string_view name;  // as in `chip = "ad7746"`
    std::uint8_t min_address, max_address;
    std::unique_ptr<Chip> (*make)(Options& options);  // reads the chip's own keys; errors go to the options' Problems
    Registry<ChipEntry> in_list{this};
};

using Chips = Registry<ChipEntry>;

// The place in `allowed` of the number at `key`; that of `fallback` where the key is missing or has an error. setup
unsigned choice(Options& options, std::string_view key, std::initializer_list<double> allowed, double fallback);

}  // namespace tactiled
