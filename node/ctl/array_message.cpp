#include "node/ctl/array_message.hpp"

#include <bit>
#include <cmath>

#include "drivers/mcap/cdr.hpp"
#include "node/ctl/array_text.hpp"

namespace tactiled::ctl {

const std::string_view kArrayDefinition =
    R"(# The results of an array of taxels: tactiled/layout.h, struct tactiled_array. SI units, frame S.
builtin_interfaces/Time stamp  # wall clock of t_ns
uint64 t_ns          # that of the sample of the same time, whose quality is that of the array
uint32 n_out         # taxels without a force of their own
uint32 n_contact     # taxels in contact
uint32 peak_taxel    # taxel of the largest press, where peak_n is a number
float32 peak_n
float32 peak_sd_n
float32[3] cop_s_m
float32[3] cop_sd_m
float32 area_m2
float32 area_sd_m2
float32 axis_rad
float32 axis_sd_rad
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";

const std::string_view kCloudDefinition = R"(std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: sensor_msgs/PointField
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count
)";

namespace {

constexpr std::uint8_t kUint32 = 6, kFloat32 = 7;  // PointField

void put_time(CdrWriter& cdr, std::uint64_t wall_ns) {
    cdr.put(std::int32_t(wall_ns / 1'000'000'000u));
    cdr.put(std::uint32_t(wall_ns % 1'000'000'000u));
}

}  // namespace

TaxelCloud cloud_of(const SegmentView& segment, std::uint32_t sensor, const Array& array) {
    const tactiled_array_plan& plan = segment.c()->array[sensor];
    return {.rows = plan.rows,
            .columns = plan.columns,
            .components = plan.components,
            .place_S = {tactiled_taxel_places(segment.c(), sensor), std::size_t(plan.n_taxels) * 6},
            .force_S_N = array.forces(),
            .state = array.states()};
}

void encode_array(const tactiled_array& array, std::uint64_t wall_ns, std::string& out) {
    CdrWriter cdr(out);
    put_time(cdr, wall_ns);
    cdr.put(array.sample.t_ns);
    // Without a peak its taxel is that of an earlier sample.
    const std::uint32_t peak_taxel = std::isfinite(array.peak_N) ? array.peak_taxel : 0;
    for (const std::uint32_t number : {array.n_out, array.n_contact, peak_taxel}) cdr.put(number);
    cdr.put(array.peak_N), cdr.put(array.peak_sd_N);
    for (const auto* triple : {&array.cop_S_m, &array.cop_sd_m})
        for (const float number : *triple) cdr.put(number);
    for (const float number : {array.area_m2, array.area_sd_m2, array.axis_rad, array.axis_sd_rad}) cdr.put(number);
}

void encode_cloud(const TaxelCloud& cloud, const std::string& frame_id, std::uint64_t wall_ns, std::string& out) {
    const auto n = std::uint32_t(cloud.place_S.size() / 6), n_forces = std::uint32_t(std::popcount(cloud.components));
    const std::uint32_t numbers = 5 + n_forces, point_step = 4 * numbers;
    CdrWriter cdr(out);
    put_time(cdr, wall_ns);
    cdr.put(std::string_view(frame_id));
    const std::uint32_t width = cloud.columns != 0 ? cloud.columns : n;
    cdr.put(cloud.columns != 0 ? cloud.rows : 1u);
    cdr.put(width);
    cdr.put(numbers);  // fields
    std::uint32_t offset = 0;
    const auto field = [&](std::string_view name, std::uint8_t type) {
        cdr.put(name);
        cdr.put(offset);
        cdr.put(type);
        cdr.put(1u);
        offset += 4;
    };
    for (const char* name : {"x", "y", "z", "press_N"}) field(name, kFloat32);
    constexpr const char* kForces[] = {"fx_N", "fy_N", "fz_N"};
    for (std::uint32_t c = 0; c < 3; ++c)
        if ((cloud.components >> c & 1u) != 0) field(kForces[c], kFloat32);
    field("state", kUint32);
    cdr.put(std::uint8_t(0));  // little-endian
    cdr.put(point_step);
    cdr.put(point_step * width);
    cdr.put(point_step * n);
    const auto append = [&](const void* bytes, std::size_t size) { out.append(static_cast<const char*>(bytes), size); };
    for (std::size_t i = 0; i < n; ++i) {
        const float *const place = &cloud.place_S[6 * i], *const force = cloud.force_S_N + i * n_forces;
        const float press = press_N(cloud.components, force, place + 3);
        const std::uint32_t state = cloud.state[i];
        append(place, 3 * sizeof *place);
        append(&press, sizeof press);
        append(force, n_forces * sizeof *force);
        append(&state, sizeof state);
    }
    cdr.put(std::uint8_t(0));  // is_dense: no, a taxel without a force has NaN
}

}  // namespace tactiled::ctl
