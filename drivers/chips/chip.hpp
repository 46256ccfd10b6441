// The interface of a chip on an I2C bus: configuration and reading of a conversion. A chip object never waits and
// never reads a clock; Station calls it when an action is due. To add a chip, write a file with an entry at its end
// and add a line to CMakeLists.txt.
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

// Ways in which a chip signals a conversion.
enum class Pace : std::uint8_t {
    continuous,  // converts continuously and signals when a conversion is ready
    triggered,   // converts on command and signals the end
    counted,     // converts continuously and numbers its conversions
    timed        // converts continuously and signals nothing
};

class Chip {
public:
    virtual ~Chip() = default;

    struct Progress {
        Answer answer = Answer::ok;
        enum Kind : std::uint8_t { more, done, wrong } kind = more;  // wrong: this is another chip than configured
        std::uint32_t wait_us = 0;  // wait before the next step, or before the first conversion
        std::uint64_t found = 0;    // if wrong: the value found in place of expected()
    };
    // Makes one step of the configuration that brings the chip from any state to converting; `step` counts from 0. At
    // `done` a conversion has begun.
    // rt: blocks on the bus, for a few transfers
    [[nodiscard]] virtual Progress set_up(Port& port, unsigned step) noexcept = 0;

    struct Reading {
        Answer answer = Answer::ok;
        enum Kind : std::uint8_t {
            nothing,   // no conversion is ready
            part,      // one conversion was read; the frame needs more
            frame,     // the frame is complete
            bad,       // the answer is damaged: wrong checksum
            was_reset  // the chip has lost its settings
        } kind = nothing;
        bool began = false;      // this call has begun the next conversion
        std::uint32_t lost = 0;  // Pace::counted: conversions that were not read
        std::uint64_t taken_ns =
            0;  // Pace::continuous: read time of the value, which can be newer than the one that was signalled
    };
    // Reads a conversion if one is ready. rt: blocks on the bus, for a few transfers
    [[nodiscard]] virtual Reading read(Port& port, Frame& frame) noexcept = 0;

    [[nodiscard]] virtual Pace pace() const noexcept = 0;
    // Edge of the chip's data-ready line at the end of a conversion; `none` if it has no such line.
    enum class ReadyEdge : std::uint8_t { none, rising, falling };
    [[nodiscard]] virtual ReadyEdge ready_edge() const noexcept { return ReadyEdge::none; }
    // True if the noise is more than a count in every setting, by the data sheet. setup
    [[nodiscard]] virtual bool is_noisy() const noexcept { return false; }
    // Number of electrodes that an analog switch connects to the input successively; 0: there is no switch.
    [[nodiscard]] virtual unsigned electrodes() const noexcept { return 0; }
    // Duration of the present conversion, or interval between two conversions, by the data sheet.
    [[nodiscard]] virtual std::uint64_t conversion_ns() const noexcept = 0;
    // Number of successive conversions per frame. setup
    [[nodiscard]] virtual unsigned conversions() const noexcept { return 1; }
    // Identification register of this chip, such as "its registers 0xFE and 0xFF read", 0x54491004. setup
    struct Identity {
        std::string_view what;
        std::uint64_t expected;
    };
    [[nodiscard]] virtual Identity identity() const noexcept = 0;
};

struct ChipEntry {
    std::string_view name;  // name in `chip = "ad7746"`
    std::uint8_t min_address, max_address;
    std::unique_ptr<Chip> (*make)(Options& options);  // reads the chip's own keys; errors go to the options' Problems
    Registry<ChipEntry> in_list{this};
};

using Chips = Registry<ChipEntry>;

// Returns the index in `allowed` of the number at `key`; the index of `fallback` if the key is missing or has an
// error. setup
unsigned choice(Options& options, std::string_view key, std::initializer_list<double> allowed, double fallback);

}  // namespace tactiled
