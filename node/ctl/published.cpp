#include "node/ctl/published.hpp"

#include <fmt/format.h>

#include <utility>

#include "node/ctl/array_message.hpp"
#include "node/ctl/sample_message.hpp"

namespace tactiled::ctl {

std::string metadata_of(const mcap::Channel& channel, std::string_view key) {
    const auto found = channel.metadata.find(std::string(key));
    return found == channel.metadata.end() ? "" : found->second;
}

void open_recording(mcap::MessageFile& file, const std::string& path) {
    if (const std::string wrong = file.open(path); !wrong.empty()) throw SetupError(wrong);
}

std::optional<Published::Sample> Published::of_frame(std::size_t sensor, std::uint64_t t_ns, std::uint64_t frame_at) {
    auto& waiting = sensors_[sensor].waiting;
    for (;;) {
        while (!waiting.empty() && waiting.front().sample.sample.t_ns < t_ns) waiting.pop_front();
        if (!waiting.empty()) break;
        if (file_.bytes_read() > frame_at + kMaxBetween || !read_on(frame_at)) return std::nullopt;
    }
    if (waiting.front().sample.sample.t_ns != t_ns) return std::nullopt;
    Sample sample = std::move(waiting.front().sample);
    waiting.pop_front();
    return sample;
}

// Reads the file's next message. Returns false at its end.
bool Published::read_on(std::uint64_t frame_at) {
    const auto message = file_.next();
    if (!message) return false;
    const std::string name = metadata_of(*message->channel, kSensorKey);
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if (name == node_.plan.sensors[i].name) take(sensors_[i], *message, frame_at);
    return true;
}

// The messages of an array precede their sample. Drops samples that no frame has matched for long.
void Published::take(OfSensor& of, const mcap::Message& message, std::uint64_t frame_at) {
    const std::string_view schema = message.channel->schema;
    if (schema == kArraySchema) of.array.assign(message.data.data(), message.data.size());
    if (schema == kCloudSchema) of.cloud.assign(message.data.data(), message.data.size());
    tactiled_sample sample;
    if (schema != kSampleSchema || !decode_sample(message.data, sample)) return;
    // Before the first frame there are at most three markers: no data yet, and the reason.
    if (!std::exchange(of.any, true)) of.from_the_start = sample.sequence <= 2;
    while (!of.waiting.empty() && of.waiting.front().at + kMaxBetween < frame_at) of.waiting.pop_front();
    const bool is_simulated = metadata_of(*message.channel, "simulated") == "true";
    of.waiting.push_back({file_.bytes_read(),
                          {sample, std::exchange(of.array, ""), std::exchange(of.cloud, ""),
                           frame_id_of(metadata_of(*message.channel, kSensorKey), is_simulated)}});
}

}  // namespace tactiled::ctl
