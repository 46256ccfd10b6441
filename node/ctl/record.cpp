// tactilectl record FILE: all frames of all links and all samples of all sensors, from shared memory into an MCAP file. It
// costs the daemon nothing: what goes wrong here, a full disk too, ends the recording and nothing else.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "config/options.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/writer.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/liveness.hpp"
#include "node/ctl/recorded_config.hpp"
#include "node/ctl/sample_message.hpp"
#include "node/ctl/verb.hpp"
#include "node/shm/frame_record.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper", file, config;
    bool overwrite = false, json = false;
    double seconds = 0;
    int flush_ms = 200;
};

std::uint64_t wall_ns() {
    timespec t{};
    ::clock_gettime(CLOCK_REALTIME, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

// Takes every record of one ring in turn, from the newest on; counts those that were overwritten before it came.
class Tail {
public:
    Tail(const SegmentView& segment, const tactiled_ring& ring)
        : base_(segment.base()), ring_(&ring), next_(tactiled_ring_head(base_, &ring)) {}

    // False when there is none now.
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

class Recording {
public:
    Recording(const SegmentView& segment, const Args& args) : file_(args.file, args.overwrite) {
        const std::string node = segment.header().name;
        const auto of_frames =
            file_.add_schema(std::string(mcap::kFrameSchema), "ros2msg", std::string(mcap::kFrameDefinition));
        const auto of_samples = file_.add_schema(std::string(kSampleSchema), "ros2msg", std::string(kSampleDefinition));
        const auto of_wrenches = file_.add_schema(std::string(kWrenchSchema), "ros2msg", std::string(kWrenchDefinition));
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
                                channel(of_wrenches, "wrench_uncertain")});
        }
        if (!args.config.empty()) attach_config(file_, args.config, wall_ns());
        wall_from_monotonic_ns_ = wall_ns() - monotonic_ns();
    }

    // All that has come since the last turn.
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
        for (auto& sensor : sensors_)
            while (sensor.tail.next(sample)) {
                const auto number = std::uint32_t(sample.sequence);
                encode_sample(sample, wall(sample.t_ns), message_);
                file_.message(sensor.samples, number, wall(sample.t_ns), message_);
                // A wrench carries no quality: what is only UNCERTAIN has a topic of its own, what is BAD has no numbers.
                encode_wrench(sample, sensor.frame_id, wall(sample.t_ns), message_);
                file_.message(sample.quality == TACTILED_UNCERTAIN ? sensor.doubtful : sensor.wrenches, number,
                              wall(sample.t_ns), message_);
            }
    }
    void flush() { file_.flush(); }
    void close() { file_.close(); }

    [[nodiscard]] std::uint64_t lost() const {
        std::uint64_t lost = 0;
        for (const auto& link : links_) lost += link.tail.lost();
        for (const auto& sensor : sensors_) lost += sensor.tail.lost();
        return lost;
    }
    [[nodiscard]] const mcap::Writer& file() const { return file_; }

private:
    [[nodiscard]] std::uint64_t wall(std::uint64_t t_ns) const { return t_ns + wall_from_monotonic_ns_; }

    struct LinkTail {
        Tail tail;
        std::uint16_t channel;
    };
    struct SensorTail {
        std::string frame_id;
        Tail tail;
        std::uint16_t samples, wrenches, doubtful;
    };
    mcap::Writer file_;
    std::vector<LinkTail> links_;
    std::vector<SensorTail> sensors_;
    std::uint64_t wall_from_monotonic_ns_ = 0;
    std::string message_;
};

int record(Args args) {
    catch_interrupt();
    std::string why;
    const Segment segment = Segment::try_open(args.node, why);
    if (!segment.is_open()) {
        fmt::print(stderr, "tactilectl: {}\n", why);
        return kNotReachable;
    }
    if (segment.n_links() != 0 && segment.link(0).frames.slots == 0)
        throw SetupError(fmt::format("node \"{}\" is of version {}, which shows no frames: nothing could be replayed",
                                     args.node, segment.header().version));
    if (const Liveness liveness = liveness_of(segment); liveness.is_dead()) {
        fmt::print(stderr, "tactilectl: {}\n", liveness.why);
        return kNotReachable;
    }
    if (args.config.empty()) {
        args.config = config_of_daemon(segment);
        if (args.config.empty())
            fmt::print(stderr,
                       "tactilectl: the recording will not contain the daemon's configuration: name it with --config\n");
    } else if (::access(args.config.c_str(), R_OK) != 0) {  // before there is a file
        throw SetupError(args.config + ": cannot be read");
    }
    Recording recording(segment, args);
    const std::uint64_t begun_ns = monotonic_ns();
    std::uint64_t flushed_ns = begun_ns;
    bool ended = false;  // the daemon
    std::string died;    // why it publishes nothing any more
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
    if (!died.empty()) {
        fmt::print(stderr, "tactilectl: {}\n", died);
        return kNotReachable;
    }
    if (recording.file().messages() == 0) {
        fmt::print(stderr, "tactilectl: nothing was recorded: no link sent a frame\n");
        return kUnhealthy;
    }
    return recording.lost() != 0 ? kUnhealthy : kGood;
}

}  // namespace

void add_record(CLI::App& app, Run& run) {
    auto args = std::make_shared<Args>();
    auto* verb = add_verb(app, "record", "All frames and samples into an MCAP file, until Ctrl-C or the daemon's end",
                          "  tactilectl record pick.mcap --seconds 10\n");
    verb->add_option("file", args->file, "such as pick.mcap; forces as geometry_msgs/WrenchStamped beside the whole samples")
        ->required();
    add_node_option(verb, args->node);
    verb->add_option("--seconds", args->seconds, "end after so long; 0: not by itself")->check(CLI::NonNegativeNumber);
    verb->add_option("--config", args->config, "the configuration to keep in the file; default: that of the running daemon");
    verb->add_option("--flush-ms", args->flush_ms,
                     "a chunk is written at least this often: what a kill loses; a power cut, what the kernel held")
        ->check(CLI::Range(100, 1000))
        ->capture_default_str();
    verb->add_flag("--overwrite", args->overwrite, "replace a file that is there");
    verb->add_flag("--json", args->json, "say at the end as JSON what was recorded");
    verb->callback([args, &run] { run = [args] { return record(*args); }; });
}

}  // namespace tactiled::ctl
