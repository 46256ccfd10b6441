// Texts of tactiled-mqtt, without I/O. mqtt.schema.json describes them; a value that is not known is null.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "node/bridges/bridge.hpp"

namespace tactiled::bridges::mqtt {

// Each message is renewed before it expires, so that silence means an end. 2 s: the smallest expiry that a broker which
// counts whole seconds keeps for at least one. A quarter of it: two messages may be late, and the broker has one all the
// time.
inline constexpr std::uint32_t kExpiryS = 2;
inline constexpr std::uint64_t kRenewNs = kExpiryS * 1'000'000'000ull / 4;

struct Topics {
    std::string prefix = "tactiled", node;
    [[nodiscard]] std::string of_node(const char* what) const { return prefix + "/" + node + "/" + what; }
    [[nodiscard]] std::string state() const { return of_node("state"); }
    [[nodiscard]] std::string of(const std::string& sensor, const char* what) const {
        return prefix + "/" + node + "/" + sensor + "/" + what;
    }
};

// A bridge, in the messages of its state.
struct Sender {
    std::string id;      // names this process alone
    double since_s = 0;  // when it began, since 1970
};
// The sender of the text if that is the state of a bridge that is connected; else one without an id.
Sender sender_of(const std::string& text);
// True if both send below one topic, and `mine` has to be silent: the one that was there first goes on.
bool gives_way(const Sender& mine, const Sender& other);

// Keeps a bridge silent while another one, which was there first, says each 0.5 s that it sends below the same topic, and
// at the begin of a connection until it would have heard that. Times are of CLOCK_MONOTONIC.
class Precedence {
public:
    explicit Precedence(const std::string& node);
    [[nodiscard]] const Sender& mine() const { return mine_; }
    // A connection has begun. The bridge is silent for kListenNs.
    void listen(std::uint64_t now_ns);
    // `text`: a state that has come to the topic, or "". True: this bridge may send from now on.
    bool hear(const std::string& text, std::uint64_t now_ns);
    [[nodiscard]] bool is_silent() const { return silent_; }
    // True while the bridge is silent because of another one.
    [[nodiscard]] bool gives_way() const { return gives_way_; }

    // Two states of a bridge that sends are due within this time, so that one of them may be lost.
    static constexpr std::uint64_t kListenNs = 2 * kRenewNs;

private:
    void be_silent_until(std::uint64_t until_ns);

    Sender mine_;
    std::uint64_t until_ns_ = 0;
    bool silent_ = true, gives_way_ = false;
};

// The samples of one sensor since its last message: the newest, how many there were, and how many of them were BAD.
struct Batch {
    tactiled_sample newest{};
    std::uint32_t samples = 0, bad = 0;
};

// `simulated`: no device measures the values of this node.
// Texts with a time until which the value is valid as a reader of the segment judges it.
std::string wrench_text(const Batch& batch, std::uint64_t until_ns, bool simulated);
std::string tool_text(const tactiled_tool& tool, std::uint64_t until_ns, bool simulated);
// Texts that are true now and valid for kExpiryS. `worst`: quality of the worst sensor.
std::string quality_text(const tactiled_sample& sample, bool simulated);
std::string grasp_text(const tactiled_grasp& grasp, std::uint32_t worst, bool simulated);
// `sensors`: the names of the node's sensors, of which the text names those that are in doubt.
std::string weight_text(const tactiled_grasp& grasp, std::uint32_t worst, const std::vector<std::string>& sensors,
                        bool simulated);
std::string state_text(const Follower& follower, const Counts& counts, std::uint32_t worst, const Sender& sender);
std::string last_will_text();
// The text without its times: another one is a change.
std::string without_times(const std::string& text);

// Says which samples differ from the last one that it said so of.
class Deadband {
public:
    Deadband(double force_N, double torque_Nm) : force_N_(force_N), torque_Nm_(torque_Nm) {}
    // `now_ns`: CLOCK_MONOTONIC. True for another quality, a component that moved by the deadband, and after kRenewNs.
    bool passes(const tactiled_sample& sample, std::uint64_t now_ns);

private:
    double force_N_, torque_Nm_;
    std::uint64_t last_ns_ = 0;
    std::uint32_t quality_ = ~0u;
    std::array<double, 6> last_{};
};

}  // namespace tactiled::bridges::mqtt
