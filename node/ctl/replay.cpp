// tactilectl replay FILE: passes the recorded frames through the daemon's sensor code as fast as possible and reports
// whether the samples equal the published ones. Driver "replay" plays a recording in real time.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "config/text_file.hpp"
#include "decoupling/csv.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/message_file.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/sample_message.hpp"
#include "node/ctl/verb.hpp"
#include "node/setup.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string file, config, sensor, out;
    bool json = false;
};

// Result of the comparison of one sensor's samples.
struct Outcome {
    std::uint64_t frames = 0, compared = 0, equal = 0;
    std::uint64_t raw_only = 0;    // equal samples that were compared before tare and filter
    std::uint64_t without_sd = 0;  // compared samples whose sd depends on frames before the file
    std::string first_difference;
};

bool same(const double* a, const double* b, std::size_t n) { return std::memcmp(a, b, n * sizeof *a) == 0; }

// Returns "" or the first part that differs. `raw_only`: the input of a tare or a filter is not in the file.
// `from_the_start`: else the noise that the sd takes into account was measured on frames before those of the file.
std::string difference(const tactiled_sample& was, const tactiled_sample& is, bool raw_only, bool from_the_start,
                       bool has_places) {
    // A restart that has lost the tare is not repeated here, nor is the tare that a calibration needs, nor the age of a
    // zero.
    const bool zero_lost = ((was.reasons | is.reasons) & (TACTILED_ZERO_UNKNOWN | TACTILED_ZERO_OLD)) != 0;
    const std::uint32_t of_the_moment = TACTILED_TARING | TACTILED_WRONG_RATE | TACTILED_DRIFTED | TACTILED_SENSORS_DIFFER |
                                        TACTILED_UNPROVED_AGE | TACTILED_ARRIVAL_ONLY | TACTILED_ZERO_UNKNOWN |
                                        TACTILED_ZERO_OLD | (zero_lost ? std::uint32_t(TACTILED_UNKNOWN_UNCERTAINTY) : 0u);
    // The motion before the file is not known here, nor how many values have left it.
    const std::uint32_t of_the_past = from_the_start ? 0u : std::uint32_t(TACTILED_STEPPED | TACTILED_GLITCHES);
    // the frame was too late; a recording does not contain that of a frame
    if ((was.reasons & TACTILED_STALE) != 0) return "";
    // Comparisons with another sensor, or with the time of other frames, are not repeated here.
    const bool compared = (was.reasons & (TACTILED_SENSORS_DIFFER | TACTILED_UNPROVED_AGE)) != 0 ||
                          ((was.reasons ^ is.reasons) & of_the_past) != 0;
    if (was.quality != is.quality && !compared && !zero_lost) return "quality";
    if (((was.reasons ^ is.reasons) & ~(of_the_moment | of_the_past)) != 0) return "reasons";
    if (was.missing != is.missing || was.saturated != is.saturated) return "channels";
    if (!same(was.raw_force_S_N, is.raw_force_S_N, 3)) return "raw_force_S_N";
    if (!same(was.raw_torque_S_Nm, is.raw_torque_S_Nm, 3)) return "raw_torque_S_Nm";
    if (from_the_start && !zero_lost && was.tare_count == 0 &&  // the age of a tare is not in the file
        (!same(was.sd_force_N, is.sd_force_N, 3) || !same(was.sd_torque_Nm, is.sd_torque_Nm, 3)))
        return "sd";
    // The place is that of the tared force where its sd allows one. A recording of a daemon before layout 1.9 may have none.
    if (from_the_start && !raw_only && !zero_lost && was.tare_count == 0 && has_places && !same(was.cop_S_m, is.cop_S_m, 2))
        return "cop_S_m";
    if (!same(&was.residual, &is.residual, 1)) return "residual";
    if (was.device_sequence != is.device_sequence || TACTILED_DIRECTION(was.state) != TACTILED_DIRECTION(is.state))
        return "device_sequence or direction";
    if (!raw_only && (!same(was.force_S_N, is.force_S_N, 3) || !same(was.torque_S_Nm, is.torque_S_Nm, 3)))
        return "force_S_N";
    return "";
}

std::string name_of(const mcap::Channel& channel, std::string_view key) {
    const auto found = channel.metadata.find(std::string(key));
    return found == channel.metadata.end() ? "" : found->second;
}

void open_file(mcap::MessageFile& file, const std::string& path) {
    if (const std::string wrong = file.open(path); !wrong.empty()) throw SetupError(wrong);
}

// The published samples, read from the file together with its frames.
class Published {
public:
    // Bytes of the file that may be between a frame and its sample. The recorder writes both in one cycle or in two
    // successive ones.
    static constexpr std::uint64_t kMaxBetween = 32u << 20;

    Published(const std::string& path, const Node& node) : node_(node), sensors_(node.plan.sensors.size()) {
        open_file(file_, path);
    }

    // Returns the sample of a frame at about byte `frame_at`; nullopt if the file has none. Frames with the same
    // timestamp are assigned by their order.
    std::optional<tactiled_sample> of_frame(std::size_t i, std::uint64_t t_ns, std::uint64_t frame_at) {
        auto& waiting = sensors_[i].waiting;
        for (;;) {
            while (!waiting.empty() && waiting.front().sample.t_ns < t_ns) waiting.pop_front();
            if (!waiting.empty()) break;
            if (file_.bytes_read() > frame_at + kMaxBetween || !read_on(frame_at)) return std::nullopt;
        }
        if (waiting.front().sample.t_ns != t_ns) return std::nullopt;
        const tactiled_sample sample = waiting.front().sample;
        waiting.pop_front();
        return sample;
    }
    // True if no frame of the sensor arrived before the file began.
    [[nodiscard]] bool from_the_start(std::size_t i) const { return sensors_[i].from_the_start; }

private:
    // Reads the file's next message. Returns false at its end. Drops samples that no frame has matched for long.
    bool read_on(std::uint64_t frame_at) {
        const auto message = file_.next();
        if (!message) return false;
        tactiled_sample sample;
        if (message->channel->schema != kSampleSchema || !decode_sample(message->data, sample)) return true;
        const std::string name = name_of(*message->channel, kSensorKey);
        for (std::size_t i = 0; i < sensors_.size(); ++i) {
            if (name != node_.plan.sensors[i].name) continue;
            OfSensor& of = sensors_[i];
            // Before the first frame there are at most three markers: no data yet, and the reason.
            if (!std::exchange(of.any, true)) of.from_the_start = sample.sequence <= 2;
            while (!of.waiting.empty() && of.waiting.front().at + kMaxBetween < frame_at) of.waiting.pop_front();
            of.waiting.push_back({file_.bytes_read(), sample});
        }
        return true;
    }

    struct Waiting {
        std::uint64_t at;  // approximate byte in the file
        tactiled_sample sample;
    };
    struct OfSensor {
        std::deque<Waiting> waiting;
        bool any = false, from_the_start = false;
    };
    const Node& node_;
    mcap::MessageFile file_;
    std::vector<OfSensor> sensors_;
};

class Replayed {
public:
    Replayed(Node& node, const Args& args) : node_(node), outcome_(node.sensors.size()) {
        for (std::size_t i = 0; i < node.sensors.size(); ++i) node.sensors[i].start(0, 0);
        if (args.out.empty()) return;
        for (std::size_t i = 0; i < node.plan.sensors.size(); ++i)
            if (args.sensor.empty() ? node.plan.sensors.size() == 1 : args.sensor == node.plan.sensors[i].name)
                shown_ = int(i);
        if (shown_ < 0) throw SetupError("--out writes one sensor: --sensor NAME, one of the configuration's");
        forces_ = std::make_unique<ForcesWriter>(args.out);
    }

    // Processes a frame of a link at about byte `at` of the file; `published` has the sample of that time.
    void frame(const std::string& link, const Frame& frame, std::uint64_t at, Published& published) {
        for (const auto& each : node_.links) {
            if (each->name != link) continue;
            for (const auto& binding : each->bindings)
                if (binding.device == frame.device) judge(binding.sensor, frame, at, published);
        }
    }
    void finish() {
        if (forces_) forces_->close();
    }
    [[nodiscard]] const std::vector<Outcome>& outcome() const { return outcome_; }

private:
    void judge(std::size_t i, const Frame& frame, std::uint64_t at, Published& published) {
        Outcome& outcome = outcome_[i];
        ++outcome.frames;
        const std::optional<tactiled_sample> was = published.of_frame(i, frame.t_ns, at);
        // A discontinuity between two frames that only the pipeline saw restarts the filter.
        if (was && last_epoch_[i] != 0 && was->epoch != last_epoch_[i]) {
            (void)node_.sensors[i].has_discontinuity(false, frame.t_ns);
            (void)node_.sensors[i].marker(frame.t_ns);
        }
        const tactiled_sample is = node_.sensors[i].sample(frame, frame.t_ns);
        if (int(i) == shown_)
            forces_->write(double(frame.t_ns) / 1e9, estimate_of(is), quality_text(is.quality, is.reasons));
        if (!was) return;
        last_epoch_[i] = was->epoch;
        ++outcome.compared;
        // Free rests before the file, and those that a grasp did not permit, are not repeated here: they move the zero.
        const bool from_the_start = published.from_the_start(i) && !node_.grasp;
        if (!from_the_start) ++outcome.without_sd;
        const bool raw_only = was->tare_count != 0 || !from_the_start;
        has_places_ |= std::isfinite(was->cop_S_m[0]) || std::isfinite(was->cop_S_m[1]);
        const std::string what = difference(*was, is, raw_only, from_the_start, has_places_);
        if (what.empty() && raw_only) ++outcome.raw_only;
        if (what.empty())
            ++outcome.equal;
        else if (outcome.first_difference.empty())
            outcome.first_difference = fmt::format("sample {}: {}", was->sequence, what);
    }
    Node& node_;
    std::vector<Outcome> outcome_;
    std::array<std::uint32_t, TACTILED_MAX_SENSORS> last_epoch_{};
    int shown_ = -1;
    bool has_places_ = false;  // the recording has stated one
    std::unique_ptr<ForcesWriter> forces_;
};

// Loads the configuration in the recording, or the one of --config.
Node load(const Args& args) {
    Problems problems;
    if (!args.config.empty()) {
        Node node = load_node(args.config, problems, "");
        problems.throw_if_any();
        return node;
    }
    auto attached = mcap::attached_files(args.file);
    const auto named = std::find_if(attached.begin(), attached.end(), [](const auto& a) { return a.first == kConfigName; });
    if (named == attached.end() || named + 1 == attached.end())
        throw SetupError(fmt::format(
            "{}: has no configuration inside: give it with --config FILE, or a recording of tactilectl record", args.file));
    const std::string config_path = (named + 1)->first;  // the next attachment has its own path
    attached.erase(named);
    const TextFiles files(std::move(attached));
    Node node = load_node(config_path, problems, "");
    problems.throw_if_any();
    return node;
}

int replay(const Args& args) {
    mcap::MessageFile file;
    open_file(file, args.file);
    Node node = load(args);
    Published published(args.file, node);
    Replayed replayed(node, args);
    Frame frame;
    std::uint64_t frames = 0;
    while (const auto message = file.next())
        if (message->channel->schema == mcap::kFrameSchema && mcap::decode_frame(message->data, frame)) {
            replayed.frame(name_of(*message->channel, mcap::kLinkKey), frame, file.bytes_read(), published);
            ++frames;
        }
    replayed.finish();
    const std::string why = file.why();
    if (frames == 0) throw SetupError(fmt::format("{}: {}", args.file, why.empty() ? "holds no frames" : why));

    bool all_equal = true;
    nlohmann::json sensors = nlohmann::json::array();
    for (std::size_t i = 0; i < node.plan.sensors.size(); ++i) {
        const Outcome& o = replayed.outcome()[i];
        const char* name = node.plan.sensors[i].name;
        all_equal = all_equal && o.equal == o.compared && o.compared != 0;
        sensors.push_back({{"name", name},
                           {"frames", o.frames},
                           {"compared", o.compared},
                           {"equal", o.equal},
                           {"before_tare_and_filter", o.raw_only},
                           {"without_sd", o.without_sd},
                           {"first_difference", o.first_difference}});
        if (!args.json)
            fmt::print("{}: {} frames, {} samples compared{}, {} equal bit for bit{}{}\n", name, o.frames, o.compared,
                       o.without_sd != 0 ? fmt::format(" ({} of them without the sd)", o.without_sd) : "", o.equal,
                       o.raw_only != 0 ? fmt::format(" ({} of them before tare and filter)", o.raw_only) : "",
                       o.first_difference.empty() ? "" : "; first difference: " + o.first_difference);
    }
    if (args.json) fmt::print("{}\n", nlohmann::json{{"schema", 1}, {"why", why}, {"sensors", sensors}}.dump());
    if (!why.empty()) fmt::print(stderr, "tactilectl: {}: {}\n", args.file, why);
    return all_equal ? kGood : kUnhealthy;
}

}  // namespace

Run add_replay(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("file", args->file, "made by tactilectl record").required();
    verb.add_option("--config", args->config, "another configuration than the one in the recording");
    verb.add_option("--out", args->out, "forces.csv of one sensor; - is standard output");
    verb.add_option("--sensor", args->sensor, "whose forces, where there are several");
    verb.add_flag("--json", args->json, "the comparison as JSON");
    return [args] { return replay(*args); };
}

}  // namespace tactiled::ctl
