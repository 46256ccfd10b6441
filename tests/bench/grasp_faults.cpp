#include "tests/bench/grasp_faults.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <vector>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::bench {
namespace {

constexpr double kPi = std::numbers::pi, kGravity_m_s2 = 9.80665, kStiffer = 3;
using Vector3 = Eigen::Vector3d;

constexpr FaultKind kKinds[] = {
    {Fault::none, "right set-up", 0, true, true},
    {Fault::dead_shear, "one jaw's shear dead", 2, true, false},
    {Fault::dead_shear, "three jaws, one dead", 3, true, false},
    {Fault::reversed, "one jaw's axis reversed", 2, true, false},
    {Fault::reversed, "three jaws, one turned by 180 degrees", 3, true, false},
    {Fault::turned_90, "one jaw turned by 90 degrees", 0, true, false},
    {Fault::gravity_reversed, "gravity's sign wrong", 0, true, false},
    {Fault::half_gain, "one jaw at half gain", 0, true, false},
    {Fault::gain_creeps, "gain of one jaw creeps by 1.2 %/s", 0, true, false},
    {Fault::zero_drifts, "zero of one jaw drifts by 10 mN/s", 0, true, false},
    {Fault::both_zeros_drift, "zeros of all jaws drift by 10 mN/s", 0, true, false},
    {Fault::tilted, "tilted by 25 to 45 degrees, not reported", 0, true, false},
    {Fault::swings_up, "swings at 0.7 to 1.4 Hz with 2 to 4 m/s^2 from the lift on", 0, true, false},
    {Fault::swings_later, "the same, from 2 s after the lift on", 0, true, false},
    {Fault::exchanged, "jaws exchanged", 0, true, true},
    {Fault::half_rate, "one jaw with half rate", 0, true, true},
    {Fault::late, "one jaw 300 ms late", 0, true, false},
    {Fault::gain_drifts, "gain of one jaw drifts by 0.1 to 0.5 %/s", 0, true, true},
    {Fault::stamped_late, "one jaw's sample time is 50 to 300 ms late", 0, true, true},
    {Fault::leaks_mass, "the object leaks 1 to 5 % of its mass a second", 0, true, true},
    {Fault::jaw_on_table, "one jaw is set on a table, 1 s after the lift", 0, true, true},
    {Fault::second_object, "a second object of 5 to 100 % is added or lost", 0, true, true},
    {Fault::upside_down, "gripper upside down, reported", 0, true, true},
    {Fault::gravity_size, "gravity of a wrong magnitude", 0, true, true},
    {Fault::slow_lift, "steady acceleration of 0.3 to 1 m/s^2 for 3 s", 0, false, false},
    {Fault::cable, "a cable pulls along gravity with 5 to 40 % of the weight", 0, false, false},
    {Fault::table, "a table carries 5 to 40 % of the weight", 0, false, false},
};

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed * 7919 + 3) {}
    double uniform(double from, double to) { return from + (to - from) * double(engine_() >> 11) * 0x1p-53; }
    double log_uniform(double from, double to) { return std::exp(uniform(std::log(from), std::log(to))); }
    double normal(double sd) {  // sum of twelve: the same on every machine
        double sum = -6;
        for (int i = 0; i < 12; ++i) sum += uniform(0, 1);
        return sd * sum;
    }

private:
    std::mt19937_64 engine_;
};

struct Jaw {
    Eigen::Matrix3d S_from_G;
    double share = 0, gain = 1;
    Vector3 axis_gain{1, 1, 1}, zero_N{0, 0, 0}, leak{0, 0, 0};
    double noise_N = 0, drift_N_s = 0;
};

struct Plan {
    double mass_kg, press_N, rate_Hz, transfer_s, acceleration_m_s2, accelerates_s, travel_s, hold_s;
    Vector3 down_G;
    std::vector<Jaw> jaws;
    double told_accelerates_ms;
    // index of the damaged jaw
    std::size_t damaged;
    double size, frequency_Hz, begins_s;
    Vector3 tilt_axis_G;
};

// Skins at azimuth psi around the palm's axis, z inwards, y towards the palm: frame S of jaw j.
Eigen::Matrix3d frame_of(std::size_t jaw, std::size_t jaws) {
    const double psi = 2 * kPi * double(jaw) / double(jaws);
    Eigen::Matrix3d S_from_G;
    S_from_G << -std::sin(psi), std::cos(psi), 0, 0, 0, -1, -std::cos(psi), -std::sin(psi), 0;
    return S_from_G;
}

Plan plan_of(const FaultKind& kind, Random& random, Objects objects, unsigned n_jaws) {
    const bool judging = objects == Objects::judging;
    Plan p{};
    const std::size_t either = random.uniform(0, 1) < 0.5 ? 2 : 3;
    const std::size_t jaws = kind.jaws != 0 ? kind.jaws : n_jaws != 0 ? n_jaws : either;
    p.mass_kg = judging ? random.log_uniform(0.03, 3) : random.log_uniform(0.1, 0.6);
    const double weight_N = p.mass_kg * kGravity_m_s2, min_N = weight_N / double(jaws) / 0.6;
    p.press_N = min_N * (judging ? random.uniform(1.3, 7) : random.uniform(1.5, 4));
    p.rate_Hz = std::array{200.0, 500.0, 1000.0}[std::size_t(random.uniform(0, 3))];
    p.transfer_s = random.uniform(0.05, 0.3);
    p.acceleration_m_s2 = random.uniform(0.3, 2);
    p.accelerates_s = random.uniform(0.08, 0.14);
    p.travel_s = random.uniform(0.4, 1.0);
    p.told_accelerates_ms = random.uniform(0, 1) < 0.5 ? 150 : 1000;
    p.hold_s = 4;
    const double tilt = 20 * kPi / 180 * std::sqrt(random.uniform(0, 1)), phi = random.uniform(0, 2 * kPi);
    p.down_G = {std::sin(tilt) * std::cos(phi), std::sin(tilt) * std::sin(phi), std::cos(tilt)};
    double sum = 0;
    for (std::size_t j = 0; j < jaws; ++j) {
        Jaw jaw;
        jaw.S_from_G = frame_of(j, jaws);
        sum += jaw.share = 1 + random.normal(judging ? 0.04 : 0.02);
        jaw.gain = 1 + random.normal(0.01);
        for (int k = 0; k < 3; ++k) jaw.axis_gain[k] = 1 + random.normal(0.005);
        for (int k = 0; k < 3; ++k) jaw.zero_N[k] = random.normal(0.05 * p.press_N);
        jaw.leak = {random.normal(0.004), random.normal(0.004), 0};
        jaw.noise_N = 0.002 * p.press_N;
        jaw.drift_N_s = random.normal(0.0002 * p.press_N);
        p.jaws.push_back(jaw);
    }
    for (Jaw& jaw : p.jaws) jaw.share /= sum;
    p.damaged = std::size_t(random.uniform(0, double(jaws)));
    p.begins_s = random.uniform(0, 2);
    const double where = random.uniform(0, 2 * kPi);
    p.tilt_axis_G = {std::cos(where), std::sin(where), 0};
    switch (kind.fault) {
        case Fault::half_gain: p.size = random.uniform(0.4, 0.6); break;
        case Fault::gain_creeps: p.size = 0.012, p.hold_s = 30; break;
        case Fault::zero_drifts:
        case Fault::both_zeros_drift: p.size = 0.010, p.hold_s = 30; break;
        case Fault::tilted: p.size = random.uniform(25, 45) * kPi / 180; break;
        case Fault::swings_up:
        case Fault::swings_later:
            p.size = random.uniform(2, 4), p.frequency_Hz = random.uniform(0.7, 1.4), p.hold_s = 8;
            break;
        case Fault::gain_drifts:
            p.size = random.uniform(0.001, 0.005) * (random.uniform(0, 1) < 0.5 ? -1 : 1), p.hold_s = 20;
            break;
        case Fault::stamped_late: p.size = random.uniform(0.05, 0.3); break;
        case Fault::leaks_mass: p.size = random.uniform(0.01, 0.05), p.hold_s = 8; break;
        case Fault::jaw_on_table: p.size = random.uniform(0.1, 0.6); break;
        case Fault::second_object: p.size = random.log_uniform(0.05, 1) * (random.uniform(0, 1) < 0.5 ? -0.9 : 1); break;
        case Fault::upside_down: p.down_G *= -1; break;
        case Fault::gravity_size:
            p.size = random.uniform(0, 1) < 0.5 ? random.uniform(0.5, 0.97) : random.uniform(1.03, 1.5);
            break;
        case Fault::slow_lift: p.size = random.uniform(0.3, 1); break;
        case Fault::cable:
        case Fault::table: p.size = random.uniform(0.05, 0.4); break;
        default: break;
    }
    return p;
}

constexpr double kMean_s = 0.1;  // the weight is a mean over so long
constexpr double kFree_s = 0.6, kClosing_s = 0.2, kClamped_s = 0.3;
constexpr double kLift_s = kFree_s + kClosing_s + kClamped_s;  // when the load begins to come

// Acceleration of the hand upwards, t_s after the load is on the jaws.
double up_m_s2(const Plan& p, Fault fault, double t_s) {
    if (t_s < 0) return 0;
    if (fault == Fault::slow_lift) return t_s < 3 ? p.size : 0;
    if (fault == Fault::swings_up || (fault == Fault::swings_later && t_s > 2))
        return p.size * std::sin(2 * kPi * p.frequency_Hz * (t_s + p.begins_s));
    if (t_s < p.accelerates_s) return p.acceleration_m_s2;
    const double brakes_s = p.accelerates_s + p.travel_s;
    return t_s > brakes_s && t_s < brakes_s + p.accelerates_s ? -p.acceleration_m_s2 : 0;
}

// The mass of the held object, kg.
double mass_kg(const Plan& p, Fault fault, double t_s) {
    const double since_s = t_s - kLift_s - p.transfer_s;
    if (fault == Fault::leaks_mass) return p.mass_kg * (1 - p.size * std::clamp(since_s - p.begins_s, 0.0, 1e9));
    if (fault == Fault::second_object && since_s > 1 + p.begins_s) return p.mass_kg * (1 + p.size);
    return p.mass_kg;
}

// The force of the object on jaw j in its frame, N.
Vector3 force_S(const Plan& p, std::size_t j, Fault fault, double t_s) {
    const Jaw& jaw = p.jaws[j];
    const double closed = std::clamp((t_s - kFree_s) / kClosing_s, 0.0, 1.0);
    const double loaded = std::clamp((t_s - kLift_s) / p.transfer_s, 0.0, 1.0), since_s = t_s - kLift_s - p.transfer_s;
    Vector3 down_G = p.down_G;
    if (fault == Fault::tilted && since_s > p.begins_s - 1)  // within 0.2 s; half of them before the lift
        down_G = Eigen::AngleAxisd(p.size * std::clamp((since_s - p.begins_s + 1) / 0.2, 0.0, 1.0), p.tilt_axis_G) * down_G;
    double pull_N = loaded * mass_kg(p, fault, t_s) * (kGravity_m_s2 + up_m_s2(p, fault, since_s));
    if (fault == Fault::cable) pull_N += loaded * p.size * p.mass_kg * kGravity_m_s2;
    if (fault == Fault::table) pull_N -= loaded * p.size * p.mass_kg * kGravity_m_s2;
    const Vector3 pull_S = jaw.S_from_G * down_G * pull_N;
    Vector3 force;
    if (p.jaws.size() == 2)
        force = {jaw.share * pull_S.x(), jaw.share * pull_S.y(), pull_S.z() / 2};
    else
        force = {pull_S.x() * 2 / (1 + kStiffer) / double(p.jaws.size()), jaw.share * pull_S.y(),
                 pull_S.z() * 2 * kStiffer / (1 + kStiffer) / double(p.jaws.size())};
    force.z() -= closed * p.press_N;
    if (fault == Fault::jaw_on_table && j == p.damaged)  // the table presses on the skin's edge, against gravity
        force.y() += p.size * p.mass_kg * kGravity_m_s2 / double(p.jaws.size()) * std::clamp((since_s - 1) / 0.1, 0.0, 1.0);
    return force;
}

// The sensor's error, without and with its damage.
Vector3 measured_S(const Plan& p, std::size_t j, Fault fault, double t_s, Random& random) {
    const Jaw& jaw = p.jaws[j];
    const double source_s = fault == Fault::late && j == p.damaged ? t_s - 0.3 : t_s;
    Vector3 f = force_S(p, j, fault, source_s);
    f += jaw.leak * f.z();
    f = (f.array() * jaw.axis_gain.array()).matrix() * jaw.gain;
    const bool damaged = j == p.damaged;
    if (damaged && fault == Fault::dead_shear) f.head<2>().setZero();
    if (damaged && fault == Fault::reversed) f.head<2>() *= -1;
    if (damaged && fault == Fault::turned_90) f.head<2>() = Eigen::Vector2d(-f.y(), f.x());
    if (damaged && fault == Fault::half_gain) f *= p.size;
    if (damaged && (fault == Fault::gain_creeps || fault == Fault::gain_drifts))
        f *= 1 + p.size * std::max(0.0, t_s - kFree_s);
    if (fault == Fault::both_zeros_drift || (damaged && fault == Fault::zero_drifts))
        f.y() += p.size * std::max(0.0, t_s - kFree_s);
    f += jaw.zero_N + Vector3::Constant(jaw.drift_N_s * t_s);
    for (int k = 0; k < 3; ++k) f[k] += random.normal(jaw.noise_N);
    return f;
}

grasp::Setup setup_of(const Plan& p, Fault fault) {
    grasp::Setup setup;
    double g = fault == Fault::gravity_reversed ? -kGravity_m_s2 : kGravity_m_s2;
    if (fault == Fault::gravity_size) g *= p.size;
    setup.gravity_G = {g * p.down_G.x(), g * p.down_G.y(), g * p.down_G.z()};
    setup.lift_accelerates_ms = p.told_accelerates_ms;
    for (std::size_t j = 0; j < p.jaws.size(); ++j) {
        const std::size_t other = fault == Fault::exchanged && p.jaws.size() > 1 ? (j < 2 ? 1 - j : j) : j;
        grasp::JawSetup jaw;
        jaw.sensor = std::uint32_t(j);
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) jaw.S_from_G[std::size_t(r)][std::size_t(c)] = p.jaws[other].S_from_G(r, c);
        jaw.contact_on_N = 0.1 * p.press_N;
        jaw.contact_off_N = 0.05 * p.press_N;
        setup.jaws.push_back(jaw);
    }
    return setup;
}

void one_grasp(const FaultKind& kind, Random& random, Objects objects, unsigned jaws, FaultFigures& figures) {
    const Plan p = plan_of(kind, random, objects, jaws);
    grasp::Grasp grasp(setup_of(p, kind.fault));
    bool wrong = false, stable = false, ever = false, reported = false, named = false;
    const auto steps = std::size_t((kLift_s + p.transfer_s + p.hold_s) * p.rate_Hz);
    for (std::size_t i = 1; i <= steps; ++i) {
        const double t_s = double(i) / p.rate_Hz;
        for (std::size_t j = 0; j < p.jaws.size(); ++j) {
            if (kind.fault == Fault::half_rate && j == p.damaged && i % 2 == 0) continue;
            const Vector3 f = measured_S(p, j, kind.fault, t_s, random);
            const double press_N = std::max(0.0, -(f.z() - p.jaws[j].zero_N.z()));
            grasp::JawSample s{.t_ns = 1'000'000'000 + std::uint64_t(t_s * 1e9), .quality = TACTILED_GOOD, .reasons = 0};
            if (kind.fault == Fault::stamped_late && j == p.damaged) s.t_ns -= std::uint64_t(p.size * 1e9);
            for (int k = 0; k < 3; ++k) {
                s.force_S_N[std::size_t(k)] = f[k];
                s.sd_N[std::size_t(k)] = std::hypot(k == 2 ? 0.011 * press_N : 0.005 * press_N, p.jaws[j].noise_N);
            }
            grasp.sample(j, s);
        }
        const tactiled_grasp g = grasp.state();
        stable = g.weight_state == TACTILED_WEIGHT_STABLE;
        ever |= stable;
        if ((g.weight_doubts & ~std::uint32_t(TACTILED_DOUBT_MOVES)) != 0) {
            reported = true;
            named |= (g.doubtful >> p.damaged & 1u) != 0;
        }
        if (!stable) continue;
        const double error_kg = std::min(std::abs(g.weight_kg - mass_kg(p, kind.fault, t_s)),
                                         std::abs(g.weight_kg - mass_kg(p, kind.fault, t_s - kMean_s))),
                     sds = error_kg / g.weight_sd_kg;
        wrong |= sds > 4;
        if (sds > figures.worst_sds) figures.worst_sds = sds;
        figures.worst_error = std::max(figures.worst_error, error_kg / p.mass_kg);
    }
    ++figures.n;
    figures.wrong += wrong;
    figures.ever_stable += ever;
    figures.lost += ever && !stable;
    figures.reported += reported;
    figures.named += named;
}

}  // namespace

std::span<const FaultKind> fault_kinds() { return kKinds; }

FaultFigures fault_figures(const FaultKind& kind, int n, std::uint64_t seed, Objects objects, unsigned jaws) {
    Random random(seed * 101 + std::uint64_t(kind.fault) * 7 + kind.jaws);
    FaultFigures figures;
    for (int i = 0; i < n; ++i) one_grasp(kind, random, objects, jaws, figures);
    return figures;
}

}  // namespace tactiled::bench
