// Answers whole requests of TCP and RTU. It reads shared memory like any reader and has one ring of commands, so it
// could be a process of its own. Used from one thread.
#pragma once
#include <atomic>
#include <cstdint>
#include <span>
#include <string>

#include "config/config.hpp"
#include "node/modbus/controls.hpp"
#include "node/modbus/identify.hpp"
#include "node/modbus/responder.hpp"
#include "node/modbus/taxels.hpp"

namespace tactiled::modbus {

class Service {
public:
    // setup
    Service(std::string node_name, const ModbusSettings& settings, CommandRing& commands);

    // Answers a whole request, in the framing of `responder`, through it. Returns the number of bytes sent, or 0 if
    // the answer was not sent completely or none is due.
    std::size_t answer(std::span<const std::uint8_t> request, Session& session, Responder& responder);

    struct Counts {
        std::atomic<std::uint64_t> requests{0}, exceptions{0};
    };
    [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

    // Refuses writes as busy until then: the requests may have waited for a process that was stopped, and their senders may
    // have given up.
    void refuse_writes_until(std::uint64_t t_ns) noexcept { refuses_until_ns_ = t_ns; }

    // Sends commands for which the pipeline had no room. Called regularly.
    void tick(std::uint64_t now_ns) noexcept { controls_.tick(now_ns); }
    [[nodiscard]] bool watches_plc() const noexcept { return controls_.watches_plc(); }

private:
    [[nodiscard]] View look();
    void fill_run(Run run, const View& view, const Session& session, std::uint64_t now_ns);
    void fill_registers(const Area& area, Run run, const View& view, const Session& session, std::uint64_t now_ns);
    void fill_bits(const View& view, const Session& session, std::uint64_t now_ns);

    std::string node_name_;
    bool scratch_;
    std::array<int, kSensorBlocks> force_scales_;
    Controls controls_;
    Identity identity_;
    Taxels taxels_;
    Tables tables_;
    Segment segment_;
    std::uint64_t segment_tried_ns_ = 0, refuses_until_ns_ = 0;
    Counts counts_;
};

}  // namespace tactiled::modbus
