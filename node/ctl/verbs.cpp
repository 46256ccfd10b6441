#include "node/ctl/verbs.hpp"

#include <iterator>

namespace tactiled::ctl {

// Each is in the file of its verb, which adds the options.
Run add_status(Command verb), add_top(Command verb), add_read(Command verb), add_record(Command verb),
    add_replay(Command verb), add_tare(Command verb), add_clear(Command verb), add_weigh(Command verb),
    add_teach(Command verb), add_tool_fit(Command verb), add_grasp_check(Command verb), add_map(Command verb),
    add_check(Command verb), add_completion(Command verb), add_doctor(Command verb);

namespace {

constexpr Verb kVerbs[] = {
    {"status", add_status, "All sensors, links and the grasp once; exit status 1 when a sensor has no value",
     "  tactilectl status\n  tactilectl status --json | jq .fault\n"},
    {"top", add_top, "Sensors, links, grasp and arrays, live; q ends it",
     "  tactilectl top\n  tactilectl top --json --count 10\n"},
    {"read", add_read, "The newest sample of a sensor, or all of them as they come",
     "  tactilectl read left\n  tactilectl read left --follow --csv --count 1000 > forces.csv\n  tactilectl read skin "
     "--array\n"},
    {"record", add_record, "All frames and samples into an MCAP file, until Ctrl-C or the daemon's end",
     "  tactilectl record pick.mcap --seconds 10\n"},
    {"replay", add_replay, "Processes a recording with the daemon's own code, and compares the samples",
     "  tactilectl replay pick.mcap --config my.toml\n  tactilectl replay pick.mcap --config my.toml --sensor left --out "
     "forces.csv\n"},
    {"tare", add_tare, "Sets the zero of a sensor to its present reading; the raw force stays readable",
     "  tactilectl tare left\n  tactilectl tare all --remove\n"},
    {"clear", add_clear, "Clears latched faults and slip latches", "  tactilectl clear\n"},
    {"weigh", add_weigh, "Starts, stops, zeroes or scales the weighing of what the gripper holds",
     "  tactilectl weigh known 0.250     250 g hang now\n  tactilectl weigh zero\n"},
    {"teach", add_teach, "Learns the mass of an object from real grasps, so that the daemon recognises it",
     "  tactilectl teach bolt\n  tactilectl teach --list\n"},
    {"tool-fit", add_tool_fit,
     "Measures the mass and the centre of the hand that the sensors of [tool] carry, in poses that you choose",
     "  tactilectl tool-fit --poses 8\n"},
    {"grasp-check", add_grasp_check,
     "Finds errors of [grasp] in a guided grasp of a known weight, and prints the lines that are right",
     "  tactilectl grasp-check 0.250     with an object of 250 g\n"},
    {"map", add_map, "The Modbus register map",
     "  tactilectl map --format csv > map.csv\n  tactilectl map --format st > tactiled.st\n"},
    {"check", add_check, "Checks a configuration and its calibrations; prints every error in them, and what is unsafe",
     "  tactilectl check my.toml\n  tactilectl check --keys\n"},
    {"completion", add_completion, "Prints a script that completes verbs, options and sensors in bash or zsh",
     "  source <(tactilectl completion bash)\n"},
    {"doctor", add_doctor,
     "Checks what on this machine can delay the daemon (rights, kernel, processors, clock, devices) and what in its "
     "configuration is unsafe; exit status 1 when something is wrong",
     "  tactilectl doctor --config my.toml\n"},
};

}  // namespace

const std::vector<Verb>& verbs() {
    static const std::vector<Verb> all = [] {
        std::vector<Verb> list(std::begin(kVerbs), std::end(kVerbs));
        list.insert(list.end(), std::begin(kLaboratoryVerbs), std::end(kLaboratoryVerbs));
        return list;
    }();
    return all;
}

}  // namespace tactiled::ctl
