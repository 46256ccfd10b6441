// tactilectl tool-fit: measures the part of the hand that each sensor of [tool] carries, from poses that a person chooses.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <memory>

#include "decoupling/tool/tool_fit.hpp"
#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/guided.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kSame_m_s2 = 0.2;  // gravity of two poses that are one

struct Args {
    std::string node = "gripper", config;
    unsigned poses = 6;
    double seconds = 1;
    bool ask_gravity = false;
};

std::string numbers(const std::array<double, 3>& v, double scale, int digits) {
    return fmt::format("[{:.{}f}, {:.{}f}, {:.{}f}]", v[0] * scale, digits, v[1] * scale, digits, v[2] * scale, digits);
}

// One pose. False: give up.
bool take_pose(const Segment& segment, const Args& args, std::uint32_t mask, std::vector<Observed>& poses) {
    const std::string where = fmt::format("Pose {} of {}", poses.size() + 1, args.poses);
    while (interrupted == 0) {
        if (!ask_person(
                fmt::format("{}: turn the hand, with nothing in it and nothing that touches it; when it rests, press "
                            "Enter: ",
                            where)))
            return false;
        Observed seen = observe(segment, mask, args.seconds);
        if (seen.fault.empty() && args.ask_gravity) {
            const auto typed = ask_person("gravity in G, three numbers in m/s^2 (palm down: 0 0 9.81): ");
            if (!typed) return false;
            const auto g = three_numbers(*typed);
            if (!g)
                seen.fault = fmt::format("\"{}\" is not three numbers", *typed);
            else
                seen.gravity_G_m_s2 = *g;
        }
        const auto& g = seen.gravity_G_m_s2;
        const double size = std::hypot(g[0], g[1], g[2]);
        if (seen.fault.empty() && !(size > 9.7 && size < 9.9))
            seen.fault = args.ask_gravity ? fmt::format("its length is {:.2f}, not 9.7 .. 9.9 m/s^2", size)
                                          : "the robot does not report gravity (registers GRAVITY_X .. GRAVITY_Z); type it "
                                            "with --ask-gravity";
        for (const Observed& before : poses) {
            const auto& b = before.gravity_G_m_s2;
            if (seen.fault.empty() && std::hypot(g[0] - b[0], g[1] - b[1], g[2] - b[2]) < kSame_m_s2)
                seen.fault = "gravity is that of a pose before: turn the hand further, or see that the robot reports it";
        }
        if (seen.fault.empty()) {
            fmt::print("  gravity {} m/s^2\n", numbers(g, 1, 2));
            poses.push_back(std::move(seen));
            return true;
        }
        fmt::print("  not taken: {}\n", seen.fault);
    }
    return false;
}

int fit(const Args& args) {
    catch_interrupt();
    const Segment segment = open_node(args.node);
    const Node node = configuration_of(segment, args.config);
    if (!node.tool) throw SetupError("there is no [tool] in the configuration");
    std::uint32_t mask = 0;
    for (const auto& sensor : node.tool->sensors) mask |= 1u << sensor.sensor;
    std::vector<Observed> poses;
    while (poses.size() < args.poses)
        if (!take_pose(segment, args, mask, poses))
            throw VerbError(kUnhealthy, fmt::format("ended after {} of {} poses", poses.size(), args.poses));
    int exit_status = kGood;
    fmt::print("\n# For the configuration; then reload the daemon, and untare.\n");
    for (const auto& sensor : node.tool->sensors) {
        std::vector<tool::Pose> of_sensor;
        for (const Observed& pose : poses) of_sensor.push_back({pose.gravity_G_m_s2, pose.raw_S[sensor.sensor]});
        const tool::Fit f = tool::fit_tool(of_sensor, sensor.S_from_G, sensor.position_G_m);
        const std::string& name = node.config.sensors[sensor.sensor].name;
        if (!f.fault.empty()) {
            fmt::print("# sensor \"{}\": {}\n", name, f.fault);
            exit_status = kUnhealthy;
            continue;
        }
        fmt::print("[[tool.sensor]]  # left in the poses: {:.4f} N rms, {:.4f} N at most\nsensor = \"{}\"\n", f.residual_N,
                   f.worst_N, name);
        for (const auto& one : node.config.tool->sensors)
            if (one.sensor == name) {
                if (one.options.has("x_S_in_G"))
                    fmt::print("x_S_in_G = {}\nz_S_in_G = {}\n", numbers(one.x_S_in_G, 1, 6), numbers(one.z_S_in_G, 1, 6));
                fmt::print("position_G_mm = {}\n", numbers(one.position_G_mm, 1, 3));
            }
        fmt::print("mass_kg = {:.5f}\nmass_sd_kg = {:.5f}\n", f.mass_kg, f.mass_sd_kg);
        if (f.has_centre)
            fmt::print("centre_G_mm = {}\ncentre_sd_mm = {:.3f}\n", numbers(f.centre_G_m, 1e3, 3), f.centre_sd_m * 1e3);
        fmt::print("zero_S_N = {}\nzero_sd_N = {:.5f}\n", numbers(f.zero_S_N, 1, 5), f.zero_sd_N);
        if (f.has_centre) fmt::print("zero_S_Nm = {}\nzero_sd_Nm = {:.6f}\n", numbers(f.zero_S_Nm, 1, 6), f.zero_sd_Nm);
    }
    return exit_status;
}

}  // namespace

Run add_tool_fit(Command verb) {
    auto args = std::make_shared<Args>();
    add_node_option(verb, args->node);
    verb.add_option("--config", args->config, "the configuration; default: the daemon's own");
    verb.add_option("--poses", args->poses, "how many, of orientations as different as possible")
        .integer_in(tool::kMinPoses, 100)
        .show_default();
    verb.add_option("--seconds", args->seconds, "that each pose is averaged").number_in(0.1, 60.0).show_default();
    verb.add_flag("--ask-gravity", args->ask_gravity, "asks for gravity in each pose, where no robot reports it");
    return [args] { return fit(*args); };
}

}  // namespace tactiled::ctl
