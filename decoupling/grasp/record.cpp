// Makes the record of shared memory from the estimator's state.
#include <algorithm>
#include <cmath>

#include "decoupling/grasp/grasp_state.hpp"

namespace tactiled::grasp {

tactiled_grasp Grasp::state() const noexcept {
    const State& s = *state_;
    tactiled_grasp g{};
    tactiled_forget_grasp(&g);
    g.t_ns = s.t_ns;
    g.t_lift_off_ns = s.lift_off_ns;
    g.state = s.phase.now();
    g.grasps = s.phase.grasps();
    g.slips = s.slips;
    g.slip_latch = s.latch;
    double grip_N = 0, needed_N = kNaN;
    const Friction* min = nullptr;  // the jaw with the least friction slips first
    for (std::size_t j = 0; j < s.jaws.size(); ++j) {
        const State::Jaw& jaw = s.jaws[j];
        const Contact& contact = s.contacts[j];
        g.slip_state[jaw.sensor] = std::uint16_t(jaw.slip.state());
        g.slip_count[jaw.sensor] = std::uint16_t(jaw.slip.slips());
        if (jaw.slip.state() == TACTILED_SLIP_GROSS) g.slip_mask |= 1u << jaw.sensor;
        grip_N += std::max(0.0, contact.observation().press_N) / double(s.jaws.size());
        g.friction_use[jaw.sensor] = float(jaw.slip.use());
        const Friction& f = jaw.slip.friction();
        if (min == nullptr || f.coefficient() < min->coefficient()) min = &f;
        const double sure = f.coefficient() - (f.learnt() ? std::min(f.sd(), f.coefficient() / 2) : 0);
        needed_N = std::fmax(needed_N, s.setup.margin * jaw.peak_shear_N / sure);
    }
    if (g.state == TACTILED_GRIP_UNKNOWN) return g;
    g.grip_N = float(grip_N);
    g.friction = float(min->coefficient());
    g.friction_sd = float(min->sd());
    if (s.phase.holds()) g.recommended_grip_N = float(needed_N);
    const Weighed& w = s.weight.now();
    g.weight_state = w.state;
    if (s.phase.holds() && !s.weight.observable()) {
        g.weight_state = TACTILED_WEIGHT_NOT_OBSERVABLE;
        return g;
    }
    g.weight_kg = w.mass_kg;
    g.weight_sd_kg = w.sd_kg;
    g.weight_doubts = w.doubts;
    for (std::size_t j = 0; j < s.jaws.size(); ++j)
        if ((w.jaws >> j & 1u) != 0) g.doubtful |= 1u << s.jaws[j].sensor;
    if (g.weight_state != TACTILED_WEIGHT_STABLE) return g;
    const Recognised object = s.objects.recognise(w.mass_kg, w.sd_kg);
    if (object.id == 0) return g;
    g.object_id = object.id;
    g.object_probability = float(object.probability);
    std::copy(object.name.begin(), object.name.end(), g.object);
    return g;
}

}  // namespace tactiled::grasp
