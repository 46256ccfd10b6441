// [grasp]: which sensors sit on which jaw, and how they are turned.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "config/names.hpp"
#include "config/tables.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxJaws = 8;                   // grasp::kMaxJaws
constexpr double kSkewDeg = 1;                        // of two axes that a person wrote down as perpendicular
constexpr double kMinG_m_s2 = 9.7, kMaxG_m_s2 = 9.9;  // 9.76 on Huascaran, 9.83 at the poles
constexpr double kDeg = 57.29577951308232;

using Vector = std::array<double, 3>;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double length(const Vector& a) { return std::sqrt(dot(a, a)); }
Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector unit(const Vector& a) {
    const double l = length(a);
    return {a[0] / l, a[1] / l, a[2] / l};
}

// Nothing where it is wrong; why has been told then.
std::optional<Vector> read_axis(Options& table, const char* key) {
    if (!table.has(key)) {
        table.problem(key, fmt::format("{} is missing; it says where this axis of the skin points in the gripper's frame G, "
                                       "for example {} = [0, 1, 0]",
                                       key, key));
        return std::nullopt;
    }
    const auto v = table.numbers(key, {-1000, 1000}, {3, 3});
    if (v.size() != 3) return std::nullopt;
    if (v[0] == 0 && v[1] == 0 && v[2] == 0) {
        table.problem(key, fmt::format("{} = [0, 0, 0] has no direction", key));
        return std::nullopt;
    }
    return unit({v[0], v[1], v[2]});
}

JawSettings read_jaw(Options table) {
    const std::string sensor = table.text("sensor");
    const auto x_read = read_axis(table, "x_S_in_G"), z_read = read_axis(table, "z_S_in_G");
    const Vector x = x_read.value_or(Vector{1, 0, 0}), z = z_read.value_or(Vector{0, 0, 1});
    const double share = table.number("share", {0, 1}, 0);
    const double skew_deg = std::abs(std::asin(std::clamp(dot(x, z), -1.0, 1.0))) * kDeg;
    if (x_read && z_read && skew_deg > kSkewDeg)
        table.problem("z_S_in_G",
                      fmt::format("x_S_in_G and z_S_in_G are axes of one frame and should be perpendicular; they "
                                  "are {:.1f} degrees from it",
                                  skew_deg));
    const Vector y = skew_deg < 89 ? unit(cross(z, x)) : Vector{0, 1, 0};
    return {
        sensor, {cross(y, z), y, z}, share, table};  // z as it was written; x moves where they were not quite perpendicular
}

void check_jaws(Options& grasp, std::vector<JawSettings>& jaws, const std::vector<SensorSettings>& sensors) {
    std::vector<std::string> names;
    for (const auto& sensor : sensors) names.push_back(sensor.name);
    double shares = 0;
    for (auto jaw = jaws.begin(); jaw != jaws.end(); ++jaw) {
        shares += jaw->share;
        if (jaw->sensor.empty()) continue;  // reported already
        if (std::any_of(jaws.begin(), jaw, [&](const auto& j) { return j.sensor == jaw->sensor; }))
            jaw->options.problem("sensor", fmt::format("sensor = {} has a [[grasp.jaw]] already", in_quotes(jaw->sensor)));
        if (std::find(names.begin(), names.end(), jaw->sensor) != names.end()) continue;
        const auto near = nearest_name(jaw->sensor, names);
        jaw->options.problem("sensor", fmt::format("sensor = {} is no [[sensor]]; {}", in_quotes(jaw->sensor),
                                                   near ? fmt::format("did you mean \"{}\"?", *near)
                                                        : fmt::format("known: {}", fmt::join(names, ", "))));
    }
    const bool mixed = std::any_of(jaws.begin(), jaws.end(), [](const auto& j) { return j.share == 0; }) && shares > 0;
    if (mixed) grasp.problem("jaw", "give each [[grasp.jaw]] its share, or none: then all jaws of the gripper carry alike");
    if (shares > 1.001)
        grasp.problem("jaw", fmt::format("the shares of the jaws are {:g} of the weight together; 1 at most", shares));
}

}  // namespace

std::optional<GraspSettings> read_grasp(Options& root, const std::string& node_name,
                                        const std::vector<SensorSettings>& sensors, const std::string& folder) {
    if (!root.has("grasp")) return std::nullopt;
    Options table = root.table("grasp");
    GraspSettings g{};
    for (const auto& jaw : table.tables("jaw", kMaxJaws)) g.jaws.push_back(read_jaw(jaw));
    if (!table.has("jaw")) table.problem("jaw", "[grasp] has no [[grasp.jaw]]; one for each sensor that sits on a jaw");
    check_jaws(table, g.jaws, sensors);
    g.jaws_of_gripper = static_cast<int>(table.integer("jaws_of_gripper", {1, 16}, std::int64_t(g.jaws.size())));
    if (g.jaws_of_gripper < int(g.jaws.size()))
        table.problem("jaws_of_gripper",
                      fmt::format("jaws_of_gripper = {}, but {} have a sensor", g.jaws_of_gripper, g.jaws.size()));
    const auto gravity = table.numbers("gravity_G_m_s2", {-10, 10}, {3, 3});
    if (gravity.size() == 3) std::copy_n(gravity.begin(), 3, g.gravity_G_m_s2.begin());
    const double pull = length(g.gravity_G_m_s2);
    if (pull != 0 && (pull < kMinG_m_s2 || pull > kMaxG_m_s2))
        table.problem("gravity_G_m_s2", fmt::format("gravity_G_m_s2 has a length of {:.3g}; on Earth it is 9.81 m/s^2, "
                                                    "and [0, 0, 0] where its direction is not known",
                                                    pull));
    g.friction = table.number("friction", {0, 5}, 0);
    g.share_sd = table.number("share_sd", {1e-6, 1}, 0.01);
    g.margin = table.number("margin", {1, 10}, 1.5);
    g.weigh_window_ms = table.number("weigh_window_ms", {10, 1000}, 100);
    g.slip_sensitivity = table.number("slip_sensitivity", {0, 100}, 50) / 100;
    g.lift_acceleration_m_s2 = table.number("lift_acceleration_m_s2", {0, 50}, 2);
    g.lift_accelerates_ms = table.number("lift_accelerates_ms", {0, 5000}, 1000);
    const std::string objects = table.text("objects", fmt::format("/var/lib/tactiled/{}.objects.toml", node_name));
    if (objects.empty()) table.problem("objects", "objects = \"\" names no file; leave the key out for the default");
    g.objects = (std::filesystem::absolute(folder) / objects).lexically_normal().string();
    return g;
}

}  // namespace tactiled
