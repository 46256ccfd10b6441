// tactilectl read SENSOR: samples from shared memory.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "node/ctl/array_text.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/liveness.hpp"
#include "node/ctl/verb.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper", sensor;
    bool follow = false, csv = false, json = false, raw = false, array = false;
    long count = 0;
    double timeout_s = 2;
};

std::string cell(double value) { return std::isfinite(value) ? fmt::format("{}", value) : std::string(); }

// A row of forces.csv; t_s is CLOCK_MONOTONIC.
std::string csv_row(const tactiled_sample& s, bool raw) {
    std::string row = fmt::format("{:.6f}", double(s.t_ns) / 1e9);
    for (const double* values : {raw ? s.raw_force_S_N : s.force_S_N, raw ? s.raw_torque_S_Nm : s.torque_S_Nm, s.sd_force_N})
        for (int i = 0; i < 3; ++i) row += "," + cell(values[i]);
    return row + "," + fmt::format("\"{}\"", quality_text(s.quality, s.reasons));
}

std::string json_row(const tactiled_sample& s) {
    return nlohmann::json{{"schema", 1},
                          {"sequence", s.sequence},
                          {"t_ns", s.t_ns},
                          {"epoch", s.epoch},
                          {"quality", quality_text(s.quality, s.reasons)},
                          {"force_S_N", s.force_S_N},
                          {"torque_S_Nm", s.torque_S_Nm},
                          {"sd_force_N", s.sd_force_N},
                          {"raw_force_S_N", s.raw_force_S_N},
                          {"tare_count", s.tare_count}}
        .dump();
}

std::string text_row(const tactiled_sample& s, bool raw) {
    std::string row = fmt::format("{:>10}", s.sequence);
    const double* const force = raw ? s.raw_force_S_N : s.force_S_N;
    for (int i = 0; i < 3; ++i)
        row += std::isfinite(force[i]) ? fmt::format(" {:>10.4f}", force[i]) : fmt::format(" {:>10}", "-");
    return row + "  " + quality_text(s.quality, s.reasons);
}

// Prints the state of a daemon that does not run. Returns true if it is dead.
bool report_daemon(const Reader& reader) {
    if (!reader.is_attached()) return false;
    const Liveness liveness = liveness_of(reader.segment());
    if (!liveness.runs()) fmt::print(stderr, "tactilectl: {}\n", liveness.why);
    return liveness.is_dead();
}

int read_array(const Args& args, Reader& reader) {
    Array array;
    if (!reader.latest(array)) {
        fmt::print(stderr, "tactilectl: the sensor \"{}\" has no taxels\n", args.sensor);
        return kUsage;
    }
    const SegmentView segment = reader.segment();
    const auto sensor = std::uint32_t(segment.find(args.sensor));
    std::string out;
    if (args.json) {
        out = R"({"schema":1,)";
        append_array_json(segment, sensor, array, out);
        out.back() = '}';
        out += '\n';
    } else if (args.csv) {
        out = kArrayCsvHeader;
        append_array_csv(segment, sensor, array, out);
    } else {
        out = array_table(segment, sensor, array);
    }
    fmt::print("{}", out);
    return report_daemon(reader) ? kNotReachable : array.head().sample.quality == TACTILED_BAD ? kUnhealthy : kGood;
}

int read(const Args& args) {
    catch_interrupt();
    Reader reader(args.node, args.sensor);
    if (!reader.is_attached()) {
        fmt::print(stderr, "tactilectl: {}\n", reader.why_not());
        std::string unused;
        if (!Segment::try_open(args.node, unused).is_open()) return kNotReachable;
        return kUsage;
    }
    if (args.array) return read_array(args, reader);
    if (args.csv)
        fmt::print("t_s,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,sd_fx_N,sd_fy_N,sd_fz_N,quality\n");
    else if (!args.json)
        fmt::print("{:>10} {:>10} {:>10} {:>10}  quality\n", "sequence", "fx/N", "fy/N", "fz/N");
    const auto print = [&](const tactiled_sample& s) {
        fmt::print("{}\n", args.json ? json_row(s) : args.csv ? csv_row(s, args.raw) : text_row(s, args.raw));
    };
    if (!args.follow) {
        const tactiled_sample sample = reader.latest();
        print(sample);
        return report_daemon(reader) ? kNotReachable : sample.quality == TACTILED_BAD ? kUnhealthy : kGood;
    }
    tactiled_sample sample{};
    std::uint64_t heard_ns = monotonic_ns();
    for (long n = 0; interrupted == 0 && (args.count == 0 || n < args.count);) {
        if (reader.next(sample)) {
            print(sample);
            heard_ns = monotonic_ns();
            ++n;
            continue;
        }
        std::fflush(stdout);
        if (std::ferror(stdout) != 0) break;  // the reader of the output has disconnected
        if (args.timeout_s > 0 && double(monotonic_ns() - heard_ns) > args.timeout_s * 1e9) {
            fmt::print(stderr, "tactilectl: nothing from \"{}\" for {} s\n", args.sensor, args.timeout_s);
            if (report_daemon(reader)) return kNotReachable;
            return reader.is_attached() && reader.segment().is_current() ? kUnhealthy : kNotReachable;
        }
        std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
    if (reader.lost() != 0)
        fmt::print(stderr, "tactilectl: {} samples were missed: this program was too slow\n", reader.lost());
    return sample.quality == TACTILED_BAD ? kUnhealthy : kGood;
}

}  // namespace

Run add_read(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("sensor", args->sensor, "name of the sensor").required();
    add_node_option(verb, args->node);
    const Option follow = verb.add_flag("--follow", args->follow, "every sample, as they come");
    verb.add_flag("--csv", args->csv, "columns of forces.csv, or a line for each taxel");
    verb.add_flag("--json", args->json, "one JSON object a line");
    const Option raw = verb.add_flag("--raw", args->raw, "before tare (text and CSV; JSON has both)");
    verb.add_flag("--array", args->array, "the newest array of a sensor with taxels").excludes(follow).excludes(raw);
    verb.add_option("--count", args->count, "with --follow: end after so many")
        .integer_in(1L, 1'000'000'000L)
        .needs("--follow");
    verb.add_option("--timeout", args->timeout_s, "with --follow: seconds without a sample before giving up; 0 never")
        .not_negative()
        .show_default();
    return [args] { return read(*args); };
}

}  // namespace tactiled::ctl
