// One chip in operation: it is configured, read when a conversion is due, paused when it does not answer, and
// configured again after a reset. All times are those of the bus, so that tests need not wait.
#pragma once
#include <memory>
#include <string>

#include "drivers/chips/chip.hpp"
#include "drivers/chips/conversion_clock.hpp"

namespace tactiled {

class Station {
public:
    Station(std::string name, std::unique_ptr<Chip> chip, Port port, std::uint16_t device, LinkCounts& counts,
            ReadyLine* ready)
        : name_(std::move(name)), chip_(std::move(chip)), port_(port), device_(device), counts_(counts), ready_(ready) {}

    // Starts again after the link was opened. setup
    void start() noexcept;

    enum class Outcome : std::uint8_t { nothing, frame, hangs, disconnected };  // the last two concern the whole bus
    // Does the action that is due. rt: blocks on the bus, for a few transfers
    [[nodiscard]] Outcome step(Frame& frame) noexcept;

    // Checks the chip's data-ready line, if it has one: an edge makes the chip due. A missed edge costs only age,
    // because the prediction of the clock remains. rt: as ReadyLine::take
    void look() noexcept;

    [[nodiscard]] std::uint64_t due_ns() const noexcept { return due_ns_; }

    // For open(): is_settled() is true if the chip is converting or has failed; complaint() describes the fault, ""
    // if there is none. setup
    [[nodiscard]] bool is_settled() const noexcept { return state_ == State::converting || pause_ms_ != 0; }
    [[nodiscard]] bool is_wrong() const noexcept { return is_wrong_; }
    [[nodiscard]] bool answers() const noexcept { return pause_ms_ == 0 || is_wrong_; }
    [[nodiscard]] std::string place() const;
    [[nodiscard]] std::string complaint() const;

private:
    enum class State : std::uint8_t { setting_up, converting };

    Outcome set_up() noexcept;
    Outcome convert(Frame& frame) noexcept;
    [[nodiscard]] std::uint64_t predicted_ns() const noexcept;
    [[nodiscard]] std::uint64_t ended_ns(std::uint64_t before_ns, std::uint64_t now_ns) noexcept;
    Outcome take(const Chip::Reading& reading, std::uint64_t before_ns, Frame& frame) noexcept;
    void begin_conversion() noexcept;
    void set_up_again() noexcept;
    Outcome fail(Answer answer) noexcept;
    Outcome give_up() noexcept;
    Outcome restart() noexcept;

    std::string name_;
    std::unique_ptr<Chip> chip_;
    Port port_;
    std::uint16_t device_;
    LinkCounts& counts_;
    ReadyLine* ready_;  // nullptr: none

    State state_ = State::setting_up;
    ConversionClock clock_;
    std::uint64_t due_ns_ = 0, began_ns_ = 0;
    std::uint64_t edge_ns_ = 0;   // timestamp of an edge without a reading after it; 0: none
    std::uint64_t taken_ns_ = 0;  // time of the last reading: an older edge belongs to that reading
    unsigned step_ = 0, pause_ms_ = 0;
    unsigned asked_ = 0;           // polls without a result since the last conversion
    std::uint64_t latest_ns_ = 0;  // a conversion that is read after this time has waited in the chip
    std::uint64_t waited_ns_ = 0;  // sum over the parts of the frame that were read so far
    std::uint32_t lost_ = 0;
    std::uint64_t found_ = 0;
    bool is_hastened_ = false;  // the chip is due because of an edge
    bool has_edges_ = false;    // the line had an edge for the last conversion
    bool was_set_up_ = false, was_restarted_ = false, has_converted_ = false, is_retry_ = false, is_wrong_ = false;
};

}  // namespace tactiled
