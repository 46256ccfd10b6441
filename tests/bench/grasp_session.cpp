#include "tests/bench/grasp_session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <random>
#include <sstream>

#include "decoupling/fit/fit.hpp"

namespace tactiled::bench {
namespace {

constexpr double kPi = std::numbers::pi, kGravity_m_s2 = 9.80665;
constexpr std::size_t kJaws = 3;
constexpr int kMaxShown = 12;  // lifts of the known weight
constexpr double kStiffer =
    3;  // a bonded skin along its normal than along itself: how jaws share what goes across the palm's axis
const std::string kWorld = "friction_limit,partial_slip,stick_slip,texture,adhesion";

std::string scene_text(const std::string& name) {
    std::ifstream file(std::string(TACTILED_SOURCE_DIR) + "/config/scenes/" + name);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
}

// Frame S of the jaw at azimuth psi: z inwards, y up to the palm (-z of G), x = y x z.
std::array<grasp::Vector, 3> frame_of(std::size_t jaw) {
    const double psi = 2 * kPi * double(jaw) / kJaws;
    return {{{-std::sin(psi), std::cos(psi), 0}, {0, 0, -1}, {-std::cos(psi), -std::sin(psi), 0}}};
}

double dot(const grasp::Vector& a, const grasp::Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

struct Plan {
    std::size_t object;  // index of the mass; SIZE_MAX = the known weight
    double mass_kg, grip_N, free_s, clamp_s, wait_s, transfer_s, acceleration_m_s2, travel_s, lower_s;
    grasp::Vector down_G;
    std::array<double, kJaws> share;
};

// One jaw's part of a plan: its shear's size and direction, and the press that a tilted weight adds.
std::string motions_of(const Plan& p, std::size_t jaw, const Conditions& c) {
    const auto frame = frame_of(jaw);
    const double mass_kg = p.mass_kg * p.share[jaw];
    const double x = dot(frame[0], p.down_G) * 2 / (1 + kStiffer), y = dot(frame[1], p.down_G);
    const double press = -dot(frame[2], p.down_G) * 2 * kStiffer / (1 + kStiffer), shear = std::hypot(x, y);
    const double size = std::hypot(shear, press);
    return fmt::format(
        "[[motion]]\ndo = \"hold\"\nfor_s = {}\n"
        "[[motion]]\ndo = \"press\"\nto_N = {}\nin_s = {}\ncourse = \"smooth\"\n"
        "[[motion]]\ndo = \"hold\"\nfor_s = {}\n"
        "[[motion]]\ndo = \"lift\"\nmass_kg = {}\ndirection_deg = {}\nlean_deg = {}\nin_s = {}\nacceleration_m_s2 = {}\n"
        "for_s = {}\ntravel_s = {}\nvibration_N = {}\nvibration_Hz = {}\n"
        "[[motion]]\ndo = \"hold\"\nfor_s = 0.3\n"
        "[[motion]]\ndo = \"shear\"\nto_N = 0\nin_s = {}\ncourse = \"smooth\"\n"
        "[[motion]]\ndo = \"hold\"\nfor_s = 0.1\n"
        "[[motion]]\ndo = \"release\"\nin_s = 0.2\n",
        p.free_s, p.grip_N, p.clamp_s, p.wait_s, mass_kg * size, std::atan2(y, x) * 180 / kPi,
        std::atan2(press, shear) * 180 / kPi, p.transfer_s, p.acceleration_m_s2, 2 * c.accelerates_s, p.travel_s,
        c.vibration * mass_kg * kGravity_m_s2, c.vibration_Hz, p.lower_s);
}

std::string scene_of(const std::vector<Plan>& plans, std::size_t jaw, std::uint64_t seed, const Conditions& c) {
    std::string text = fmt::format(
        "format = 1\ntitle = \"session\"\nseed = {}\nrate_Hz = {}\n[body]\nfriction = 3.0\n[effects.self_heating]\nrise_K = "
        "0\n"
        "[[sensor]]\nname = \"jaw\"\nmodel = \"hair\"\nserial = {}\nfull_scale_N = 0.34\n",
        seed * 8 + jaw, c.rate_Hz, seed * kJaws + jaw + 1);
    text += "[[motion]]\ndo = \"hold\"\nfor_s = 0.5\n[[motion]]\ndo = \"press\"\nto_N = 0.34\n";
    for (const int direction : {0, 90, 180, 270})  // exercised, as by the calibration
        text += fmt::format(
            "[[motion]]\ndo = \"shear\"\nto_N = 0.3\ndirection_deg = {}\n[[motion]]\ndo = \"shear\"\nto_N = 0\n", direction);
    text += "[[motion]]\ndo = \"release\"\n";
    for (const Plan& p : plans) text += motions_of(p, jaw, c);
    return text + "[[motion]]\ndo = \"hold\"\nfor_s = 0.4\n";
}

// The known weight is lifted `shown` times at first.
std::vector<Plan> plan(std::uint64_t seed, const std::vector<double>& masses_kg, int times, int shown, const Conditions& c) {
    std::mt19937_64 random(seed * 1000003 + 17);
    const auto uniform = [&](double from, double to) { return from + (to - from) * double(random() >> 11) * 0x1p-53; };
    const auto normal = [&] {  // sum of twelve: the same on every machine
        double sum = -6;
        for (int i = 0; i < 12; ++i) sum += uniform(0, 1);
        return sum;
    };
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < masses_kg.size(); ++i) order.insert(order.end(), std::size_t(times), i);
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random() % i]);
    if (c.known_kg > 0) order.insert(order.begin(), std::size_t(shown), SIZE_MAX);
    std::vector<Plan> plans;
    for (const std::size_t object : order) {
        Plan p{};
        p.object = object;
        p.mass_kg = object == SIZE_MAX ? c.known_kg : masses_kg[object];
        const double jaw_N = p.mass_kg * kGravity_m_s2 / kJaws;
        p.grip_N = uniform(std::max(0.08, 1.35 * jaw_N), 0.30);  // the calibration goes to 0.34
        p.free_s = uniform(0.3, 0.6);
        p.clamp_s = uniform(0.2, 0.5);
        p.wait_s = uniform(0.2, 0.4);
        p.transfer_s = uniform(0.05, 0.3);
        p.acceleration_m_s2 = uniform(c.min_acceleration_m_s2, c.max_acceleration_m_s2);
        p.travel_s = uniform(0.4, 1.0);
        p.lower_s = uniform(0.1, 0.2);
        const double tilt = object == SIZE_MAX ? 0 : c.tilt_deg / 180 * kPi * std::sqrt(uniform(0, 1)),
                     phi = uniform(0, 2 * kPi);
        p.down_G = {std::sin(tilt) * std::cos(phi), std::sin(tilt) * std::sin(phi), std::cos(tilt)};
        double sum = 0;
        for (double& share : p.share) sum += share = 1 + c.share_sd * normal();
        for (double& share : p.share) share /= sum;
        plans.push_back(p);
    }
    return plans;
}

// When each plan begins and when its object leaves the table, s of the scene.
struct Times {
    std::vector<double> begin_s, lift_s, off_s, end_s;
};
Times times_of(const sim::Scene& scene, std::size_t plans) {
    Times t;
    const auto& segments = scene.motion.segments();
    for (std::size_t i = 0; i < segments.size(); ++i)
        if (segments[i].kind == "lift" && segments[i - 1].kind != "lift") {
            t.begin_s.push_back(segments[i - 3].begin_s);
            t.lift_s.push_back(segments[i].begin_s);
            t.off_s.push_back(segments[i].end_s);
        }
    for (std::size_t i = 1; i < plans; ++i) t.end_s.push_back(t.begin_s[i] + 0.1);  // the skin gives back what it yielded
    t.end_s.push_back(scene.motion.length_s());
    return t;
}

grasp::Setup setup_of(std::size_t sensed, const Conditions& c) {
    grasp::Setup setup;
    setup.jaws_of_gripper = kJaws;
    setup.gravity_G = {0, 0, kGravity_m_s2};
    setup.weigh_window_ms = c.window_ms;
    setup.lift_accelerates_ms = 150;  // initial value of Conditions::accelerates_s
    for (std::size_t j = 0; j < sensed; ++j) {
        grasp::JawSetup jaw{.errs_by_gain = true};
        jaw.sensor = std::uint32_t(j);
        jaw.S_from_G = frame_of(j);
        jaw.contact_on_N = 0.02;
        jaw.contact_off_N = 0.012;
        setup.jaws.push_back(jaw);
    }
    return setup;
}

void follow(Outcome& o, const tactiled_grasp& g, double since_off_s) {
    o.grasped |= g.state == TACTILED_GRIP_GRASPED;
    o.lifted |= g.state == TACTILED_GRIP_HOLDING;
    o.opened |= o.lifted && g.state == TACTILED_GRIP_OPEN;
    const auto i = std::size_t(std::max(0.0, since_off_s) / kMomentEvery_s);
    const Moment now{g.weight_kg, g.weight_sd_kg, tactiled_weight_state(g.weight_state)};
    if (since_off_s >= 0 && i < kMoments) o.after[i] = now;
    if (since_off_s < -0.5 || !std::isnan(o.stable_after_s) || g.weight_state != TACTILED_WEIGHT_STABLE) return;
    o.stable_after_s = since_off_s;
    o.first_stable = now;
    o.object_id = g.object_id;
    o.probability = g.object_probability;
    o.lift_off_error_s = -1;
}

}  // namespace

sim::Scene parse_scene(const std::string& text) {
    Problems problems;
    sim::Scene scene = sim::read_scene(Options::parse_text(text, "session", problems), problems);
    problems.throw_if_any();
    return scene;
}

Recording record(const sim::Scene& scene, Decoupler& model) {
    Recording r;
    sim::Simulation simulation(scene, "all");
    for (;;) {
        const sim::Block& block = simulation.advance(0);
        if (block.n == 0) return r;
        for (std::size_t n = 0; n < block.n; ++n) {
            std::array<double, sim::kMaxSensorChannels> channel{};
            for (std::size_t k = 0; k < scene.sensors[0].n(); ++k) channel[k] = block.channel[k][n];
            const auto t_ns = std::uint64_t(1'000'000'000 + double(block.first + n) / scene.rate_Hz * 1e9);
            const Estimate e = model.decouple({.channel = std::span(channel).first(scene.sensors[0].n()),
                                               .missing = block.missing[n],
                                               .saturated = 0,
                                               .t_ns = t_ns});
            grasp::JawSample s{.t_ns = t_ns, .quality = e.quality(), .reasons = e.reasons};
            std::copy_n(e.wrench_S.begin(), 3, s.force_S_N.begin());
            std::copy_n(e.sd.begin(), 3, s.sd_N.begin());
            r.samples.push_back(s);
            r.up_m_s2.push_back(block.acceleration_m_s2[n]);
        }
    }
}

Calibration calibrate(const std::string& calibrate_scene, int serial, bool mirrored) {
    std::string text = scene_text(calibrate_scene);
    const auto put = [&](const std::string& before, const std::string& now) {
        text.replace(text.find(before), before.size(), now);
    };
    put("model = \"hair\"\n", fmt::format("model = \"hair\"\nserial = {}\n", serial));
    // Loads of its own: what the skin remembers of one and the same course would be the same error of every sensor.
    put("do = \"wander\"\n", fmt::format("do = \"wander\"\nseed = {}\n", serial));
    if (!mirrored) {
        put("count = 100\n", "count = 200\n");
        put("mirrored = true", "mirrored = false");
    }
    const sim::Scene scene = parse_scene(text);
    const sim::Sensor& sensor = scene.sensors[0];
    sim::Simulation signals(scene, "all"), world(scene, kWorld);
    Labelled labelled{.name = calibrate_scene, .channels = sensor.channels, .sessions = {}, .rows = {}};
    std::array<double, 3> before{1e9, 0, 0};
    int still = 0;
    const int settled = int(0.05 * scene.rate_Hz);
    for (;;) {
        const sim::Block& x = signals.advance(0);
        const sim::Block& y = world.advance(0);
        if (x.n == 0) break;
        for (std::size_t n = 0; n < x.n; ++n) {
            const std::array<double, 3> load{y.load[0][n], y.load[1][n], y.load[2][n]};
            still = load == before ? still + 1 : 0;
            before = load;
            if (still < settled) continue;
            LabelledRow row{
                .line = std::int64_t(x.first + n), .channel = {}, .session = 0, .t_ns = std::uint64_t(x.t_s[n] * 1e9)};
            for (std::size_t k = 0; k < sensor.n(); ++k) row.channel.push_back(x.channel[k][n]);
            std::copy(load.begin(), load.end(), row.wrench_S.begin());
            labelled.rows.push_back(std::move(row));
        }
    }
    FitRequest request{.model = "hair",
                       .method = "matrix",
                       .serial = fmt::format("{}", serial),
                       .channel_unit = "dR/R0",
                       .date = "2000-01-01"};
    request.parameters["area_m2"] = 2.827e-5;
    return fit(labelled, request).calibration;
}

std::unique_ptr<Decoupler> decoupler(const Calibration& calibration) { return make_decoupler(calibration); }

namespace {

// Returns nothing if the known weight was refused in the last of the lifts in which it was shown.
std::optional<std::vector<Outcome>> session_of(std::uint64_t seed, const std::vector<double>& masses_kg, int times,
                                               int shown, const Conditions& c, const std::vector<grasp::Object>& taught) {
    const std::vector<Plan> plans = plan(seed, masses_kg, times, shown, c);
    std::vector<Recording> jaws;
    Times when;
    for (std::size_t j = 0; j < kJaws; ++j) {
        const auto model = decoupler(calibrate(c.calibration, int(seed * kJaws + j + 1), c.mirrored));
        const sim::Scene scene = parse_scene(scene_of(plans, j, seed, c));
        when = times_of(scene, plans.size());
        jaws.push_back(record(scene, *model));
        if (c.ignore_domain)
            for (grasp::JawSample& sample : jaws.back().samples) sample.reasons &= ~std::uint32_t(TACTILED_OUTSIDE_DOMAIN);
    }
    std::vector<grasp::Grasp> estimators;
    for (std::size_t sensed = 1; sensed <= kMaxSensed; ++sensed) {
        estimators.emplace_back(setup_of(sensed, c));
        estimators.back().objects(taught);
    }
    std::vector<Outcome> outcomes;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::size_t at = 0;
    std::array<double, kMaxSensed> zero_N{};
    for (std::size_t p = 0; p < plans.size(); ++p) {
        const Plan& plan = plans[p];
        const double g = kGravity_m_s2;
        std::vector<Outcome> now(kMaxSensed);
        for (std::size_t e = 0; e < kMaxSensed; ++e) {
            now[e].object = plan.object;
            now[e].sensed = e + 1;
            now[e].mass_kg = plan.mass_kg;
            now[e].stable_after_s = nan;
            now[e].after.fill({nan, nan, TACTILED_WEIGHT_NONE});
        }
        bool reported_gravity = false, known = false;
        for (; at < jaws[0].samples.size(); ++at) {
            const double t_s = double(at) / c.rate_Hz;
            if (t_s >= when.end_s[p]) break;
            if (!reported_gravity) {
                for (auto& e : estimators) e.gravity({g * plan.down_G[0], g * plan.down_G[1], g * plan.down_G[2]});
                reported_gravity = true;
                zero_N[0] = jaws[0].samples[at].force_S_N[1];
            }
            for (std::size_t e = 0; e < kMaxSensed; ++e) {
                grasp::Grasp& estimator = estimators[e];
                if (c.tell_acceleration && at % std::size_t(std::max(1.0, c.rate_Hz / 125)) == 0) {
                    const auto late = std::size_t(0.008 * c.rate_Hz);
                    const double up = at >= late ? 0.97 * jaws[0].up_m_s2[at - late] : 0;
                    estimator.acceleration({-up * plan.down_G[0], -up * plan.down_G[1], -up * plan.down_G[2]},
                                           jaws[0].samples[at].t_ns);
                }
                for (std::size_t j = 0; j <= e; ++j) estimator.sample(j, jaws[j].samples[at]);
                const tactiled_grasp state = estimator.state();
                follow(now[e], state, t_s - when.off_s[p]);
                if (state.weight_state == TACTILED_WEIGHT_STABLE && now[e].lift_off_error_s == -1)
                    now[e].lift_off_error_s = double(state.t_lift_off_ns) * 1e-9 - 1 - when.off_s[p];
                // Shown for half a second, then the operator confirms.
                if (plan.object == SIZE_MAX && t_s > when.off_s[p] + 0.45 && e + 1 == kMaxSensed && !known) {
                    known = true;
                    for (auto& each : estimators) known &= each.known_weight(c.known_kg);
                }
            }
            if (t_s > when.lift_s[p] - 0.05 &&
                now[0].clamped_leak == 0)  // scaled as the weight is, but for the known weight: of a second order
                now[0].clamped_leak = -(jaws[0].samples[at].force_S_N[1] - zero_N[0]) / (plan.mass_kg * g / kJaws);
        }
        if (plan.object == SIZE_MAX && p + 1 == std::size_t(shown) && !known && !c.ignore_domain) return std::nullopt;
        if (plan.object == SIZE_MAX) continue;
        outcomes.insert(outcomes.end(), now.begin(), now.end());
    }
    for (Outcome& outcome : outcomes) outcome.shown = shown;
    return outcomes;
}

}  // namespace

std::vector<Outcome> session(std::uint64_t seed, const std::vector<double>& masses_kg, int times, const Conditions& c,
                             const std::vector<grasp::Object>& taught) {
    for (int shown = 2; shown <= kMaxShown; ++shown)
        if (auto outcomes = session_of(seed, masses_kg, times, shown, c, taught)) return *std::move(outcomes);
    throw std::runtime_error(fmt::format("a known weight was refused in {} lifts", kMaxShown));
}

}  // namespace tactiled::bench
