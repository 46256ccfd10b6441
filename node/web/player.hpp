// Plays a recording into a segment of its own, as a daemon would publish it, so that the page shows it as it shows a daemon.
#pragma once
#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "drivers/mcap/message_file.hpp"
#include "node/shm/writer.hpp"

namespace tactiled::web {

class Player {
public:
    // setup: throws SetupError where the file has no samples, or cannot be read
    explicit Player(const std::string& path);
    ~Player();
    Player(const Player&) = delete;
    Player& operator=(const Player&) = delete;

    [[nodiscard]] const std::string& node_name() const { return plan_.name; }

private:
    // Names, and the components that each sensor measures, from the beginning of the file.
    void plan(const std::string& path);
    // Index of the sensor that the message is a sample of, or -1.
    int sensor_of(const mcap::Message& message, tactiled_sample& sample) const;
    void run(const std::string& path);
    // From the file's beginning to its end, or to the end of this object.
    void play(mcap::MessageFile& file);
    // Publishes node records while it waits.
    void wait_until(std::uint64_t t_ns);
    void beat(std::uint64_t now_ns);

    SegmentPlan plan_;
    std::map<std::string, int> index_;  // sensors of the plan, by the name in the file
    std::unique_ptr<SegmentWriter> writer_;
    std::vector<tactiled_sample> last_;
    tactiled_node node_{};
    std::uint64_t beat_ns_ = 0, heartbeat_ns_ = 0;
    std::uint32_t rounds_ = 0;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace tactiled::web
