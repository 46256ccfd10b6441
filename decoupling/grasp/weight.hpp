// The mass that the jaws carry, from their tangential forces and gravity.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "decoupling/grasp/contact.hpp"
#include "decoupling/grasp/evidence.hpp"

namespace tactiled::grasp {

inline constexpr double kKnownFactor = 5;   // maximum factor by which a known weight may change the scale
inline constexpr double kKnownSure = 0.05;  // relative sd of a known weight: noise must not set the scale

struct Weighed {
    tactiled_weight_state state = TACTILED_WEIGHT_NONE;
    double mass_kg, sd_kg;          // NaN if not known
    std::uint64_t lift_off_ns = 0;  // the load first reached nine tenths of this mass; 0 = not known
    std::uint32_t doubts = 0;       // enum tactiled_weight_doubt: the reasons why it is not stable
    std::uint32_t jaws = 0;         // bit n: jaw n contradicts the others
};

inline constexpr double kNoPart = 1e-6;    // a smaller part of an axis is a rounded rotation
inline constexpr double kLeak = 0.03;      // largest part of the press that may appear as a shear
inline constexpr double kDown_rad = 0.01;  // uncertainty of the direction of gravity

// The reading of a jaw in the grip before the lift. It is a leak of the press, which the weight contains, or a force that
// the lift removes; the standard deviation includes both.
struct Rest {
    Eigen::Vector2d force_S_N{kNaN, kNaN};  // tangential; NaN: not measured
    double press_N = 0;
};

class Weight {
public:
    // The load reaches nine tenths some time before the object leaves the table, so that the arm may still accelerate
    // where the window begins. This part of the window suffices if it is at rest.
    static constexpr double kNewest = 0.7;

    explicit Weight(const Setup& setup);

    void gravity(const Eigen::Vector3d& gravity_G_m_s2) noexcept;
    void acceleration(const Eigen::Vector3d& acceleration_G_m_s2, std::uint64_t t_ns) noexcept;
    void window(double ms) noexcept;

    // Adds one more sample of a jaw. rt: wait-free
    void take(std::size_t jaw, const Observation& observation) noexcept;
    // rt: wait-free
    void rest(std::size_t jaw, const Rest& rest) noexcept { jaws_[jaw].rest = rest; }
    // Weighs from now on, as a lift begins. rt: wait-free
    void begin(std::uint64_t t_ns) noexcept;
    void end() noexcept;
    // Computes the weight again if 5 ms have passed. rt: bounded by the blocks of 1.3 s
    void judge(std::span<const Contact> jaws, std::uint64_t now_ns) noexcept;

    [[nodiscard]] const Weighed& now() const noexcept { return now_; }
    [[nodiscard]] bool weighing() const noexcept { return weighing_; }
    [[nodiscard]] bool observable() const noexcept { return carries_ > 0; }
    bool zero() noexcept;  // tares the stable load
    void no_tare() noexcept { tare_kg_ = 0; }
    void slipped() noexcept { first_.known = false; }  // the shares of the jaws may have changed
    // The same as Grasp::known_weight(). rt: wait-free
    bool known(double mass_kg, std::span<const Contact> jaws) noexcept;

private:
    // The samples of all jaws in 5 ms.
    struct Block {
        std::uint64_t t_ns = 0;
        double mass_kg = 0;
        bool acceleration_known = false;
        double acceleration_m_s2 = 0;
    };
    struct Mean {
        double mass_kg = 0, sd_kg = 0;  // sd of the mean, from the scatter of its parts
        double blocks_sd_kg = 0;        // sd of a block
        double trend_kg = 0;            // newer half minus older half
        double bend_kg = 0;             // outer quarters minus inner ones
        double jitter_kg = 0;           // sd of a block, from its difference to the next one
        std::size_t n = 0;
        bool accelerations_known = true;
        double max_acceleration_m_s2 = 0;
    };
    // The findings of the checks that compare the jaws with each other and the weight with itself.
    struct Findings {
        std::uint32_t doubts = 0, jaws = 0;
        double sd_kg = 0;  // from disagreement that is no contradiction
        std::array<double, kMaxJaws> off{};
    };
    void rescale(double factor) noexcept;
    void close_block(std::uint64_t now_ns) noexcept;
    void aim() noexcept;
    void publish_first(const Mean& mean, std::span<const Contact> jaws, std::uint64_t now_ns) noexcept;
    void publish_held(const Mean& mean, std::span<const Contact> jaws, std::uint64_t now_ns) noexcept;
    [[nodiscard]] const Block& block(std::size_t back) const noexcept;
    [[nodiscard]] Mean mean_since(std::uint64_t from_ns) const noexcept;
    [[nodiscard]] double share_sd() const noexcept;
    [[nodiscard]] double rest_kg(std::span<const Contact> jaws) const noexcept;
    [[nodiscard]] double max_leak_kg(std::span<const Contact> jaws) const noexcept;
    [[nodiscard]] std::uint32_t carrying() const noexcept;
    [[nodiscard]] double zeros_kg(std::span<const Contact> jaws) const noexcept;
    [[nodiscard]] double leaks_kg(double mass_kg, std::span<const Contact> jaws) const noexcept;
    [[nodiscard]] double sensors_kg(double mass_kg, std::span<const Contact> jaws) const noexcept;
    [[nodiscard]] bool sure(double mass_kg, double sd_kg) const noexcept;
    [[nodiscard]] double newest_departs_kg() const noexcept;
    [[nodiscard]] std::uint64_t first_above(double mass_kg) const noexcept;
    [[nodiscard]] std::uint64_t lift_off(double mass_kg) const noexcept;
    [[nodiscard]] double systematic_kg(double mass_kg, std::span<const Contact> jaws) const noexcept;
    [[nodiscard]] double off_axis_kg(std::span<const Contact> jaws, double mass_kg, std::uint32_t& found) const noexcept;
    std::span<const JawForces> forces_since(std::uint64_t from_ns, std::span<const Contact> jaws) noexcept;
    [[nodiscard]] Findings examine(std::span<const JawForces> forces, double mass_kg, double sd_kg,
                                   double unknown_m_s2) const noexcept;
    [[nodiscard]] std::uint64_t last_lift_off(std::span<const JawForces> forces, std::uint64_t first_ns,
                                              std::uint32_t& late) const noexcept;
    [[nodiscard]] bool moved(const Mean& window, std::uint64_t from_ns, std::uint64_t now_ns) const noexcept;
    void take_first(const Findings& found) noexcept;
    [[nodiscard]] bool flat(const Mean& mean) const noexcept;
    [[nodiscard]] bool part_is_flat(const Mean& mean, double part) const noexcept;
    [[nodiscard]] double drifted_kg(std::span<const Contact> jaws, std::uint64_t from_ns) const noexcept;
    [[nodiscard]] double unexplained_kg(double mass_kg) const noexcept;
    void forget_first() noexcept;

    struct Jaw {
        Eigen::Matrix3d S_from_G;
        double share = 0;
        Eigen::Vector3d axis_S;   // tangential direction in which the jaw carries; 0 = it carries nothing
        double carries_m_s2 = 0;  // force along the axis per kg of the object
        double sum_N = 0, last_N = 0;
        Eigen::Vector3d sum_S_N = Eigen::Vector3d::Zero(), last_S_N = Eigen::Vector3d::Zero();
        int n = 0;
        Rest rest;
        bool errs_by_gain = false;
        std::uint64_t t_ns = 0;                                // time of the newest sample
        tactiled_weight_state refusal = TACTILED_WEIGHT_NONE;  // from the samples of this block
        bool blind = false;                                    // the newest sample has no value along the axis
    };
    std::array<Jaw, kMaxJaws> jaws_;
    std::size_t n_jaws_, n_all_;  // jaws with a sensor, and all jaws of the gripper
    bool central_;                // three jaws or more: the shares perpendicular to the palm's axis are unknown
    double share_sd_;
    double max_acceleration_m_s2_;
    std::uint64_t accelerates_ns_, window_ns_;

    Eigen::Vector3d gravity_G_{0, 0, 0}, acceleration_G_{0, 0, 0};
    std::uint64_t acceleration_ns_ = 0;
    bool acceleration_reported_ = false;
    double contact_N_ = 0;  // sum of the jaws' thresholds of contact
    double carries_ = 0;    // sum of carries_m_s2 over the jaws: N per kg
    double tilt_ = 0;       // tangent of the angle between the load and the axis

    // after this time without a sample, earlier samples are not used
    static constexpr std::uint64_t kBreak_ns = 500'000'000;
    static constexpr std::size_t kBlocks = 256;
    std::array<Block, kBlocks> blocks_{};
    std::array<std::array<Eigen::Vector3f, kMaxJaws>, kBlocks> block_forces_S_N_{};  // per block and jaw
    std::array<JawForces, kMaxJaws> forces_{};                                       // forces in the newest window
    std::size_t newest_ = 0, n_ = 0;
    std::uint64_t block_ns_ = 0;

    tactiled_weight_state refusal_ = TACTILED_WEIGHT_NONE;  // from the last block
    bool weighing_ = false, held_known_ = false;
    struct {
        bool done = false;
        double mass_kg = 0, rest_kg = 0;
        bool was_force = false;              // rest_kg was larger than a leak
        std::uint32_t carrying = 0;          // one bit per jaw
        double sd = 0;                       // relative sd of the scale: scatter, zeros and direction of gravity
        std::array<double, kMaxJaws> off{};  // Shares::off
        Eigen::Vector3d balance_off_G = Eigen::Vector3d::Zero();  // Balance::off_G
    } check_;
    // The first stable weight of this grasp and its shares: both are constant, unless a sensor creeps.
    struct {
        bool known = false, weighed = false;  // known: off is valid; weighed: mass_kg is valid until the load changes
        double mass_kg = 0, sd_kg = 0;
        std::array<double, kMaxJaws> off{};
    } first_;
    bool all_face_ = false;      // all jaws have sensors and face each other, so that their presses balance
    double unexplained_kg_ = 0;  // sum of small changes in this grasp: the object or a sensor may have caused them
    double departed_kg_ = kNaN;  // the weight before the present change
    bool changed_ = false;       // the load changed when the held weight was last left
    std::uint64_t block_before_ns_ = 0;
    bool again_ = false;             // the load changed, so weighing restarted in this grasp
    std::uint64_t balanced_ns_ = 0;  // time at which the presses last balanced without an acceleration
    std::uint64_t begun_ns_ = 0, agreed_ns_ = 0;
    std::uint64_t rests_ns_ = 0;  // begin of the window of the first stable value
    double held_kg_ = 0, held_sd_kg_ = 0, held_blocks_sd_kg_ = 0, tare_kg_ = 0, scale_ = 1;
    Weighed now_;
};

}  // namespace tactiled::grasp
