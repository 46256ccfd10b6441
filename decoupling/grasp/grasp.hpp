// From the forces of the jaws to what the gripper does with what it holds: contact, grip, slip, weight, which object.
// It never fails: what it cannot know it says, and a value that is not known is NaN.
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

// One jaw that carries a sensor. Its skin's frame S is turned against the gripper's frame G (z out of the palm, the
// direction is the robot's tool flange's): v_S = S_from_G * v_G, rows of an orthonormal matrix.
struct JawSetup {
    std::uint32_t sensor = 0;  // of the node: index of slip_state ...
    std::array<Vector, 3> S_from_G{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    double share = 0;  // of the object's weight that this jaw carries; 0: all jaws of the gripper alike
    double contact_on_N = 0.5, contact_off_N = 0.3;  // of the press; widened to the noise that the free phase shows
    double full_scale_N[3] = {0, 0, 0};              // beyond it a weight is OVERLOAD; 0 = not known
    bool errs_by_gain = false;  // what its calibration leaves is a smooth curve through 0, as measured for hairs: one known
                                // weight corrects most of it

    bool operator==(const JawSetup&) const = default;
};

struct Setup {
    std::vector<JawSetup> jaws;
    unsigned jaws_of_gripper = 0;       // with and without a sensor; 0: as many as `jaws`
    Vector gravity_G{0, 0, 0};          // m/s^2, until a command says otherwise; all 0: not known, no weight
    double friction = 0;                // to begin with; 0: not known until a slip shows it
    double share_sd = 0.01;             // of a jaw's share from grasp to grasp, once a known weight was shown; before, 0.1
    double margin = 1.5;                // recommended grip / least grip
    double weigh_window_ms = 100;       // the weight is a mean over so long
    double lift_acceleration_m_s2 = 2;  // the most that the arm uses where nobody tells its acceleration, and for how
    // long after lift-off at most. 1 s is longer than picks take: too long delays a weight, too short makes one of the arm's
    // braking.
    double lift_accelerates_ms = 1000;

    bool operator==(const Setup&) const = default;
};

// A taught object: it weighs this much, +- the sd from grasp to grasp.
struct Object {
    std::uint32_t id = 0;  // > 0
    std::string name;
    double mass_kg = 0, sd_kg = 0;
};

// The sample of one sensor at one instant: tared, not low-passed, frame S.
struct JawSample {
    std::uint64_t t_ns = 0;
    std::array<double, 3> force_S_N{}, sd_N{};
    tactiled_quality quality = TACTILED_BAD;
    std::uint32_t reasons = 0;  // enum tactiled_reason
};

enum class Hint : std::uint32_t { open = 0, closing = 1, closed = 2, lifting = 3, moving = 4, opening = 5, none = 0xFFFF };

class Grasp {
public:
    // setup: asserts 1 .. kMaxJaws jaws; `setup` was checked by who read it
    explicit Grasp(const Setup& setup);
    ~Grasp();
    Grasp(Grasp&&) noexcept;
    Grasp& operator=(Grasp&&) noexcept;

    // One sample of jaw `jaw`, in the order in which they come. rt: wait-free
    void sample(std::size_t jaw, const JawSample& sample) noexcept;

    // Judged at `now_ns`: a jaw that is silent for longer than stale_ns of its sensor was told so by a BAD sample before.
    // rt: wait-free
    [[nodiscard]] tactiled_grasp state() const noexcept;

    // Data from the robot or the PLC. NaN or Hint::none: not known any more. rt: wait-free
    void hint(Hint gripper) noexcept;
    void gravity(const Vector& gravity_G_m_s2) noexcept;
    void acceleration(const Vector& acceleration_G_m_s2, std::uint64_t t_ns) noexcept;  // of the hand; good for 100 ms

    // Commands; false: not now. rt: wait-free
    bool start_weighing() noexcept;  // from now on, whatever the state machine thinks of a lift
    bool stop_weighing() noexcept;
    bool zero_weight() noexcept;  // what hangs now, stable, is no object: tare, until this grasp ends
    // The load that hangs now, stable and but for the share's deviation known to 5 %, weighs this: sets the scale of the
    // shares. Before its lift it was gripped and read as no more than 5 % of it, and there is no tare. 0, at any time: the
    // scale is forgotten.
    bool known_weight(double mass_kg) noexcept;
    void clear_slips(std::uint32_t sensor_mask) noexcept;
    void slip_sensitivity(double zero_to_one) noexcept;
    void weigh_window(double ms) noexcept;
    // At most kMaxObjects of them; copied. rt: wait-free
    void objects(std::span<const Object> objects) noexcept;
    static constexpr std::size_t kMaxObjects = 32;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace tactiled::grasp
