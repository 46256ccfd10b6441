// Shared by the files with the rows of the register map: the data that a value comes from, units, and common values.
#pragma once
#include <limits>

#include "node/modbus/encode.hpp"

namespace tactiled::modbus {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr unsigned kWholeNode = kSensorBlocks;

// Sensors of the node, bit n = sensor n.
struct Masks {
    std::uint32_t good = 0, contact = 0, stale = 0, overload = 0;
};
Masks masks_of(const View& view, const ClientReport& client) noexcept;

// The data of one block. References are valid during its encoding.
struct Source {
    Source(const View& from, const ClientReport& of_client, unsigned index) noexcept
        : view(from), client(of_client), sensor(index) {
        if (sensor == kWholeNode) masks = masks_of(view, client);
        if (sensor == kWholeNode || exists()) return;
        none = view.snapshot.sensor[sensor];
        tactiled_invalidate(&none, 0);  // sentinels, and of STATUS only the fault
    }
    Source(const Source&) = delete;
    Source& operator=(const Source&) = delete;

    const View& view;
    const ClientReport& client;
    unsigned sensor;         // kWholeNode: the block belongs to no sensor
    tactiled_sample none{};  // the sample of a sensor that does not exist
    const tactiled_sample& sample = exists() ? view.snapshot.sensor[sensor] : none;
    Masks masks{};  // all 0 in the block of a sensor
    const tactiled_node& node = view.snapshot.node;
    const tactiled_grasp& grasp = node.grasp;
    const tactiled_tool& tool = node.tool;

    [[nodiscard]] bool exists() const noexcept { return sensor < sensors_of(view); }
};

inline bool has_value(std::uint32_t quality) noexcept { return quality == TACTILED_GOOD || quality == TACTILED_UNCERTAIN; }
// True if a sample's reasons say that its sensor delivers nothing.
bool is_silent(std::uint32_t reasons) noexcept;

// Returns whether a register of a block whose saturation STATUS reports exceeds its range.
bool exceeds_range(std::span<const Register> rows, const Source& s) noexcept;

// Marks a value whose saturation STATUS reports.
constexpr Value reported(Value value) {
    value.reports_range = true;
    return value;
}

// Marks a word of bits of which not every bit is a trouble.
constexpr Value unread(std::uint16_t word, Value value) {
    value.unread = word;
    return value;
}
inline constexpr std::uint16_t kNothingGood = 0, kFaultAlone = 0x8000;  // words of these

inline constexpr Unit kNoUnit{}, kBeats{"1 / 100 ms"}, kMilliseconds{"ms"}, kMicroseconds{"us"}, kHertz{"Hz"},
    kThousandth{"0.001", 1e-3}, kPermille{"0.1 %", 1e-3}, kForce{"0.01 N", kForceUnit_N},
    kSensorForce{"0.01 N", kForceUnit_N, true}, kTorque{"0.001 Nm", 1e-3}, kLength{"0.01 mm", 1e-5}, kMass{"0.1 g", 1e-4},
    kGrams{"1 g", 1e-3}, kTemperature{"0.1 degC", 0.1}, kAcceleration{"0.001 m/s2", 1e-3};
inline constexpr Unit kFloatN{"N"}, kFloatNm{"Nm"}, kFloatMm{"mm"}, kFloatKg{"kg"}, kFloatS{"s"}, kFloatDegC{"degC"};

// SEQ and SEQ_END of each block.
inline double sequence(const Source& s) noexcept { return std::uint16_t(s.node.sequence); }
inline constexpr std::string_view kSeqMeaning = "number of the published frame, as in the global block";

// Age in ms, for registers of that unit. A missing time must not seem as young as the machine.
inline double age_ms(const Source& s, std::uint64_t t_ns) noexcept {
    const std::uint64_t now_ns = s.view.snapshot.taken_ns;
    if (t_ns == 0) return kMaxU16;  // no frame so far
    return now_ns > t_ns ? double((now_ns - t_ns) / 1'000'000u) : 0;
}

std::span<const Register> global_rows();
std::span<const Register> grasp_rows();
std::span<const Register> command_rows();
std::span<const Register> doubt_rows();
std::span<const Register> float_rows();
std::span<const Register> sensor_rows();
std::span<const Register> sensor_float_rows();
std::span<const Register> sensor_sd_rows();
std::span<const Register> age_bound_rows();
std::span<const Register> head_rows();
std::span<const Register> page_rows();
std::span<const Register> tool_rows();
std::span<const Register> tool_float_rows();
std::span<const Register> control_rows();

}  // namespace tactiled::modbus
