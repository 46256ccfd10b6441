// Reads what the node publishes, as its users do, and counts what must never be: lies and false alarms.
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
    kWrongValue,  // GOOD, and not what the device measured
    kWrongForce,  // not the raw force less its tare, low-passed; or a tare of what is no zero
    kWrongGrasp,  // known or stable though a jaw is not, a weight that is not that of the object, or a counter that falls
    kReload,      // refused and not told, or told and not refused
    kTooOld,      // GOOD, and the device measured it longer ago than stale_ms
    kWrongTimestamp,         // the sample's time is not that of its frame
    kLate,                   // GOOD 10 ms after the link was gone
    kNoSentinel,             // a number beside BAD
    kOutOfOrder,             // a record that does not follow the one before
    kUnmarkedDiscontinuity,  // values on both sides of a break in one epoch
    kUncountedLoss,          // frames are missing, and `lost` does not say so
    kWrongRegister,          // a register says ok, and its force is none that the device measured of late
    kRegisterSentinel,       // a register says fault, and its force is a number
    kHeartbeat,              // beats without data
    kFalseAlarm,             // not GOOD without a fault
    kNotRecovered,           // not GOOD at the end
    kFindings
};
std::string name_of(Finding finding);

struct Findings {
    std::array<std::uint64_t, kFindings> count{};
    std::uint64_t samples = 0, good = 0, reads = 0;  // records; of them GOOD; registers' answers
    std::uint64_t tares = 0, stable_weights = 0;     // that came to an end; node records with one
    std::uint64_t digest = 14695981039346656037u;    // of every record and register read
    std::string first;                               // in words
    [[nodiscard]] std::uint64_t total() const;
    void add(Finding finding, unsigned sensor, const std::string& what);
    void mix(const void* bytes, std::size_t size);
};

// What the witness may know of the world beside the devices' truth.
struct Expectation {
    std::array<bool, kSensors> may_suffer{};  // a fault is near
    std::array<std::uint64_t, kSensors>
        disconnected_since{};  // the link is unplugged and could be seen to be; 0 = it is not
    bool plc_reads = false;    // this turn
    bool new_daemon = false;   // memory's reader and the register server have perhaps not both found it yet
    int reload_refused = -1;   // what WARN must say; -1: it need not say anything yet
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

    // The pipeline has taken a tare of the sensors of `mask`.
    void tare_begins(std::uint32_t mask) noexcept;
    // The calibration of this sensor may be replaced from now on by one with `gain`; then: it was, or it was not.
    void expect_gain(unsigned sensor, double gain, std::array<Device*, kSensors> devices);
    void settle_gain(unsigned sensor, bool replaced, std::array<Device*, kSensors> devices);

    bool follows = true;  // false: this reader has been stopped

private:
    void follow(unsigned sensor, const Device& device);
    void judge(unsigned sensor, const Device& device, const tactiled_sample& s);
    [[nodiscard]] bool may_be_unseen(unsigned sensor, const Device& device, const Device::Truth& truth, std::uint64_t t_ns,
                                     bool first_of_a_level);
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
    std::array<double, kSensors> gain_, wanted_gain_{};  // 0 = none is wanted
    struct BeforeGain {
        double gain = 0;
        std::uint64_t until_ns = 0;
    };
    std::array<BeforeGain, kSensors> before_gain_{};
    struct Unseen {
        std::uint32_t undetected = 0;
        unsigned readings = 0;
        unsigned others_doubtful = 0;  // doubtful_ of the other one, when it began
    };
    std::array<Unseen, kSensors> unseen_{};      // of the run of lies that the device is in
    std::array<unsigned, kSensors> doubtful_{};  // records that nothing can be compared with
    std::array<bool, kSensors> was_a_spike_{};   // the record before
    bool is_up_to_date_ = true;                  // with the records, but for those of this turn
    tactiled_node node_{};
    std::uint32_t node_epoch_ = 0;
    std::uint64_t doubtful_until_ns_ = 0;  // a jaw was, and its weight is a mean
    std::uint16_t heartbeat_ = 0;
    std::uint64_t silent_since_ns_ = 0;
};

}  // namespace tactiled::faults
