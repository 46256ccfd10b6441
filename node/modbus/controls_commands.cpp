// Commands by the block 5000 .. 5004, by the registers 5010 .. 5017, and by coils.
#include <algorithm>
#include <iterator>

#include "node/modbus/controls.hpp"

namespace tactiled::modbus {

using Kind = Command::Kind;
enum class Mask : std::uint8_t { none, optional, required };

// A command of the block, which a register may run as well.
struct PlcCommand {
    CommandCode code;
    Kind kind;           // TEACH: passes the stored objects on
    std::uint16_t cell;  // the register; 0 = none
    Mask mask;           // the sensors that it is for
    bool weighs = false, needs_stable_weight = false;
};

namespace {

constexpr PlcCommand kPlcCommands[] = {
    {kTare, Kind::tare, kTareCell, Mask::required},
    {kUntare, Kind::untare, kUntareCell, Mask::required},
    {kClearLatches, Kind::clear_latches, kClearLatchCell, Mask::optional},
    {kStartWeighing, Kind::start_weighing, kWeighCell, Mask::none, true},
    {kStopWeighing, Kind::stop_weighing, 0, Mask::none, true},
    {kResetPeaks, Kind::reset_peaks, kResetPeakCell, Mask::required},
    {kZeroWeight, Kind::zero_weight, kZeroWeightCell, Mask::none, true},
    {kSelfTest, Kind::self_test, 0, Mask::required},
    {kKnownWeight, Kind::known_weight, kKnownWeightCell, Mask::none, true, true},
    {kTeach, Kind::objects, kTeachCell, Mask::none, true, true},
};
static_assert(std::size(kPlcCommands) == kTeach);  // in the order of the codes, which begin with 1

// Returns the command of a register from kTareCell to kKnownWeightCell.
const PlcCommand& command_at(unsigned cell) noexcept {
    return *std::find_if(std::begin(kPlcCommands), std::end(kPlcCommands), [&](const auto& c) { return c.cell == cell; });
}

bool lacks_weight(const PlcCommand& command, const tactiled_grasp& held) noexcept {
    return (command.needs_stable_weight && !is_stable(held)) || (command.code == kTeach && !is_teachable(weighing_of(held)));
}

// Refuses a tare at once if it is known to be impossible now.
bool have_values(const View& view, std::uint32_t mask) {
    for (unsigned i = 0; i < kSensorBlocks; ++i)
        if ((mask >> i & 1) != 0 && view.snapshot.sensor[i].quality == TACTILED_BAD) return false;
    return true;
}

}  // namespace

// ---- checks ----------------------------------------------------------------------------------------------------------

// Checks a command of one register, other than 0. A value that is known to be impossible is refused at once.
Exception Controls::check_command_cell(unsigned at, std::uint16_t value, const View& view) const noexcept {
    const PlcCommand& command = command_at(at);
    if (writable_at(at)->type == Type::mask && (value & ~sensor_mask_of(view)) != 0) return kIllegalValue;
    if (command.weighs && !weighs_) return kDeviceFailure;
    if (is_busy(view)) return kBusy;
    if (!view.alive || (command.code == kTare && !have_values(view, value))) return kDeviceFailure;
    return lacks_weight(command, view.snapshot.node.grasp) ? kDeviceFailure : kNone;
}

// A 0 is no command, except that it stops weighing if it is written to that coil alone.
Exception Controls::check_coil(const Request& request, unsigned i, const View& view) const noexcept {
    const unsigned at = request.write.at + i;
    if (!is_set(request, i) && (at != kWeighCoil || request.write.count != 1)) return kNone;
    if (!view.alive || (at == kWeighCoil && !weighs_)) return kDeviceFailure;
    if (at < kClearAllCoil && (sensor_mask_of(view) >> at % kSensorBlocks & 1) == 0)
        return kIllegalAddress;  // no such sensor
    if (is_busy(view)) return kBusy;
    return at < kSlipCoils && !have_values(view, 1u << at) ? kDeviceFailure : kNone;
}

// A write is carried out completely or not at all; of two commands, the pipeline might refuse the second.
bool Controls::coils_are_one_command(const Request& request) noexcept {
    int commands = 0;
    bool tares = false, slips = false;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = request.write.at + i;
        if (!is_set(request, i)) continue;
        tares |= at < kSlipCoils;
        slips |= at >= kSlipCoils && at < kClearAllCoil;
        commands += at >= kClearAllCoil ? 1 : 0;
    }
    return commands + (tares ? 1 : 0) + (slips ? 1 : 0) <= 1;
}

// ---- effects ---------------------------------------------------------------------------------------------------------

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
        Command order;
        order.kind = kind;
        order.mask = mask;
        begin_direct(session, code, send(order, now_ns), now_ns);
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

void Controls::run_command_cell(unsigned at, std::uint16_t value, const View& view, const Session& session,
                                std::uint64_t now_ns) noexcept {
    const PlcCommand& command = command_at(at);
    const std::uint32_t number = start(command, value, value, decode(*writable_at(at), value), view, now_ns);
    begin_direct(session, command.code, number, now_ns);
    if (command.code == kTeach) teacher_ = &clients_.of_writer(session.host, now_ns);
}

// CMD_SEQ has changed: the block is a command. Its errors are reported in CMD_RESULT, not by an exception.
void Controls::run_block(CommandClient& client, const View& view, std::uint64_t now_ns) noexcept {
    const std::array<std::uint16_t, 5>& block = client.taken;
    const auto reject = [&](tactiled_command_result result) { client.settle({TACTILED_COMMAND_REJECTED, result}); };
    if (block[0] < kTare || block[0] > kTeach) return reject(TACTILED_COMMAND_UNKNOWN);
    const PlcCommand& command = kPlcCommands[block[0] - 1];
    const std::uint32_t mask = block[1], parameter = std::uint32_t(block[2]) << 16 | block[3];
    if ((mask & ~sensor_mask_of(view)) != 0 || (command.mask == Mask::required && mask == 0))
        return reject(TACTILED_COMMAND_BAD_MASK);
    const tactiled_grasp& held = view.snapshot.node.grasp;
    if ((command.weighs && !weighs_) || lacks_weight(command, held)) return reject(TACTILED_COMMAND_NOT_NOW);
    const bool teaches = command.code == kTeach;
    if (command.needs_stable_weight && (parameter == 0 || (teaches && parameter > 65534)))
        return reject(TACTILED_COMMAND_BAD_PARAMETER);
    client.number = start(command, mask, parameter, parameter * 1e-4, view, now_ns);
    sent_ns_ = now_ns;
    if (client.number == 0) return reject(TACTILED_COMMAND_FAILED);
    client.settle({TACTILED_COMMAND_RUNNING, TACTILED_COMMAND_OK});
    teaching_for_block_ = teaches;
    running_ = &client;
}

// Starts a command with those of its arguments that it needs. TEACH has no number before its file is stored.
std::uint32_t Controls::start(const PlcCommand& command, std::uint32_t mask, std::uint32_t id, double mass_kg,
                              const View& view, std::uint64_t now_ns) noexcept {
    if (command.code == kTeach) {
        teaching_.begin(id, weighing_of(view.snapshot.node.grasp));
        return ~0u;
    }
    Command order;
    order.kind = command.kind;
    if (command.mask != Mask::none) order.mask = mask;
    if (command.needs_stable_weight) order.mass_kg = mass_kg;
    return send(order, now_ns);
}

std::uint32_t Controls::send(Command command, std::uint64_t now_ns) noexcept {
    command.number = number_ + 1;
    command.until_ns = now_ns + kAnswerNs;
    if (!commands_.send(command)) return 0;  // the pipeline hangs
    ++number_;
    if (command.kind == Kind::tare || command.kind == Kind::untare) {
        tare_number_ = number_;
        tare_mask_ = command.kind == Kind::tare ? command.mask : 0;
    }
    return number_;
}

}  // namespace tactiled::modbus
