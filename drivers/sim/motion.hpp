// The motions of a scene: a sequence of segments, each of which moves the state of the contact from its present value
// to a target. They can be evaluated at any time, and their extremes are known without a run.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "config/options.hpp"
#include "drivers/sim/block.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

struct Body {
    enum class Shape { flat, sphere, edge, textured, cylinder, fingers } shape = Shape::flat;
    // Radius of a sphere, a cylinder or a fingertip, half width of an edge's contact; a flat body covers the sensor.
    double radius_m = 5e-3;
    // On an array of taxels: length of an edge or a cylinder, distance of two fingertips, along a line at this angle to x.
    double length_m = 10e-3, apart_m = 10e-3, turn_rad = 0;
    double stiffness_Pa = 3e9;  // Young's modulus
    double friction = 0.8, kinetic_friction = 0.7;
    double mass_kg = 0;
    double temperature_K = 0;  // relative to the temperature at the scene's begin
    double texture_pitch_m = 1e-3, texture_height_m = 0;
    double adhesion_J_m2 = 0;
};

// State of the contact, in the scene's directions.
struct State {
    double press_N = 0;                     // > 0 under a press
    double shear_N = 0, direction_rad = 0;  // towards which the body pulls the skin
    double x_m = 0, y_m = 0;                // centre of contact
    double speed_m_s = 0;                   // sliding speed
    double ambient_K = 0, body_K = 0;       // relative to the temperature at the scene's begin
    double acceleration_m_s2 = 0;           // acceleration of the sensors, against gravity

    bool operator==(const State&) const = default;
};

// Course of a motion from its start to its end, u = 0 .. 1.
enum class Course { linear, smooth, at_once };
// Addition during the motion: none, amplitude * sin(phase), its sign, or half a sine over the whole motion.
enum class Wave { none, sine, square, pulse };

struct Segment {
    double begin_s = 0, end_s = 0;
    State from, to;
    Course course = Course::linear;
    Wave wave = Wave::none;
    bool wave_on_press = true;  // else the wave is on the shear
    double amplitude_N = 0;
    double from_Hz = 0, to_Hz = 0;  // start and end frequency of a linear sine sweep
    double slid_m = 0;              // path slid before this segment
    bool still = false;             // nothing changes during the segment
    std::string kind;               // name in the scene
    std::uint32_t line = 0;
};

// Largest values over a scene (or its beginning) at one sensor, with its share and rotation: the input of bounds.
struct Extent {
    Load max{};    // |load|: N, Nm
    Load span{};   // maximum minus minimum, including the 0 before the scene
    Load rate{};   // |d load / dt|, N/s, Nm/s, outside jumps
    Load jump{};   // largest immediate change
    Load added{};  // by effects of the contact, at any instant and in any order
    // largest decrease of a load through them, if the scene's own load never decreases
    Load back{};
    double jump_every_s = 1e300;  // minimum time between two jumps that are not of one wave
    double press_min_N = 0;       // minimum press while a shear acts
    double shear_excess_N = 0;    // largest of shear - friction * press, >= 0
    double kinetic_excess_N = 0;  // the same with the kinetic friction
    bool reverses = false;        // some component of the load decreases at some time
    double frequency_Hz = 0;      // highest frequency of a sine, 0 if there is none
    double speed_m_s = 0, slide_m = 0;
    double x_m = 0, y_m = 0;  // |centre of contact| in the sensor's frame
    double moved_m = 0;       // largest distance of the centre of contact from its first place
    // largest |difference| from the beginning; of the body from the ambient temperature
    double ambient_K = 0, body_K = 0;
    double ambient_rate_K_s = 0;
    double acceleration_m_s2 = 0;
    double length_s = 0;
    double stretch = 1, slack_s = 0;  // by effects of time: samples nominally t apart may be stretch * t + slack_s apart

    [[nodiscard]] double apart_s(double seconds) const { return stretch * seconds + slack_s; }
    // Largest change of a component of the load within that time.
    [[nodiscard]] double change(Axis axis, double seconds) const;
    [[nodiscard]] Load changes(double seconds) const;  // for each component
};

class Motion {
public:
    Motion() = default;
    // setup
    Motion(std::vector<Segment> segments, const Body& body);

    // Fills load, x_m, y_m, radius_m, slide_m, speed_m_s, ambient_K, body_K and acceleration_m_s2 from t_s, for
    // block.n samples. Before and after the scene the state is constant. rt: wait-free
    void fill(Block& block, const Sensor& sensor) const noexcept;

    // Extremes over the segments `first` to `last`, both included; all by default. setup
    [[nodiscard]] Extent extent(const Sensor& sensor, std::size_t first = 0, std::size_t last = SIZE_MAX) const;

    [[nodiscard]] double length_s() const { return segments_.empty() ? 0 : segments_.back().end_s; }
    [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }

private:
    std::vector<Segment> segments_;
    Body body_;
};

// Half the width of the contact before any effect changes it: the body's radius; a flat body covers the sensor.
// rt: wait-free
double contact_radius(const Body& body, const Sensor& sensor) noexcept;
// True if the contact on the sensor's array grows with the press, as a sphere's does. rt: wait-free
bool grows(const Body& body, const Sensor& sensor) noexcept;
// Half the width of the contact on an array under a press on all of it: for a sphere by Hertz with the skin's
// stiffness, at least 1 um; else as contact_radius(). rt: wait-free
double footprint_m(const Body& body, const Sensor& sensor, double press_N) noexcept;
// True if the body covers all taxels of the sensor's array equally, of either kind. rt: wait-free
bool covers_array(const Body& body, const Sensor& sensor) noexcept;

// Reads the [[motion]] tables of a scene. Errors go to the options' Problems. setup
Motion read_motion(Options& scene, const Body& body, double rate_Hz);

}  // namespace tactiled::sim
