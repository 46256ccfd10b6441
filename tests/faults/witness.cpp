#include "witness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "clock.hpp"
#include "drivers/wire/sequence_tracker.hpp"

namespace tactiled::faults {
namespace {

constexpr std::uint64_t kCycleNs = 2 * kMs;  // time within which a waiting frame is taken and published
constexpr std::uint64_t kHeldNs = 12 * kMs;  // the same for a cable that delays frames
constexpr unsigned kSecondBelieved = 19;     // sequence_tracker.hpp
constexpr std::uint64_t kDoubtedNs = SequenceTracker::kMax * 2 * kPeriodNs;  // at half the rate

}  // namespace

std::string name_of(Finding finding) {
    constexpr const char* kNames[] = {"wrong value",
                                      "wrong force",
                                      "wrong grasp",
                                      "reload",
                                      "too old",
                                      "wrong stamp",
                                      "late",
                                      "no sentinel",
                                      "out of order",
                                      "unmarked break",
                                      "uncounted loss",
                                      "wrong register",
                                      "register without sentinel",
                                      "heartbeat",
                                      "false alarm",
                                      "not recovered"};
    static_assert(std::size(kNames) == kFindings);
    return kNames[finding];
}

std::uint64_t Findings::total() const { return std::accumulate(count.begin(), count.end(), std::uint64_t(0)); }

void Findings::add(Finding finding, unsigned sensor, const std::string& what) {
    ++count[finding];
    if (first.empty())
        first = fmt::format("{} at {} us, sensor {}: {}", name_of(finding), world_ns / 1000 % 100'000'000, sensor, what);
}

void Findings::mix(const void* bytes, std::size_t size) {
    for (std::size_t i = 0; i + 4 <= size; i += 4) {
        std::uint32_t word;
        std::memcpy(&word, static_cast<const char*>(bytes) + i, 4);
        digest = (digest ^ word) * 1099511628211u;
    }
}

Witness::Witness(const std::string& node, const ModbusSettings& settings, CommandRing& commands, Findings& findings)
    : findings_(findings),
      service_(node, settings, commands),
      readers_{Reader{node, "s0"}, Reader{node, "s1"}, Reader{node, "s2"}, Reader{node, "s3"}},
      forces_{ForceTruth{0, 0}, ForceTruth{1, 0}, ForceTruth{2, kTareLimit_N}, ForceTruth{3, kTareLimit_N}} {
    gain_.fill(kN_per_count);
}

double Witness::force_of(unsigned i, std::uint32_t sequence, unsigned k) const {
    return gain_[i] * (count_of(i, sequence, k) - (is_jaw(i) ? place_of(i, k) : 0));
}

bool Witness::is_force_of(unsigned i, std::uint32_t sequence, unsigned k, double force_N) const {
    const double now_N = force_of(i, sequence, k);
    return std::abs(force_N - now_N) <= 1e-9 ||
           (wanted_gain_[i] != 0 && std::abs(force_N - now_N / gain_[i] * wanted_gain_[i]) <= 1e-9);
}

// Published before the change and found only now, by a reader that had not found the daemon yet.
bool Witness::is_of_the_gain_before(unsigned i, const tactiled_sample& s, unsigned k) const {
    const auto [gain, until_ns] = before_gain_[i];
    return s.t_published_ns < until_ns &&
           std::abs(s.raw_force_S_N[k] - force_of(i, s.device_sequence, k) / gain_[i] * gain) <= 1e-9;
}

void Witness::tare_begins(std::uint32_t mask) noexcept {
    for (unsigned i = 0; i < kSensors; ++i) {
        if ((mask >> i & 1u) == 0) continue;
        is_up_to_date_ ? forces_[i].tare_begins(world_ns) : forces_[i].missed(false);
    }
}

void Witness::expect_gain(unsigned i, double gain, std::array<Device*, kSensors> devices) {
    follow(i, *devices[i]);
    wanted_gain_[i] = gain;
}

void Witness::settle_gain(unsigned i, bool replaced, std::array<Device*, kSensors> devices) {
    follow(i, *devices[i]);
    if (replaced) {
        before_gain_[i] = {gain_[i], world_ns};
        gain_[i] = wanted_gain_[i];
    }
    wanted_gain_[i] = 0;
}

void Witness::look(std::array<Device*, kSensors> devices, const Expectation& expected) {
    for (unsigned i = 0; i < kSensors; ++i) look_at_latest(i, *devices[i], expected);
    is_up_to_date_ = follows;
    if (follows)
        for (unsigned i = 0; i < kSensors; ++i) follow(i, *devices[i]);
    look_at_grasp();
    if (expected.plc_reads) look_at_registers(devices, expected);
}

// Reads every record from the ring, not judged by its age, and so with the daemon's own quality.
void Witness::follow(unsigned i, const Device& device) {
    if (!readers_[i].is_attached()) return;
    const SegmentView segment = readers_[i].segment();
    const tactiled_ring& ring = segment.sensor(i).ring;
    if (attached_epoch_[i] != segment.header().epoch) {  // another daemon: from its first record on
        attached_epoch_[i] = segment.header().epoch;
        cursors_[i] = {};
        seen_[i] = false;
        last_value_[i].lost = 0;
        forces_[i].missed(true);
        unseen_[i] = {};
        broken_[i] = last_value_[i].quality != TACTILED_NO_VALUE;
    }
    tactiled_sample s;
    std::uint64_t lost = cursors_[i].lost;
    while (tactiled_ring_next(segment.base(), &ring, &cursors_[i], &s, sizeof s) != 0) {
        if (seen_[i] && s.sequence != last_[i].sequence + 1 + (cursors_[i].lost - lost))
            findings_.add(kOutOfOrder, i, fmt::format("record {} after {}", s.sequence, last_[i].sequence));
        if (cursors_[i].lost != lost) {  // a slow reader: the previous record is unknown
            last_value_[i].quality = TACTILED_NO_VALUE;
            forces_[i].missed(false);
        }
        lost = cursors_[i].lost;
        judge(i, device, s);
        last_[i] = s;
        seen_[i] = true;
    }
}

void Witness::judge(unsigned i, const Device& device, const tactiled_sample& s) {
    ++findings_.samples;
    findings_.mix(&s, sizeof s);
    if ((s.reasons & ~std::uint32_t(TACTILED_SENSORS_DIFFER)) != 0) ++doubtful_[i];
    const bool has_value = s.quality == TACTILED_GOOD || s.quality == TACTILED_UNCERTAIN;
    if (!has_value) {
        forces_[i].gap();
        for (unsigned k = 0; k < kChannels; ++k)
            if (!std::isnan(s.force_S_N[k]) || !std::isnan(s.raw_force_S_N[k]))
                findings_.add(kNoSentinel, i, fmt::format("{} N beside BAD", s.force_S_N[k]));
        constexpr std::uint32_t kDiscontinuities =
            TACTILED_STALE | TACTILED_DISCONNECTED | TACTILED_FROZEN | TACTILED_DAEMON_STOPPED;
        if ((s.reasons & kDiscontinuities) != 0) broken_[i] = true;
        return;
    }
    tactiled_sample& before = last_value_[i];
    const bool comparable = before.quality != TACTILED_NO_VALUE;
    // The frame between two spikes may be lost: a step that is seen twice in a row is a level until its end is seen. So is
    // one at the begin of a stream.
    const bool spike = device.truth(s.device_sequence).spike, again = std::exchange(was_a_spike_[i], spike) == spike;
    if (spike && (again || !comparable || s.epoch != before.epoch)) spikes_are_a_level_[i] = true;
    if (!spike && again && s.quality == TACTILED_GOOD) spikes_are_a_level_[i] = false;
    if (std::exchange(broken_[i], false) && comparable && s.epoch == before.epoch)
        findings_.add(kUnmarkedDiscontinuity, i, fmt::format("epoch {:x} before and after", s.epoch));
    const bool jumped = before.t_ns <= device.jumped_ns + kHeldNs && device.jumped_ns <= s.t_ns;
    // While two devices count, the order of the numbers is unknown, and also the frames that are still on the way
    // when one has ended.
    const bool two_count = device.doubled_ns != 0 && before.t_ns <= device.doubled_ns + kDoubtedNs;
    if (comparable && s.epoch == before.epoch && !jumped && !two_count) {
        const std::uint32_t mask = device.is_text() ? ~0u : 0xFFFFu;
        const std::uint32_t gap = (s.device_sequence - before.device_sequence - 1) & mask;
        // BAD frames in between are frames as well.
        const std::uint32_t bad_ones = std::uint32_t(s.sequence - before.sequence - 1);
        if (gap != s.lost - before.lost + bad_ones)
            findings_.add(
                kUncountedLoss, i,
                fmt::format("{} to {}, lost {} to {}", before.device_sequence, s.device_sequence, before.lost, s.lost));
        if (s.t_ns < before.t_ns) findings_.add(kOutOfOrder, i, "its time goes back");
    }
    before = s;
    const Device::Truth& truth = device.truth(s.device_sequence);
    const bool waited_for_a_stopped_daemon = device.stopped_ns != 0 && s.t_ns + kHeldNs >= device.stopped_ns &&
                                             truth.arrived_ns <= device.stopped_until_ns + kHeldNs;
    if ((s.t_ns < truth.arrived_ns && !waited_for_a_stopped_daemon) || s.t_ns > truth.arrived_ns + kHeldNs)
        findings_.add(
            kWrongTimestamp, i,
            fmt::format("{} us after its arrival", (std::int64_t(s.t_ns) - std::int64_t(truth.arrived_ns)) / 1000));
    if (const std::string wrong = forces_[i].judge(s, truth.undetected == 0 && !truth.spike); !wrong.empty())
        findings_.add(kWrongForce, i, wrong);
    findings_.tares += std::exchange(forces_[i].tares, 0);
    if (s.quality != TACTILED_GOOD) return;
    ++findings_.good;
    for (unsigned k = 0; k < kChannels; ++k)
        if (!is_force_of(i, s.device_sequence, k, s.raw_force_S_N[k]) && !is_of_the_gain_before(i, s, k)) {
            if (may_be_unseen(i, device, truth, s.t_ns)) return;
            return findings_.add(kWrongValue, i,
                                 fmt::format("{} N of frame {}, channel {}", s.raw_force_S_N[k], s.device_sequence, k));
        }
}

// A step is detected in its first reading; a repetition is detected after frozen_after readings, each
// time that a daemon restarts; a fault that only the other sensor of the pair can show is detected while that one can
// be compared.
bool Witness::may_be_unseen(unsigned i, const Device& device, const Device::Truth& truth, std::uint64_t t_ns) {
    if (truth.spike) return spikes_are_a_level_[i];
    if (truth.undetected == 0) return false;
    if (unseen_[i].undetected != truth.undetected) unseen_[i] = {truth.undetected, 0, truth.beside ? doubtful_[1 - i] : 0};
    unsigned incomparable = 0;
    if (truth.beside) {
        incomparable = doubtful_[1 - i] - unseen_[i].others_doubtful;
        const std::uint64_t others_ns =
            last_[1 - i].t_ns;  // after a stopped loop one of them is ahead by all waiting frames
        if (std::max(t_ns, others_ns) - std::min(t_ns, others_ns) > kAgreeMs * kMs) return true;
        const tactiled_sample other = latest(1 - i);
        if (other.quality == TACTILED_BAD) unseen_[i].readings = 0;  // a wrong one clears this one: compared again later
        if (other.quality == TACTILED_BAD || (other.reasons & ~std::uint32_t(TACTILED_SENSORS_DIFFER)) != 0) return true;
    }
    const auto differ_after = unsigned(kDifferAfter * std::max(kPeriodNs, device.period_ns) / device.period_ns);  // a time
    const unsigned may_be = truth.beside ? differ_after + incomparable : truth.second ? kSecondBelieved : kFrozenAfter - 1;
    return ++unseen_[i].readings <= may_be;
}

// A tare is lost with its calibration; nobody knows which one of two devices has remained, or if one that counts anew has
// its zero: its force is another one.
bool Witness::needs_a_tare(unsigned i, const Device& device, const tactiled_sample& s) {
    return (i == kRecalibrated || device.doubled_ns != 0 || device.jumped_ns != 0) &&
           (s.reasons & TACTILED_ZERO_UNKNOWN) != 0;
}

void Witness::look_at_latest(unsigned i, const Device& device, const Expectation& expected) {
    const tactiled_sample s = readers_[i].latest();
    if (s.quality != TACTILED_GOOD) {
        if (!expected.may_suffer[i] && !needs_a_tare(i, device, s))
            findings_.add(kFalseAlarm, i, fmt::format("quality {}, reasons {:x}", s.quality, s.reasons));
        if (s.quality == TACTILED_BAD && !std::isnan(s.force_S_N[0])) findings_.add(kNoSentinel, i, "latest()");
        return;
    }
    const Device::Truth& truth = device.truth(s.device_sequence);
    if (truth.undetected == 0 && !truth.spike && !is_force_of(i, s.device_sequence, 1, s.raw_force_S_N[1]))
        findings_.add(kWrongValue, i, "latest()");
    if (world_ns > truth.arrived_ns + kStaleMs * kMs + kCycleNs)
        findings_.add(kTooOld, i,
                      fmt::format("{} ms, says {} ms", (world_ns - truth.arrived_ns) / kMs, (world_ns - s.t_ns) / kMs));
    if (expected.disconnected_since[i] != 0 && world_ns > expected.disconnected_since[i] + 10 * kMs)
        findings_.add(kLate, i,
                      fmt::format("GOOD {} ms after the link was gone", (world_ns - expected.disconnected_since[i]) / kMs));
}

Witness::Registers Witness::read_registers() {
    Registers out{};
    const auto ask = [&](std::uint16_t at, std::span<std::uint16_t> cells) {
        const std::uint8_t n = std::uint8_t(cells.size());
        const std::array<std::uint8_t, 12> adu{0, 1, 0, 0, 0, 6, 1, 4, std::uint8_t(at >> 8), std::uint8_t(at), 0, n};
        responder_.set_descriptor(socket_.fd());
        (void)service_.answer(adu, session_, responder_);
        std::array<std::uint8_t, modbus::kMaxAdu> answer{};
        const std::size_t size = socket_.take(answer);
        for (std::size_t k = 0; size == 9u + 2u * n && k < n; ++k)
            cells[k] = std::uint16_t(answer[9 + 2 * k] << 8 | answer[10 + 2 * k]);
    };
    ask(0, out.global);
    ask(100, out.sensors);
    ++findings_.reads;
    findings_.mix(&out, sizeof out);
    return out;
}

void Witness::look_at_registers(const std::array<Device*, kSensors>& devices, const Expectation& expected) {
    const Registers now = read_registers();
    if (expected.reload_refused >= 0 && (now.global[9] >> 7 & 1) != expected.reload_refused)
        findings_.add(kReload, 0, fmt::format("WARN {:#06x}", now.global[9]));
    if (now.global[0] != 0x5441 || now.global[4] != now.global[31]) findings_.add(kWrongRegister, 0, "global block");
    bool all_silent = true;
    for (unsigned i = 0; i < kSensors; ++i) {
        const std::uint16_t* block = &now.sensors[25 * i];
        const bool ok = (block[1] & 1) != 0, fault = (block[1] & 0x8000) != 0;
        all_silent &= (block[1] & 1u << 6) != 0;
        if (fault)
            for (unsigned k = 4; k < 7; ++k)
                if (block[k] != 0x8000) findings_.add(kRegisterSentinel, i, fmt::format("{:04x}", block[k]));
        if (!ok) continue;
        bool found = false;
        const Device& device = *devices[i];
        // Compares tared or low-passed values with shared memory of the same instant, which is compared with the
        // truth.
        if (expected.new_daemon && i == 1) continue;  // low-passed from the first sample on
        if (const tactiled_sample s = latest(i); s.tare_count != 0 || (s.state & TACTILED_LOW_PASS) != 0) {
            for (unsigned k = 0; k < kChannels; ++k)
                if (std::abs(std::int16_t(block[4 + k]) * 0.01 - std::clamp(s.force_S_N[k], -327.67, 327.67)) >
                        0.005 + 1e-9 ||
                    s.quality != TACTILED_GOOD)
                    findings_.add(kWrongRegister, i,
                                  fmt::format("{} cN, {} N in memory", std::int16_t(block[4 + k]), s.force_S_N[k]));
            continue;
        }
        for (std::uint32_t back = 1; back <= 32 && !found; ++back) {
            const std::uint32_t sequence = device.sent(back);
            const Device::Truth& truth = device.truth(sequence);
            if (truth.arrived_ns == 0 || world_ns > truth.arrived_ns + kStaleMs * kMs + kCycleNs) break;
            found = truth.undetected != 0 || truth.spike;
            const auto is_reported = [&](double gain) {
                bool same = true;
                for (unsigned k = 0; k < kChannels; ++k) {
                    const double force_N = force_of(i, sequence, k) / gain_[i] * gain;
                    same &= std::int16_t(block[4 + k]) == std::lround(force_N * 100) ||
                            std::int16_t(block[4 + k]) == std::lround(std::nearbyint(force_N / 0.01));
                }
                return same;
            };
            const bool same = is_reported(gain_[i]) || (wanted_gain_[i] != 0 && is_reported(wanted_gain_[i]));
            const auto age_ms = std::int64_t((world_ns - truth.arrived_ns) / kMs);
            found = found || (same && std::abs(age_ms - std::int64_t(block[3])) <= 12);
        }
        if (!found)
            findings_.add(kWrongRegister, i,
                          fmt::format("{} {} {} cN, {} ms", std::int16_t(block[4]), std::int16_t(block[5]),
                                      std::int16_t(block[6]), block[3]));
    }
    if (!all_silent || silent_since_ns_ == 0) silent_since_ns_ = all_silent ? world_ns : 0;
    const bool beats = now.global[5] != heartbeat_ && now.global[5] != 0;  // 0: of another daemon
    if (all_silent && beats && world_ns > silent_since_ns_ + 100 * kMs)
        findings_.add(kHeartbeat, 0, "it beats though every sensor is silent");
    heartbeat_ = now.global[5];
}

}  // namespace tactiled::faults
