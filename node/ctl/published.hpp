// The samples and arrays of a recording as the daemon published them, beside the frames that tactilectl replay processes.
#pragma once
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/mcap/message_file.hpp"
#include "node/setup.hpp"

namespace tactiled::ctl {

// "" if the channel does not say it.
[[nodiscard]] std::string metadata_of(const mcap::Channel& channel, std::string_view key);
// setup: throws SetupError where the file cannot be opened
void open_recording(mcap::MessageFile& file, const std::string& path);

class Published {
public:
    // Bytes of the file that may be between a frame and its sample. The recorder writes both in one cycle or in two
    // successive ones.
    static constexpr std::uint64_t kMaxBetween = 32u << 20;

    struct Sample {
        tactiled_sample sample;
        std::string array, cloud;  // messages of its array (array_message.hpp); "" = none
        std::string frame_id;      // in the header of `cloud`
    };

    Published(const std::string& path, const Node& node) : node_(node), sensors_(node.plan.sensors.size()) {
        open_recording(file_, path);
    }
    // Returns the sample of a frame at about byte `frame_at`; nullopt if the file has none. Frames with the same
    // timestamp are assigned by their order.
    std::optional<Sample> of_frame(std::size_t sensor, std::uint64_t t_ns, std::uint64_t frame_at);
    // True if no frame of the sensor arrived before the file began.
    [[nodiscard]] bool from_the_start(std::size_t sensor) const { return sensors_[sensor].from_the_start; }

private:
    struct Waiting {
        std::uint64_t at;  // approximate byte in the file
        Sample sample;
    };
    struct OfSensor {
        std::deque<Waiting> waiting;
        std::string array, cloud;  // belong to the next sample
        bool any = false, from_the_start = false;
    };
    bool read_on(std::uint64_t frame_at);
    void take(OfSensor& of, const mcap::Message& message, std::uint64_t frame_at);

    const Node& node_;
    mcap::MessageFile file_;
    std::vector<OfSensor> sensors_;
};

}  // namespace tactiled::ctl
