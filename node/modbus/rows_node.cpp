// The registers of the node as a whole: global block, grasp, commands of the client, doubts of the weight, floats.
#include <algorithm>
#include <cmath>

#include "node/modbus/rows.hpp"

namespace tactiled::modbus {
namespace {

using S = const Source&;
using Grasp = tactiled_grasp;

// The part of the node's state that remains valid when its loop has stopped; the present state of its sensors is then
// unknown.
constexpr std::uint32_t kOutlivesLoop = TACTILED_SIMULATED | TACTILED_ANY_UNCALIBRATED | TACTILED_WARNING | TACTILED_FAULT;

double status(S s) noexcept {
    std::uint32_t bits = s.node.status & 0xFFFFu & ~std::uint32_t(TACTILED_ANY_CONTACT);
    if (!s.view.alive) bits = (bits & kOutlivesLoop) | TACTILED_FAULT | TACTILED_ANY_STALE;
    if (s.masks.contact != 0) bits |= TACTILED_ANY_CONTACT;
    if (is_grasped(s.grasp)) bits |= 1u << 2;
    if (s.grasp.slip_mask != 0) bits |= 1u << 3;
    if (s.grasp.slip_latch != 0) bits |= 1u << 4;
    if (has_weight(s.grasp)) bits |= 1u << 5;
    if (is_stable(s.grasp)) bits |= 1u << 6;
    if (s.masks.overload != 0) bits |= 1u << 7;
    if (s.masks.stale != 0) bits = (bits & ~std::uint32_t(TACTILED_READY)) | TACTILED_ANY_STALE;
    return bits | s.client.status_bits;
}

double fault(S s) noexcept {
    return s.node.fault | (s.view.alive ? 0u : std::uint32_t(TACTILED_FAULT_INTERNAL)) | s.client.fault_bits;
}

double newest_age_ms(S s) noexcept {
    std::uint64_t newest_ns = 0;
    for (unsigned i = 0; i < sensors_of(s.view); ++i) {
        const tactiled_sample& sample = s.view.snapshot.sensor[i];
        if ((sample.reasons & TACTILED_NO_DATA_YET) == 0) newest_ns = std::max(newest_ns, sample.t_ns);
    }
    return age_ms(s, newest_ns);
}

template <auto member>
double grasp(S s) noexcept {
    return double(s.grasp.*member);
}

double weight_kg(S s) noexcept { return has_weight(s.grasp) ? s.grasp.weight_kg : kNaN; }
double weight_sd_kg(S s) noexcept { return has_weight(s.grasp) ? s.grasp.weight_sd_kg : kNaN; }

double since_lift_off_ms(S s) noexcept {
    const std::uint64_t taken_ns = s.view.snapshot.taken_ns, lift_off_ns = s.grasp.t_lift_off_ns;
    if (!is_grasped(s.grasp) || s.grasp.state == TACTILED_GRIP_GRASPED || lift_off_ns == 0) return kNaN;
    return taken_ns > lift_off_ns ? std::floor(double(taken_ns - lift_off_ns) / 1e6) : 0;
}

using enum Type;

constexpr Register kGlobal[] = {
    {kMagic0, "MAGIC0", text, kNoUnit, "0x5441 \"TA\"; a client that reads 0x4354 here is off by one address",
     [](S) { return 0x5441; }},
    {kMagic1, "MAGIC1", text, kNoUnit, "0x4354 \"CT\"", [](S) { return 0x4354; }},
    {kMapVersion, "MAP_VER", text, kNoUnit, "256 * major + minor; a minor version only adds registers",
     [](S) { return kMapMajor << 8 | kMapMinor; }},
    {kSensors, "N_SENSORS", u16, kNoUnit, "1 .. 16", [](S s) { return sensors_of(s.view); }},
    {kSeq, "SEQ", count, kNoUnit, "number of the published frame, wraps", sequence},
    {kHeartbeat, "HEARTBEAT", count, kBeats, "stops when acquisition, the loop or every sensor stops",
     [](S s) { return s.node.heartbeat; }},
    {6, "AGE_MS", u16, kMilliseconds, "age of the newest sensor frame when the answer was built; 65534 = that or more",
     newest_age_ms},
    {kStatus, "STATUS", bits, kNoUnit, "state of the node", unread(kFaultAlone, status)},
    {8, "FAULT", bits, kNoUnit, "latched", fault},
    {9, "WARN", bits, kNoUnit, "true now", [](S s) { return s.node.warning; }},
    {kOk, "OK", mask, kNoUnit, "the sensor's value is GOOD", unread(kNothingGood, [](S s) { return s.masks.good; })},
    {kContact, "CONTACT", mask, kNoUnit, "the magnitude has passed CONTACT_ON, and not fallen below CONTACT_OFF since",
     unread(kNothingGood, [](S s) { return s.masks.contact; })},
    {12, "SLIP", mask, kNoUnit, "gross slip now", grasp<&Grasp::slip_mask>},
    {kSlipLatch, "SLIP_LATCH", mask, kNoUnit, "gross slip since the last CLEAR_SLIP, CLEAR_ALL or CLEAR_LATCH",
     grasp<&Grasp::slip_latch>},
    {kOverload, "OVERLOAD", mask, kNoUnit,
     "a channel is saturated, a register saturates, or the magnitude is above OVERLOAD_AT",
     [](S s) { return s.masks.overload; }},
    {15, "STALE", mask, kNoUnit, "the sensor delivers nothing", [](S s) { return s.masks.stale; }},
    {16, "GRIP_FORCE", u16, kForce, "normal force of a jaw, mean of those with a sensor", grasp<&Grasp::grip_N>},
    {17, "GRIP_STATE", enumeration, kNoUnit, "0xFFFF: not known; no [grasp] is configured, or a jaw's sensor has no value",
     grasp<&Grasp::state>},
    {18, "WEIGHT_G", u16, kGrams, "WEIGHT, for clients of one register; a negative weight reads 0", weight_kg},
    {19, "WEIGHT_STATE", enumeration, kNoUnit, "state of WEIGHT", grasp<&Grasp::weight_state>},
    {20, "WEIGHT", i32, kMass, "net, of the object alone", weight_kg},
    {22, "WEIGHT_SD", u16, kMass, "its standard deviation", weight_sd_kg},
    {23, "REC_GRIP", u16, kForce, "recommended GRIP_FORCE: the minimum that holds, with a margin",
     grasp<&Grasp::recommended_grip_N>},
    {24, "SLIP_COUNT", count, kNoUnit,
     "gross slips of all jaws: counted in the loop, so that none is missed between two scans", grasp<&Grasp::slips>},
    {kCmdSeqAck, "CMD_SEQ_ACK", count, kNoUnit,
     "the CMD_SEQ last taken from this client's address; 0 = none since the daemon's start. Write this + 1 for a command",
     [](S s) { return s.client.commands.taken[4]; }},
    {kCmdState, "CMD_STATE", enumeration, kNoUnit, "state of this client's last command in the block 5000 .. 5004",
     [](S s) { return s.client.commands.outcome.state; }},
    {kCmdResult, "CMD_RESULT", enumeration, kNoUnit, "result of that command",
     [](S s) { return s.client.commands.outcome.result; }},
    {28, "CAL_ID", text, kNoUnit, "CRC-16 of configuration and calibrations: changes when either does",
     [](S s) { return s.view.segment != nullptr ? s.view.segment->calibration_id() : 0u; }},
    {kPlcHbEcho, "PLC_HB_ECHO", count, kNoUnit, "echo of the PLC_HEARTBEAT of this client's address",
     [](S s) { return s.client.heartbeat; }},
    {30, "CYCLE_WORST", u16, kMicroseconds, "worst cycle of the pipeline within the last second",
     [](S s) { return s.view.alive ? s.node.worst_cycle_us : kNaN; }},
    {kSeqEnd, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

constexpr Register kGrasp[] = {
    {kGraspSeq, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {1, "OBJECT_ID", u16, kNoUnit, "id of the taught object with this WEIGHT; 0 = unknown, or no weight",
     grasp<&Grasp::object_id>},
    {2, "OBJECT_PROB", u16, kPermille, "probability of OBJECT_ID, against the other objects and an unknown one",
     grasp<&Grasp::object_probability>},
    {3, "FRICTION", u16, kThousandth, "coefficient: learnt in this grasp, or as configured", grasp<&Grasp::friction>},
    {4, "FRICTION_SD", u16, kThousandth, "its standard deviation; 0xFFFF where it is as configured",
     grasp<&Grasp::friction_sd>},
    {5, "GRASPS", count, kNoUnit, "one more each time that GRIP_STATE becomes grasped", grasp<&Grasp::grasps>},
    {6, "SINCE_LIFT", u16, kMilliseconds, "time since lift-off while an object is held; 65534 = that or more",
     since_lift_off_ms},
    {kGraspSeqEnd, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

constexpr Register kCommands[] = {
    {0, "CMD_REPEATS", count, kNoUnit, "later writes of the same CMD_SEQ, which ran nothing",
     [](S s) { return s.client.commands.repeats; }},
    {1, "DIRECT_CMD", enumeration, kNoUnit,
     "last command of this client by one register (5010 .. 5017) or by coils; 0 = none",
     [](S s) { return s.client.commands.direct_code; }},
    {2, "DIRECT_STATE", enumeration, kNoUnit, "state of that command", [](S s) { return s.client.commands.direct.state; }},
    {3, "DIRECT_RESULT", enumeration, kNoUnit, "result of that command, as CMD_RESULT",
     [](S s) { return s.client.commands.direct.result; }},
    {4, "DIRECT_COUNT", count, kNoUnit, "one more with each of these commands",
     [](S s) { return s.client.commands.direct_count; }},
};

constexpr Register kDoubts[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {1, "WEIGHT_WHY", bits, kNoUnit, "why WEIGHT is not stable while an object is held; 0 where it is stable",
     grasp<&Grasp::weight_doubts>},
    {2, "WEIGHT_JAWS", mask, kNoUnit, "the jaws that cause WEIGHT_WHY, as far as the forces show them",
     grasp<&Grasp::doubtful>},
    {7, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

constexpr Register kFloats[] = {
    {0, "SEQ", count, kNoUnit, kSeqMeaning, sequence},
    {2, "WEIGHT", f32, kFloatKg, "net, of the object alone", weight_kg},
    {4, "WEIGHT_SD", f32, kFloatKg, "its standard deviation", weight_sd_kg},
    {6, "GRIP_FORCE", f32, kFloatN, "normal force of a jaw, mean", grasp<&Grasp::grip_N>},
    {8, "REC_GRIP", f32, kFloatN, "the minimum that holds, with a margin", grasp<&Grasp::recommended_grip_N>},
    {10, "FRICTION", f32, kNoUnit, "coefficient", grasp<&Grasp::friction>},
    {12, "TIME", f32, kFloatS, "time of the frame on the daemon's clock, modulo 4096",
     [](S s) { return std::fmod(double(s.node.t_ns) * 1e-9, 4096); }},
    {14, "FRICTION_SD", f32, kNoUnit, "NaN where FRICTION is as configured", grasp<&Grasp::friction_sd>},
    {16, "OBJECT_PROB", f32, kNoUnit, "probability 0 .. 1, as in the grasp block", grasp<&Grasp::object_probability>},
    {24, "SEQ_END", count, kNoUnit, "= SEQ", sequence},
};

}  // namespace

Masks masks_of(const View& view, const ClientReport& client) noexcept {
    Masks masks;
    for (unsigned i = 0; i < sensors_of(view); ++i) {
        const Source s(view, client, i);
        const auto bit = [&](bool is_set) { return is_set ? 1u << i : 0u; };
        masks.good |= bit(s.sample.quality == TACTILED_GOOD);
        masks.contact |= bit((s.sample.state & TACTILED_CONTACT) != 0);
        masks.stale |= bit(is_silent(s.sample.reasons));
        masks.overload |= bit((s.sample.reasons & TACTILED_SATURATED) != 0 || (s.sample.state & TACTILED_OVERLOAD) != 0 ||
                              exceeds_range(sensor_rows(), s));
    }
    return masks;
}

std::span<const Register> global_rows() { return kGlobal; }
std::span<const Register> grasp_rows() { return kGrasp; }
std::span<const Register> command_rows() { return kCommands; }
std::span<const Register> doubt_rows() { return kDoubts; }
std::span<const Register> float_rows() { return kFloats; }

}  // namespace tactiled::modbus
