// tactilectl replay FILE: passes the recorded frames through the daemon's sensor code as fast as possible and reports
// whether the samples equal the published ones. Driver "replay" plays a recording in real time.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "config/text_file.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/patch/patch.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/taxels_message.hpp"
#include "node/ctl/array_message.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/published.hpp"
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
    std::uint64_t raw_only = 0;            // equal samples that were compared before tare and filter
    std::uint64_t without_sd = 0;          // compared samples whose sd depends on frames before the file
    std::uint64_t arrays = 0, taxels = 0;  // compared samples whose array, and whose taxels, were compared
    std::uint64_t without_taxels = 0;      // frames whose raw taxels the file lacks
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

    // A frame of a link at about byte `at` of the file.
    struct Input {
        const Frame& frame;
        Taxels taxels;
        std::uint64_t wall_ns, at;
    };
    // Processes a frame; `published` has the sample of that time.
    void frame(const std::string& link, const Input& input, Published& published) {
        for (const auto& each : node_.links) {
            if (each->name != link) continue;
            for (const auto& binding : each->bindings)
                if (binding.device == input.frame.device) judge(binding.sensor, input, published);
        }
    }
    void finish() {
        if (forces_) forces_->close();
    }
    [[nodiscard]] const std::vector<Outcome>& outcome() const { return outcome_; }

private:
    void judge(std::size_t i, const Input& input, Published& published) {
        const Frame& frame = input.frame;
        Outcome& outcome = outcome_[i];
        ++outcome.frames;
        Patch* const patch = node_.sensors[i].patch();
        if (patch != nullptr && input.taxels.shape.size() == 0) {
            ++outcome.without_taxels;
            return;
        }
        const std::optional<Published::Sample> found = published.of_frame(i, frame.t_ns, input.at);
        const tactiled_sample* const was = found ? &found->sample : nullptr;
        // A discontinuity between two frames that only the pipeline saw restarts the filter.
        if (was != nullptr && last_epoch_[i] != 0 && was->epoch != last_epoch_[i]) {
            (void)node_.sensors[i].has_discontinuity(false, frame.t_ns);
            (void)node_.sensors[i].marker(frame.t_ns);
        }
        const tactiled_sample is = node_.sensors[i].sample(frame, frame.t_ns, input.taxels);
        const void* const record = patch != nullptr ? patch->record(is) : nullptr;
        if (int(i) == shown_)
            forces_->write(double(frame.t_ns) / 1e9, estimate_of(is), quality_text(is.quality, is.reasons));
        if (was == nullptr) return;
        last_epoch_[i] = was->epoch;
        ++outcome.compared;
        // Free rests before the file, and those that a grasp did not permit, are not repeated here: they move the zero.
        const bool from_the_start = published.from_the_start(i) && !node_.grasp;
        if (!from_the_start) ++outcome.without_sd;
        const bool raw_only = was->tare_count != 0 || !from_the_start;
        has_places_ |= std::isfinite(was->cop_S_m[0]) || std::isfinite(was->cop_S_m[1]);
        std::string what = difference(*was, is, raw_only, from_the_start, has_places_);
        if (record != nullptr && what.empty()) what = array_difference(i, *found, is, record, input.wall_ns);
        if (what.empty() && raw_only) ++outcome.raw_only;
        if (what.empty())
            ++outcome.equal;
        else if (outcome.first_difference.empty())
            outcome.first_difference = fmt::format("sample {}: {}", was->sequence, what);
    }
    // Returns "" or the part of the array that differs. A tare in force, whose readings are not in the file, moves the zero
    // of each taxel.
    std::string array_difference(std::size_t i, const Published::Sample& published, const tactiled_sample& is,
                                 const void* record, std::uint64_t wall_ns) {
        const tactiled_sample& was = published.sample;
        const bool zero_lost = ((was.reasons | is.reasons) & (TACTILED_ZERO_UNKNOWN | TACTILED_STALE)) != 0;
        if (was.tare_count != 0 || zero_lost || (was.quality == TACTILED_BAD) != (is.quality == TACTILED_BAD)) return "";
        const auto& head = *static_cast<const tactiled_array*>(record);
        if (!published.array.empty()) {
            ++outcome_[i].arrays;
            encode_array(head, wall_ns, message_);
            if (message_ != published.array) return "array";
        }
        if (published.cloud.empty()) return "";
        ++outcome_[i].taxels;
        const tactiled_sensor& entry = node_.plan.sensors[i];
        const auto n_forces = std::size_t(entry.n_taxels) * std::size_t(std::popcount(entry.taxel_components));
        const auto* const force = reinterpret_cast<const float*>(&head + 1);
        encode_cloud({.rows = entry.taxel_rows,
                      .columns = entry.taxel_columns,
                      .components = entry.taxel_components,
                      .place_S = node_.plan.places[i],
                      .force_S_N = force,
                      .state = reinterpret_cast<const std::uint8_t*>(force + n_forces)},
                     published.frame_id, wall_ns, message_);
        return message_ == published.cloud ? "" : "taxels";
    }

    Node& node_;
    std::vector<Outcome> outcome_;
    std::string message_;
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

void print(const char* sensor, const Outcome& o) {
    fmt::print("{}: {} frames, {} samples compared{}{}, {} equal bit for bit{}{}\n", sensor, o.frames, o.compared,
               o.arrays != 0 ? fmt::format(" with {} arrays and {} maps of taxels", o.arrays, o.taxels) : "",
               o.without_sd != 0 ? fmt::format(" ({} of them without the sd)", o.without_sd) : "", o.equal,
               o.raw_only != 0 ? fmt::format(" ({} of them before tare and filter)", o.raw_only) : "",
               o.first_difference.empty() ? "" : "; first difference: " + o.first_difference);
}

// Processes all frames of the file and returns their number.
std::uint64_t run(mcap::MessageFile& file, Replayed& replayed, Published& published) {
    Frame frame;
    mcap::RecordedTaxels raw;  // belongs to the next frame
    std::string raw_link;      // "" = there are none
    std::uint64_t frames = 0;
    while (const auto message = file.next()) {
        const std::string& schema = message->channel->schema;
        const std::string link = metadata_of(*message->channel, mcap::kLinkKey);
        if (schema == mcap::kTaxelsSchema) raw_link = mcap::decode_taxels(message->data, raw) ? link : "";
        if (schema != mcap::kFrameSchema || !mcap::decode_frame(message->data, frame)) continue;
        const bool has_taxels = raw_link == link && raw.t_ns == frame.t_ns;
        const Taxels taxels = has_taxels ? Taxels{raw.shape, raw.value} : Taxels{};
        replayed.frame(link, {frame, taxels, message->time_ns, file.bytes_read()}, published);
        raw_link.clear();
        ++frames;
    }
    replayed.finish();
    return frames;
}

int replay(const Args& args) {
    mcap::MessageFile file;
    open_recording(file, args.file);
    Node node = load(args);
    Published published(args.file, node);
    Replayed replayed(node, args);
    const std::uint64_t frames = run(file, replayed, published);
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
                           {"arrays", o.arrays},
                           {"taxels", o.taxels},
                           {"without_taxels", o.without_taxels},
                           {"first_difference", o.first_difference}});
        if (!args.json) print(name, o);
        if (o.without_taxels != 0)
            fmt::print(stderr, "tactilectl: {}: {} frames were left out, because the recording lacks their raw taxels\n",
                       name, o.without_taxels);
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
