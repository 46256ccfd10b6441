// tactilectl teach NAME: measures the weight of an object in real grasps; the daemon then recognises the object by
// its weight.
#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "config/names.hpp"
#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/verb.hpp"
#include "node/objects.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper", name, forget;
    bool list = false, reload = false, json = false;
    unsigned count = 5;
    double timeout_s = 60;
};

nlohmann::json as_json(const TaughtObject& o) {
    return {{"id", o.id},       {"name", o.name},     {"mass_kg", o.mass_kg},
            {"sd_kg", o.sd_kg}, {"grasps", o.grasps}, {"scaled", o.scaled}};
}

// Returns the next grasps of the node, each as soon as its weight is stable; fewer than requested if interrupted.
std::vector<Weighing> weigh_grasps(Segment& segment, const Args& args) {
    std::vector<Weighing> weighings;
    tactiled_node node{};
    bool counting = false;
    std::uint32_t taken = 0;  // tactiled_grasp.grasps of the last one, or at the beginning
    std::uint64_t heard_ns = monotonic_ns();
    while (interrupted == 0 && weighings.size() < args.count) {
        if (double(monotonic_ns() - heard_ns) > args.timeout_s * 1e9)
            throw VerbError(kUnhealthy, fmt::format("no grasp with a stable weight for {} s: {} of {} seen, nothing stored",
                                                    args.timeout_s, weighings.size(), args.count));
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        std::string unused;
        if (!segment.is_current()) {  // a successor counts from 0
            if (Segment fresh = Segment::try_open(args.node, unused); fresh.is_open()) segment = std::move(fresh);
            counting = false;
            continue;
        }
        if (!segment.latest_node(node)) continue;
        const tactiled_grasp& g = node.grasp;
        if (!counting) {
            taken = g.grasps;
            counting = true;
        }
        if (g.grasps == taken || g.weight_state != TACTILED_WEIGHT_STABLE || !is_teachable(weighing_of(g))) continue;
        taken = g.grasps;
        heard_ns = monotonic_ns();
        weighings.push_back(weighing_of(g));
        if (!args.json) {
            fmt::print("grasp {} of {}: {:.4f} kg +- {:.4f} kg{}\n", weighings.size(), args.count, g.weight_kg,
                       g.weight_sd_kg, (node.status & TACTILED_SIMULATED) != 0 ? "  (simulated)" : "");
            std::fflush(stdout);
        }
    }
    return weighings;
}

int store_and_load(const Segment& segment, const std::string& path, const std::vector<TaughtObject>& taught) {
    store_objects(path, taught);
    const Answer answer = ask(segment, "load-objects", 5);
    if (answer.exit_status != kGood)
        fmt::print(stderr, "tactilectl: {} is stored, but the daemon has not read it: {}\n", path,
                   answer.text.empty() ? "refused" : answer.text);
    return answer.exit_status;
}

int list(const std::vector<TaughtObject>& taught, bool json) {
    if (json) {
        nlohmann::json out{{"schema", 1}, {"objects", nlohmann::json::array()}};
        for (const auto& o : taught) out["objects"].push_back(as_json(o));
        fmt::print("{}\n", out.dump());
        return kGood;
    }
    fmt::print("{:>5} {:<31} {:>10} {:>10} {:>7}\n", "id", "name", "mass/kg", "sd/kg", "grasps");
    for (const auto& o : taught)
        fmt::print("{:>5} {:<31} {:>10.4f} {:>10.4f} {:>7}\n", o.id, o.name, o.mass_kg, o.sd_kg, o.grasps);
    return kGood;
}

std::vector<TaughtObject> taught_in(const std::string& path) {
    Problems problems;
    auto taught = load_objects(path, problems);
    problems.throw_if_any();
    return taught;
}

// Returns the standard deviation of the weights from grasp to grasp, or the largest one that a grasp states, if
// larger.
double scatter_kg(const std::vector<Weighing>& weighings) {
    if (weighings.size() < 2) return 0;
    const double n = double(weighings.size());
    double mean = 0, squares = 0;
    for (const auto& w : weighings) mean += w.mass_kg / n;
    for (const auto& w : weighings) squares += (w.mass_kg - mean) * (w.mass_kg - mean);
    return std::sqrt(squares / (n - 1));
}
double stated_kg(const std::vector<Weighing>& weighings) {
    double stated = 0;
    for (const auto& w : weighings) stated = std::max(stated, w.sd_kg);
    return stated;
}

// Grasps that differ by so much are no scatter of one object.
constexpr double kApart = 0.1, kApart_stated = 5;  // their scatter over the mass, and over what each weight states

int teach(Segment& segment, const std::string& path, const Args& args) {
    std::vector<TaughtObject> before = taught_in(path);
    const TaughtObject* known = find_object(before, args.name);
    if (known == nullptr && before.size() >= grasp::Grasp::kMaxObjects)
        throw VerbError(kUnhealthy,
                        fmt::format("{} objects are taught, no more fit: tactilectl teach --forget NAME", before.size()));
    fmt::print(stderr, "Grasp and lift \"{}\" {} times, and release it in between.{}\n", args.name, args.count,
               known != nullptr ? " What was taught of it before is replaced." : "");
    const auto weighings = weigh_grasps(segment, args);
    if (weighings.size() < args.count) return kUnhealthy;
    for (const Weighing& w : weighings)
        if (w.scaled != weighings.front().scaled)
            throw VerbError(kUnhealthy,
                            "the scale was set in between (tactilectl weigh known or forget, or a restart): nothing stored");
    const double scatter = scatter_kg(weighings);
    if (const double mass_kg = summary_of(weighings).mass_kg;
        scatter > kApart * mass_kg && scatter > kApart_stated * stated_kg(weighings))
        throw VerbError(kUnhealthy,
                        fmt::format("the {} weights of {:.4f} kg on average scatter by {:.4f} kg, and each states "
                                    "{:.4f} kg: they are of different objects. Nothing stored",
                                    weighings.size(), mass_kg, scatter, stated_kg(weighings)));
    const ObjectsLock lock(path);
    before = taught_in(path);  // another program may have changed the file meanwhile
    known = find_object(before, args.name);
    if (known == nullptr && before.size() >= grasp::Grasp::kMaxObjects)
        throw VerbError(kUnhealthy, fmt::format("{} objects are taught by now, no more fit", before.size()));
    TaughtObject object = summary_of(weighings);
    object.name = args.name;
    object.id = known != nullptr ? known->id : free_id(before);
    if (const auto confusion = confused_with(object, before))
        throw VerbError(
            kUnhealthy,
            fmt::format("\"{}\" ({:.4f} kg, sd {:.4f} kg) cannot be distinguished from \"{}\" ({:.4f} kg, sd {:.4f} kg): "
                        "they are {:.1f} sd of each apart, {:g} are needed. Nothing stored",
                        object.name, object.mass_kg, object.sd_kg, confusion->other->name, confusion->other->mass_kg,
                        confusion->other->sd_kg, confusion->apart_sd, kApart_sd));
    std::vector<TaughtObject> taught;
    for (const auto& other : before)
        if (other.id != object.id) taught.push_back(other);
    taught.push_back(object);
    const int exit_status = store_and_load(segment, path, taught);
    if (args.json)
        fmt::print("{}\n", nlohmann::json{{"schema", 1}, {"object", as_json(object)}, {"file", path}}.dump());
    else
        fmt::print(
            "{}: {:.4f} kg, sd {:.4f} kg, id {}, in {}\n"
            "(the grasps scatter by {:.4f} kg, and each weight states {:.4f} kg: the larger one counts)\n",
            object.name, object.mass_kg, object.sd_kg, object.id, path, scatter, stated_kg(weighings));
    return exit_status;
}

int run_teach(const Args& args) {
    catch_interrupt();
    Segment segment = open_node(args.node);
    std::string why;
    const std::string path = ask_plain(segment, "objects-file", 5, why);
    if (path.empty()) throw VerbError(kNotReachable, why);
    if (path.front() != '/') throw VerbError(kUnhealthy, "there is no [grasp] in the daemon's configuration");
    if (args.reload) {
        const Answer answer = ask(segment, "load-objects", 5);
        if (answer.exit_status != kGood) throw VerbError(answer.exit_status, answer.text);
        return kGood;
    }
    if (args.list) return list(taught_in(path), args.json);
    if (args.forget.empty()) return teach(segment, path, args);
    const ObjectsLock lock(path);
    const auto taught = taught_in(path);
    const TaughtObject* const disconnected = find_object(taught, args.forget);
    if (disconnected == nullptr)
        throw VerbError(kUsage, fmt::format("no object \"{}\" is taught (tactilectl teach --list)", args.forget));
    std::vector<TaughtObject> left;
    for (const auto& object : taught)
        if (&object != disconnected) left.push_back(object);
    const int exit_status = store_and_load(segment, path, left);
    if (exit_status == kGood && !args.json) fmt::print("{}: removed\n", args.forget);
    return exit_status;
}

}  // namespace

Run add_teach(Command verb) {
    auto args = std::make_shared<Args>();
    Command what = verb.add_group_of_which_one_is_needed("what");
    what.add_option("name", args->name, "the object's name").check([](const std::string& name) {
        return valid_name(name) ? std::string() : std::string(kValidName);
    });
    what.add_flag("--list", args->list, "list the taught objects");
    what.add_option("--forget", args->forget, "removes an object");
    what.add_flag("--reload", args->reload, "the daemon reads the file again, after it was edited by hand");
    add_node_option(verb, args->node);
    verb.add_option("--count", args->count, "grasps to learn from").integer_in(1, 1000).show_default();
    verb.add_option("--timeout", args->timeout_s, "seconds without a new stable weight before giving up")
        .number_in(0.1, 86400.0)
        .show_default();
    verb.add_flag("--json", args->json, "one JSON object");
    return [args] { return run_teach(*args); };
}

}  // namespace tactiled::ctl
