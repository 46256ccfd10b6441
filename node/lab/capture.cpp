// tactilectl capture LINK|DEVICE: records channels under known loads into a labelled.csv, before there is a sensor or
// a calibration.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "config/names.hpp"
#include "config/options.hpp"
#include "drivers/driver.hpp"
#include "node/ctl/command_line.hpp"
#include "node/lab/capture_file.hpp"
#include "node/lab/capture_steadiness.hpp"
#include "node/lab/listen.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kGiveUp_s = 5;  // time without a frame
constexpr int kReadMs = 20;

struct Args {
    std::string what, config = "/etc/tactiled/tactiled.toml", node = "gripper";
    std::string append, session, reference, scale;
    std::vector<std::string> labels, channels;
    unsigned baud = 0, scale_baud = 9600;
    int device = -1;
    double seconds = 2, settle_s = 0.3;
    bool json = false, force = false;
};

// The driver of a link, without node and sensor.
struct Source {
    Problems problems;  // before the options, which refer to it
    Options options;
    std::unique_ptr<Driver> driver;
    Source() : options(Options::parse_text("", "", problems)) {}
};

std::unique_ptr<Source> open_source(const Args& args) {
    auto source = std::make_unique<Source>();
    if (const std::string port = device_of(args.what); !port.empty()) {
        const Heard heard = listen(port, args.baud, 1);
        if (!heard.guess)
            throw SetupError(
                fmt::format("{}: {}", port, heard.bytes.empty() ? "nothing arrives" : why_no_format(heard.bytes)));
        source->options = Options::parse_text(heard.keys(), args.what, source->problems);
    } else {
        Options root = Options::parse_file(args.config, source->problems);
        std::vector<std::string> names;
        bool found = false;
        for (Options& table : root.tables("link")) {
            names.push_back(table.text("name", ""));
            if (names.back() != args.what) continue;
            source->options = table;
            found = true;
        }
        source->problems.throw_if_any();
        if (!found)
            throw SetupError(fmt::format("{}: link {} {}", args.config, in_quotes(args.what), is_unknown(args.what, names)));
    }
    const std::string name = source->options.text("driver");
    const DriverEntry* const entry = Drivers::find(name);
    if (entry == nullptr)
        source->options.problem("driver",
                                fmt::format("driver = {} {}", in_quotes(name), is_unknown(name, Drivers::names())));
    source->problems.throw_if_any();
    source->driver = entry->make(source->options);
    source->problems.throw_if_any();
    return source;
}

// Reads frames for `seconds` after `settle_s`; the load of each row is NaN. At most `max_rows`.
// setup: throws SetupError where the link cannot be opened, sends nothing, or sends frames of different sizes
std::vector<CapturedRow> read_rows(Driver& driver, int& device, double settle_s, double seconds, Reference* reference,
                                   std::size_t max_rows = SIZE_MAX) {
    if (const std::string why = driver.open(); !why.empty()) throw std::runtime_error(why);
    std::vector<CapturedRow> rows;
    const std::uint64_t began_ns = monotonic_ns();
    std::uint64_t first_ns = 0, heard_ns = began_ns;
    Frame frame;
    while (interrupted == 0 && rows.size() < max_rows) {
        const Status status = driver.read(frame, kReadMs);
        const std::uint64_t now_ns = monotonic_ns();
        if (reference != nullptr) reference->poll();
        if (double(now_ns - heard_ns) > kGiveUp_s * 1e9) break;
        if (first_ns != 0 && double(now_ns - first_ns) > (settle_s + seconds) * 1e9) break;
        if (status == Status::disconnected) {
            driver.close();
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
            if (const std::string why = driver.open(); !why.empty()) throw std::runtime_error(why);
        }
        if (status != Status::frame) continue;
        if (device < 0) device = frame.device;
        if (frame.device != device) continue;
        heard_ns = now_ns;
        if (first_ns == 0) first_ns = now_ns;
        if (double(now_ns - first_ns) < settle_s * 1e9) continue;
        CapturedRow row{frame.t_ns != 0 ? frame.t_ns : now_ns, {}, {}};
        row.channel.assign(frame.channel.begin(), frame.channel.begin() + frame.n_channels);
        row.load.fill(std::nan(""));
        if (!rows.empty() && rows.front().channel.size() != row.channel.size())
            throw std::runtime_error(
                fmt::format("frames of {} and of {} channels: --device N chooses one of several devices",
                            rows.front().channel.size(), row.channel.size()));
        if (rows.empty() || row.t_ns > rows.back().t_ns) rows.push_back(std::move(row));
    }
    if (reference != nullptr) {
        std::this_thread::sleep_for(std::chrono::milliseconds(60));  // the sample after the last frame
        reference->poll();
    }
    driver.close();
    if (rows.empty() && interrupted == 0)
        throw std::runtime_error(
            fmt::format("no frame in {:g} s: tactilectl identify shows what the port sends", kGiveUp_s));
    return rows;
}

// Returns the next load that the user types for `file`; nullopt at the end of the input and after two empty lines.
// Repeats the question after a line that is no load of this file, and counts that line in `refused`.
std::optional<Load> ask_load(const CaptureFile& file, int& refused) {
    int empty = 0;
    for (std::string line; interrupted == 0 && empty < 2;) {
        fmt::print(stderr, "Apply a load, then type it, such as fz_N=-5 (press: fz < 0); two empty lines end: ");
        if (!std::getline(std::cin, line)) break;
        empty = line.find_first_not_of(" \t\r") == line.npos ? empty + 1 : 0;
        if (empty != 0) continue;
        try {
            const Load load = parse_load({line});
            file.check(load);
            return load;
        } catch (const SetupError& error) {
            fmt::print(stderr, "tactilectl: {}\n", error.what());
            ++refused;
        }
    }
    return std::nullopt;
}

int capture(Args args) {
    if (int(!args.labels.empty()) + int(!args.reference.empty()) + int(!args.scale.empty()) > 1)
        refuse("--label, --reference and --scale exclude each other");
    catch_interrupt();
    const bool measured = !args.reference.empty() || !args.scale.empty();
    std::optional<Load> typed;
    if (!args.labels.empty()) typed = parse_load(args.labels);
    for (const auto& name : args.channels)
        if (!valid_channel(name)) throw SetupError(fmt::format("--channels {}: {}", in_quotes(name), kValidChannel));
    if (!args.session.empty() && !valid_channel(args.session))
        throw SetupError(
            fmt::format("--session {}: write 1 .. 31 bytes without space, comma or quote", in_quotes(args.session)));
    const auto source = open_source(args);
    std::unique_ptr<Reference> reference;
    if (!args.reference.empty()) reference = reference_sensor(args.node, args.reference);
    if (!args.scale.empty()) reference = reference_scale(args.scale, args.scale_baud);

    const std::size_t n = [&] {
        const auto first = read_rows(*source->driver, args.device, 0, kGiveUp_s, nullptr, 1);
        return first.empty() ? 0 : first.front().channel.size();
    }();
    if (n == 0) return kUnhealthy;  // interrupted
    if (!args.channels.empty() && args.channels.size() != n)
        throw SetupError(fmt::format("--channels names {}, a frame has {}", args.channels.size(), n));
    std::vector<std::string> names = args.channels;
    const bool there = ::access(args.append.c_str(), F_OK) == 0;
    for (std::size_t k = names.size(); k < n; ++k) names.push_back(there ? "" : fmt::format("c{}", k + 1));
    CaptureFile file(args.append, names);
    if (typed) file.check(*typed);
    const std::string session = !args.session.empty() ? args.session : file.last_session();

    nlohmann::json loads = nlohmann::json::array();
    std::size_t captured = 0;
    int refused = 0;  // lines that were no load
    while (interrupted == 0) {
        const std::optional<Load> load = measured || typed ? typed : ask_load(file, refused);
        if (!measured && !load) break;
        auto rows = read_rows(*source->driver, args.device, args.settle_s, args.seconds, reference.get());
        if (interrupted != 0) break;
        const std::size_t read = rows.size();
        for (auto& row : rows) {
            const auto found = measured ? reference->at(row.t_ns) : load;
            if (found) row.load = *found;
        }
        std::erase_if(rows, [](const CapturedRow& row) {
            return std::none_of(row.load.begin(), row.load.end(), [](double v) { return std::isfinite(v); });
        });
        if (rows.empty())
            throw std::runtime_error(
                fmt::format("the reference measured nothing beside these {} frames: is it GOOD, and does it "
                            "send?",
                            read));
        if (rows.size() != read)
            fmt::print(stderr, "tactilectl: {} of {} frames had no reference\n", read - rows.size(), read);
        const auto channels = steadiness(rows, file.channels());
        const auto moving = moving_channels(channels, file);
        if (!args.json) print_load(rows, channels);
        if (!measured && !args.force && !moving.empty()) {
            fmt::print(stderr,
                       "tactilectl: the load changed while it was read ({}): these rows are not appended; wait until it "
                       "rests (--settle), or --force appends them\n",
                       fmt::join(moving, " "));
            ++refused;
            if (typed) break;
            continue;
        }
        file.append(rows, session);
        captured += rows.size();
        loads.push_back(load_json(rows, channels));
        if (measured || typed) break;
    }
    if (captured == 0) {
        fmt::print(stderr, "tactilectl: nothing was captured\n");
        return kUnhealthy;
    }
    // A person has seen the question again; a program has not, and its load is not in the file.
    const int status = refused != 0 && ::isatty(STDIN_FILENO) == 0 ? kUnhealthy : kGood;
    const auto missing = file.missing();
    if (args.json) {
        fmt::print("{}\n", nlohmann::json{{"schema", 1},
                                          {"file", args.append},
                                          {"session", session},
                                          {"loads", loads},
                                          {"coverage", file.coverage()},
                                          {"missing", missing}}
                               .dump());
        return status;
    }
    fmt::print("{}, session {}: {}\n", args.append, session, fmt::join(file.coverage(), "; "));
    for (const auto& text : missing) fmt::print("still missing: {}\n", text);
    if (missing.empty())
        fmt::print("next: tactilectl calibrate --model generic --in {} --out my_sensor.toml\n", args.append);
    return status;
}

}  // namespace

Run add_capture(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("port", args->what, "a link of --config, a serial port, or ADDRESS:PORT").required();
    verb.add_option("--append", args->append, "labelled.csv, which is created or continued").required();
    verb.add_option("--config", args->config, "the configuration that has the link").show_default();
    verb.add_option("--label", args->labels, "the load, frame S: fz_N=-5 is a press of 5 N; without it: asked for")
        .take_all();
    verb.add_option("--reference", args->reference, "a sensor of the running daemon that measures the load");
    verb.add_option("--scale", args->scale, "serial port of a scale that prints g, kg or N; it carries the load, fz = -m g");
    verb.add_option("--scale-baud", args->scale_baud, "its rate").show_default();
    add_node_option(verb, args->node);
    verb.add_option("--session", args->session, "one mounting; default: that of the file's last row, else 1");
    verb.add_option("--channels", args->channels, "names for a new file: A,B,C; default c1,c2 ...").delimiter(',');
    verb.add_option("--device", args->device, "number of the device, where the link carries several").integer_in(0, 65'535);
    verb.add_option("--baud", args->baud, "rate of a serial port that is named directly").integer_in(50, 12'000'000);
    verb.add_option("--seconds", args->seconds, "time to read under each load").number_in(0.05, 86'400.0).show_default();
    verb.add_option("--settle", args->settle_s, "seconds to wait before them").number_in(0.0, 3600.0).show_default();
    verb.add_flag("--force", args->force, "append the rows of a load that changed while it was read, too");
    verb.add_flag("--json", args->json, "one JSON object");
    return [args] { return capture(*args); };
}

}  // namespace tactiled::ctl
