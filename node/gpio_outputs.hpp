// The thread that shows the state of the node on GPIO lines, for a machine without a PLC. The thread reads shared memory
// like any other reader.
#pragma once
#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/gpio.hpp"
#include "node/log.hpp"
#include "node/realtime.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

// States of the lines. True means that the condition is present; the level of the line may be inverted.
struct GpioSigns {
    bool fault = true, grasped = false, slip = false, alive = false;
    bool operator==(const GpioSigns&) const = default;
};

// Converts a node record to signs. Without a fresh record the signs show a fault.
class GpioJudge {
public:
    GpioJudge(int slip_ms) noexcept : slip_ns_(std::uint64_t(slip_ms) * 1'000'000u) {}
    // Returns the signs; `node` is nullptr if there is no fresh record.
    GpioSigns judge(const tactiled_node* node, std::uint64_t now_ns) noexcept;

private:
    std::uint64_t slip_ns_, slip_until_ns_ = 0;
    std::uint32_t slips_ = 0;
    bool seen_ = false;
};

class GpioOutputs {
public:
    // Starts the thread. A line that is not available does not block the others; it is requested again, at first after 50
    // ms, later each second.
    // setup: throws SetupError where no thread can be made
    GpioOutputs(std::string node_name, const GpioSettings& settings);
    // Shows a fault, then releases the lines.
    ~GpioOutputs();
    GpioOutputs(const GpioOutputs&) = delete;
    GpioOutputs& operator=(const GpioOutputs&) = delete;

private:
    struct LastLogged {
        std::string text;
        std::uint64_t t_ns = 0;
    };

    struct Line {
        const char* key;  // key of [gpio]
        std::string name;
        bool GpioSigns::*sign;
        bool high_means;  // value of the sign at a high level
        GpioOutput output{};
        bool driven = false;
        LastLogged logged_refused{};
    };

    void run() noexcept;
    void cycle(std::uint64_t now_ns);
    GpioSigns look(std::uint64_t now_ns);
    // Opens the lines that are not driven, fault first. Returns true if at least one was opened.
    bool open_missing();
    // Sets the driven lines. Returns false if a line was removed; that line is then no longer driven.
    bool set_driven();
    [[nodiscard]] std::size_t driven() const noexcept;
    static void log_unless_repeated(LastLogged& last, LogLevel level, const std::string& text);

    std::string node_name_, chip_;
    std::vector<Line> lines_;
    GpioJudge judge_;
    GpioSigns signs_;
    Segment segment_;
    std::uint64_t segment_tried_ns_ = 0, open_ns_ = 0, pause_ns_ = 0;
    std::uint64_t set_ns_ = 0;  // 0: not set since a line was opened
    LastLogged logged_driving_, logged_disconnected_;
    std::atomic<bool> stop_{false};
    RtThread thread_;
};

}  // namespace tactiled
