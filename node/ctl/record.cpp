// tactilectl record FILE: records all frames of all links, all samples of all sensors and the wrench on the gripper
// from shared memory into an MCAP file. It costs the daemon nothing: an error here, such as a full disk, ends only the
// recording.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <tuple>
#include <utility>

#include "config/text_file.hpp"
#include "decoupling/csv.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/writer.hpp"
#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/liveness.hpp"
#include "node/ctl/sample_message.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"
#include "node/setup.hpp"
#include "node/shm/frame_record.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper", file, config, compression = "none";
    bool overwrite = false, json = false, csv = false;
    double seconds = 0;
    int flush_ms = 200;
};

std::uint64_t wall_ns() {
    timespec t{};
    ::clock_gettime(CLOCK_REALTIME, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

// Reads every record of one ring in order, from the newest on, and counts records that were overwritten before it
// read them.
class Tail {
public:
    Tail(const SegmentView& segment, const tactiled_ring& ring)
        : base_(segment.base()), ring_(&ring), next_(tactiled_ring_head(base_, &ring)) {}

    // Returns false if there is no further record now.
    template <class Record>
    bool next(Record& record) {
        for (;;) {
            const std::uint32_t head = tactiled_ring_head(base_, ring_);
            if (head == next_) return false;
            if (head - next_ > ring_->slots) {
                lost_ += head - ring_->slots - next_;
                next_ = head - ring_->slots;
            }
            if (tactiled_ring_read(base_, ring_, next_++, &record, sizeof record) != 0) return true;
            ++lost_;
        }
    }
    [[nodiscard]] std::uint64_t lost() const { return lost_; }

private:
    const char* base_;
    const tactiled_ring* ring_;
    std::uint32_t next_;
    std::uint64_t lost_ = 0;
};

// Returns the configuration and every file that it names, as they are on the disk: first the configuration as
// "tactiled.toml", then all of them under their own paths.
TextFiles::List configuration_files(const Segment& segment, const Args& args) {
    std::string path = args.config, why;
    if (path.empty()) path = ask_plain(segment, "config-file", 5, why);
    const auto warn = [](const std::string& text) { fmt::print(stderr, "tactilectl: warning: {}\n", text); };
    if (path.empty() || (args.config.empty() && path.front() != '/')) {
        warn(fmt::format("the configuration is not recorded, replay will need --config: {}",
                         why.empty() ? "the daemon does not say where it is" : why));
        return {};
    }
    const TextFiles files;
    Problems problems;
    const Node node = load_node(std::filesystem::absolute(path).string(), problems);
    if (files.list().empty()) {
        if (!args.config.empty()) throw SetupError(problems.lines().front());
        warn(fmt::format("the configuration is not recorded, replay will need --config: {}", problems.lines().front()));
        return {};
    }
    if (!problems.empty())
        warn(problems.lines().front());
    else if (node.plan.calibration_id != segment.calibration_id())
        warn(fmt::format("{} or a calibration was changed since the daemon read it: replay may differ", path));
    TextFiles::List list{{kConfigName, files.list().front().second}};
    for (const auto& file : files.list())
        if (std::find(list.begin() + 1, list.end(), file) == list.end()) list.push_back(file);
    return list;
}

class Recording {
public:
    Recording(const Segment& segment, const Args& args)
        : segment_(segment), files_(configuration_files(segment, args)), file_(args.file, args.overwrite, args.compression) {
        const std::string node = segment.header().name;
        const auto of_frames =
            file_.add_schema(std::string(mcap::kFrameSchema), "ros2msg", std::string(mcap::kFrameDefinition));
        const auto of_samples = file_.add_schema(std::string(kSampleSchema), "ros2msg", std::string(kSampleDefinition));
        const auto of_wrenches = file_.add_schema(std::string(kWrenchSchema), "ros2msg", std::string(kWrenchDefinition));
        const auto of_qualities = file_.add_schema(std::string(kQualitySchema), "ros2msg", std::string(kQualityDefinition));
        for (std::uint32_t i = 0; i < segment.n_links(); ++i) {
            const tactiled_link& link = segment.link(i);
            links_.push_back({Tail(segment, link.frames),
                              file_.add_channel(of_frames, fmt::format("/{}/link/{}/frames", node, link.name), "cdr",
                                                {{std::string(mcap::kLinkKey), link.name},
                                                 {"driver", link.driver},
                                                 {"simulated", link.simulated != 0 ? "true" : "false"}})});
        }
        for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
            const tactiled_sensor& sensor = segment.sensor(i);
            bool simulated = false;
            for (std::uint32_t l = 0; l < segment.n_links(); ++l)
                simulated |= std::string_view(segment.link(l).name) == sensor.link && segment.link(l).simulated != 0;
            const std::map<std::string, std::string> about{{std::string(kSensorKey), sensor.name},
                                                           {"simulated", simulated ? "true" : "false"},
                                                           {"link", sensor.link},
                                                           {"model", sensor.model},
                                                           {"method", sensor.method},
                                                           {"serial", sensor.serial}};
            const auto channel = [&](std::uint16_t schema, const char* what) {
                return file_.add_channel(schema, fmt::format("/{}/{}/{}", node, sensor.name, what), "cdr", about);
            };
            sensors_.push_back({fmt::format("{}{}", sensor.name, simulated ? " (simulated)" : ""),
                                Tail(segment, sensor.ring), channel(of_samples, "sample"), channel(of_wrenches, "wrench"),
                                channel(of_qualities, "quality"),
                                args.csv ? std::make_unique<ForcesWriter>(csv_path(args.file, sensor.name)) : nullptr});
        }
        if (segment.header().node.record_size > TACTILED_NODE_SIZE_1_6) {  // there is a [tool]
            const auto of_tools = file_.add_schema(std::string(kToolSchema), "ros2msg", std::string(kToolDefinition));
            tool_.emplace(ToolTail{fmt::format("{}/G", node), Tail(segment, segment.header().node),
                                   file_.add_channel(of_tools, fmt::format("/{}/tool", node), "cdr", {}),
                                   file_.add_channel(of_wrenches, fmt::format("/{}/tool/wrench", node), "cdr", {})});
        }
        for (const auto& [name, bytes] : files_)
            file_.attach(name, name.ends_with(".toml") ? "application/toml" : "text/plain", bytes, wall_ns());
        wall_from_monotonic_ns_ = wall_ns() - monotonic_ns();
    }

    // Records everything that has arrived since the last cycle.
    void cycle() {
        tactiled_frame shown;
        Frame frame;
        for (auto& link : links_)
            while (link.tail.next(shown)) {
                read_published(shown, frame);
                mcap::encode_frame(frame, wall(frame.t_ns), message_);
                file_.message(link.channel, frame.sequence, wall(frame.t_ns), message_);
            }
        tactiled_sample sample;
        for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
            SensorTail& sensor = sensors_[i];
            const auto age_bound_s = float(age_bound_ms(segment_, i) / 1000);
            while (sensor.tail.next(sample)) {
                const auto number = std::uint32_t(sample.sequence);
                encode_sample(sample, wall(sample.t_ns), message_);
                file_.message(sensor.samples, number, wall(sample.t_ns), message_);
                // Every sample has a wrench, so that a plot has no gaps; a BAD one has no numbers.
                encode_wrench(sample, sensor.frame_id, wall(sample.t_ns), message_);
                file_.message(sensor.wrenches, number, wall(sample.t_ns), message_);
                encode_quality(sample, age_bound_s, wall(sample.t_ns), message_);
                file_.message(sensor.qualities, number, wall(sample.t_ns), message_);
                if (sensor.csv)
                    sensor.csv->write(double(sample.t_ns) / 1e9, estimate_of(sample),
                                      quality_text(sample.quality, sample.reasons));
            }
        }
        tactiled_node node;
        while (tool_ && tool_->tail.next(node)) {
            const tactiled_tool& tool = node.tool;
            const auto news = std::tuple(tool.t_newest_ns, tool.quality, tool.why);
            if (std::exchange(tool_->last, news) == news) continue;
            const auto number = std::uint32_t(node.sequence);
            encode_tool(tool, wall(tool.t_newest_ns), message_);
            file_.message(tool_->whole, number, wall(tool.t_newest_ns), message_);
            encode_wrench(tool, tool_->frame_id, wall(tool.t_newest_ns), message_);
            file_.message(tool_->wrenches, number, wall(tool.t_newest_ns), message_);
        }
    }
    void flush() { file_.flush(); }
    void close() {
        file_.close();
        for (auto& sensor : sensors_)
            if (sensor.csv) sensor.csv->close();
    }

    [[nodiscard]] std::uint64_t lost() const {
        std::uint64_t lost = 0;
        for (const auto& link : links_) lost += link.tail.lost();
        for (const auto& sensor : sensors_) lost += sensor.tail.lost();
        if (tool_) lost += tool_->tail.lost();
        return lost;
    }
    [[nodiscard]] const mcap::Writer& file() const { return file_; }

private:
    [[nodiscard]] std::uint64_t wall(std::uint64_t t_ns) const { return t_ns + wall_from_monotonic_ns_; }
    // Returns the path of the CSV file: pick.mcap and sensor "left" give pick.left.csv.
    static std::string csv_path(const std::string& file, const std::string& sensor) {
        const std::string stem = file.ends_with(".mcap") ? file.substr(0, file.size() - 5) : file;
        return fmt::format("{}.{}.csv", stem, sensor);
    }

    struct LinkTail {
        Tail tail;
        std::uint16_t channel;
    };
    struct SensorTail {
        std::string frame_id;
        Tail tail;
        std::uint16_t samples, wrenches, qualities;
        std::unique_ptr<ForcesWriter> csv;
    };
    struct ToolTail {
        std::string frame_id;
        Tail tail;
        std::uint16_t whole, wrenches;
        std::tuple<std::uint64_t, std::uint32_t, std::uint32_t> last{};
    };
    const Segment& segment_;
    TextFiles::List files_;  // read first: without a configuration that was named there is no recording
    mcap::Writer file_;
    std::vector<LinkTail> links_;
    std::vector<SensorTail> sensors_;
    std::optional<ToolTail> tool_;
    std::uint64_t wall_from_monotonic_ns_ = 0;
    std::string message_;
};

int record(const Args& args) {
    catch_interrupt();
    const Segment segment = open_node(args.node);
    if (segment.n_links() != 0 && segment.link(0).frames.slots == 0)
        throw SetupError(fmt::format("node \"{}\" is of version {}, which shows no frames: nothing could be replayed",
                                     args.node, segment.header().version));
    if (const Liveness liveness = liveness_of(segment); liveness.is_dead()) throw VerbError(kNotReachable, liveness.why);
    Recording recording(segment, args);
    const std::uint64_t begun_ns = monotonic_ns();
    std::uint64_t flushed_ns = begun_ns;
    bool ended = false;  // true: the daemon has ended
    std::string died;    // reason why the daemon has stopped publishing
    while (interrupted == 0 && !ended && died.empty() &&
           (args.seconds <= 0 || double(monotonic_ns() - begun_ns) < args.seconds * 1e9)) {
        ended = !segment.is_current();
        recording.cycle();
        if (const Liveness liveness = liveness_of(segment); liveness.is_dead()) died = liveness.why;
        if (const std::uint64_t now = monotonic_ns(); now - flushed_ns >= std::uint64_t(args.flush_ms) * 1'000'000u) {
            recording.flush();
            flushed_ns = now;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    recording.cycle();
    recording.close();
    const double seconds = double(monotonic_ns() - begun_ns) / 1e9;
    if (args.json)
        fmt::print("{}\n", nlohmann::json{{"schema", 1},
                                          {"file", args.file},
                                          {"seconds", seconds},
                                          {"messages", recording.file().messages()},
                                          {"bytes", recording.file().bytes()},
                                          {"lost", recording.lost()},
                                          {"daemon_ended", ended || !died.empty()}}
                               .dump());
    else
        fmt::print("{}: {:.1f} s, {} messages, {} bytes{}\n", args.file, seconds, recording.file().messages(),
                   recording.file().bytes(), ended ? "; the daemon has ended" : "");
    if (recording.lost() != 0)
        fmt::print(stderr, "tactilectl: {} records were missed: this program or the disk was too slow\n", recording.lost());
    if (!died.empty()) throw VerbError(kNotReachable, died);
    if (recording.file().messages() == 0) throw VerbError(kUnhealthy, "nothing was recorded: no link sent a frame");
    return recording.lost() != 0 ? kUnhealthy : kGood;
}

}  // namespace

Run add_record(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("file", args->file, "such as pick.mcap; forces as geometry_msgs/WrenchStamped beside the whole samples")
        .required();
    add_node_option(verb, args->node);
    verb.add_option("--seconds", args->seconds, "end after so long; 0: not by itself").not_negative();
    verb.add_option("--config", args->config, "the configuration to keep in the file; default: the daemon's own");
    verb.add_option("--compression", args->compression, "of the chunks: none, lz4 or zstd")
        .one_of({"none", "lz4", "zstd"})
        .show_default();
    verb.add_flag("--csv", args->csv, "beside FILE.mcap the forces of each sensor, as FILE.SENSOR.csv");
    verb.add_option("--flush-ms", args->flush_ms,
                    "a chunk is written at least this often; the last one is lost if the program is killed, and more after "
                    "a power cut")
        .integer_in(100, 1000)
        .show_default();
    verb.add_flag("--overwrite", args->overwrite, "replace a file that is there");
    verb.add_flag("--json", args->json, "say at the end as JSON what was recorded");
    return [args] { return record(*args); };
}

}  // namespace tactiled::ctl
