// tactilectl tare SENSOR|all: the same as the PLC's command, acknowledged by the daemon.
#include <fmt/format.h>

#include <memory>

#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper", sensor;
    bool remove = false;
    double timeout_s = 15;
};

const char* result_text(int result) {
    switch (result) {
        case TACTILED_COMMAND_OK: return "done";
        case TACTILED_COMMAND_NOT_NOW:
            return "refused: a sensor has no trustworthy value now, or a tare is running (tactilectl status)";
        case TACTILED_COMMAND_BAD_MASK: return "refused: no such sensor";
        case TACTILED_COMMAND_FAILED:
            return "failed: a sensor lost its value, or gave too few samples, while the zero was averaged";
        case TACTILED_COMMAND_MOVING:
            return "refused: the force of a sensor moved while its zero was averaged (tare_ms); wait until it rests";
        case TACTILED_COMMAND_UNDER_LOAD:
            return "refused: a sensor is under load, beyond its tare_limit_N (20 % of its full scale in each component "
                   "unless its [[sensor]] has another): unload it; where its zero has moved so far, calibrate it, or write "
                   "a larger tare_limit_N";
        case TACTILED_COMMAND_NOT_STORED:
            return "refused, or lost with the next restart: the file of zeros cannot be written; the daemon's log has the "
                   "reason";
        case TACTILED_COMMAND_TIMED_OUT: return "timed out";
        default: return "refused";
    }
}

int tare(const Args& args) {
    const Segment segment = open_node(args.node);
    std::uint32_t mask = (1u << segment.n_sensors()) - 1;
    if (args.sensor != "all") {
        const int index = segment.find(args.sensor);
        if (index < 0) throw VerbError(kUsage, segment.why_no_sensor(args.node, args.sensor));
        mask = 1u << index;
    }
    const char* const verb = args.remove ? "untare" : "tare";
    const Answer answer = ask(segment, fmt::format("{} {}", verb, mask), args.timeout_s);
    fmt::print(answer.exit_status == kGood ? stdout : stderr, "{} {}: {}\n", verb, args.sensor, result_text(answer.result));
    Snapshot now;
    if (answer.result == TACTILED_COMMAND_UNDER_LOAD && segment.snapshot(now))
        for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
            if (const double* const raw_N = now.sensor[i].raw_force_S_N; (mask >> i & 1u) != 0)
                fmt::print(stderr, "{} reads fx {:.3f}, fy {:.3f}, fz {:.3f} N without a tare\n", segment.sensor(i).name,
                           raw_N[0], raw_N[1], raw_N[2]);
    if (answer.exit_status != kGood && answer.result == TACTILED_COMMAND_NOT_NOW && segment.snapshot(now))
        for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
            const auto& s = now.sensor[i];
            if ((mask >> i & 1u) == 0 || (s.quality == TACTILED_GOOD && s.reasons == 0)) continue;
            fmt::print(stderr, "{} is {}\n{}", segment.sensor(i).name, quality_text(s.quality, s.reasons),
                       remedy_lines(segment.sensor(i).name, s.reasons));
        }
    return answer.exit_status;
}

}  // namespace

Run add_tare(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("sensor", args->sensor, "name of the sensor, or all").required();
    add_node_option(verb, args->node);
    verb.add_flag("--remove", args->remove, "back to the calibration's zero");
    add_timeout_option(verb, args->timeout_s);
    return [args] { return tare(*args); };
}

}  // namespace tactiled::ctl
