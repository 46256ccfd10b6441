// [grasp]: the sensors on the jaws and their orientation.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "config/names.hpp"
#include "config/tables.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxJaws = 16;                  // grasp::kMaxJaws
constexpr double kSkewDeg = 1;                        // allowed error of two axes that are configured as perpendicular
constexpr double kMinG_m_s2 = 9.7, kMaxG_m_s2 = 9.9;  // 9.76 on Huascaran, 9.83 at the poles
constexpr double kFaces = -0.2;      // cosine between the normals of two jaws that hold an object between them
constexpr double kTangential = 0.3;  // share of gravity in the plane of a skin, below which there is no weight
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

// Returns the direction of a field of the jaw; nothing, with an error, if its length is 0.
std::optional<Vector> axis(Options& table, const char* key, const Vector& v) {
    if (!table.has(key)) {
        table.problem(key, fmt::format("{} is missing; it says where this axis of the skin points in the gripper's frame G, "
                                       "for example {} = [0, 1, 0]",
                                       key, key));
        return std::nullopt;
    }
    if (std::isnan(v[0])) return std::nullopt;  // the error is reported already
    if (v[0] == 0 && v[1] == 0 && v[2] == 0) {
        table.problem(key, fmt::format("{} = [0, 0, 0] has no direction", key));
        return std::nullopt;
    }
    return unit(v);
}

JawSettings read_jaw(Options table) {
    JawSettings jaw{};
    jaw.options = table;
    read_fields(jaw_fields(), table, jaw);
    jaw.S_from_G = read_axes(table, jaw.x_S_in_G, jaw.z_S_in_G);
    return jaw;
}

void check_jaws(Options& grasp, std::vector<JawSettings>& jaws, const std::vector<SensorSettings>& sensors) {
    const std::vector<std::string> names = names_of(sensors);
    double shares = 0;
    for (auto jaw = jaws.begin(); jaw != jaws.end(); ++jaw) {
        shares += jaw->share;
        if (jaw->sensor.empty()) continue;  // the error is reported already
        if (std::any_of(jaws.begin(), jaw, [&](const auto& j) { return j.sensor == jaw->sensor; }))
            jaw->options.problem("sensor", fmt::format("sensor = {} has a [[grasp.jaw]] already", in_quotes(jaw->sensor)));
        if (std::find(names.begin(), names.end(), jaw->sensor) == names.end())
            jaw->options.problem("sensor", is_no("sensor", jaw->sensor, "sensor", names));
    }
    const bool mixed = std::any_of(jaws.begin(), jaws.end(), [](const auto& j) { return j.share == 0; }) && shares > 0;
    if (mixed) grasp.problem("jaw", "give each [[grasp.jaw]] its share, or none: then all jaws of the gripper carry alike");
    if (shares > 1.001)
        grasp.problem("jaw", fmt::format("the shares of the jaws are {:g} of the weight together; 1 at most", shares));
}

// Checks that shares add up to less than 1 if some belong to jaws without a sensor.
void check_sum_of_shares(Options& grasp, const GraspSettings& g) {
    double shares = 0;
    for (const JawSettings& jaw : g.jaws) shares += jaw.share;
    if (shares > 0 && shares < 0.998 && g.jaws_of_gripper == int(g.jaws.size()))
        grasp.problem("jaw",
                      fmt::format("all {} jaws have a sensor, but their shares are {:g} of the weight together, not 1; "
                                  "count a jaw without a sensor in jaws_of_gripper",
                                  g.jaws.size(), shares));
}

}  // namespace

std::array<Vector, 3> read_axes(Options& table, const Vector& x_written, const Vector& z_written) {
    const auto x_read = axis(table, "x_S_in_G", x_written), z_read = axis(table, "z_S_in_G", z_written);
    const Vector x = x_read.value_or(Vector{1, 0, 0}), z = z_read.value_or(Vector{0, 0, 1});
    const double skew_deg = std::abs(std::asin(std::clamp(dot(x, z), -1.0, 1.0))) * kDeg;
    if (x_read && z_read && skew_deg > kSkewDeg)
        table.problem("z_S_in_G",
                      fmt::format("x_S_in_G and z_S_in_G are axes of one frame and should be perpendicular; they "
                                  "are {:.1f} degrees from it",
                                  skew_deg));
    const Vector y = skew_deg < 89 ? unit(cross(z, x)) : Vector{0, 1, 0};
    return {cross(y, z), y, z};  // z is kept as configured; x is corrected if the two are not exactly perpendicular
}

void check_gravity(Options& table, const char* key, const Vector& gravity_m_s2) {
    const double pull = length(gravity_m_s2);
    if (gravity_m_s2 != Vector{0, 0, 0} && !(pull >= kMinG_m_s2 && pull <= kMaxG_m_s2))
        table.problem(key, fmt::format("{} has a length of {:.3g}; on Earth it is 9.81 m/s^2, and [0, 0, 0] where its "
                                       "direction is not known",
                                       key, pull));
}

const Fields<JawSettings>& jaw_fields() {
    using S = JawSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, sensor), kRequired, Text::any,
         "Name of a [[sensor]]; its contact_on_N and contact_off_N are those of the press."},
        {TACTILED_KEY(S, x_S_in_G), kRequired, range(-1000, 1000), "",
         "Direction of the skin's x axis, along its connector, in G; of any length."},
        {TACTILED_KEY(S, z_S_in_G), kRequired, range(-1000, 1000), "",
         "Direction of the skin's z axis, out of the skin, in G; perpendicular to x within 1 degree."},
        {TACTILED_KEY(S, share), Default(0.0, "0 = all jaws alike"), range(0, 1), "",
         "Fraction of the weight that this jaw carries; for all jaws or for none."},
    };
    return fields;
}

const Fields<GraspSettings>& grasp_fields() {
    using S = GraspSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, jaws_of_gripper), Default(0, "as many as there are [[grasp.jaw]]"), range(1, 16), "",
         "Number of jaws, with and without a sensor."},
        {TACTILED_KEY(S, gravity_G_m_s2), Vector{0, 0, 0}, range(-10, 10), "m/s^2",
         "Direction in which weight pulls, seen in G, with a length of 9.7 .. 9.9; [0, 0, 9.81] = the palm looks down. [0, "
         "0, 0] = not known: no weight until the PLC writes GRAVITY_X .. GRAVITY_Z."},
        {TACTILED_KEY(S, friction), 0, range(0, 5), "",
         "Friction coefficient between skin and object at the start; 0 = not known until a slip shows it."},
        {TACTILED_KEY(S, share_sd), 0.01, range(1e-6, 1), "",
         "Standard deviation of a jaw's share of the weight from grasp to grasp, where some jaws have no sensor and a known "
         "weight was shown (`tactilectl weigh known`)."},
        {TACTILED_KEY(S, margin), 1.5, range(1, 10), "", "Recommended grip divided by the minimum grip."},
        {TACTILED_KEY(S, weigh_window_ms), 100, range(10, 1000), "ms", "Time over which the weight is averaged."},
        {TACTILED_KEY(S, slip_sensitivity), 50, range(0, 100), "%",
         "100 detects the smallest slips, and false ones as well."},
        {TACTILED_KEY(S, lift_acceleration_m_s2), 2, range(0, 50), "m/s^2",
         "Largest acceleration of the arm while it lifts, where the PLC does not write it."},
        {TACTILED_KEY(S, lift_accelerates_ms), 1000, range(0, 5000), "ms",
         "Time after lift-off by which the arm no longer accelerates or brakes. A weight becomes stable weigh_window_ms "
         "later at the earliest. Set less only where it is true of the arm: otherwise a stable weight may be measured while "
         "the arm brakes. Not waited for where the PLC writes the acceleration."},
        {TACTILED_KEY(S, objects), "/var/lib/tactiled/NAME.objects.toml", Text::any,
         "File of taught objects, seen from the folder of this file. The register TEACH and `tactilectl teach` write it; "
         "the user who runs the latter must be allowed to write there."},
    };
    return fields;
}

std::optional<GraspSettings> read_grasp(Options& root, const std::string& node_name,
                                        const std::vector<SensorSettings>& sensors, const std::string& folder) {
    Options table = root.table("grasp");  // marks the table as known even if the file does not have it
    if (!root.has("grasp")) return std::nullopt;
    GraspSettings g{};
    for (const auto& jaw : table.tables("jaw", kMaxJaws)) g.jaws.push_back(read_jaw(jaw));
    read_fields(grasp_fields(), table, g, node_name);
    if (!table.has("jaw")) table.problem("jaw", "[grasp] has no [[grasp.jaw]]; add one for each sensor on a jaw");
    check_jaws(table, g.jaws, sensors);
    if (g.jaws_of_gripper == 0) g.jaws_of_gripper = int(g.jaws.size());
    if (g.jaws_of_gripper < int(g.jaws.size()))
        table.problem("jaws_of_gripper",
                      fmt::format("jaws_of_gripper = {}, but {} have a sensor", g.jaws_of_gripper, g.jaws.size()));
    check_sum_of_shares(table, g);
    check_gravity(table, "gravity_G_m_s2", g.gravity_G_m_s2);
    g.slip_sensitivity /= 100;
    if (g.objects.empty()) table.problem("objects", "objects = \"\" names no file; leave the key out for the default");
    // A configuration without a folder in its name is in the current folder; absolute("") would throw.
    g.objects = (std::filesystem::absolute(folder.empty() ? "." : folder) / g.objects).lexically_normal().string();
    return g;
}

std::vector<std::string> grasp_advice(const GraspSettings& g) {
    std::vector<std::string> advice;
    const double pull = length(g.gravity_G_m_s2);
    for (const JawSettings& jaw : g.jaws) {
        const Vector& z = jaw.S_from_G[2];
        const bool faces = std::any_of(g.jaws.begin(), g.jaws.end(),
                                       [&](const JawSettings& other) { return dot(z, other.S_from_G[2]) < kFaces; });
        if (g.jaws_of_gripper == int(g.jaws.size()) && g.jaws.size() > 1 && !faces)
            advice.push_back(
                fmt::format("[[grasp.jaw]] \"{}\" faces no other jaw: z_S_in_G = [{:g}, {:g}, {:g}] points out of "
                            "its skin, towards the object; the balance of the presses is not checked",
                            jaw.sensor, jaw.z_S_in_G[0], jaw.z_S_in_G[1], jaw.z_S_in_G[2]));
        if (pull > 0 && length(cross(z, g.gravity_G_m_s2)) < kTangential * pull)
            advice.push_back(
                fmt::format("[[grasp.jaw]] \"{}\": gravity points into its skin, so it measures no weight: check "
                            "z_S_in_G and gravity_G_m_s2",
                            jaw.sensor));
    }
    return advice;
}

}  // namespace tactiled
