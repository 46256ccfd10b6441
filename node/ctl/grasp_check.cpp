// tactilectl grasp-check: a guided grasp of a known weight that finds errors of [grasp], and prints the lines that are
// right.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <memory>

#include "decoupling/grasp/setup_check.hpp"
#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/guided.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

using grasp::SetupFault;
using grasp::SetupFinding;

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kLeastTilt_deg = 15;
constexpr double kG_m_s2 = 9.80665;   // CGPM 1901
constexpr double kLeastShare = 0.02;  // least force that some jaw feels where the jaws hold it, over the object's weight

struct Args {
    std::string node = "gripper", config;
    double mass_kg = 0, seconds = 1, tilt_deg = 30;
};

std::string axis(const grasp::Vector& v) {
    std::vector<std::string> words;
    for (const double x : v) words.push_back(fmt::format("{:g}", std::abs(x) < 1e-4 ? 0.0 : std::round(x * 1e4) / 1e4));
    return fmt::format("[{}]", fmt::join(words, ", "));
}

// Asks until a pose could be averaged; nothing at the end of the input.
std::optional<Observed> pose(const Segment& segment, std::uint32_t mask, double seconds, const std::string& what) {
    while (ask_person(what + " When all rests, press Enter: ")) {
        Observed seen = observe(segment, mask, seconds);
        if (seen.fault.empty()) return seen;
        fmt::print("  not taken: {}\n", seen.fault);
    }
    return std::nullopt;
}

std::string says(const SetupFinding& f, const grasp::GuidedGrasp& seen, const GraspSettings& settings) {
    const std::string name = seen.jaws[f.jaw].name;
    switch (f.fault) {
        case SetupFault::gravity_sign: {
            const grasp::Vector g = seen.gravity_G_m_s2;
            return fmt::format(
                "gravity has the wrong sign: the weight pulls the other way. If the robot writes GRAVITY_X .. "
                "GRAVITY_Z, it must write the negative\n[grasp]\ngravity_G_m_s2 = {}\n",
                axis({-g[0], -g[1], -g[2]}));
        }
        case SetupFault::turned:
            return fmt::format(
                "jaw \"{}\" is turned by {} degrees about its normal\n[[grasp.jaw]]  # \"{}\"\nx_S_in_G = {}\n", name,
                f.degrees > 180 ? f.degrees - 360 : f.degrees, name, axis(f.x_S_in_G));
        case SetupFault::exchanged: {
            const JawSettings &a = settings.jaws[f.jaw], &b = settings.jaws[f.other];
            std::string text = fmt::format("jaws \"{}\" and \"{}\" are exchanged\n", a.sensor, b.sensor);
            for (const auto& [sensor, place] : {std::pair(&a, &b), std::pair(&b, &a)})
                text += fmt::format("[[grasp.jaw]]\nsensor = \"{}\"\nx_S_in_G = {}\nz_S_in_G = {}\n", sensor->sensor,
                                    axis(place->x_S_in_G), axis(place->z_S_in_G));
            return text;
        }
        case SetupFault::contact: {
            const double on_N = f.value / 5;
            const std::string scale =
                seen.jaws[f.jaw].full_scale_N > 0 ? fmt::format(", full scale {:g} N", seen.jaws[f.jaw].full_scale_N) : "";
            if (!(f.value > 0))
                return fmt::format(
                    "jaw \"{}\" has no press: it reads {:.3f} N{}; see that it touches, and that its z axis "
                    "points out of its skin\n",
                    name, f.value, scale);
            return fmt::format(
                "jaw \"{}\": contact_on_N = {:g} is too large for its press of {:.3f} N{}\n[[sensor]]  # \"{}\"\n"
                "contact_on_N = {:.3g}\ncontact_off_N = {:.3g}\n",
                name, seen.jaws[f.jaw].contact_on_N, f.value, scale, name, on_N, on_N / 2);
        }
        case SetupFault::shares: {
            std::string text = "the jaws do not share the weight as configured\n";
            for (std::size_t j = 0; j < seen.jaws.size(); ++j)
                text += fmt::format("[[grasp.jaw]]  # \"{}\"\nshare = {:.3f}\n", seen.jaws[j].name, f.shares[j]);
            return text;
        }
        case SetupFault::dead:
            return fmt::format("jaw \"{}\" carries nothing: its shear is dead, or it does not hold\n", name);
        case SetupFault::sum:
            return fmt::format(
                "the forces of all jaws add up to {:.0f} % of the known weight: a wrong mass, a wrong gain "
                "(calibrate again), or something else that carries it\n",
                100 * f.value);
        case SetupFault::unexplained:
            return "the jaws contradict the configuration, and no single error explains it: check x_S_in_G and z_S_in_G of "
                   "each jaw, and gravity\n";
    }
    return "";
}

int check(const Args& args) {
    catch_interrupt();
    const Segment segment = open_node(args.node);
    const Node node = configuration_of(segment, args.config);
    if (!node.grasp || !node.config.grasp) throw SetupError("there is no [grasp] in the configuration");
    const GraspSettings& settings = *node.config.grasp;
    grasp::GuidedGrasp guided;
    guided.jaws_of_gripper = node.grasp->estimator.jaws_of_gripper;
    guided.mass_kg = args.mass_kg;
    guided.gravity_G_m_s2 = settings.gravity_G_m_s2;
    std::uint32_t mask = 0;
    for (const grasp::JawSetup& jaw : node.grasp->estimator.jaws) {
        mask |= 1u << jaw.sensor;
        guided.jaws.push_back({.name = node.config.sensors[jaw.sensor].name,
                               .S_from_G = jaw.S_from_G,
                               .share = jaw.share,
                               .contact_on_N = jaw.contact_on_N,
                               .full_scale_N = jaw.full_scale_N[2]});
    }
    const std::string lower = guided.jaws.front().name;
    const grasp::Vector z = guided.jaws.front().S_from_G[2];
    const struct {
        std::string what;
        grasp::Vector grasp::CheckedJaw::*into;
    } steps[] = {
        {"1 of 4: open the jaws, with nothing between them and the palm down.", nullptr},
        {fmt::format("2 of 4: close them on an object of {:g} kg that stands on a table.", args.mass_kg),
         &grasp::CheckedJaw::closed_N},
        {"3 of 4: lift it, so that it hangs free.", &grasp::CheckedJaw::lifted_N},
        {fmt::format(
             "4 of 4: tilt the hand by {:g} degrees, so that the place of jaw \"{}\", on the side {} of G, comes down.",
             args.tilt_deg, lower, axis({-z[0], -z[1], -z[2]})),
         &grasp::CheckedJaw::tilted_N}};
    std::optional<Observed> open;
    // Returns true if no jaw feels more than without an object.
    const auto feels_nothing = [&](const Observed& seen) {
        double most_N = 0;
        for (const grasp::JawSetup& jaw : node.grasp->estimator.jaws)
            for (std::size_t k = 0; k < 3; ++k)
                most_N = std::fmax(most_N, std::abs(seen.raw_S[jaw.sensor][k] - open->raw_S[jaw.sensor][k]));
        return most_N < kLeastShare * args.mass_kg * kG_m_s2;
    };
    for (const auto& step : steps) {
        auto seen = pose(segment, mask, args.seconds, step.what);
        while (seen && open && feels_nothing(*seen)) {
            fmt::print("  not taken: no jaw feels an object: close the jaws on it\n");
            seen = pose(segment, mask, args.seconds, step.what);
        }
        if (!seen) throw VerbError(kUnhealthy, "ended before all four steps");
        if (step.into == nullptr) open = seen;
        for (std::size_t j = 0; j < guided.jaws.size() && step.into != nullptr; ++j) {
            const std::uint32_t sensor = node.grasp->estimator.jaws[j].sensor;
            for (std::size_t k = 0; k < 3; ++k) {
                const double force_N = seen->raw_S[sensor][k] - open->raw_S[sensor][k];
                (guided.jaws[j].*step.into)[k] = std::isfinite(force_N) ? force_N : 0;
            }
        }
        const auto& g = seen->gravity_G_m_s2;  // gravity of [tool], where the robot reports it
        const bool reported = std::isfinite(g[0] + g[1] + g[2]);
        if (step.into == &grasp::CheckedJaw::lifted_N && reported) guided.gravity_G_m_s2 = g;
        if (step.into != &grasp::CheckedJaw::tilted_N || !reported) continue;
        const auto& upright = guided.gravity_G_m_s2;
        const double cosine = (g[0] * upright[0] + g[1] * upright[1] + g[2] * upright[2]) / (9.81 * 9.81);
        if (cosine < std::cos(kLeastTilt_deg * kDegree))
            guided.tilted_gravity_G_m_s2 = g;  // else it is not that of the robot
    }
    const auto& g = guided.gravity_G_m_s2;
    if (!(std::hypot(g[0], g[1], g[2]) > 0))
        throw SetupError(
            "gravity is not known: gravity_G_m_s2 in [grasp] is that of the upright hand, such as [0, 0, 9.81]");
    guided.tilt_rad = args.tilt_deg * kDegree;
    const auto findings = grasp::check_setup(guided);
    if (findings.empty()) fmt::print("\ngood: the jaws read what the configuration lets expect\n");
    for (const SetupFinding& f : findings) fmt::print("\nerror: {}", says(f, guided, settings));
    return findings.empty() ? kGood : kUnhealthy;
}

}  // namespace

Run add_grasp_check(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("mass", args->mass_kg, "mass of the object in kg").required().number_in(1e-3, 1000.0);
    add_node_option(verb, args->node);
    verb.add_option("--config", args->config, "the configuration; default: the daemon's own");
    verb.add_option("--tilt", args->tilt_deg, "degrees of the tilt").number_in(kLeastTilt_deg, 60.0).show_default();
    verb.add_option("--seconds", args->seconds, "that each step is averaged").number_in(0.1, 60.0).show_default();
    return [args] { return check(*args); };
}

}  // namespace tactiled::ctl
