// Converts the forces of sensors in their own frames to the wrench that the world exerts on the gripper, in the gripper's
// frame G: rotated, about the origin of G, minus the weight of the part of the hand that each sensor carries. It never
// fails: an unknown value is NaN, and `why` has the reason.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "tactiled/layout.h"

namespace tactiled::tool {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kDown_rad = 0.01;  // uncertainty of the direction of gravity
using Vector = std::array<double, 3>;

// A sensor and the part of the hand that it carries: the part between its skin and the world, or for a wrist sensor the
// whole hand. v_S = S_from_G v_G.
struct SensorSetup {
    std::uint32_t sensor = 0;  // index in the node
    std::array<Vector, 3> S_from_G{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    Vector position_G_m{};  // origin of S: the lever arm
    double mass_kg = 0, mass_sd_kg = 0;
    Vector centre_G_m{};  // centre of that mass
    double centre_sd_m = 0;
    Vector zero_S_N{}, zero_S_Nm{};  // raw reading without load and weight, used if no tare is in force
    double zero_sd_N = 0, zero_sd_Nm = 0;

    bool operator==(const SensorSetup&) const = default;
};

struct Setup {
    std::vector<SensorSetup> sensors;
    Vector gravity_G_m_s2{};       // until a command changes it; all 0: unknown
    double acceleration_m_s2 = 2;  // the largest of the arm, used if none is reported
    double accelerates_ms = 1000;  // maximum duration of an acceleration; afterwards a steady force shows a hand at rest

    bool operator==(const Setup&) const = default;
};

// The raw wrench of one sensor at one instant and the zero of its tare.
struct Sample {
    std::uint64_t t_ns = 0;
    std::array<double, 6> raw_S{}, tare_S{}, sd{};  // force in N, torque in Nm; raw_S includes tare_S
    tactiled_budget budget{};                       // the parts of sd
    tactiled_quality quality = TACTILED_BAD;
    std::uint32_t tare_count = 0;  // 0: no tare is in force
    bool taring = false;
};

class Tool {
public:
    explicit Tool(const Setup& setup);

    // Processes the next sample of sensor `index` of the setup. rt: wait-free
    void sample(std::size_t index, const Sample& sample) noexcept;

    // Data of the robot in G; NaN: no longer known. rt: wait-free
    void gravity(const Vector& gravity_G_m_s2) noexcept;
    void acceleration(const Vector& acceleration_G_m_s2,
                      std::uint64_t t_ns) noexcept;  // acceleration of the hand; valid for 100 ms

    // rt: bounded by the sensors
    [[nodiscard]] tactiled_tool state() const noexcept;

    // Takes over the state of `before`, which had another configuration. rt: wait-free
    void succeed(const Tool& before) noexcept;

private:
    struct Sensor {
        SensorSetup setup;
        Sample last{};
        bool seen = false;
        Vector tare_gravity_G{kNaN, kNaN, kNaN};  // at the time of the tare; NaN: unknown
        bool tare_assumed = false;                // tared with the configured gravity: invalid if the robot reports another
        std::uint32_t changes_before = 0;         // number of changes of gravity before the present tare began
    };
    struct Turned {
        std::uint32_t why = 0;  // enum tactiled_tool_why
        std::array<double, 6> wrench_G{};
        // [component in G][component in S]: the part of the sensor's error in that of wrench_G
        std::array<std::array<double, 6>, 6> weight{};
        std::array<double, 6> variance{};  // of zero and hand; that of the sensor is not in it
        std::array<double, 6> common{};    // standard deviation that is common to all sensors, added linearly
    };
    [[nodiscard]] Turned turned(const Sensor& sensor, const Vector& pull_G, double unknown_m_s2) const noexcept;
    [[nodiscard]] bool reports_acceleration() const noexcept;
    void follow_rest(Sensor& sensor) noexcept;

    std::vector<Sensor> sensors_;
    Vector gravity_G_, acceleration_G_{};
    double max_acceleration_m_s2_;
    std::uint64_t accelerates_ns_;
    bool gravity_known_ = false, gravity_told_ = false;
    std::uint32_t gravity_changes_ = 0;
    std::uint64_t acceleration_ns_ = 0, t_ns_ = 0;
    bool acceleration_reported_ = false;
    // State of the hand at rest: the steady forces, and the time since which they are steady.
    std::vector<Vector> rest_S_N_;
    std::uint64_t moved_ns_ = 0;
};

}  // namespace tactiled::tool
