#include "decoupling/grasp/expectation.hpp"

#include <algorithm>
#include <cmath>
#include <random>

namespace tactiled::grasp {
namespace {

constexpr double kG_m_s2 = 9.80665;
constexpr double kFriction = 0.5;  // rubber on most things, where none is configured
constexpr double kUsual_kg = 0.5;  // without a full scale
constexpr double kNoise = 0.1;     // noise as a part of the sensor's sd, which is mostly the error of its model
constexpr std::uint64_t kStep_ns = 2'000'000;

struct Carried {
    Vector shear_S{};  // N per kg of the object
    double size = 0;
};

Carried carried_by(const Setup& setup, const JawSetup& jaw) {
    const double all = double(setup.jaws_of_gripper != 0 ? setup.jaws_of_gripper : unsigned(setup.jaws.size()));
    const double share = jaw.share > 0 ? jaw.share : 1 / all;
    Carried carried;
    for (std::size_t i = 0; i < 2; ++i) {
        for (std::size_t k = 0; k < 3; ++k) carried.shear_S[i] += share * jaw.S_from_G[i][k] * setup.gravity_G[k];
        carried.size = std::hypot(carried.size, carried.shear_S[i]);
    }
    return carried;
}

// An ideal hand: all jaws have the same press, and each carries its share.
class IdealHand {
public:
    IdealHand(const Setup& setup, const std::vector<JawAccuracy>& accuracy)
        : setup_(setup), accuracy_(accuracy), grasp_(setup) {
        for (const JawSetup& jaw : setup.jaws) carried_.push_back(carried_by(setup, jaw));
    }

    // Returns the standard deviation of a weight; NaN if it does not become stable.
    double weigh(double mass_kg, double press_N) {
        go(0.2, 0, 0);
        go(0.5, 0, 0);
        go(0.2, press_N, 0);
        go(0.5, press_N, 0);
        go(0.15, press_N, mass_kg);
        const double longest_s = (setup_.lift_accelerates_ms + 3 * setup_.weigh_window_ms) * 1e-3 + 1.5;
        for (double waited_s = 0; waited_s < longest_s; waited_s += 0.1) {
            go(0.1, press_N, mass_kg);
            if (grasp_.state().weight_state == TACTILED_WEIGHT_STABLE) return grasp_.state().weight_sd_kg;
        }
        return kNaN;
    }
    bool know(double mass_kg) { return grasp_.known_weight(mass_kg); }
    void release() { go(0.2, press_N_, 0); }

private:
    void go(double seconds, double press_N, double mass_kg) {
        const double from_N = press_N_, from_kg = mass_kg_;
        const int n = std::max(1, int(std::lround(seconds * 1e9 / double(kStep_ns))));
        for (int i = 1; i <= n; ++i) {
            const double u = double(i) / n;
            press_N_ = from_N + u * (press_N - from_N);
            mass_kg_ = from_kg + u * (mass_kg - from_kg);
            step();
        }
    }
    void step() {
        t_ns_ += kStep_ns;
        for (std::size_t j = 0; j < setup_.jaws.size(); ++j) {
            JawSample sample{.t_ns = t_ns_, .quality = tactiled_quality(tactiled_verdict(0, true))};
            const Vector load{mass_kg_ * carried_[j].shear_S[0], mass_kg_ * carried_[j].shear_S[1], -press_N_};
            for (std::size_t i = 0; i < 3; ++i) {
                sample.sd_N[i] = std::hypot(accuracy_[j].sd_N[i], accuracy_[j].sd_slope[i] * load[i]);
                sample.force_S_N[i] = load[i] + kNoise * accuracy_[j].sd_N[i] * noise_(random_);
            }
            grasp_.sample(j, sample);
        }
    }

    Setup setup_;
    std::vector<JawAccuracy> accuracy_;
    std::vector<Carried> carried_;
    Grasp grasp_;
    std::mt19937_64 random_{1};
    std::normal_distribution<double> noise_;
    std::uint64_t t_ns_ = 1'000'000'000;
    double press_N_ = 0, mass_kg_ = 0;
};

// Returns the press that holds a mass with the margin of the setup and touches for certain.
double press_for(const Setup& setup, double mass_kg) {
    const double friction = setup.friction > 0 ? setup.friction : kFriction;
    double press_N = 0;
    for (const JawSetup& jaw : setup.jaws)
        press_N = std::max({press_N, 2 * jaw.contact_on_N, setup.margin * mass_kg * carried_by(setup, jaw).size / friction});
    return press_N;
}

// Returns the largest mass whose press and shear are within full scale; infinite where full scale is not known.
double max_mass_kg(const Setup& setup) {
    double max_kg = std::numeric_limits<double>::infinity();
    const double friction = setup.friction > 0 ? setup.friction : kFriction;
    for (const JawSetup& jaw : setup.jaws) {
        const Carried carried = carried_by(setup, jaw);
        for (std::size_t i = 0; i < 2; ++i)
            if (jaw.full_scale_N[i] > 0 && carried.shear_S[i] != 0)
                max_kg = std::min(max_kg, jaw.full_scale_N[i] / std::abs(carried.shear_S[i]));
        if (jaw.full_scale_N[2] > 0 && carried.size > 0)
            max_kg = std::min(max_kg, jaw.full_scale_N[2] * friction / setup.margin / carried.size);
    }
    return max_kg;
}

// Rounds down to one digit.
double round_kg(double mass_kg) {
    const double unit = std::pow(10, std::floor(std::log10(mass_kg)));
    return std::floor(mass_kg / unit + 1e-9) * unit;
}

}  // namespace

std::vector<ExpectedWeight> expected_weights(Setup setup, const std::vector<JawAccuracy>& accuracy) {
    if (std::hypot(setup.gravity_G[0], setup.gravity_G[1], setup.gravity_G[2]) == 0) setup.gravity_G = {0, 0, kG_m_s2};
    const double max_kg = max_mass_kg(setup);
    if (!(max_kg > 0)) return {};
    const double heavy_kg = std::isfinite(max_kg) ? round_kg(max_kg / 2) : kUsual_kg;
    std::vector<ExpectedWeight> all;
    for (const double mass_kg : {heavy_kg, heavy_kg / 5}) {
        ExpectedWeight one{.mass_kg = mass_kg, .press_N = press_for(setup, mass_kg), .known_kg = heavy_kg};
        one.sd_kg = IdealHand(setup, accuracy).weigh(mass_kg, one.press_N);
        IdealHand hand(setup, accuracy);
        (void)hand.weigh(heavy_kg, press_for(setup, heavy_kg));
        if (hand.know(heavy_kg)) {
            hand.release();
            one.sd_known_kg = hand.weigh(mass_kg, one.press_N);
        }
        all.push_back(one);
    }
    return all;
}

}  // namespace tactiled::grasp
