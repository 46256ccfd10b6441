// The effect of a valid write, and the values that are read back.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "config/text_file.hpp"
#include "node/log.hpp"
#include "node/modbus/controls.hpp"

namespace tactiled::modbus {
namespace {

constexpr std::uint64_t kUnlockNs = 30'000'000'000;

bool is_setting(std::uint16_t at) { return at >= kFilterHz && at <= kWeighWindow; }

// The settings file's keys, in the order of the registers; value = register * scale.
struct Key {
    const char* name;
    double scale;
};
constexpr Key kKeys[] = {{"filter_hz", 1},     {"contact_on_N", 0.01},  {"contact_off_N", 0.01},
                         {"overload_N", 0.01}, {"slip_sensitivity", 1}, {"weigh_window_ms", 1}};

}  // namespace

// ---- writing ---------------------------------------------------------------------------------------------------------

void Controls::write(const Request& request, const View& view, Session& session, std::uint64_t now_ns) noexcept {
    if (request.function == kWriteCoil || request.function == kWriteCoils) return write_coils(request, session, now_ns);
    for (unsigned i = 0; i < request.write.count; ++i)
        write_register(std::uint16_t(request.write.at + i), requested(request, i, session), view, session, now_ns);
    const unsigned end = request.write.at + request.write.count;
    if (request.write.at <= kWeighWindow && end > kFilterHz) send_settings();
    robot_.send(commands_);
}

void Controls::write_coils(const Request& request, const Session& session, std::uint64_t now_ns) noexcept {
    std::uint32_t tare = 0, slips = 0;
    bool clear = false, weigh = false;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = request.write.at + i;
        if (!is_set(request, i)) continue;
        if (at < kSlipCoils)
            tare |= 1u << at;
        else if (at < kClearAllCoil)
            slips |= 1u << (at - kSlipCoils);
        clear |= at == kClearAllCoil;
        weigh |= at == kWeighCoil;
    }
    const auto run = [&](std::uint16_t code, Command::Kind kind, std::uint32_t mask) {
        begin_direct(session, code, send(kind, mask, now_ns), now_ns);
    };
    if (tare != 0) run(kTare, Command::Kind::tare, tare);
    if (slips != 0) run(kClearSlips, Command::Kind::clear_slips, slips);
    if (clear) run(kClearLatches, Command::Kind::clear_latches, 0);
    if (weigh) run(kStartWeighing, Command::Kind::start_weighing, 0);
    if (request.write.at == kWeighCoil && !weigh) run(kStopWeighing, Command::Kind::stop_weighing, 0);
}

// DIRECT_STATE and DIRECT_RESULT report the outcome of a command of one register or coil.
void Controls::begin_direct(const Session& session, std::uint16_t code, std::uint32_t number,
                            std::uint64_t now_ns) noexcept {
    CommandClient& client = clients_.of_writer(session.host, now_ns);
    client.direct_code = code;
    ++client.direct_count;
    client.direct_number = number;
    client.direct_ns = now_ns;
    client.direct = {TACTILED_COMMAND_RUNNING, TACTILED_COMMAND_OK};
    if (number == 0) client.direct = {TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_FAILED};  // the pipeline hangs
}

void Controls::write_command_cell(std::uint16_t at, std::uint16_t value, const View& view, const Session& session,
                                  std::uint64_t now_ns) noexcept {
    const auto run = [&](std::uint16_t code, Command::Kind kind, std::uint32_t mask) {
        begin_direct(session, code, send(kind, mask, now_ns), now_ns);
    };
    switch (at) {
        case kTareCell: return run(kTare, Command::Kind::tare, value);
        case kUntareCell: return run(kUntare, Command::Kind::untare, value);
        case kClearLatchCell: return run(kClearLatches, Command::Kind::clear_latches, value);
        case kResetPeakCell: return run(kResetPeaks, Command::Kind::reset_peaks, value);
        case kWeighCell: return run(kStartWeighing, Command::Kind::start_weighing, 0);
        case kZeroWeightCell: return run(kZeroWeight, Command::Kind::zero_weight, 0);
        case kKnownWeightCell: return begin_direct(session, kKnownWeight, send_known_weight(value * 1e-3, now_ns), now_ns);
        default:
            begin_direct(session, kTeach, ~0u, now_ns);
            teacher_ = &clients_.of_writer(session.host, now_ns);
            return teaching_.begin(value, weighing_of(view.snapshot.node.grasp));
    }
}

void Controls::write_register(std::uint16_t at, std::uint16_t value, const View& view, Session& session,
                              std::uint64_t now_ns) noexcept {
    if (at >= kScratchAt) {
        scratch_[at - kScratchAt] = value;
        return;
    }
    if (is_setting(at)) {
        settings_[at - kFilterHz] = value;
        return;
    }
    if (Robot::has(at)) return robot_.write(at, value, now_ns);
    if (at >= kTareCell && at <= kKnownWeightCell)
        return value != 0 ? write_command_cell(at, value, view, session, now_ns) : void();
    switch (at) {
        case kPlcHeartbeat:
            if (value != heartbeat_) heartbeat_ns_ = now_ns;
            heartbeat_ = value;
            return;
        case kPlcWatchdog:
            if (value != watchdog_ms_)
                heartbeat_ns_ = now_ns;  // a block that is written repeatedly does not count as a heartbeat
            watchdog_ms_ = value;
            return;
        case kUnlock:
            if (value == 0 && session.unlocked_until_ns == unlocked_until_ns_) unlocked_until_ns_ = 0;
            session.unlocked_until_ns = value != 0 ? now_ns + kUnlockNs : 0;
            unlocked_until_ns_ = std::max(unlocked_until_ns_, session.unlocked_until_ns);
            return;
        case kSave: return save();
        default: break;
    }
    CommandClient& client = clients_.of_writer(session.host, now_ns);
    client.block[at - kCmd] = value;
    if (at == kCmdSeq && client.take_number()) run_command(client, view, now_ns);
}

// CMD_SEQ has changed: the block is a command. Its errors are reported in CMD_RESULT, not by an exception.
void Controls::run_command(CommandClient& client, const View& view, std::uint64_t now_ns) noexcept {
    const std::array<std::uint16_t, 5>& block = client.taken;
    const auto settle = [&](tactiled_command_state state, tactiled_command_result result) {
        client.settle({state, result});
    };
    const std::uint32_t mask = block[1];
    const bool needs_mask = block[0] == kTare || block[0] == kUntare || block[0] == kResetPeaks || block[0] == kSelfTest;
    if ((mask & ~sensor_mask_of(view)) != 0 || (needs_mask && mask == 0))
        return settle(TACTILED_COMMAND_REJECTED,
                      block[0] >= kTare && block[0] <= kTeach ? TACTILED_COMMAND_BAD_MASK : TACTILED_COMMAND_UNKNOWN);
    const auto follow_number = [&](std::uint32_t number) {
        client.number = number;
        sent_ns_ = now_ns;
        if (number == 0) return settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_FAILED);
        settle(TACTILED_COMMAND_RUNNING, TACTILED_COMMAND_OK);
        running_ = &client;
    };
    const auto run = [&](Command::Kind kind, std::uint32_t sensors) { follow_number(send(kind, sensors, now_ns)); };
    const std::uint32_t parameter = std::uint32_t(block[2]) << 16 | block[3];
    const tactiled_grasp& held = view.snapshot.node.grasp;
    const bool needs_stable = block[0] == kKnownWeight || block[0] == kTeach;
    const bool weighs = block[0] == kStartWeighing || block[0] == kStopWeighing || block[0] == kZeroWeight || needs_stable;
    if (weighs &&
        (!weighs_ || (needs_stable && !is_stable(held)) || (block[0] == kTeach && !is_teachable(weighing_of(held)))))
        return settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_NOT_NOW);
    if (needs_stable && (parameter == 0 || (block[0] == kTeach && parameter > 65534)))
        return settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_BAD_PARAMETER);
    switch (block[0]) {
        case kTare: return run(Command::Kind::tare, mask);
        case kUntare: return run(Command::Kind::untare, mask);
        case kClearLatches: return run(Command::Kind::clear_latches, mask);
        case kResetPeaks: return run(Command::Kind::reset_peaks, mask);
        case kSelfTest: return run(Command::Kind::self_test, mask);
        case kStartWeighing: return run(Command::Kind::start_weighing, 0);
        case kStopWeighing: return run(Command::Kind::stop_weighing, 0);
        case kZeroWeight: return run(Command::Kind::zero_weight, 0);
        case kKnownWeight: return follow_number(send_known_weight(parameter * 1e-4, now_ns));
        case kTeach:
            teaching_for_block_ = true;
            running_ = &client;
            settle(TACTILED_COMMAND_RUNNING, TACTILED_COMMAND_OK);
            return teaching_.begin(parameter, weighing_of(view.snapshot.node.grasp));
        default: return settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_UNKNOWN);
    }
}

std::uint32_t Controls::send(Command command, std::uint64_t now_ns) noexcept {
    Command* const slot = commands_.claim();
    if (slot == nullptr) return 0;  // the pipeline hangs
    command.number = ++number_;
    command.until_ns = now_ns + kAnswerNs;
    *slot = command;
    commands_.push();
    commands_.commit();
    if (command.kind == Command::Kind::tare || command.kind == Command::Kind::untare) {
        tare_number_ = number_;
        tare_mask_ = command.kind == Command::Kind::tare ? command.mask : 0;
    }
    return number_;
}

std::uint32_t Controls::send(Command::Kind kind, std::uint32_t mask, std::uint64_t now_ns) noexcept {
    Command command;
    command.kind = kind;
    command.mask = mask;
    return send(command, now_ns);
}

std::uint32_t Controls::send_known_weight(double mass_kg, std::uint64_t now_ns) noexcept {
    Command command;
    command.kind = Command::Kind::known_weight;
    command.mass_kg = mass_kg;
    return send(command, now_ns);
}

void Controls::send_settings() noexcept {
    Command* const slot = commands_.claim();
    settings_unsent_ = slot == nullptr;
    if (settings_unsent_) return;
    const auto value = [&](unsigned i) { return settings_[i] == kAsConfigured ? kNaN : settings_[i] * kKeys[i].scale; };
    *slot = Command{};
    slot->kind = Command::Kind::set;
    slot->settable = {value(0), value(1), value(2), value(3)};
    slot->grasp = {value(4) / 100, value(5)};
    commands_.push();
    commands_.commit();
}

// ---- reading ---------------------------------------------------------------------------------------------------------

void Controls::read(Run run, const Session& session, std::uint64_t now_ns, std::uint16_t* out) const noexcept {
    const CommandClient& client = clients_.at(session.host);
    for (unsigned i = 0; i < run.count; ++i) {
        const unsigned at = run.at + i;
        std::uint16_t value = 0;
        if (at >= kScratchAt)
            value = scratch_[at - kScratchAt];
        else if (at <= kCmdSeq)
            value = client.block[at - kCmd];
        else if (is_setting(std::uint16_t(at)))
            value = settings_[at - kFilterHz];
        else if (Robot::has(at))
            value = robot_.read(at);
        else
            switch (at) {
                case kPlcHeartbeat: value = heartbeat_; break;
                case kPlcWatchdog: value = watchdog_ms_; break;
                case kUnlock: value = now_ns <= session.unlocked_until_ns && session.unlocked_until_ns != 0; break;
                case kSave: value = saving_.load(); break;
                default: break;
            }
        out[i] = value;
    }
}

void Controls::read_coils(const View& view, std::span<std::uint8_t, kCoils> out) const noexcept {
    std::fill(out.begin(), out.end(), std::uint8_t(0));
    // True until the tare is acknowledged: after the last sample its zero has to be stored.
    const tactiled_command& answer = view.snapshot.node.command[TACTILED_FROM_MODBUS];
    const bool tares = answer.acknowledged == tare_number_ && answer.state == TACTILED_COMMAND_RUNNING;
    for (unsigned i = 0; i < kSensorBlocks; ++i) {
        const bool taring =
            (view.snapshot.sensor[i].reasons & TACTILED_TARING) != 0 || (tares && (tare_mask_ >> i & 1) != 0);
        out[kTareCoils + i] = taring ? 1 : 0;
    }
    out[kWeighCoil] = has_weight(view.snapshot.node.grasp) ? 1 : 0;
}

bool Controls::plc_is_silent(std::uint64_t now_ns) const noexcept {
    return watchdog_ms_ != 0 && now_ns > heartbeat_ns_ + std::uint64_t(watchdog_ms_) * 1'000'000u;
}

void Controls::read_commands(const Session& session, std::span<std::uint16_t, kCommandsSize> out) const noexcept {
    const CommandClient& client = clients_.at(session.host);
    std::fill(out.begin(), out.end(), std::uint16_t(0));
    out[kCmdRepeats] = client.repeats;
    out[kDirectCmd] = client.direct_code;
    out[kDirectState] = std::uint16_t(client.direct.state);
    out[kDirectResult] = std::uint16_t(client.direct.result);
    out[kDirectCount] = client.direct_count;
}

void Controls::add_to_global(const Session& session, std::uint64_t now_ns,
                             std::span<std::uint16_t, kGlobalSize> global) const noexcept {
    const CommandClient& client = clients_.at(session.host);
    global[kCmdSeqAck] = client.taken[4];
    global[kCmdState] = std::uint16_t(client.outcome.state);
    global[kCmdResult] = std::uint16_t(client.outcome.result);
    global[kPlcHbEcho] = heartbeat_;
    if (plc_is_silent(now_ns)) global[kStatus] |= 1u << 12;
    if (now_ns <= unlocked_until_ns_) global[kStatus] |= 1u << 13;
    if (saving_.load() == failed || unreadable_.load() || teach_failed_) {
        global[kFault] |= 1u << 6;
        global[kStatus] |= std::uint16_t(TACTILED_FAULT);
    }
}

// ---- keeping ---------------------------------------------------------------------------------------------------------

void Controls::load() {
    if (::access(path_.c_str(), F_OK) != 0) return;
    Problems problems;
    Options file = Options::parse_file(path_, problems, 4096);
    auto loaded = settings_;
    for (unsigned i = 0; i < kSettings; ++i) {
        const Limits& limits = writable_at(kFilterHz + i)->limits;
        if (!file.has(kKeys[i].name)) continue;
        const Range range{limits.min * kKeys[i].scale, limits.max * kKeys[i].scale};
        loaded[i] = std::uint16_t(std::lround(file.number(kKeys[i].name, range) / kKeys[i].scale));
    }
    file.finish();
    for (const auto& line : problems.lines()) log_line(LogLevel::warning, "{}; stored settings are not used", line);
    unreadable_.store(!problems.empty());
    if (!problems.empty()) return;
    settings_ = loaded;
    send_settings();
}

void Controls::save() noexcept {
    saver_.join();  // it has ended: check() has verified that nothing is being stored
    to_save_ = settings_;
    saving_.store(storing);
    try {
        saver_.start("save", 0, -1, [this] {
            try {
                std::string text = "# What a PLC has set and stored; overrides the configuration. Written by tactiled.\n";
                for (unsigned i = 0; i < kSettings; ++i)
                    if (to_save_[i] != kAsConfigured)
                        text += fmt::format("{} = {:.10g}\n", kKeys[i].name, to_save_[i] * kKeys[i].scale);
                replace_file(path_, text);
                unreadable_.store(false);
                saving_.store(idle);
            } catch (const std::exception& error) {
                log_line(LogLevel::warning, "Modbus SAVE: {}", error.what());
                saving_.store(failed);
            }
        });
    } catch (const std::exception&) { saving_.store(failed); }
}

}  // namespace tactiled::modbus
