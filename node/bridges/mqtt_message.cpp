#include "node/bridges/mqtt_message.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <tuple>
#include <utility>

#include "node/bridges/edge.hpp"
#include "node/ctl/grasp_text.hpp"
#include "node/ctl/status_text.hpp"

namespace tactiled::bridges::mqtt {
namespace {

using nlohmann::json;

constexpr int kSchema = 2;

std::string dump(const json& message) { return message.dump(-1, ' ', false, json::error_handler_t::replace); }

double microseconds(double t_s) { return std::round(t_s * 1e6) / 1e6; }

template <typename T>
json numbers(const T (&values)[3]) {  // a NaN is written as null
    return json::array({values[0], values[1], values[2]});
}

double component(const tactiled_sample& s, std::size_t i) { return i < 3 ? s.force_S_N[i] : s.torque_S_Nm[i - 3]; }

// The fields that each message has. `until_s`: see the schema.
json head(std::uint32_t quality, double t_s, double until_s, bool simulated) {
    return {{"schema", kSchema},
            {"t_s", microseconds(t_s)},
            {"valid_until_s", microseconds(until_s)},
            {"quality", edge_of(quality).word},
            {"simulated", simulated}};
}

json head_now(std::uint32_t quality, bool simulated) {
    const double now_s = wall_s(monotonic_ns());
    return head(quality, now_s, now_s + kExpiryS, simulated);
}

// Words with blanks between them, as a list.
json list_of(const std::string& words) {
    json list = json::array();
    std::istringstream in(words);
    for (std::string word; in >> word;) list.push_back(word);
    return list;
}

}  // namespace

std::string wrench_text(const Batch& batch, std::uint64_t until_ns, bool simulated) {
    const tactiled_sample& s = batch.newest;
    json message = head(s.quality, wall_s(s.t_ns), wall_s(until_ns), simulated);
    message.update({{"sequence", s.sequence},
                    {"reasons", reason_words(s.reasons)},
                    {"force_N", numbers(s.force_S_N)},
                    {"torque_Nm", numbers(s.torque_S_Nm)},
                    {"sd_force_N", numbers(s.sd_force_N)},
                    {"sd_torque_Nm", numbers(s.sd_torque_Nm)},
                    {"samples", batch.samples},
                    {"bad", batch.bad}});
    return dump(message);
}

std::string tool_text(const tactiled_tool& t, std::uint64_t until_ns, bool simulated) {
    json message = head(t.quality, wall_s(t.t_ns), wall_s(until_ns), simulated);
    message.update({{"reasons", list_of(ctl::tool_why_text(t.why))},
                    {"force_N", numbers(t.force_G_N)},
                    {"torque_Nm", numbers(t.torque_G_Nm)},
                    {"sd_force_N", numbers(t.sd_force_N)},
                    {"sd_torque_Nm", numbers(t.sd_torque_Nm)}});
    return dump(message);
}

std::string quality_text(const tactiled_sample& s, bool simulated) {
    json message = head_now(s.quality, simulated);
    message["reasons"] = reason_words(s.reasons);
    return dump(message);
}

std::string grasp_text(const tactiled_grasp& g, std::uint32_t worst, bool simulated) {
    json message = head_now(grasp_quality(g, worst), simulated);
    message.update(
        {{"state", ctl::grip_state_text(g.state)}, {"object", g.object}, {"grasps", g.grasps}, {"slips", g.slips}});
    return dump(message);
}

std::string weight_text(const tactiled_grasp& g, std::uint32_t worst, const std::vector<std::string>& sensors,
                        bool simulated) {
    json jaws = json::array();
    for (std::size_t i = 0; i < sensors.size(); ++i)
        if ((g.doubtful >> i & 1u) != 0) jaws.push_back(sensors[i]);
    json message = head_now(weight_quality(g, worst), simulated);
    message.update({{"state", ctl::weight_state_text(g.weight_state)},
                    {"weight_kg", g.weight_kg},
                    {"sd_weight_kg", g.weight_sd_kg},
                    {"doubts", list_of(ctl::doubts_text(g.weight_doubts))},
                    {"doubtful", jaws}});
    return dump(message);
}

std::string state_text(const Follower& follower, const Counts& counts, std::uint32_t worst, const Sender& sender) {
    json sensors = json::array();
    for (std::uint32_t i = 0; i < follower.n_sensors(); ++i) sensors.push_back(follower.segment().sensor(i).name);
    json message = head_now(follower.is_alive() ? worst : std::uint32_t(TACTILED_BAD), follower.is_simulated());
    message.update({{"online", true},
                    {"bridge", sender.id},
                    {"since_s", sender.since_s},
                    {"daemon", follower.is_alive()},
                    {"why", follower.why()},
                    {"sensors", sensors},
                    {"fault", follower.is_alive() ? json(follower.node().fault) : json()},
                    {"sent", counts.sent},
                    {"dropped", counts.dropped},
                    {"missed", follower.missed()}});
    return dump(message);
}

Sender sender_of(const std::string& text) {
    const json message = json::parse(text, nullptr, false);
    if (!message.is_object() || message.value("online", json()) != true) return {};
    const json id = message.value("bridge", json()), since_s = message.value("since_s", json());
    if (!id.is_string() || !since_s.is_number()) return {};
    return {id, since_s};
}

bool gives_way(const Sender& mine, const Sender& other) {
    return !other.id.empty() && other.id != mine.id && std::tie(other.since_s, other.id) < std::tie(mine.since_s, mine.id);
}

Precedence::Precedence(const std::string& node) {
    std::random_device random;
    mine_ = {fmt::format("tactiled-mqtt-{}-{:08x}", node, random()), wall_s(monotonic_ns())};
}

void Precedence::be_silent_until(std::uint64_t until_ns) {
    until_ns_ = std::max(until_ns_, until_ns);
    silent_ = true;
}

void Precedence::listen(std::uint64_t now_ns) { be_silent_until(now_ns + kListenNs); }

bool Precedence::hear(const std::string& text, std::uint64_t now_ns) {
    if (bridges::mqtt::gives_way(mine_, sender_of(text))) {
        gives_way_ = true;
        be_silent_until(now_ns + kExpiryS * 1'000'000'000ull);
    }
    if (now_ns < until_ns_) return false;
    gives_way_ = false;
    return std::exchange(silent_, false);
}

std::string last_will_text() {
    return dump({{"schema", kSchema}, {"quality", edge_of(TACTILED_BAD).word}, {"online", false}, {"daemon", false}});
}

std::string without_times(const std::string& text) {
    json message = json::parse(text);
    message.erase("t_s");
    message.erase("valid_until_s");
    return dump(message);
}

bool Deadband::passes(const tactiled_sample& sample, std::uint64_t now_ns) {
    bool moved = sample.quality != quality_ || now_ns - last_ns_ >= kRenewNs;
    for (std::size_t i = 0; i < 6; ++i) {
        const double by = std::fabs(component(sample, i) - last_[i]);  // NaN: both are, or the quality has changed
        moved |= by >= (i < 3 ? force_N_ : torque_Nm_) || std::isnan(component(sample, i)) != std::isnan(last_[i]);
    }
    if (!moved) return false;
    quality_ = sample.quality;
    last_ns_ = now_ns;
    for (std::size_t i = 0; i < 6; ++i) last_[i] = component(sample, i);
    return true;
}

}  // namespace tactiled::bridges::mqtt
