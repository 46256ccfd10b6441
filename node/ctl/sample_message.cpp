#include "node/ctl/sample_message.hpp"

#include <algorithm>

#include "drivers/mcap/cdr.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {

const std::string_view kSampleDefinition =
    R"(# One sample of one sensor: tactiled/layout.h, struct tactiled_sample. SI units, frame S.
builtin_interfaces/Time stamp  # wall clock of t_ns
uint64 sequence
uint64 t_ns
uint64 t_published_ns
uint32 epoch
uint32 quality       # 1 good, 2 uncertain, 3 bad
uint32 reasons
uint32 device_sequence
uint32 missing
uint32 saturated
uint32 tare_count
uint32 lost
float64[3] force_s_n
float64[3] torque_s_nm
float64[3] sd_force_n
float64[3] sd_torque_nm
float64[3] raw_force_s_n
float64[3] raw_torque_s_nm
float64[2] cop_s_m
float64 residual
float32 rate_hz
float32 temperature_c
uint32 state
float32 peak_n
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";

const std::string_view kToolDefinition =
    R"(# What the world exerts on the gripper, in its frame G: tactiled/layout.h, struct tactiled_tool. SI units.
builtin_interfaces/Time stamp  # wall clock of t_newest_ns
uint64 t_ns
uint64 t_newest_ns
uint32 quality       # 1 good, 2 uncertain, 3 bad
uint32 why
uint32 sensors
uint32 bad
float64[3] force_g_n
float64[3] torque_g_nm
float64[3] sd_force_n
float64[3] sd_torque_nm
float32[3] gravity_g_m_s2
float32 mass_kg
uint32[16] sensor_quality
float32[48] sensor_force_g_n      # three numbers a sensor
float32[48] sensor_torque_g_nm
float32[48] sensor_sd_force_n
float32[48] sensor_sd_torque_nm
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";

const std::string_view kQualityDefinition =
    R"(# Quality of the wrench of the same time. A BAD wrench has no numbers.
builtin_interfaces/Time stamp
uint32 quality  # 1 good, 2 uncertain, 3 bad
uint32 reasons  # tactiled/layout.h, enum tactiled_reason
float32 age_bound_s  # largest possible age of the newest frame, when this was recorded; NaN: not known
string text     # "uncertain:saturated"
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";

const std::string_view kWrenchDefinition = R"(std_msgs/Header header
geometry_msgs/Wrench wrench
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Wrench
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
)";

namespace {

void put_time(CdrWriter& cdr, std::uint64_t wall_ns) {
    cdr.put(std::int32_t(wall_ns / 1'000'000'000u));
    cdr.put(std::uint32_t(wall_ns % 1'000'000'000u));
}

// Calls `each` for the fields in the order of the definition, for writing and for reading.
template <class Sample, class Each>
void each_field(Sample& s, Each&& each) {
    each(s.sequence), each(s.t_ns), each(s.t_published_ns);
    each(s.epoch), each(s.quality), each(s.reasons), each(s.device_sequence);
    each(s.missing), each(s.saturated), each(s.tare_count), each(s.lost);
    for (auto* triple : {s.force_S_N, s.torque_S_Nm, s.sd_force_N, s.sd_torque_Nm, s.raw_force_S_N, s.raw_torque_S_Nm})
        for (int i = 0; i < 3; ++i) each(triple[i]);
    each(s.cop_S_m[0]), each(s.cop_S_m[1]), each(s.residual);
    each(s.rate_Hz), each(s.temperature_C), each(s.state), each(s.peak_N);
}

}  // namespace

void encode_sample(const tactiled_sample& sample, std::uint64_t wall_ns, std::string& out) {
    CdrWriter cdr(out);
    put_time(cdr, wall_ns);
    each_field(sample, [&](const auto& value) { cdr.put(value); });
}

bool decode_sample(std::span<const char> bytes, tactiled_sample& sample) {
    CdrReader cdr(bytes);
    sample = tactiled_sample{};
    (void)cdr.get<std::int32_t>();
    (void)cdr.get<std::uint32_t>();
    each_field(sample, [&](auto& value) { value = cdr.get<std::remove_reference_t<decltype(value)>>(); });
    return !cdr.failed();
}

void encode_wrench(const tactiled_sample& sample, const std::string& frame_id, std::uint64_t wall_ns, std::string& out) {
    CdrWriter cdr(out);
    put_time(cdr, wall_ns);
    cdr.put(std::string_view(frame_id));
    for (const double force_N : sample.force_S_N) cdr.put(force_N);
    for (const double torque_Nm : sample.torque_S_Nm) cdr.put(torque_Nm);
}

void encode_quality(const tactiled_sample& sample, float age_bound_s, std::uint64_t wall_ns, std::string& out) {
    CdrWriter cdr(out);
    put_time(cdr, wall_ns);
    cdr.put(sample.quality);
    cdr.put(sample.reasons);
    cdr.put(age_bound_s);
    cdr.put(std::string_view(quality_text(sample.quality, sample.reasons)));
}

void encode_tool(const tactiled_tool& t, std::uint64_t wall_ns, std::string& out) {
    CdrWriter cdr(out);
    put_time(cdr, wall_ns);
    cdr.put(t.t_ns), cdr.put(t.t_newest_ns);
    cdr.put(t.quality), cdr.put(t.why), cdr.put(t.sensors), cdr.put(t.bad);
    for (const auto* triple : {&t.force_G_N, &t.torque_G_Nm, &t.sd_force_N, &t.sd_torque_Nm})
        for (const double number : *triple) cdr.put(number);
    for (const float number : t.gravity_G_m_s2) cdr.put(number);
    cdr.put(t.mass_kg);
    for (const std::uint32_t quality : t.sensor_quality) cdr.put(quality);
    for (const auto* all : {&t.sensor_force_G_N, &t.sensor_torque_G_Nm, &t.sensor_sd_force_N, &t.sensor_sd_torque_Nm})
        for (const auto& triple : *all)
            for (const float number : triple) cdr.put(number);
}

void encode_wrench(const tactiled_tool& tool, const std::string& frame_id, std::uint64_t wall_ns, std::string& out) {
    tactiled_sample as_sample{};
    std::copy_n(tool.force_G_N, 3, as_sample.force_S_N);
    std::copy_n(tool.torque_G_Nm, 3, as_sample.torque_S_Nm);
    encode_wrench(as_sample, frame_id, wall_ns, out);
}

Estimate estimate_of(const tactiled_sample& s) {
    Estimate e;
    for (std::size_t c = 0; c < 3; ++c) {
        e.wrench_S[c] = s.force_S_N[c];
        e.wrench_S[c + 3] = s.torque_S_Nm[c];
        e.sd[c] = s.sd_force_N[c];
        e.sd[c + 3] = s.sd_torque_Nm[c];
    }
    std::copy_n(s.cop_S_m, 2, e.cop_S_m.begin());
    e.residual = s.residual;
    return e;
}

}  // namespace tactiled::ctl
