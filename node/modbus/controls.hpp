// Writes of a PLC: commands, hints, settings, scratch. A write is checked completely before any part of it is carried
// out.
#pragma once
#include <atomic>
#include <cstdint>
#include <span>
#include <string>

#include "config/config.hpp"
#include "node/modbus/command_clients.hpp"
#include "node/modbus/encode.hpp"
#include "node/modbus/request_validator.hpp"
#include "node/modbus/robot.hpp"
#include "node/modbus/taxels.hpp"
#include "node/modbus/teaching.hpp"
#include "node/pipeline.hpp"
#include "node/realtime.hpp"

namespace tactiled::modbus {

// The state of one connection.
struct Session {
    HostAddress host{};  // the client that owns the commands; all 0 on the RTU line
    bool may_write = false;
    std::uint64_t unlocked_until_ns = 0;  // end of the time in which settings may be written
    LatchedTaxels taxels;
};

struct PlcCommand;  // controls_commands.cpp

class Controls {
public:
    // `commands` leads to the pipeline: the ring of TACTILED_FROM_MODBUS. Reads the settings that SAVE has stored.
    // setup
    Controls(const ModbusSettings& settings, CommandRing& commands);
    Controls(const Controls&) = delete;
    Controls& operator=(const Controls&) = delete;

    // Follows the running command, if there is one. Called before check(), write() and report().
    void follow(const View& view, std::uint64_t now_ns) noexcept;

    // Checks whether a write of functions 5, 6, 15, 16, 22, 23 may be carried out now; changes nothing.
    [[nodiscard]] Exception check(const Request& request, const View& view, const Session& session,
                                  std::uint64_t now_ns) const noexcept;
    // Sends commands for which the pipeline had no room, and ends the hints of a silent PLC. Called regularly.
    void tick(std::uint64_t now_ns) noexcept;
    // Returns true if hints are in force that may expire, so that tick() must come soon after the PLC's silence.
    [[nodiscard]] bool watches_plc() const noexcept { return robot_.may_expire(); }
    // Carries out a write that check() has accepted.
    void write(const Request& request, const View& view, Session& session, std::uint64_t now_ns) noexcept;

    // Reads the registers of `run`, which is in the controls or in scratch.
    void read(Run run, const Session& session, std::uint64_t now_ns, std::uint16_t* out) const noexcept;
    void read_coils(const View& view, std::span<std::uint8_t, kCoils> out) const noexcept;
    // Returns the state of this client's commands, echo, and the bits of STATUS and FAULT that are known here.
    [[nodiscard]] ClientReport report(const Session& session, std::uint64_t now_ns) const noexcept;
    // Notes that this client has been sent its CMD_RESULT.
    void note_read(const Session& session) noexcept { clients_.note_read(session.host); }

private:
    static constexpr std::uint64_t kAnswerNs = 15'000'000'000;  // longer than the longest tare
    enum Saving : std::uint8_t { idle, storing, failed };

    [[nodiscard]] bool is_busy(const View& view) const noexcept;
    [[nodiscard]] bool command_waits(const Request& request, const View& view, const Session& session) const noexcept;
    [[nodiscard]] std::uint16_t requested(const Request& request, unsigned i, const Session& session) const noexcept;
    [[nodiscard]] Exception check_register(unsigned at, std::uint16_t value, const View& view, const Session& session,
                                           std::uint64_t now_ns) const noexcept;
    [[nodiscard]] bool registers_fit(const Request& request, const Session& session, std::uint64_t now_ns) const noexcept;
    [[nodiscard]] Exception check_command_cell(unsigned at, std::uint16_t value, const View& view) const noexcept;
    [[nodiscard]] Exception check_coil(const Request& request, unsigned i, const View& view) const noexcept;
    [[nodiscard]] static bool coils_are_one_command(const Request& request) noexcept;
    [[nodiscard]] bool plc_is_silent(std::uint64_t now_ns) const noexcept;
    void note_life(const Request& request, const Session& session, std::uint64_t now_ns) noexcept;
    void write_register(unsigned at, std::uint16_t value, const View& view, Session& session, std::uint64_t now_ns) noexcept;
    void write_coils(const Request& request, const Session& session, std::uint64_t now_ns) noexcept;
    void run_block(CommandClient& client, const View& view, std::uint64_t now_ns) noexcept;
    void run_command_cell(unsigned at, std::uint16_t value, const View& view, const Session& session,
                          std::uint64_t now_ns) noexcept;
    std::uint32_t start(const PlcCommand& command, std::uint32_t mask, std::uint32_t id, double mass_kg, const View& view,
                        std::uint64_t now_ns) noexcept;
    void begin_direct(const Session& session, std::uint16_t code, std::uint32_t number, std::uint64_t now_ns) noexcept;
    void follow_direct(const tactiled_command& answer, std::uint64_t now_ns) noexcept;
    // Sends a command. Returns the number by which the pipeline acknowledges it, 0 if the pipeline does not take it.
    std::uint32_t send(Command command, std::uint64_t now_ns) noexcept;
    void hand_over_objects(std::uint64_t now_ns) noexcept;
    void follow_teaching(const tactiled_command& answer) noexcept;
    void send_settings() noexcept;
    void settle_block(tactiled_command_state state, tactiled_command_result result) noexcept;
    void load();
    void save() noexcept;

    bool enabled_, weighs_;
    std::string path_;
    CommandRing& commands_;
    CommandClients clients_;
    Words words_;  // settings, heartbeat, scratch
    Robot robot_;
    std::uint64_t unlocked_until_ns_ = 0;  // by any client

    std::uint32_t number_ = 0;  // number of the last command sent to the pipeline
    std::uint32_t acknowledged_by_pipeline_ = 0;
    std::uint32_t tare_number_ = 0;     // number of the last tare or untare that was sent
    std::uint32_t tare_mask_ = 0;       // sensors of the last tare, 0 if it was an untare
    CommandClient* running_ = nullptr;  // the client whose block runs; nullptr = none
    std::uint64_t sent_ns_ = 0;         // the time of that command

    Teaching teaching_;
    bool teaching_for_block_ = false;   // the CMD_STATE of running_ reports it
    CommandClient* teacher_ = nullptr;  // the client that requested it by the register
    bool teach_failed_ = false;         // the last one by the register, which has no CMD_STATE
    std::uint32_t objects_number_ = 0;  // number of the command that hands over the taught objects; 0 = not sent yet

    std::atomic<Saving> saving_{idle};
    bool settings_unsent_ = false;
    std::atomic<bool> unreadable_{false};  // the settings of an earlier SAVE cannot be read
    Words to_save_;
    RtThread saver_;
};

}  // namespace tactiled::modbus
