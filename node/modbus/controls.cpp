#include "node/modbus/controls.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "config/text_file.hpp"
#include "node/log.hpp"

namespace tactiled::modbus {
namespace {

constexpr std::uint64_t kUnlockNs = 30'000'000'000;
constexpr std::uint64_t kAnswerNs = 15'000'000'000;  // longer than the longest tare

bool is_setting(std::uint16_t at) { return at >= kFilterHz && at <= kWeighWindow; }

std::uint32_t sensors_of(const View& view) { return view.segment != nullptr ? (1u << view.segment->n_sensors()) - 1 : 0; }
// What cannot be tared now is refused at once where that is known at once.
bool have_values(const View& view, std::uint32_t mask) {
    for (unsigned i = 0; i < kSensorBlocks; ++i)
        if ((mask >> i & 1) != 0 && view.snapshot.sensor[i].quality == TACTILED_BAD) return false;
    return true;
}
bool is_set(const Request& request, unsigned i) { return (request.written[i / 8] >> i % 8 & 1) != 0; }

// The settings file's keys, in the order of the registers; value = register * scale.
struct Key {
    const char* name;
    double scale;
};
constexpr Key kKeys[] = {{"filter_hz", 1},     {"contact_on_N", 0.01},  {"contact_off_N", 0.01},
                         {"overload_N", 0.01}, {"slip_sensitivity", 1}, {"weigh_window_ms", 1}};

}  // namespace

Controls::Controls(const ModbusSettings& settings, Ring<Command>& commands)
    : enabled_(settings.commands), path_(settings.settings), commands_(commands) {
    settings_.fill(kAsConfigured);
    if (enabled_) load();
}

void Controls::follow(const View& view, std::uint64_t now_ns) noexcept {
    tick();
    const tactiled_command& answer = view.snapshot.node.command[TACTILED_FROM_MODBUS];
    acknowledged_by_pipeline_ = answer.acknowledged;
    if (state_ != TACTILED_COMMAND_RUNNING) return;
    if (answer.acknowledged == block_number_ && answer.state != TACTILED_COMMAND_RUNNING) {
        const bool good = answer.state == TACTILED_COMMAND_DONE && answer.result == TACTILED_COMMAND_OK;
        settle(good ? TACTILED_COMMAND_DONE : TACTILED_COMMAND_REJECTED, tactiled_command_result(answer.result));
    } else if (now_ns > sent_ns_ + kAnswerNs) {
        settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_TIMED_OUT);
    }
}

// Also before the pipeline has taken the command: two tares in one segment of TCP are two.
bool Controls::is_busy(const View& view) const noexcept {
    return (view.snapshot.node.status & TACTILED_ANY_TARING) != 0 || state_ == TACTILED_COMMAND_RUNNING ||
           std::int32_t(acknowledged_by_pipeline_ - tare_number_) < 0;
}

// ---- may it be written? ----------------------------------------------------------------------------------------------

// The value that the request would give register number i of its run.
std::uint16_t Controls::wished(const Request& request, unsigned i) const noexcept {
    const auto word = [&](std::size_t at) { return std::uint16_t(request.written[at] << 8 | request.written[at + 1]); };
    if (request.function != kMaskWrite) return word(2 * std::size_t(i));
    std::uint16_t now = 0;
    read(request.write, Session{}, 0, &now);
    return std::uint16_t((now & word(0)) | (word(2) & ~word(0)));  // 1.1b3, 6.16
}

Exception Controls::check(const Request& request, const View& view, const Session& session,
                          std::uint64_t now_ns) const noexcept {
    if (!enabled_ || !session.may_write) return kIllegalAddress;  // to this client they are read-only
    const bool coils = request.function == kWriteCoil || request.function == kWriteCoils;
    Exception first = kNone;  // of the run; a wrong address comes before a wrong value
    for (unsigned i = 0; i < request.write.count; ++i) {
        const auto at = std::uint16_t(request.write.at + i);
        const Exception found = !coils               ? check_register(at, wished(request, i), view, session, now_ns)
                                : is_set(request, i) ? check_coil(at, view)
                                                     : kNone;
        if (found == kIllegalAddress) return found;
        if (first == kNone) first = found;
    }
    if (first == kNone && (takes_more_than_one_command(request) || contact_is_upside_down(request))) return kIllegalValue;
    return first;
}

// A write is carried out whole or not at all; of two commands the pipeline might refuse the second.
bool Controls::takes_more_than_one_command(const Request& request) const noexcept {
    int commands = 0;
    if (request.function == kWriteCoil || request.function == kWriteCoils) {
        bool tares = false;
        for (unsigned i = 0; i < request.write.count; ++i) {
            tares |= is_set(request, i) && request.write.at + i < kSlipCoils;
            commands += is_set(request, i) && request.write.at + i == kClearAllCoil ? 1 : 0;
        }
        return commands + (tares ? 1 : 0) > 1;
    }
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = request.write.at + i;
        const std::uint16_t value = wished(request, i);
        commands += (at >= kTareCell && at <= kResetPeakCell && value != 0) || (at == kCmdSeq && value != block_[4]) ? 1 : 0;
    }
    return commands > 1;
}

// Where both ends of the hysteresis are set here, contact must not end above where it begins.
bool Controls::contact_is_upside_down(const Request& request) const noexcept {
    if (request.function == kWriteCoil || request.function == kWriteCoils) return false;
    std::uint16_t on = settings_[kContactOn - kFilterHz], off = settings_[kContactOff - kFilterHz];
    bool touched = false;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = request.write.at + i;
        if (at == kContactOn) on = wished(request, i);
        if (at == kContactOff) off = wished(request, i);
        touched |= at == kContactOn || at == kContactOff;
    }
    return touched && on != kAsConfigured && off != kAsConfigured && off > on;
}

Exception Controls::check_register(std::uint16_t at, std::uint16_t value, const View& view, const Session& session,
                                   std::uint64_t now_ns) const noexcept {
    if (at >= kScratchAt) return kNone;
    const Limits& limits = writable_at(at)->limits;
    if (limits.locked && now_ns > session.unlocked_until_ns) return kIllegalAddress;
    const bool as_configured = limits.locked && value == kAsConfigured;
    if ((value < limits.least || value > limits.most) && !as_configured) return kIllegalValue;
    if (at == kPlcWatchdog && value != 0 && value < 10) return kIllegalValue;
    if (at == kUnlock && value != kUnlockWord && value != 0) return kIllegalValue;
    if (at >= kTareCell && at <= kResetPeakCell && (value & ~sensors_of(view)) != 0) return kIllegalValue;
    if (at == kWeighCell && value != 0) return kDeviceFailure;  // no weighing in this version
    const bool command = (at >= kTareCell && at <= kResetPeakCell && value != 0) || (at == kCmdSeq && value != block_[4]);
    if (command && is_busy(view)) return kBusy;  // one at a time, so that CMD_STATE tells of the one that was asked for
    if (command && !view.alive) return kDeviceFailure;
    if (at == kTareCell && !have_values(view, value)) return kDeviceFailure;
    if (at == kSave && saving_.load() == storing) return kBusy;
    return kNone;
}

Exception Controls::check_coil(std::uint16_t at, const View& view) const noexcept {
    if (at == kWeighCoil || !view.alive) return kDeviceFailure;
    if (at == kClearAllCoil) return is_busy(view) ? kBusy : kNone;
    if ((sensors_of(view) >> at % kSensorBlocks & 1) == 0) return kIllegalAddress;  // no such sensor
    if (at >= kSlipCoils) return kNone;
    return is_busy(view) ? kBusy : have_values(view, 1u << at) ? kNone : kDeviceFailure;
}

// ---- writing ---------------------------------------------------------------------------------------------------------

void Controls::write(const Request& request, const View& view, Session& session, std::uint64_t now_ns) noexcept {
    if (request.function == kWriteCoil || request.function == kWriteCoils) {
        std::uint32_t tare = 0;
        bool clear = false;
        for (unsigned i = 0; i < request.write.count; ++i) {
            const unsigned at = request.write.at + i;
            if (!is_set(request, i)) continue;
            if (at < kSlipCoils) tare |= 1u << at;
            clear |= at == kClearAllCoil;
        }
        if (tare != 0) send(Command::Kind::tare, tare, now_ns);
        if (clear) send(Command::Kind::clear_latches, 0, now_ns);
        return;
    }
    for (unsigned i = 0; i < request.write.count; ++i)
        write_register(std::uint16_t(request.write.at + i), wished(request, i), view, session, now_ns);
    const unsigned end = request.write.at + request.write.count;
    if (request.write.at <= kWeighWindow && end > kFilterHz) send_settings();
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
    switch (at) {
        case kTareCell: return void(value != 0 ? send(Command::Kind::tare, value, now_ns) : 0);
        case kUntareCell: return void(value != 0 ? send(Command::Kind::untare, value, now_ns) : 0);
        case kClearLatchCell: return void(value != 0 ? send(Command::Kind::clear_latches, 0, now_ns) : 0);
        case kResetPeakCell: return void(value != 0 ? send(Command::Kind::reset_peaks, value, now_ns) : 0);
        case kWeighCell: return;
        case kPlcHeartbeat:
            if (value != heartbeat_) heartbeat_ns_ = now_ns;
            heartbeat_ = value;
            return;
        case kPlcWatchdog:
            if (value != watchdog_ms_)
                heartbeat_ns_ = now_ns;  // a block that is written again and again keeps nothing alive
            watchdog_ms_ = value;
            return;
        case kGripperState: gripper_state_ = value; return;
        case kGripperForce: gripper_force_ = value; return;
        case kUnlock:
            if (value == 0 && session.unlocked_until_ns == unlocked_until_ns_) unlocked_until_ns_ = 0;
            session.unlocked_until_ns = value != 0 ? now_ns + kUnlockNs : 0;
            unlocked_until_ns_ = std::max(unlocked_until_ns_, session.unlocked_until_ns);
            return;
        case kSave: return save();
        default: break;
    }
    const std::uint16_t last = block_[4];
    block_[at - kCmd] = value;
    if (at == kCmdSeq && value != last) run_command(view, now_ns);
}

// CMD_SEQ has changed: the block is a command. What is wrong with it is told in CMD_RESULT, not by an exception.
void Controls::run_command(const View& view, std::uint64_t now_ns) noexcept {
    acknowledged_ = block_[4];
    const std::uint32_t mask = block_[1];
    const bool needs_mask = block_[0] == kTare || block_[0] == kUntare || block_[0] == kResetPeaks || block_[0] == kSelfTest;
    if ((mask & ~sensors_of(view)) != 0 || (needs_mask && mask == 0))
        return settle(TACTILED_COMMAND_REJECTED,
                      block_[0] >= kTare && block_[0] <= kSelfTest ? TACTILED_COMMAND_BAD_MASK : TACTILED_COMMAND_UNKNOWN);
    const auto run = [&](Command::Kind kind, std::uint32_t sensors) {
        block_number_ = send(kind, sensors, now_ns);
        sent_ns_ = now_ns;
        if (block_number_ == 0) return settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_FAILED);
        settle(TACTILED_COMMAND_RUNNING, TACTILED_COMMAND_OK);
    };
    switch (block_[0]) {
        case kTare: return run(Command::Kind::tare, mask);
        case kUntare: return run(Command::Kind::untare, mask);
        case kClearLatches: return run(Command::Kind::clear_latches, 0);
        case kResetPeaks: return run(Command::Kind::reset_peaks, mask);
        case kSelfTest: return run(Command::Kind::self_test, mask);
        case kStartWeighing:
        case kStopWeighing:
        case kZeroWeight: return settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_NOT_NOW);  // no weighing in this version
        default: return settle(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_UNKNOWN);
    }
}

void Controls::settle(tactiled_command_state state, tactiled_command_result result) noexcept {
    state_ = state;
    result_ = result;
}

std::uint32_t Controls::send(Command::Kind kind, std::uint32_t mask, std::uint64_t now_ns) noexcept {
    Command* const slot = commands_.claim();
    if (slot == nullptr) return 0;  // the pipeline hangs
    *slot = Command{};
    slot->kind = kind;
    slot->mask = mask;
    slot->number = ++number_;
    slot->until_ns = now_ns + kAnswerNs;
    commands_.push();
    commands_.commit();
    if (kind == Command::Kind::tare || kind == Command::Kind::untare) tare_number_ = number_;
    return number_;
}

void Controls::send_settings() noexcept {
    Command* const slot = commands_.claim();
    settings_unsent_ = slot == nullptr;
    if (settings_unsent_) return;
    const auto value = [&](unsigned i) { return settings_[i] == kAsConfigured ? kNaN : settings_[i] * kKeys[i].scale; };
    *slot = Command{};
    slot->kind = Command::Kind::set;
    slot->settable = {value(0), value(1), value(2), value(3)};
    commands_.push();
    commands_.commit();
}

// ---- reading ---------------------------------------------------------------------------------------------------------

void Controls::read(Run run, const Session& session, std::uint64_t now_ns, std::uint16_t* out) const noexcept {
    for (unsigned i = 0; i < run.count; ++i) {
        const unsigned at = run.at + i;
        std::uint16_t value = 0;
        if (at >= kScratchAt)
            value = scratch_[at - kScratchAt];
        else if (at <= kCmdSeq)
            value = block_[at - kCmd];
        else if (is_setting(std::uint16_t(at)))
            value = settings_[at - kFilterHz];
        else
            switch (at) {
                case kPlcHeartbeat: value = heartbeat_; break;
                case kPlcWatchdog: value = watchdog_ms_; break;
                case kGripperState: value = gripper_state_; break;
                case kGripperForce: value = gripper_force_; break;
                case kUnlock: value = now_ns <= session.unlocked_until_ns && session.unlocked_until_ns != 0; break;
                case kSave: value = saving_.load(); break;
                default: break;
            }
        out[i] = value;
    }
}

void Controls::read_coils(const View& view, std::span<std::uint8_t, kCoils> out) const noexcept {
    std::fill(out.begin(), out.end(), std::uint8_t(0));
    for (unsigned i = 0; i < kSensorBlocks; ++i)
        out[kTareCoils + i] = (view.snapshot.sensor[i].reasons & TACTILED_TARING) != 0 ? 1 : 0;
}

void Controls::add_to_global(std::uint64_t now_ns, std::span<std::uint16_t, kGlobalSize> global) const noexcept {
    global[kCmdSeqAck] = acknowledged_;
    global[kCmdState] = std::uint16_t(state_);
    global[kCmdResult] = std::uint16_t(result_);
    global[kPlcHbEcho] = heartbeat_;
    const bool expired = watchdog_ms_ != 0 && now_ns > heartbeat_ns_ + std::uint64_t(watchdog_ms_) * 1'000'000u;
    if (expired) global[kStatus] |= 1u << 12;
    if (now_ns <= unlocked_until_ns_) global[kStatus] |= 1u << 13;
    if (saving_.load() == failed || unreadable_.load()) {
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
        const Range range{limits.least * kKeys[i].scale, limits.most * kKeys[i].scale};
        loaded[i] = std::uint16_t(file.number(kKeys[i].name, range) / kKeys[i].scale + 0.5);
    }
    file.finish();
    for (const auto& line : problems.lines())
        log_line(LogLevel::warning, fmt::format("{}; stored settings are not used", line));
    unreadable_.store(!problems.empty());
    if (!problems.empty()) return;
    settings_ = loaded;
    send_settings();
}

void Controls::save() noexcept {
    saver_.join();  // it has ended: check() has seen that nothing is being stored
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
                log_line(LogLevel::warning, fmt::format("Modbus SAVE: {}", error.what()));
                saving_.store(failed);
            }
        });
    } catch (const std::exception&) { saving_.store(failed); }
}

}  // namespace tactiled::modbus
