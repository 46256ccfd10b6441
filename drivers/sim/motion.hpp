// What happens in a scene: a sequence of motions, each of which takes the state of the contact from where it is to where it
// shall be. Evaluated at any time; its extremes are known without running it.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "config/options.hpp"
#include "drivers/sim/block.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

// The body that touches the sensors.
struct Body {
    enum class Shape { flat, sphere, edge, textured } shape = Shape::flat;
    double radius_m = 5e-3;     // of a sphere or an edge's contact; a flat body covers the sensor
    double stiffness_Pa = 3e9;  // Young's modulus
    double friction = 0.8, kinetic_friction = 0.7;
    double mass_kg = 0;
    double temperature_K = 0;  // above that at which the scene begins
    double texture_pitch_m = 1e-3, texture_height_m = 0;
    double adhesion_J_m2 = 0;
};

// The contact's state, in the scene's directions.
struct State {
    double press_N = 0;                     // > 0 while pressing
    double shear_N = 0, direction_rad = 0;  // towards which the body pulls the skin
    double x_m = 0, y_m = 0;                // centre of contact
    double speed_m_s = 0;                   // of sliding
    double ambient_K = 0, body_K = 0;       // above that at which the scene began
    double acceleration_m_s2 = 0;           // of the sensors, against gravity

    bool operator==(const State&) const = default;
};

// Course of a motion from its start to its end, u = 0 .. 1.
enum class Course { linear, smooth, at_once };
// What it adds on the way: nothing, amplitude * sin(phase), its sign, or half a sine over the whole motion.
enum class Wave { none, sine, square, pulse };

struct Segment {
    double begin_s = 0, end_s = 0;
    State from, to;
    Course course = Course::linear;
    Wave wave = Wave::none;
    bool wave_on_press = true;  // else on the shear
    double amplitude_N = 0;
    double from_Hz = 0, to_Hz = 0;  // a sine's frequency goes linearly from one to the other
    double slid_m = 0;              // path slid before it
    bool still = false;             // without any change
    std::string kind;               // as the scene names it
    std::uint32_t line = 0;
};

// Largest values over a scene (or its beginning) at one sensor, its share and turn included: what bounds are made of.
struct Extent {
    std::array<double, kAxes> max{};    // |load|: N, Nm
    std::array<double, kAxes> span{};   // largest less least, the 0 before the scene included
    std::array<double, kAxes> rate{};   // |d load / dt|, N/s, Nm/s, where it is no jump
    std::array<double, kAxes> jump{};   // largest change at once
    std::array<double, kAxes> added{};  // by effects of the contact, at any instant and in any order
    std::array<double, kAxes> back{};   // how far a load may come back through them, where the scene's own never does
    double jump_every_s = 1e300;        // least time between two jumps that are not of one wave
    double press_min_N = 0;             // while a shear acts
    double shear_excess_N = 0;          // largest of shear - friction * press, >= 0
    double kinetic_excess_N = 0;        // the same with the kinetic friction
    bool reverses = false;              // some component of the load ever comes back
    double frequency_Hz = 0;            // highest of a sine, 0 where there is none
    double speed_m_s = 0, slide_m = 0;
    double x_m = 0, y_m = 0;           // |centre of contact| in the sensor's frame
    double moved_m = 0;                // largest distance of the centre of contact from its first place
    double ambient_K = 0, body_K = 0;  // largest |difference| from the beginning; of the body from the ambient temperature
    double ambient_rate_K_s = 0;
    double acceleration_m_s2 = 0;
    double length_s = 0;
    double stretch = 1, slack_s = 0;  // by effects of time: what lies t apart may be taken stretch * t + slack_s apart

    [[nodiscard]] double apart_s(double seconds) const { return stretch * seconds + slack_s; }
    // The largest change of a component of the load within so many seconds.
    [[nodiscard]] double change(Axis axis, double seconds) const;
    [[nodiscard]] std::array<double, kAxes> changes(double seconds) const;  // of each
};

class Motion {
public:
    Motion() = default;
    // setup
    Motion(std::vector<Segment> segments, const Body& body);

    // t_s -> load, x_m, y_m, radius_m, slide_m, speed_m_s, ambient_K, body_K, acceleration_m_s2, for block.n samples.
    // Before the scene and after it the state stands still. rt: wait-free
    void fill(Block& block, const Sensor& sensor) const noexcept;

    // While segments `first` to `last` last, both included; all by default. setup
    [[nodiscard]] Extent extent(const Sensor& sensor, std::size_t first = 0, std::size_t last = SIZE_MAX) const;

    [[nodiscard]] double length_s() const { return segments_.empty() ? 0 : segments_.back().end_s; }
    [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }

private:
    std::vector<Segment> segments_;
    Body body_;
};

// Half the width of the contact before any effect changes it: the body's radius; a flat body covers the sensor. rt:
// wait-free
double contact_radius(const Body& body, const Sensor& sensor) noexcept;
// True if the contact on the sensor's array grows with the press: a sphere's. rt: wait-free
bool grows(const Body& body, const Sensor& sensor) noexcept;
// Half the width of the contact on an array under a press on all of it: a sphere's by Hertz with the skin's stiffness, at
// least 1 um; else as contact_radius(). rt: wait-free
double footprint_m(const Body& body, const Sensor& sensor, double press_N) noexcept;
// True if the body lies on all taxels of the sensor's array alike. rt: wait-free
bool covers_array(const Body& body, const Sensor& sensor) noexcept;

// Reads the [[motion]] tables of a scene. Errors go to the options' Problems. setup
Motion read_motion(Options& scene, const Body& body, double rate_Hz);

}  // namespace tactiled::sim
