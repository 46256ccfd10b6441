// Reads the published data of the node, like its users, and counts forbidden events: undetected wrong values and
// false alarms.
#pragma once
#include <array>
#include <cstdint>
#include <string>

#include "config/config.hpp"
#include "device.hpp"
#include "force_truth.hpp"
#include "node/modbus/service.hpp"
#include "tactiled/reader.hpp"
#include "tests/unit/modbus/answer_socket.hpp"

namespace tactiled::faults {

enum Finding {
    kWrongValue,             // GOOD, but not the measured value
    kWrongForce,             // not the raw force minus its tare, low-passed; or a tare of an invalid zero
    kWrongGrasp,             // known or stable although a jaw is not, a wrong weight, or a decreasing counter
    kReload,                 // refused and not reported, or reported and not refused
    kTooOld,                 // GOOD, but measured longer ago than stale_ms
    kWrongTimestamp,         // the sample's time is not that of its frame
    kLate,                   // GOOD 10 ms after the link was disconnected
    kNoSentinel,             // a number in a BAD sample
    kOutOfOrder,             // a record that does not follow the one before
    kUnmarkedDiscontinuity,  // values on both sides of a discontinuity in one epoch
    kUncountedLoss,          // frames are missing, and `lost` does not count them
    kWrongRegister,          // a register reports ok, and the device did not measure its force recently
    kRegisterSentinel,       // a register reports a fault, and its force is a number
    kHeartbeat,              // heartbeats without data
    kFalseAlarm,             // not GOOD without a fault
    kNotRecovered,           // not GOOD at the end
    kFindings
};
std::string name_of(Finding finding);

struct Findings {
    std::array<std::uint64_t, kFindings> count{};
    std::uint64_t samples = 0, good = 0, reads = 0;  // records; GOOD ones; answers of registers
    std::uint64_t tares = 0, stable_weights = 0;     // finished tares; node records with a stable weight
    std::uint64_t digest = 14695981039346656037u;    // over every record and register read
    std::string first;                               // text of the first finding
    [[nodiscard]] std::uint64_t total() const;
    void add(Finding finding, unsigned sensor, const std::string& what);
    void mix(const void* bytes, std::size_t size);
};

// The witness' knowledge of the world besides the devices' truth.
struct Expectation {
    std::array<bool, kSensors> may_suffer{};  // bit set: a fault is near
    std::array<std::uint64_t, kSensors>
        disconnected_since{};  // time at which the unplugged link could be detected; 0 = plugged
    bool plc_reads = false;    // in this cycle
    bool new_daemon = false;   // the reader of shared memory or the register server may not have found it yet
    int reload_refused = -1;   // required value of WARN; -1: any value is allowed
};

class Witness {
public:
    Witness(const std::string& node, const ModbusSettings& settings, CommandRing& commands, Findings& findings);
    void look(std::array<Device*, kSensors> devices, const Expectation& expected);
    // The registers of one answer of the real server: 32 at 0, 100 at 100.
    struct Registers {
        std::array<std::uint16_t, 32> global;
        std::array<std::uint16_t, 25 * kSensors> sensors;
    };
    [[nodiscard]] Registers read_registers();
    [[nodiscard]] tactiled_sample latest(unsigned sensor) { return readers_[sensor].latest(); }

    // Notes that the pipeline has taken a tare of the sensors of `mask`.
    void tare_begins(std::uint32_t mask) noexcept;
    // Notes that the calibration of this sensor may be replaced from now on by one with `gain`; then, that it was or
    // was not.
    void expect_gain(unsigned sensor, double gain, std::array<Device*, kSensors> devices);
    void settle_gain(unsigned sensor, bool replaced, std::array<Device*, kSensors> devices);

    bool follows = true;  // false: this reader is stopped

    // True while this sample may be doubted although no fault lasts.
    [[nodiscard]] static bool needs_a_tare(unsigned sensor, const Device& device, const tactiled_sample& s);

private:
    void follow(unsigned sensor, const Device& device);
    void judge(unsigned sensor, const Device& device, const tactiled_sample& s);
    [[nodiscard]] bool may_be_unseen(unsigned sensor, const Device& device, const Device::Truth& truth, std::uint64_t t_ns);
    void look_at_latest(unsigned sensor, const Device& device, const Expectation& expected);
    void look_at_registers(const std::array<Device*, kSensors>& devices, const Expectation& expected);
    void look_at_grasp();
    void judge_weight(const tactiled_node& node);
    [[nodiscard]] double force_of(unsigned sensor, std::uint32_t sequence, unsigned k) const;
    [[nodiscard]] bool is_of_the_gain_before(unsigned sensor, const tactiled_sample& s, unsigned k) const;
    [[nodiscard]] bool is_force_of(unsigned sensor, std::uint32_t sequence, unsigned k, double force_N) const;

    Findings& findings_;
    modbus::Service service_;
    modbus::Session session_;
    test::AnswerSocket socket_;
    modbus::Responder responder_{ModbusWire::tcp};
    std::array<Reader, kSensors> readers_;
    std::array<tactiled_cursor, kSensors> cursors_{};
    std::array<std::uint32_t, kSensors> attached_epoch_{};
    std::array<tactiled_sample, kSensors> last_{}, last_value_{};
    std::array<bool, kSensors> broken_{}, seen_{};
    std::array<ForceTruth, kSensors> forces_;
    std::array<double, kSensors> gain_, wanted_gain_{};  // 0 = no gain is expected
    struct BeforeGain {
        double gain = 0;
        std::uint64_t until_ns = 0;
    };
    std::array<BeforeGain, kSensors> before_gain_{};
    struct Unseen {
        std::uint32_t undetected = 0;
        unsigned readings = 0;
        unsigned others_doubtful = 0;  // number doubtful_ for the other one, at its begin
    };
    std::array<Unseen, kSensors> unseen_{};      // state of the present run of wrong values
    std::array<unsigned, kSensors> doubtful_{};  // number of records without a comparison
    std::array<bool, kSensors> was_a_spike_{};   // the record before
    std::array<bool, kSensors> spikes_are_a_level_{};
    bool is_up_to_date_ = true;  // all records were read except those of this cycle
    tactiled_node node_{};
    std::uint32_t node_epoch_ = 0;
    std::uint64_t doubtful_until_ns_ = 0;  // a jaw was doubtful, and its weight is a mean
    std::uint16_t heartbeat_ = 0;
    std::uint64_t silent_since_ns_ = 0;
};

}  // namespace tactiled::faults
