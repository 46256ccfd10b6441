// Processes each sample in this order: contact, slip, weight, phase.
#include "decoupling/grasp/grasp.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "decoupling/grasp/grasp_state.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kNoises = 6;
constexpr std::uint64_t kBeforeLift_ns = 100'000'000;  // a load may begin this long before it is detected
constexpr double kSteady = 0.05;                       // part of the press, between its means of 10 and 50 ms
constexpr double kPeakTime_s = 1;                      // a peak of the shear raises the recommended grip for this long
constexpr std::uint64_t kAhead_ns = 500'000'000;  // a larger jump of the time is accepted if the next sample confirms it

}  // namespace

void Grasp::State::follow(std::size_t j) noexcept {
    Jaw& jaw = jaws[j];
    const Observation& observation = contacts[j].observation();
    const double elapsed_s = jaw.t_ns > 0 ? double(observation.t_ns - std::min(observation.t_ns, jaw.t_ns)) * 1e-9 : 1;
    jaw.t_ns = observation.t_ns;
    jaw.quick_N.take(observation.press_N, elapsed_s, 0.01);
    jaw.slow_N.take(observation.press_N, elapsed_s, 0.05);
    if (std::isfinite(observation.force_S_N.x())) jaw.quick_x_N.take(observation.force_S_N.x(), elapsed_s, 0.01);
    if (std::isfinite(observation.force_S_N.y())) jaw.quick_y_N.take(observation.force_S_N.y(), elapsed_s, 0.01);
    if (!std::isfinite(observation.shear_N)) return;
    jaw.peak_shear_N = std::max(observation.shear_N, jaw.peak_shear_N * std::exp(-elapsed_s / kPeakTime_s));
}

// With hysteresis: the load ends when it has fallen to half of the threshold.
bool Grasp::State::loaded(std::size_t j) const noexcept {
    const Jaw& jaw = jaws[j];
    const Contact& contact = contacts[j];
    const double changed_N = std::hypot(jaw.quick_x_N.value - jaw.clamped_x_N, jaw.quick_y_N.value - jaw.clamped_y_N);
    const double min_N =
        std::max({kNoises * contact.noise_N(0), kNoises * contact.noise_N(1), kLeak * contact.observation().press_N});
    return changed_N > (loaded_before ? min_N / 2 : min_N);
}

Seen Grasp::State::look() const noexcept {
    Seen seen{.t_ns = t_ns, .all = true, .steady = true};
    for (std::size_t j = 0; j < jaws.size(); ++j) {
        const Jaw& jaw = jaws[j];
        const Contact& contact = contacts[j];
        seen.unknown |= !contact.observation().known;
        seen.any |= contact.touching();
        seen.all &= contact.touching();
        seen.steady &=
            std::abs(jaw.quick_N.value - jaw.slow_N.value) < kSteady * jaw.slow_N.value + kNoises * contact.noise_N(2);
        seen.loaded |= loaded(j);
        seen.slipping |= jaw.slip.state() == TACTILED_SLIP_GROSS;
        seen.left_at_once |= contact.left_at_once();
    }
    seen.weighed = weight.now().state == TACTILED_WEIGHT_STABLE;
    return seen;
}

// The reading of a jaw in the grip. rt: wait-free
Rest Grasp::State::rest(std::size_t j) const noexcept {
    const Jaw& jaw = jaws[j];
    const Eigen::Vector3d& force_S_N = contacts[j].observation().force_S_N;
    const auto seen = [&](int axis, const Low& mean) {
        return phase.resumed() || !std::isfinite(force_S_N[axis]) ? kNaN : mean.value;
    };
    return {{seen(0, jaw.quick_x_N), seen(1, jaw.quick_y_N)}, jaw.quick_N.value};
}

// Begins a grasp; after a slip, when the slip has ended.
void Grasp::State::begin_grasp() noexcept {
    begun = phase.now() != TACTILED_GRIP_SLIPPING;
    rest_ns = 0;
    for (std::size_t j = 0; j < jaws.size(); ++j) {
        Jaw& jaw = jaws[j];
        jaw.clamped_x_N = phase.resumed() ? 0 : jaw.quick_x_N.value;  // 0: all shear counts as load
        jaw.clamped_y_N = phase.resumed() ? 0 : jaw.quick_y_N.value;
        if (begun) jaw.slip.begin_grasp();
        weight.rest(j, rest(j));
    }
}

// The rest before a lift is the reading at least kBeforeLift_ns before a load was detected, so that it contains
// nothing of the lift.
void Grasp::State::follow_rest() noexcept {
    if (phase.now() != TACTILED_GRIP_GRASPED || loaded_before || forced) {
        rest_ns = 0;
        return;
    }
    if (rest_ns != 0 && t_ns < rest_ns + kBeforeLift_ns) return;
    for (std::size_t j = 0; j < jaws.size(); ++j) {
        if (rest_ns != 0) weight.rest(j, jaws[j].rest);
        jaws[j].rest = rest(j);
    }
    rest_ns = t_ns;
}

void Grasp::State::act_on() noexcept {
    const tactiled_grip_state now = phase.now();
    if (!phase.holds())
        begun = false;
    else if (!begun && phase.kept() && !phase.resumed())
        begun = true;  // the grasp continues
    else if (!begun)
        begin_grasp();
    follow_rest();
    if (now == TACTILED_GRIP_OPEN || now == TACTILED_GRIP_LOST) weight.no_tare();
    forced &= phase.holds();
    stopped &= phase.hangs();
    const bool weighs = (phase.hangs() || forced) && !stopped;
    if (weighs && !weight.weighing()) {
        weight.begin(t_ns);
        lift_off_ns = t_ns;
    }
    if (!weighs && weight.weighing()) weight.end();
    if (weight.now().lift_off_ns > 0) lift_off_ns = weight.now().lift_off_ns;
}

// Rejects a single wrong time, which would stop all clocks until that time has come.
bool Grasp::State::from_the_future(Jaw& jaw, std::uint64_t sample_ns) const noexcept {
    const std::uint64_t ahead_ns = std::exchange(jaw.ahead_ns, 0);
    if (t_ns == 0 || sample_ns <= t_ns || sample_ns - t_ns <= kAhead_ns) return false;
    if (ahead_ns > 0 && sample_ns >= ahead_ns && sample_ns - ahead_ns <= kAhead_ns) return false;
    jaw.ahead_ns = sample_ns;
    return true;
}

void Grasp::State::take(std::size_t j, const JawSample& as_it_came) noexcept {
    Jaw& jaw = jaws[j];
    Contact& contact = contacts[j];
    JawSample sample = as_it_came;
    if (from_the_future(jaw, sample.t_ns)) {
        if (sample.quality != TACTILED_BAD) return;
        sample.t_ns = t_ns;
    }
    if (hint == Hint::open) contact.opened();
    const bool value = contact.take(sample);
    const Observation& observation = contact.observation();
    t_ns = std::max(t_ns, observation.t_ns);
    if (!observation.known) {
        jaw.slip.forget();
        jaw.t_ns = 0;
    } else if (value) {
        follow(j);
        jaw.slip.take(observation, contact.touching(), phase.now() == TACTILED_GRIP_HOLDING,
                      std::max(contact.noise_N(0), contact.noise_N(1)));
        if (jaw.slip.slips() != jaw.seen_slips) {
            slips += jaw.slip.slips() - jaw.seen_slips;
            jaw.seen_slips = jaw.slip.slips();
            latch |= 1u << jaw.sensor;
            weight.slipped();
        }
        weight.take(j, observation);
    }
    const Seen seen = look();
    loaded_before = seen.loaded;
    phase.step(seen, hint);
    act_on();
    weight.judge(contacts, t_ns);
}

Grasp::Grasp(const Setup& setup) : state_(std::make_unique<State>(setup)) {
    assert(!setup.jaws.empty() && setup.jaws.size() <= kMaxJaws);
    for (const JawSetup& jaw : setup.jaws) assert(jaw.sensor < TACTILED_MAX_SENSORS);
}
Grasp::~Grasp() = default;
Grasp::Grasp(Grasp&&) noexcept = default;
Grasp& Grasp::operator=(Grasp&&) noexcept = default;

void Grasp::sample(std::size_t jaw, const JawSample& sample) noexcept {
    if (jaw < state_->jaws.size()) state_->take(jaw, sample);
}

void Grasp::hint(Hint gripper) noexcept { state_->hint = gripper; }
void Grasp::gravity(const Vector& g) noexcept { state_->weight.gravity(Eigen::Vector3d(g.data())); }
void Grasp::acceleration(const Vector& a, std::uint64_t t_ns) noexcept {
    state_->weight.acceleration(Eigen::Vector3d(a.data()), t_ns);
}

bool Grasp::start_weighing() noexcept {
    if (!state_->phase.holds()) return false;
    state_->forced = true;
    state_->stopped = false;
    state_->weight.begin(state_->t_ns);
    return true;
}

bool Grasp::stop_weighing() noexcept {
    if (!state_->weight.weighing()) return false;
    state_->forced = false;
    state_->stopped = true;
    state_->weight.end();
    return true;
}

bool Grasp::zero_weight() noexcept {
    const tactiled_grip_state now = state_->phase.now();
    return now == TACTILED_GRIP_OPEN || now == TACTILED_GRIP_LOST || state_->weight.zero();  // open: the tare has ended
}
bool Grasp::known_weight(double mass_kg) noexcept { return state_->weight.known(mass_kg, state_->contacts); }
void Grasp::clear_slips(std::uint32_t sensor_mask) noexcept { state_->latch &= ~sensor_mask; }
void Grasp::slip_sensitivity(double zero_to_one) noexcept {
    for (State::Jaw& jaw : state_->jaws) jaw.slip.sensitivity(zero_to_one);
}
void Grasp::weigh_window(double ms) noexcept { state_->weight.window(ms); }
void Grasp::objects(std::span<const Object> objects) noexcept { state_->objects.teach(objects); }

}  // namespace tactiled::grasp
