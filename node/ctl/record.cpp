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
#include "node/ctl/recorded_array.hpp"
#include "node/ctl/sample_message.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/tail.hpp"
#include "node/ctl/verb.hpp"
#include "node/setup.hpp"
#include "node/shm/frame_record.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper", file, config, compression = "none";
    bool overwrite = false, json = false, csv = false, without_raw_taxels = false;
    double seconds = 0, array_rate_Hz = 30;
    int flush_ms = 200;
};

std::uint64_t wall_ns() {
    timespec t{};
    ::clock_gettime(CLOCK_REALTIME, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

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
        : segment_(segment),
          node_(segment.header().name),
          files_(configuration_files(segment, args)),
          file_(args.file, args.overwrite, args.compression) {
        const auto schema = [&](std::string_view name, std::string_view definition) {
            return file_.add_schema(std::string(name), "ros2msg", std::string(definition));
        };
        of_frames_ = schema(mcap::kFrameSchema, mcap::kFrameDefinition);
        of_samples_ = schema(kSampleSchema, kSampleDefinition);
        of_wrenches_ = schema(kWrenchSchema, kWrenchDefinition);
        of_qualities_ = schema(kQualitySchema, kQualityDefinition);
        for (std::uint32_t i = 0; i < segment.n_links(); ++i) add_link(i, !args.without_raw_taxels);
        for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) add_sensor(i, args);
        if (segment.header().node.record_size > TACTILED_NODE_SIZE_1_6) {  // there is a [tool]
            const auto of_tools = schema(kToolSchema, kToolDefinition);
            tool_.emplace(ToolTail{fmt::format("{}/G", node_), Tail(segment, segment.header().node),
                                   file_.add_channel(of_tools, fmt::format("/{}/tool", node_), "cdr", {}),
                                   file_.add_channel(of_wrenches_, fmt::format("/{}/tool/wrench", node_), "cdr", {})});
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
                if (link.taxels) link.taxels->record(link.tail.number(), frame, wall(frame.t_ns));
                mcap::encode_frame(frame, wall(frame.t_ns), message_);
                file_.message(link.channel, frame.sequence, wall(frame.t_ns), message_);
            }
        tactiled_sample sample;
        for (std::uint32_t i = 0; i < sensors_.size(); ++i) {
            SensorTail& sensor = sensors_[i];
            const auto age_bound_s = float(age_bound_ms(segment_, i) / 1000);
            while (sensor.tail.next(sample)) {
                const auto number = std::uint32_t(sample.sequence);
                if (sensor.array) sensor.array->record(sample, wall(sample.t_ns));
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
        for (auto& sensor : sensors_) {
            if (sensor.csv) sensor.csv->close();
            if (sensor.array) sensor.array->close();
        }
    }

    [[nodiscard]] std::uint64_t lost() const {
        std::uint64_t lost = 0;
        for (const auto& link : links_) lost += link.tail.lost() + (link.taxels ? link.taxels->lost() : 0);
        for (const auto& sensor : sensors_) lost += sensor.tail.lost() + (sensor.array ? sensor.array->lost() : 0);
        if (tool_) lost += tool_->tail.lost();
        return lost;
    }
    [[nodiscard]] const mcap::Writer& file() const { return file_; }

private:
    void add_link(std::uint32_t i, bool with_raw_taxels) {
        const tactiled_link& link = segment_.link(i);
        const auto channel = file_.add_channel(of_frames_, fmt::format("/{}/link/{}/frames", node_, link.name), "cdr",
                                               {{std::string(mcap::kLinkKey), link.name},
                                                {"driver", link.driver},
                                                {"simulated", link.simulated != 0 ? "true" : "false"}});
        links_.push_back({Tail(segment_, link.frames), channel, nullptr});
        if (segment_.c()->taxels[i].slots != 0 && with_raw_taxels)
            links_.back().taxels = std::make_unique<RecordedRawTaxels>(segment_, i, file_, array_schemas(), node_);
    }
    void add_sensor(std::uint32_t i, const Args& args) {
        const tactiled_sensor& sensor = segment_.sensor(i);
        bool simulated = false;
        for (std::uint32_t l = 0; l < segment_.n_links(); ++l)
            simulated |= std::string_view(segment_.link(l).name) == sensor.link && segment_.link(l).simulated != 0;
        const std::map<std::string, std::string> about{{std::string(kSensorKey), sensor.name},
                                                       {"simulated", simulated ? "true" : "false"},
                                                       {"link", sensor.link},
                                                       {"model", sensor.model},
                                                       {"method", sensor.method},
                                                       {"serial", sensor.serial}};
        const auto channel = [&](std::uint16_t schema, const char* what) {
            return file_.add_channel(schema, fmt::format("/{}/{}/{}", node_, sensor.name, what), "cdr", about);
        };
        sensors_.push_back({frame_id_of(sensor.name, simulated), Tail(segment_, sensor.ring), channel(of_samples_, "sample"),
                            channel(of_wrenches_, "wrench"), channel(of_qualities_, "quality"),
                            args.csv ? std::make_unique<ForcesWriter>(csv_path(args.file, sensor.name)) : nullptr, nullptr});
        if (!segment_.has_array(i)) return;
        const std::string csv = args.csv ? csv_path(args.file, fmt::format("{}.taxels", sensor.name)) : "";
        sensors_.back().array = std::make_unique<RecordedArray>(
            segment_, file_, array_schemas(),
            RecordedArray::Setup{i, node_, sensors_.back().frame_id, about, args.array_rate_Hz, csv});
    }
    const ArraySchemas& array_schemas() {
        if (!array_schemas_) array_schemas_.emplace(file_);
        return *array_schemas_;
    }
    [[nodiscard]] std::uint64_t wall(std::uint64_t t_ns) const { return t_ns + wall_from_monotonic_ns_; }
    // Returns the path of the CSV file: pick.mcap and sensor "left" give pick.left.csv.
    static std::string csv_path(const std::string& file, const std::string& sensor) {
        const std::string stem = file.ends_with(".mcap") ? file.substr(0, file.size() - 5) : file;
        return fmt::format("{}.{}.csv", stem, sensor);
    }

    struct LinkTail {
        Tail tail;
        std::uint16_t channel;
        std::unique_ptr<RecordedRawTaxels> taxels;
    };
    struct SensorTail {
        std::string frame_id;
        Tail tail;
        std::uint16_t samples, wrenches, qualities;
        std::unique_ptr<ForcesWriter> csv;
        std::unique_ptr<RecordedArray> array;
    };
    struct ToolTail {
        std::string frame_id;
        Tail tail;
        std::uint16_t whole, wrenches;
        std::tuple<std::uint64_t, std::uint32_t, std::uint32_t> last{};
    };
    const Segment& segment_;
    std::string node_;
    TextFiles::List files_;  // read first: without a configuration that was named there is no recording
    mcap::Writer file_;
    std::uint16_t of_frames_ = 0, of_samples_ = 0, of_wrenches_ = 0, of_qualities_ = 0;  // schemas
    std::vector<LinkTail> links_;
    std::vector<SensorTail> sensors_;
    std::optional<ArraySchemas> array_schemas_;
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
    verb.add_flag(
        "--csv", args->csv,
        "beside FILE.mcap the forces of each sensor, as FILE.SENSOR.csv, and its taxels, as FILE.SENSOR.taxels.csv");
    verb.add_flag("--without-raw-taxels", args->without_raw_taxels,
                  "leave out the raw numbers of arrays, which replay needs: 48 kB a frame for 4,096 taxels of three");
    verb.add_option("--array-rate", args->array_rate_Hz,
                    "maps of the taxels of an array per second, in the file and in its CSV; 0: none")
        .number_in(0, 10'000)
        .show_default();
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
