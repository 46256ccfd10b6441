#include "decoupling/tool/tool.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "tactiled/uncertainty.h"

namespace tactiled::tool {
namespace {

constexpr std::uint64_t kFresh_ns = 100'000'000;  // maximum age of a reported acceleration
constexpr std::uint64_t kApart_ns = 50'000'000;   // maximum difference in time of the samples of one sum
constexpr double kMinG_m_s2 = 9.69,
                 kMaxG_m_s2 = 9.91;                // on Earth, with rounding
constexpr double kNoPart = 1e-6;                   // a smaller part of an axis is the rounding of a rotation
constexpr double kSteady_sds = 4, kSteady = 0.02;  // times the sensor's noise; part of the weight that the sensor carries

using Vector3 = Eigen::Vector3d;

Vector3 eigen(const Vector& v) noexcept { return {v[0], v[1], v[2]}; }

// Rotates v_S into v_G, with NaN only for components that depend on an unmeasured component.
Vector3 to_G(const std::array<Vector, 3>& S_from_G, const Vector3& v_S) noexcept {
    Vector3 v_G = Vector3::Zero();
    for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t i = 0; i < 3; ++i)
            if (std::abs(S_from_G[k][i]) > kNoPart) v_G[Eigen::Index(i)] += S_from_G[k][i] * v_S[Eigen::Index(k)];
    return v_G;
}

Vector3 to_S(const std::array<Vector, 3>& S_from_G, const Vector3& v_G) noexcept {
    Vector3 v_S;
    for (std::size_t k = 0; k < 3; ++k) v_S[Eigen::Index(k)] = eigen(S_from_G[k]).dot(v_G);
    return v_S;
}

// arm x force, with NaN only for components that depend on an unmeasured force.
Vector3 cross(const Vector3& arm, const Vector3& f) noexcept {
    const auto times = [](double a, double b) { return std::abs(a) > 0 ? a * b : 0.0; };
    return {times(arm.y(), f.z()) - times(arm.z(), f.y()), times(arm.z(), f.x()) - times(arm.x(), f.z()),
            times(arm.x(), f.y()) - times(arm.y(), f.x())};
}

bool is_known(const Vector& v) noexcept { return std::isfinite(v[0] + v[1] + v[2]); }

}  // namespace

Tool::Tool(const Setup& setup)
    : gravity_G_(setup.gravity_G_m_s2),
      max_acceleration_m_s2_(setup.acceleration_m_s2),
      accelerates_ns_(std::uint64_t(setup.accelerates_ms * 1e6)) {
    assert(setup.sensors.size() <= TACTILED_MAX_SENSORS);
    for (const SensorSetup& s : setup.sensors) {
        assert(s.sensor < TACTILED_MAX_SENSORS);
        sensors_.push_back({.setup = s});
    }
    rest_S_N_.assign(sensors_.size(), Vector{kNaN, kNaN, kNaN});
    gravity_known_ = eigen(gravity_G_).norm() > kMinG_m_s2 && eigen(gravity_G_).norm() < kMaxG_m_s2;
}

void Tool::gravity(const Vector& gravity_G_m_s2) noexcept {
    const double size = eigen(gravity_G_m_s2).norm();
    const bool known = size > kMinG_m_s2 && size < kMaxG_m_s2;  // false for NaN
    const bool same = known && gravity_known_ && (eigen(gravity_G_m_s2) - eigen(gravity_G_)).norm() < kDown_rad * size;
    if (!same) {
        ++gravity_changes_;
        for (Sensor& sensor : sensors_)
            if (sensor.tare_assumed) sensor.tare_gravity_G = {kNaN, kNaN, kNaN};
    }
    for (Sensor& sensor : sensors_) sensor.tare_assumed = false;
    gravity_told_ = true;
    gravity_known_ = known;
    gravity_G_ = gravity_G_m_s2;
}

void Tool::acceleration(const Vector& acceleration_G_m_s2, std::uint64_t t_ns) noexcept {
    acceleration_reported_ = eigen(acceleration_G_m_s2).norm() < 1000;  // false for NaN
    if (acceleration_reported_) acceleration_G_ = acceleration_G_m_s2;
    acceleration_ns_ = t_ns;
}

bool Tool::reports_acceleration() const noexcept {
    return acceleration_reported_ && t_ns_ < acceleration_ns_ + kFresh_ns && acceleration_ns_ < t_ns_ + kFresh_ns;
}

// The zero of a tare contains the weight of the hand in its orientation at that time.
void Tool::sample(std::size_t index, const Sample& sample) noexcept {
    if (index >= sensors_.size()) return;
    Sensor& sensor = sensors_[index];
    if (sample.taring && !sensor.last.taring) sensor.changes_before = gravity_changes_;
    if (sample.tare_count != 0 && (!sensor.seen || sample.tare_count != sensor.last.tare_count)) {
        const bool measured = sensor.seen && sensor.last.taring && sensor.changes_before == gravity_changes_;
        const bool assumed = !gravity_told_;  // a hand whose configured orientation does not change
        sensor.tare_gravity_G = gravity_known_ && (measured || assumed) ? gravity_G_ : Vector{kNaN, kNaN, kNaN};
        sensor.tare_assumed = assumed;
    }
    sensor.last = sample;
    sensor.seen = true;
    t_ns_ = std::max(t_ns_, sample.t_ns);
    follow_rest(sensor);
}

// A steady force shows a hand at rest, because no arm accelerates for longer than accelerates_ms.
void Tool::follow_rest(Sensor& sensor) noexcept {
    Vector& rest = rest_S_N_[std::size_t(&sensor - sensors_.data())];
    if (sensor.setup.mass_kg <= 0) return;
    const double weight_N = sensor.setup.mass_kg * (gravity_known_ ? eigen(gravity_G_).norm() : 9.81);
    bool steady = sensor.last.quality != TACTILED_BAD;
    for (std::size_t k = 0; k < 3 && steady; ++k) {
        if (std::isnan(sensor.last.raw_S[k])) continue;
        steady = std::abs(sensor.last.raw_S[k] - rest[k]) <= std::max(kSteady * weight_N, kSteady_sds * sensor.last.sd[k]);
    }
    if (steady) return;
    std::copy_n(sensor.last.raw_S.begin(), 3, rest.begin());
    moved_ns_ = t_ns_;
}

Tool::Turned Tool::turned(const Sensor& sensor, const Vector& pull_G, double unknown_m_s2) const noexcept {
    const SensorSetup& s = sensor.setup;
    Turned out;
    out.wrench_G.fill(kNaN);
    const bool carries = s.mass_kg > 0, tared = sensor.last.tare_count != 0;
    if (!sensor.seen || sensor.last.quality == TACTILED_BAD || sensor.last.quality == TACTILED_NO_VALUE)
        out.why |= TACTILED_TOOL_SENSOR;
    if (carries && !is_known(pull_G)) out.why |= TACTILED_TOOL_GRAVITY;
    if (carries && tared && !is_known(sensor.tare_gravity_G)) out.why |= TACTILED_TOOL_TARE;
    if (out.why != 0) return out;
    if (sensor.last.quality != TACTILED_GOOD) out.why |= TACTILED_TOOL_DOUBTED;

    const auto part = [](const std::array<double, 6>& six, Eigen::Index from) {
        return Vector3(six[std::size_t(from)], six[std::size_t(from + 1)], six[std::size_t(from + 2)]);
    };
    Vector3 force_S = part(sensor.last.raw_S, 0), torque_S = part(sensor.last.raw_S, 3);
    Vector3 hangs_G = carries ? eigen(pull_G) : Vector3::Zero();
    if (tared) {
        force_S -= part(sensor.last.tare_S, 0);
        torque_S -= part(sensor.last.tare_S, 3);
        if (carries) hangs_G -= eigen(sensor.tare_gravity_G);
    } else {
        force_S -= eigen(s.zero_S_N);
        torque_S -= eigen(s.zero_S_Nm);
    }
    const Vector3 position_G = eigen(s.position_G_m), arm_G = eigen(s.centre_G_m) - position_G;
    const Vector3 weight_G = s.mass_kg * hangs_G;
    const Vector3 force_G = to_G(s.S_from_G, force_S - to_S(s.S_from_G, weight_G));
    const Vector3 torque_G =
        to_G(s.S_from_G, torque_S - to_S(s.S_from_G, arm_G.cross(weight_G))) + cross(position_G, force_G);

    // torque_G = R torque_S + position x (R force_S), with the columns of R in S_from_G.
    for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t i = 0; i < 3; ++i) {
            const double turn = std::abs(s.S_from_G[k][i]) > kNoPart ? s.S_from_G[k][i] : 0;
            out.weight[i][k] = out.weight[i + 3][k + 3] = turn;
        }
    for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t i = 0; i < 3; ++i) {
            const std::size_t a = (i + 1) % 3, b = (i + 2) % 3;
            out.weight[i + 3][k] = s.position_G_m[a] * out.weight[b][k] - s.position_G_m[b] * out.weight[a][k];
        }

    const auto square = [](double x) { return x * x; };
    const double hangs = hangs_G.norm(), mass_N = s.mass_sd_kg * hangs;
    const double of_force = square(tared ? 0 : s.zero_sd_N) + square(mass_N);
    const double of_torque =
        square(tared ? 0 : s.zero_sd_Nm) + square(mass_N * arm_G.norm()) + square(s.centre_sd_m * weight_G.norm());
    // Common errors of all sensors: direction of gravity, now and at the tare, and an unreported acceleration.
    const double pulls = carries ? eigen(pull_G).norm() * kDown_rad * (tared ? std::sqrt(2.0) : 1) : 0;
    const double common_N = s.mass_kg * std::hypot(pulls, unknown_m_s2);
    for (std::size_t i = 0; i < 3; ++i) {
        const auto at = Eigen::Index(i);
        out.wrench_G[i] = force_G[at];
        out.wrench_G[i + 3] = torque_G[at];
        const std::size_t a = (i + 1) % 3, b = (i + 2) % 3;
        out.variance[i] = of_force;
        out.variance[i + 3] = of_torque + (square(s.position_G_m[a]) + square(s.position_G_m[b])) * of_force;
        out.common[i] = common_N;
        out.common[i + 3] = common_N * eigen(s.centre_G_m).norm();
    }
    if (!std::isfinite(torque_G.sum())) out.why |= TACTILED_TOOL_TORQUE;
    return out;
}

tactiled_tool Tool::state() const noexcept {
    tactiled_tool out{};
    if (sensors_.empty()) return out;
    out.quality = tactiled_tool_verdict(TACTILED_TOOL_SENSOR);
    tactiled_forget_tool(&out);
    Vector pull_G = gravity_known_ ? gravity_G_ : Vector{kNaN, kNaN, kNaN};
    const bool reported = reports_acceleration(), rests = t_ns_ >= moved_ns_ + accelerates_ns_;
    for (std::size_t i = 0; i < 3; ++i) {
        out.gravity_G_m_s2[i] = float(pull_G[i]);
        if (reported) pull_G[i] -= acceleration_G_[i];
    }
    const double unknown_m_s2 = reported || rests ? 0 : max_acceleration_m_s2_ / std::sqrt(3.0);
    std::array<double, 6> sum{}, variance{}, common{};
    std::array<const tactiled_budget*, TACTILED_MAX_SENSORS> budget{};
    double weight[6][TACTILED_MAX_SENSORS][6];
    out.t_ns = UINT64_MAX;
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
        const Sensor& sensor = sensors_[s];
        const std::uint32_t n = sensor.setup.sensor;
        const Turned t = turned(sensor, pull_G, unknown_m_s2);
        out.sensors |= 1u << n;
        out.why |= t.why;
        out.mass_kg += float(sensor.setup.mass_kg);
        out.sensor_quality[n] = tactiled_tool_verdict(t.why);
        out.t_ns = std::min(out.t_ns, sensor.last.t_ns);
        out.t_newest_ns = std::max(out.t_newest_ns, sensor.last.t_ns);
        if (out.sensor_quality[n] == TACTILED_BAD) out.bad |= 1u << n;
        budget[s] = &sensor.last.budget;
        for (std::size_t i = 0; i < 6; ++i) {
            std::copy(t.weight[i].begin(), t.weight[i].end(), weight[i][s]);
            const double of_sensor = tactiled_variance_of_sum(&budget[s], weight[i] + s, 1) + t.variance[i];
            auto& value = i < 3 ? out.sensor_force_G_N[n][i] : out.sensor_torque_G_Nm[n][i - 3];
            auto& sd = i < 3 ? out.sensor_sd_force_N[n][i] : out.sensor_sd_torque_Nm[n][i - 3];
            value = float(t.wrench_G[i]);
            sd = std::isnan(t.wrench_G[i]) ? float(kNaN) : float(std::sqrt(of_sensor + t.common[i] * t.common[i]));
            sum[i] += t.wrench_G[i];
            variance[i] += t.variance[i];
            common[i] += t.common[i];
        }
    }
    if (out.mass_kg > 0 && unknown_m_s2 > 0) out.why |= TACTILED_TOOL_MOVES;
    if (out.t_newest_ns > out.t_ns + kApart_ns) out.why |= TACTILED_TOOL_APART;
    out.quality = tactiled_tool_verdict(out.why);
    if (out.quality == TACTILED_BAD) return out;
    for (std::size_t i = 0; i < 6; ++i)
        variance[i] += tactiled_variance_of_sum(budget.data(), weight[i], unsigned(sensors_.size())) + common[i] * common[i];
    for (std::size_t i = 0; i < 3; ++i) {
        out.force_G_N[i] = sum[i];
        out.torque_G_Nm[i] = sum[i + 3];
        out.sd_force_N[i] = std::sqrt(variance[i]);
        out.sd_torque_Nm[i] = std::sqrt(variance[i + 3]);
    }
    return out;
}

void Tool::succeed(const Tool& before) noexcept {
    if (before.gravity_told_) {
        gravity_G_ = before.gravity_G_;
        gravity_known_ = before.gravity_known_;
        gravity_told_ = true;
    }
    acceleration_G_ = before.acceleration_G_;
    acceleration_ns_ = before.acceleration_ns_;
    acceleration_reported_ = before.acceleration_reported_;
    t_ns_ = before.t_ns_;
    moved_ns_ = t_ns_;
    for (Sensor& sensor : sensors_)
        for (const Sensor& was : before.sensors_)
            if (was.setup.sensor == sensor.setup.sensor) {
                sensor.last = was.last;
                sensor.seen = was.seen;
                sensor.tare_gravity_G = was.tare_gravity_G;
                sensor.tare_assumed = was.tare_assumed;
                sensor.changes_before = was.changes_before;
                if (!gravity_told_ && was.tare_assumed)
                    sensor.tare_gravity_G = gravity_known_ ? gravity_G_ : was.tare_gravity_G;
            }
}

}  // namespace tactiled::tool
