// Computes from the forces of the jaws the state of the gripper and of its object: contact, grip, slip, weight,
// object id. It never fails: a value that is not known is NaN, and its state says so.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tactiled/layout.h"

namespace tactiled::grasp {

inline constexpr std::size_t kMaxJaws = 16;
inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
using Vector = std::array<double, 3>;

// One jaw with a sensor. Its skin's frame S is rotated against the gripper's frame G (z out of the palm, the
// direction is the robot's tool flange's): v_S = S_from_G * v_G, rows of an orthonormal matrix.
struct JawSetup {
    std::uint32_t sensor = 0;  // number in the node: index of slip_state ...
    std::array<Vector, 3> S_from_G{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    double share = 0;  // part of the weight on this jaw; 0: equal parts for all jaws of the gripper
    double contact_on_N = 0.5, contact_off_N = 0.3;  // thresholds of the press; at least the noise of the free phase
    double full_scale_N[3] = {0, 0, 0};              // OVERLOAD above it; 0 = not known
    bool errs_by_gain = false;  // the calibration's error is a smooth curve through 0, as measured for hairs: one known
                                // weight corrects most of it

    bool operator==(const JawSetup&) const = default;
};

struct Setup {
    std::vector<JawSetup> jaws;
    unsigned jaws_of_gripper = 0;  // with and without a sensor; 0: `jaws`
    Vector gravity_G{0, 0, 0};     // m/s^2, until a command changes it; all 0: not known, no weight
    double friction = 0;           // initial value; 0: not known until the first slip
    double share_sd = 0.01;        // sd of a jaw's share from grasp to grasp, after a known weight; before it, 0.1
    double margin = 1.5;           // recommended grip / least grip
    double weigh_window_ms = 100;  // a weight is a mean over this time
    // The largest acceleration of the arm where none is reported, and how long after lift-off it lasts at
    // most. 1 s is longer than picks take: a longer time delays a weight, and during a shorter one the arm's
    // braking may be weighed.
    double lift_acceleration_m_s2 = 2;
    double lift_accelerates_ms = 1000;

    bool operator==(const Setup&) const = default;
};

// Returns an upper bound of the acceleration along gravity of a swing of the hand at this frequency from the lift on, for
// which the load may seem to be at rest at a crest of the swing, over a window of that length. At the crest the load a(t) =
// a cos(2 pi f t) bends by a (2 pi f W)^2 / 16 between the outer and the inner quarters of the window W, and the weight is
// judged at rest up to a relative bend. Infinite: a crest of any size looks at rest. rt: wait-free
double max_hidden_swing_m_s2(double frequency_Hz, double weigh_window_ms) noexcept;

// A taught object: its mass, and the sd of the mass from grasp to grasp.
struct Object {
    std::uint32_t id = 0;  // > 0
    std::string name;
    double mass_kg = 0, sd_kg = 0;
};

// The sample of one sensor at one time: tared, not low-passed, frame S.
struct JawSample {
    std::uint64_t t_ns = 0;
    std::array<double, 3> force_S_N{}, sd_N{};
    tactiled_quality quality = TACTILED_BAD;
    std::uint32_t reasons = 0;  // enum tactiled_reason
};

enum class Hint : std::uint32_t { open = 0, closing = 1, closed = 2, lifting = 3, moving = 4, opening = 5, none = 0xFFFF };

class Grasp {
public:
    // setup: asserts 1 .. kMaxJaws jaws; the caller has checked `setup`
    explicit Grasp(const Setup& setup);
    ~Grasp();
    Grasp(Grasp&&) noexcept;
    Grasp& operator=(Grasp&&) noexcept;

    // Processes one sample of jaw `jaw`, in the order of arrival. rt: wait-free
    void sample(std::size_t jaw, const JawSample& sample) noexcept;

    // Returns the state at `now_ns`. The caller must have passed a BAD sample for a jaw without a sample for longer than
    // stale_ns.
    // rt: wait-free
    [[nodiscard]] tactiled_grasp state() const noexcept;

    // Data from the robot or the PLC. NaN or Hint::none: no longer known. rt: wait-free
    void hint(Hint gripper) noexcept;
    void gravity(const Vector& gravity_G_m_s2) noexcept;
    void acceleration(const Vector& acceleration_G_m_s2, std::uint64_t t_ns) noexcept;  // valid for 100 ms

    // Commands; false: not possible now. rt: wait-free
    bool start_weighing() noexcept;  // at once, in any state of the grasp
    bool stop_weighing() noexcept;
    bool zero_weight() noexcept;  // tares the stable load, until this grasp ends
    // Sets the scale of the shares from the present load, which weighs `mass_kg`. The load must be stable and, except for
    // the uncertainty of the share, known to 5 %; before the lift the reading in the grip was at most 5 % of it, and there
    // must be no tare. 0 is accepted at any time and removes the scale.
    bool known_weight(double mass_kg) noexcept;
    void clear_slips(std::uint32_t sensor_mask) noexcept;
    void slip_sensitivity(double zero_to_one) noexcept;
    void weigh_window(double ms) noexcept;
    // Copies at most kMaxObjects of them. rt: wait-free
    void objects(std::span<const Object> objects) noexcept;
    static constexpr std::size_t kMaxObjects = 32;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace tactiled::grasp
