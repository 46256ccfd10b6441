// A device's end of a pty, which the daemon opens like a serial port. Shared by `play` and `simulate --pty`.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "drivers/wire/stream_format.hpp"

namespace tactiled::ctl {

class Command;

// The pty is reachable as `link`, a symbolic link that is removed with the Port.
class Port {
public:
    // setup: throws SetupError where there is no pty, or `link` is in the way
    explicit Port(const std::string& link);
    ~Port();
    Port(const Port&) = delete;
    Port& operator=(const Port&) = delete;

    // True while a process has the other end open.
    [[nodiscard]] bool has_reader() const;
    // Sends bytes. Waits for a limited time if the pty is full, because a real device does not depend on its
    // capacity. Returns false if the bytes were dropped; later calls then do not wait until the reader takes bytes
    // again.
    [[nodiscard]] bool send(const void* bytes, std::size_t size);
    // Returns the next line that the reader has sent, without its end; "" if there is none.
    [[nodiscard]] std::string receive();
    // Sets the device's clock, which was `time_us` at `at_ns` of CLOCK_MONOTONIC and runs on.
    void set_clock(std::uint64_t time_us, std::uint64_t at_ns) noexcept;
    [[nodiscard]] std::uint64_t clock_us(std::uint64_t at_ns) const noexcept;

private:
    std::string link_, received_;
    int master_ = -1;
    bool is_stuck_ = false;
    std::uint64_t clock_us_ = 0, clock_ns_ = 0;
};

// Format of the frames, with the options of a verb that select it.
struct Wire {
    std::string name = "lines";  // a serial format that has an encoder
    StreamSettings settings;
    double counts_per_unit = 1;

    void add_options(Command verb);
    // setup: the options are parsed
    [[nodiscard]] const StreamFormat& format() const;
    // Sends a frame whose channels are in their units; NaN: without a value. Returns false if the frame was not taken
    // completely.
    [[nodiscard]] bool send(Port& port, Frame frame) const;
    // Sleeps until that time of CLOCK_MONOTONIC, or until interrupted, and meanwhile answers the requests of the readers.
    void answer_until(std::uint64_t due_ns, std::span<const std::unique_ptr<Port>> ports) const;
};

// Waits until the port was opened and its opener has set it up, or until interrupted.
void wait_for_reader(const Port& port);
// Waits so that the reader can read the remaining bytes, which are lost when the port closes.
void let_reader_finish();

}  // namespace tactiled::ctl
