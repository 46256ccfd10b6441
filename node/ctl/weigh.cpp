// tactilectl weigh start|stop|zero|known|forget: the weight commands of a PLC, acknowledged by the daemon.
#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "decoupling/grasp/weight.hpp"
#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/grasp_text.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper", what;
    double mass_kg = 0, timeout_s = 5;
    bool force = false;  // also where the mass is far from the present weight
};

std::string result_text(int result) {
    switch (result) {
        case TACTILED_COMMAND_OK: return "done";
        case TACTILED_COMMAND_TIMED_OUT: return "timed out";
        default: return "refused";
    }
}

// Returns the reason why the grasp does not allow `what` now, as far as the node record shows it.
std::string why_not_now(const tactiled_grasp& g, const std::string& what, double mass_kg) {
    if (g.t_ns == 0) return "refused: there is no [grasp] in the daemon's configuration, or its sensors sent nothing yet";
    if (what == "known" && g.weight_state != TACTILED_WEIGHT_STABLE)
        return fmt::format(
            "refused: the weight is not stable (it is \"{}\"); grasp, lift, and wait for \"stable\" in "
            "tactilectl status",
            weight_state_text(g.weight_state));
    if (what == "known" && g.weight_sd_kg > grasp::kKnownSure * std::abs(g.weight_kg))
        return fmt::format(
            "refused: the weight of {:.4f} kg has a standard deviation of {:.0f} %; a known weight must be weighed to "
            "{:.0f} %, "
            "apart from the uncertainty of the shares: press harder, or take a heavier object",
            g.weight_kg, 100 * g.weight_sd_kg / std::abs(g.weight_kg), 100 * grasp::kKnownSure);
    if (const double factor = mass_kg / g.weight_kg;
        what == "known" && !(factor > 1 / grasp::kKnownFactor && factor < grasp::kKnownFactor))
        return fmt::format("refused: {:g} kg is {:.2g} times the {:.4f} kg that hang now; at most {:g} times, or a {:g}th",
                           mass_kg, factor, g.weight_kg, grasp::kKnownFactor, grasp::kKnownFactor);
    return fmt::format("refused: the grasp does not allow it now (grip \"{}\", weight \"{}\": tactilectl status)",
                       grip_state_text(g.state), weight_state_text(g.weight_state));
}

// Returns true if `mass_kg` is near the present weight only when it is read as grams.
bool is_in_grams(double mass_kg, double load_kg) {
    constexpr double kGramsInAKg = 1000, kNear = 3;
    const double ratio = mass_kg / kGramsInAKg / load_kg;
    return ratio > 1 / kNear && ratio < kNear;
}

constexpr double kFarApart = 0.2;  // relative difference beyond which another object is likelier than a wrong scale

int weigh(const Args& args) {
    const std::string& what = args.what;
    const Segment segment = open_node(args.node);
    tactiled_node node{};
    (void)segment.latest_node(node);
    const double before_kg = node.grasp.weight_kg;
    const bool is_stable = what == "known" && node.grasp.weight_state == TACTILED_WEIGHT_STABLE;
    if (is_stable && is_in_grams(args.mass_kg, before_kg))
        throw VerbError(
            kUsage,
            fmt::format("weigh known: the mass is in kg: {} kg is {:.0f} times the {:.4f} kg that hang now; for grams "
                        "write {}",
                        args.mass_kg, args.mass_kg / node.grasp.weight_kg, node.grasp.weight_kg, args.mass_kg / 1000));
    if (is_stable && !args.force && std::abs(args.mass_kg - before_kg) > kFarApart * std::abs(before_kg))
        throw VerbError(kUsage,
                        fmt::format("weigh known: {:g} kg is {:.0f} % of the {:.4f} kg that hang now: is it this object? "
                                    "--force sets the scale all the same",
                                    args.mass_kg, 100 * args.mass_kg / before_kg, before_kg));
    const std::string word = what == "known" ? fmt::format("{:.17g}", args.mass_kg) : what;
    const Answer answer = ask(segment, "weigh " + word, args.timeout_s);
    fmt::print(answer.exit_status == kGood ? stdout : stderr, "weigh {}: {}\n", what,
               answer.result == TACTILED_COMMAND_NOT_NOW ? why_not_now(node.grasp, what, args.mass_kg)
                                                         : result_text(answer.result));
    if (answer.exit_status == kGood && is_stable)
        fmt::print("it read {:.4f} kg, and reads {:g} kg from now on\n", before_kg, args.mass_kg);
    return answer.exit_status;
}

}  // namespace

Run add_weigh(Command verb) {
    auto args = std::make_shared<Args>();
    verb.require_verb();
    add_node_option(verb, args->node);  // accepted before the second word, too
    const auto add = [&](const char* name, const char* help) {
        Command sub = add_verb(verb, name, help);
        add_node_option(sub, args->node);
        add_timeout_option(sub, args->timeout_s);
        sub.callback([args, name] { args->what = name; });
        return sub;
    };
    add("start", "Weighs from now on, in any state of the grasp");
    add("stop", "Stops weighing");
    add("zero", "Tares the stable weight, until this grasp ends");
    add("forget", "Removes the scale of a known weight");
    Command known =
        add("known",
            "Sets the scale: the stable load weighs MASS, has no tare, and read as at most 5 % of it in the grip "
            "before its lift");
    known.add_option("mass", args->mass_kg, "its mass in kg").required().number_in(1e-6, 1000.0);
    known.add_flag("--force", args->force, "also where MASS differs by more than 20 % from the present weight");
    return [args] { return weigh(*args); };
}

}  // namespace tactiled::ctl
