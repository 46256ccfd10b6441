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

// A command in the write of a cycle that cannot run now is left out, and a later cycle runs it: its exception would take the
// heartbeat and the hints of the same write along.
bool Controls::command_waits(const Request& request, const View& view, const Session& session) const noexcept {
    if (writes_coils(request) || request.write.at < kCycleAt || (view.alive && !is_busy(view))) return false;
    for (unsigned i = 0; i < request.write.count; ++i)
        if (written_at(request, i) == kCmdSeq) return clients_.at(session.host).runs(requested(request, i, session));
    return false;
}

Exception Controls::check(const Request& request, const View& view, const Session& session,
                          std::uint64_t now_ns) const noexcept {
    if (!enabled_ || !session.may_write) return kIllegalAddress;  // read-only for this client
    const bool coils = writes_coils(request), waits = command_waits(request, view, session);
    Exception first = kNone;  // in the order of the run; a wrong address comes before a wrong value
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = written_at(request, i);
        if (waits && at <= kCmdSeq) continue;
        const Exception found = !coils ? check_register(at, requested(request, i, session), view, session, now_ns)
                                       : check_coil(request, i, view);
        if (found == kIllegalAddress) return found;
        if (first == kNone) first = found;
    }
    if (first != kNone) return first;
    return (coils ? coils_are_one_command(request) : registers_fit(request, session, now_ns)) ? kNone : kIllegalValue;
}

// Returns whether the registers of a write are allowed together: at most one command, a hysteresis whose end is not above
// its begin, a whole gravity as on Earth. Words that were not written count as they are.
bool Controls::registers_fit(const Request& request, const Session& session, std::uint64_t now_ns) const noexcept {
    Words after = words_;
    VectorDraft gravity = clients_.at(session.host).drafts(now_ns).gravity;
    int commands = 0;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = written_at(request, i);
        const std::uint16_t value = after[at] = requested(request, i, session);
        if (at >= kGravityX && at < kAccelX) gravity.put(at - kGravityX, value);
        commands += (is_command_cell(at) && value != 0) || (at == kCmdSeq && clients_.at(session.host).runs(value)) ? 1 : 0;
    }
    const std::uint16_t on = after[kContactOn], off = after[kContactOff];
    const bool contact_is_upside_down = (writes(request, kContactOn) || writes(request, kContactOff)) &&
                                        on != kAsConfigured && off != kAsConfigured && off > on;
    const bool ends_gravity = writes(request, kGravityX + 2);
    return commands <= 1 && !contact_is_upside_down &&
           (!ends_gravity || (gravity.is_whole() && Robot::is_gravity(gravity.words)));
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

// A client is alive if its own heartbeat or watchdog changes, or if it writes a hint. A write that repeats the heartbeat
// comes from a gateway or a scanner whose program stands still: only the first one counts, so that its hints expire later.
void Controls::note_life(const Request& request, const Session& session, std::uint64_t now_ns) noexcept {
    const CommandClient& before = clients_.at(session.host);
    bool beats = false, repeats = false, hints = false;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = written_at(request, i);
        const std::uint16_t word = requested(request, i, session);
        beats |= (at == kPlcHeartbeat && word != before.heartbeat) || (at == kPlcWatchdog && word != before.watchdog_ms);
        repeats |= at == kPlcHeartbeat && word == before.heartbeat;
        hints |= Robot::is_hint(at);
    }
    if (!beats && !repeats && !hints) return;
    CommandClient& client = clients_.of_writer(session.host, now_ns);
    if (!beats && (!hints || (repeats && client.life_ns != 0))) return;
    client.hints = client.drafts(now_ns);
    client.life_ns = now_ns;
}

void Controls::write(const Request& request, const View& view, Session& session, std::uint64_t now_ns) noexcept {
    if (writes_coils(request)) return write_coils(request, session, now_ns);
    const bool waits = command_waits(request, view, session);
    note_life(request, session, now_ns);
    for (unsigned i = 0; i < request.write.count; ++i)
        if (const unsigned at = written_at(request, i); !waits || at > kCmdSeq)
            write_register(at, requested(request, i, session), view, session, now_ns);
    const unsigned end = request.write.at + request.write.count;
    if (request.write.at <= kWeighWindow && end > kFilterHz) send_settings();
    const CommandClient& client = clients_.at(session.host);
    if (client.life_ns != 0) robot_.hold(client.host, client.lives_until_ns());
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
    } else if (Robot::is_hint(at) || at == kPlcHeartbeat || at == kPlcWatchdog) {
        CommandClient& client = clients_.of_writer(session.host, now_ns);
        if (at == kPlcHeartbeat)
            client.heartbeat = value;
        else if (at == kPlcWatchdog)
            client.watchdog_ms = value;
        else if (!client.is_silent(now_ns))
            robot_.write(at, value, client, now_ns);
    } else {
        words_[at] = value;
    }
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
    const CommandClient& client = clients_.at(session.host);
    for (unsigned i = 0; i < run.count; ++i) {
        const unsigned at = origin_of(std::uint16_t(run.at + i));
        if (at <= kCmdSeq)
            out[i] = client.block[at - kCmd];
        else if (at == kPlcHeartbeat)
            out[i] = client.heartbeat;
        else if (at == kPlcWatchdog)
            out[i] = client.watchdog_ms;
        else if (Robot::is_hint(at))
            out[i] = robot_.word(at, client.drafts(now_ns));
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

// True if PLCs with a watchdog have shown signs of life, and none of them does now.
bool Controls::plc_is_silent(std::uint64_t now_ns) const noexcept {
    const auto is_watched = [](const CommandClient& client) { return client.life_ns != 0 && client.watchdog_ms != 0; };
    return std::any_of(clients_.begin(), clients_.end(), is_watched) &&
           std::all_of(clients_.begin(), clients_.end(),
                       [&](const CommandClient& client) { return !is_watched(client) || client.is_silent(now_ns); });
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
