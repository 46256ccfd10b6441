// The mass that hangs on the jaws, from their tangential forces and gravity.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "decoupling/grasp/contact.hpp"

namespace tactiled::grasp {

struct Weighed {
    tactiled_weight_state state = TACTILED_WEIGHT_NONE;
    double mass_kg, sd_kg;          // NaN where not known
    std::uint64_t lift_off_ns = 0;  // when the load first came to nine tenths of this; 0 = not known
};

inline constexpr double kNoPart = 1e-6;    // of an axis: rounding of a rotation
inline constexpr double kLeak = 0.03;      // of the press that may read as a shear
inline constexpr double kDown_rad = 0.01;  // uncertainty of gravity's direction

// The reading of a jaw in the grip before the lift. A leak of the press, which the weight has in it, or a force that the
// lift takes away: the deviation has it.
struct Rest {
    Eigen::Vector2d force_S_N{kNaN, kNaN};  // tangential; NaN: not seen
    double press_N = 0;
};

class Weight {
public:
    explicit Weight(const Setup& setup);

    void gravity(const Eigen::Vector3d& gravity_G_m_s2) noexcept;
    void acceleration(const Eigen::Vector3d& acceleration_G_m_s2, std::uint64_t t_ns) noexcept;
    void window(double ms) noexcept;

    // One more sample of a jaw. rt: wait-free
    void take(std::size_t jaw, const Observation& observation) noexcept;
    // rt: wait-free
    void rest(std::size_t jaw, const Rest& rest) noexcept { jaws_[jaw].rest = rest; }
    // A lift begins: weighs from now on. rt: wait-free
    void begin(std::uint64_t t_ns) noexcept;
    void end() noexcept;
    // Judged anew when 5 ms have passed. rt: bounded by the blocks of 1.3 s
    void judge(std::span<const Contact> jaws, std::uint64_t now_ns) noexcept;

    [[nodiscard]] const Weighed& now() const noexcept { return now_; }
    [[nodiscard]] bool weighing() const noexcept { return weighing_; }
    [[nodiscard]] bool observable() const noexcept { return carries_ > 0; }
    bool zero() noexcept;  // what hangs, stable, is tare
    void no_tare() noexcept { tare_kg_ = 0; }
    // The same as Grasp::known_weight(). rt: wait-free
    bool known(double mass_kg, std::span<const Contact> jaws) noexcept;

private:
    // 5 ms of all jaws.
    struct Block {
        std::uint64_t t_ns = 0;
        double mass_kg = 0;
        bool acceleration_known = false;
        double acceleration_m_s2 = 0;
    };
    struct Mean {
        double mass_kg = 0, sd_kg = 0;  // of the mean, by the scatter of its parts
        double blocks_sd_kg = 0;        // of a block
        double trend_kg = 0;            // newer half less older half
        std::size_t n = 0;
        bool accelerations_known = true;
        double max_acceleration_m_s2 = 0;
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
    [[nodiscard]] std::uint64_t lift_off(double mass_kg) const noexcept;
    [[nodiscard]] double systematic_kg(double mass_kg, std::span<const Contact> jaws) const noexcept;
    [[nodiscard]] double off_axis_kg(std::span<const Contact> jaws, double mass_kg) const noexcept;

    struct Jaw {
        Eigen::Matrix3d S_from_G;
        double share = 0;
        Eigen::Vector3d axis_S;   // along which it carries, tangential; 0 = it carries nothing
        double carries_m_s2 = 0;  // force along the axis a kg of the object
        double sum_N = 0, last_N = 0;
        int n = 0;
        Rest rest;
        bool errs_by_gain = false;
        std::uint64_t t_ns = 0;  // of the newest sample
        bool overload = false;   // in a sample of this block
        bool blind = false;      // the newest sample says nothing along the axis
    };
    std::array<Jaw, kMaxJaws> jaws_;
    std::size_t n_jaws_, n_all_;  // with a sensor, and all of the gripper
    bool central_;                // three jaws or more: what goes across the palm's axis is shared nobody knows how
    double share_sd_;
    double max_acceleration_m_s2_;
    std::uint64_t accelerates_ns_, window_ns_;

    Eigen::Vector3d gravity_G_{0, 0, 0}, acceleration_G_{0, 0, 0};
    std::uint64_t acceleration_ns_ = 0;
    bool acceleration_reported_ = false;
    double contact_N_ = 0;  // least press that all jaws call a touch
    double carries_ = 0;    // sum over jaws of carries_m_s2: N a kg
    double tilt_ = 0;       // tangent of the angle between what pulls and the axis

    static constexpr std::uint64_t kBreak_ns = 500'000'000;  // without a sample: what was before says nothing
    static constexpr std::size_t kBlocks = 256;
    std::array<Block, kBlocks> blocks_{};
    std::size_t newest_ = 0, n_ = 0;
    std::uint64_t block_ns_ = 0;

    bool overloaded_ = false;  // in the last block
    bool weighing_ = false, held_known_ = false;
    struct {
        bool done = false;
        double mass_kg = 0, rest_kg = 0;
        bool was_force = false;      // rest_kg: more than a leak can be
        std::uint32_t carrying = 0;  // a bit a jaw
        double sd = 0;               // of the scale, as a part of it: scatter, zeros and gravity's direction
    } check_;
    std::uint64_t begun_ns_ = 0, agreed_ns_ = 0;
    double held_kg_ = 0, held_sd_kg_ = 0, held_blocks_sd_kg_ = 0, tare_kg_ = 0, scale_ = 1;
    Weighed now_;
};

}  // namespace tactiled::grasp
