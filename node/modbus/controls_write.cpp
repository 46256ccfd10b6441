// Writes of registers: checks, effects, and the words that are read back.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/text_file.hpp"
#include "node/log.hpp"
#include "node/modbus/controls.hpp"

namespace tactiled::modbus {
namespace {

constexpr std::uint64_t kUnlockNs = 30'000'000'000;

bool is_command_cell(unsigned at) { return at >= kTareCell && at <= kKnownWeightCell; }

// The settings file's keys of the registers from kFilterHz on.
constexpr const char* kKeys[] = {"filter_hz",  "contact_on_N",     "contact_off_N",
                                 "overload_N", "slip_sensitivity", "weigh_window_ms"};

// Returns the address that the request writes with its register number i. A copy counts as its origin, as in all that
// follows.
unsigned written_at(const Request& request, unsigned i) noexcept {
    const auto at = std::uint16_t(request.write.at + i);
    return writes_coils(request) ? at : origin_of(at);
}
bool writes(const Request& request, unsigned at) noexcept {
    for (unsigned i = 0; i < request.write.count; ++i)
        if (written_at(request, i) == at) return true;
    return false;
}

}  // namespace

// ---- checks ----------------------------------------------------------------------------------------------------------

// Returns the value that the request would write to register number i of its run.
std::uint16_t Controls::requested(const Request& request, unsigned i, const Session& session) const noexcept {
    const auto word = [&](std::size_t at) { return std::uint16_t(request.written[at] << 8 | request.written[at + 1]); };
    if (request.function != kMaskWrite) return word(2 * std::size_t(i));
    std::uint16_t now = 0;
    read(request.write, session, 0, &now);
    return std::uint16_t((now & word(0)) | (word(2) & ~word(0)));  // 1.1b3, 6.16
}

Exception Controls::check(const Request& request, const View& view, const Session& session,
                          std::uint64_t now_ns) const noexcept {
    if (!enabled_ || !session.may_write) return kIllegalAddress;  // read-only for this client
    const bool coils = writes_coils(request);
    Exception first = kNone;  // in the order of the run; a wrong address comes before a wrong value
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = written_at(request, i);
        const Exception found = !coils ? check_register(at, requested(request, i, session), view, session, now_ns)
                                       : check_coil(request, i, view);
        if (found == kIllegalAddress) return found;
        if (first == kNone) first = found;
    }
    if (first != kNone) return first;
    return (coils ? coils_are_one_command(request) : registers_fit(request, session)) ? kNone : kIllegalValue;
}

// Returns whether the registers of a write are allowed together: at most one command, a hysteresis whose end is not above
// its begin, a gravity as on Earth. Words that were not written count as they are.
bool Controls::registers_fit(const Request& request, const Session& session) const noexcept {
    Words after = words_;
    int commands = 0;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = written_at(request, i);
        const std::uint16_t value = after[at] = requested(request, i, session);
        commands += (is_command_cell(at) && value != 0) || (at == kCmdSeq && clients_.at(session.host).runs(value)) ? 1 : 0;
    }
    const std::uint16_t on = after[kContactOn], off = after[kContactOff];
    const bool contact_is_upside_down = (writes(request, kContactOn) || writes(request, kContactOff)) &&
                                        on != kAsConfigured && off != kAsConfigured && off > on;
    return commands <= 1 && !contact_is_upside_down && (!writes(request, kGravityX + 2) || Robot::is_gravity(after));
}

Exception Controls::check_register(unsigned at, std::uint16_t value, const View& view, const Session& session,
                                   std::uint64_t now_ns) const noexcept {
    if (at >= kScratchAt) return kNone;
    const Limits& limits = writable_at(at)->limits;
    if (limits.locked && now_ns > session.unlocked_until_ns) return kIllegalAddress;
    const bool is_special = (limits.locked && value == kAsConfigured) || (limits.may_be_none && value == kNoU16);
    if ((value < limits.min || value > limits.max) && !is_special) return kIllegalValue;
    if (at == kPlcWatchdog && value != 0 && value < 10) return kIllegalValue;
    if (at == kUnlock && value != kUnlockWord && value != 0) return kIllegalValue;
    if (is_command_cell(at) && value != 0) return check_command_cell(at, value, view);
    const bool command = at == kCmdSeq && clients_.at(session.host).runs(value);
    if (command && is_busy(view)) return kBusy;  // one at a time, so that CMD_STATE refers to the right command
    if (command && !view.alive) return kDeviceFailure;
    if (at == kSave && saving_.load() == storing) return kBusy;
    return kNone;
}

// ---- effects ---------------------------------------------------------------------------------------------------------

// A client is alive if its own heartbeat changes, or if it writes a hint. A write that repeats the heartbeat comes from a
// gateway or a scanner whose program stands still: only the first one counts, so that its hints expire later.
void Controls::note_life(const Request& request, const Session& session, std::uint64_t now_ns) noexcept {
    const CommandClient& before = clients_.at(session.host);
    bool beats = false, repeats = false, hints = false;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = written_at(request, i);
        const std::uint16_t word = requested(request, i, session);
        const bool changes = word != (at == kPlcHeartbeat ? before.heartbeat : words_[at]);
        beats |= (at == kPlcHeartbeat || at == kPlcWatchdog) && changes;
        repeats |= at == kPlcHeartbeat && !changes;
        hints |= Robot::is_hint(at);
    }
    if (!beats && !repeats && !hints) return;
    CommandClient& client = clients_.of_writer(session.host, now_ns);
    if (beats || (hints && (!repeats || client.life_ns == 0))) client.life_ns = life_ns_ = now_ns;
}

void Controls::write(const Request& request, const View& view, Session& session, std::uint64_t now_ns) noexcept {
    if (writes_coils(request)) return write_coils(request, session, now_ns);
    note_life(request, session, now_ns);
    for (unsigned i = 0; i < request.write.count; ++i)
        write_register(written_at(request, i), requested(request, i, session), view, session, now_ns);
    const unsigned end = request.write.at + request.write.count;
    if (request.write.at <= kWeighWindow && end > kFilterHz) send_settings();
    robot_.send(commands_);
}

void Controls::write_register(unsigned at, std::uint16_t value, const View& view, Session& session,
                              std::uint64_t now_ns) noexcept {
    if (at <= kCmdSeq) {
        CommandClient& client = clients_.of_writer(session.host, now_ns);
        client.block[at - kCmd] = value;
        if (at == kCmdSeq && client.take_number()) run_block(client, view, now_ns);
    } else if (is_command_cell(at)) {
        if (value != 0) run_command_cell(at, value, view, session, now_ns);
    } else if (at == kUnlock) {
        if (value == 0 && session.unlocked_until_ns == unlocked_until_ns_) unlocked_until_ns_ = 0;
        session.unlocked_until_ns = value != 0 ? now_ns + kUnlockNs : 0;
        unlocked_until_ns_ = std::max(unlocked_until_ns_, session.unlocked_until_ns);
    } else if (at == kSave) {
        save();
    } else if (Robot::is_hint(at)) {
        take_hint(at, value, clients_.of_writer(session.host, now_ns), now_ns);
    } else {
        words_[at] = value;
        if (at == kPlcHeartbeat) clients_.of_writer(session.host, now_ns).heartbeat = value;
    }
}

void Controls::take_hint(unsigned at, std::uint16_t value, CommandClient& client, std::uint64_t now_ns) noexcept {
    if (is_over(client.life_ns, now_ns)) return;
    client.has_hints = true;
    words_[at] = value;
    const bool confirms = at == kAccelCount && std::exchange(client.accel_count, value) != value;
    robot_.note(at, confirms, words_, now_ns);
}

void Controls::send_settings() noexcept {
    Command command;
    command.kind = Command::Kind::set;
    command.settable = {words_.value(kFilterHz), words_.value(kContactOn), words_.value(kContactOff),
                        words_.value(kOverloadAt)};
    command.grasp = {words_.value(kSlipSensitivity) / 100, words_.value(kWeighWindow)};
    settings_unsent_ = !commands_.send(command);
}

// ---- reading ---------------------------------------------------------------------------------------------------------

void Controls::read(Run run, const Session& session, std::uint64_t now_ns, std::uint16_t* out) const noexcept {
    for (unsigned i = 0; i < run.count; ++i) {
        const unsigned at = origin_of(std::uint16_t(run.at + i));
        if (at <= kCmdSeq)
            out[i] = clients_.at(session.host).block[at - kCmd];
        else if (at == kUnlock)
            out[i] = now_ns <= session.unlocked_until_ns && session.unlocked_until_ns != 0;
        else if (at == kSave)
            out[i] = saving_.load();
        else
            out[i] = words_[at];
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

bool Controls::is_over(std::uint64_t life_ns, std::uint64_t now_ns) const noexcept {
    const std::uint16_t watchdog_ms = words_[kPlcWatchdog];
    return watchdog_ms != 0 && life_ns != 0 && now_ns > life_ns + std::uint64_t(watchdog_ms) * 1'000'000u;
}

// One client whose hints are in force is enough, since the hints of all have effect together; without hints, all of them.
bool Controls::plc_is_silent(std::uint64_t now_ns) const noexcept {
    return is_over(life_ns_, now_ns) || std::any_of(clients_.begin(), clients_.end(), [&](const CommandClient& client) {
               return client.has_hints && is_over(client.life_ns, now_ns);
           });
}

void Controls::forget_hints() noexcept {
    if (!robot_.forget()) return;
    words_.forget_hints();
    for (CommandClient& client : clients_) client.has_hints = false;
}

ClientReport Controls::report(const Session& session, std::uint64_t now_ns) const noexcept {
    ClientReport report;
    report.commands = clients_.at(session.host);
    report.heartbeat = report.commands.heartbeat;
    if (plc_is_silent(now_ns)) report.status_bits |= 1u << 12;
    if (now_ns <= unlocked_until_ns_) report.status_bits |= 1u << 13;
    if (saving_.load() == failed || unreadable_.load() || teach_failed_) {
        report.fault_bits |= TACTILED_FAULT_STORAGE;
        report.status_bits |= TACTILED_FAULT;
    }
    return report;
}

// ---- keeping ---------------------------------------------------------------------------------------------------------

void Controls::load() {
    if (::access(path_.c_str(), F_OK) != 0) return;
    Problems problems;
    Options file = Options::parse_file(path_, problems, 4096);
    Words loaded = words_;
    for (unsigned i = 0; i < std::size(kKeys); ++i) {
        const Register& setting = *writable_at(kFilterHz + i);
        const double scale = setting.unit.scale;
        if (!file.has(kKeys[i])) continue;
        const Range range{setting.limits.min * scale, setting.limits.max * scale};
        loaded[setting.at] = std::uint16_t(std::lround(file.number(kKeys[i], range) / scale));
    }
    file.finish();
    for (const auto& line : problems.lines()) log_line(LogLevel::warning, "{}; stored settings are not used", line);
    unreadable_.store(!problems.empty());
    if (!problems.empty()) return;
    words_ = loaded;
    send_settings();
}

void Controls::save() noexcept {
    saver_.join();  // it has ended: check() has verified that nothing is being stored
    to_save_ = words_;
    saving_.store(storing);
    try {
        saver_.start("save", 0, -1, [this] {
            try {
                std::string text = "# What a PLC has set and stored; overrides the configuration. Written by tactiled.\n";
                for (unsigned i = 0; i < std::size(kKeys); ++i)
                    if (to_save_[kFilterHz + i] != kAsConfigured)
                        text += fmt::format("{} = {:.10g}\n", kKeys[i], to_save_.value(kFilterHz + i));
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
