#include "node/bridges/mqtt_message.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "node/ctl/grasp_text.hpp"

namespace tactiled::bridges::mqtt {
namespace {

using nlohmann::json;

constexpr int kSchema = 1;

std::string dump(const json& message) { return message.dump(-1, ' ', false, json::error_handler_t::replace); }

double microseconds(double t_s) { return std::round(t_s * 1e6) / 1e6; }

template <typename T>
json numbers(const T (&values)[3]) {  // a NaN is written as null
    return json::array({values[0], values[1], values[2]});
}

double component(const tactiled_sample& s, std::size_t i) { return i < 3 ? s.force_S_N[i] : s.torque_S_Nm[i - 3]; }

}  // namespace

std::string wrench_text(const Batch& batch) {
    const tactiled_sample& s = batch.newest;
    return dump({{"schema", kSchema},
                 {"t_s", microseconds(wall_s(s.t_ns))},
                 {"sequence", s.sequence},
                 {"quality", quality_word(s.quality)},
                 {"reasons", reason_words(s.reasons)},
                 {"force_N", numbers(s.force_S_N)},
                 {"torque_Nm", numbers(s.torque_S_Nm)},
                 {"sd_force_N", numbers(s.sd_force_N)},
                 {"sd_torque_Nm", numbers(s.sd_torque_Nm)},
                 {"samples", batch.samples},
                 {"bad", batch.bad}});
}

std::string quality_text(const tactiled_sample& s) {
    return dump({{"schema", kSchema},
                 {"t_s", microseconds(wall_s(monotonic_ns()))},
                 {"quality", quality_word(s.quality)},
                 {"reasons", reason_words(s.reasons)}});
}

std::string grasp_text(const tactiled_grasp& g) {
    return dump({{"schema", kSchema},
                 {"state", ctl::grip_state_text(g.state)},
                 {"weight_state", ctl::weight_state_text(g.weight_state)},
                 {"weight_kg", g.weight_kg},
                 {"sd_weight_kg", g.weight_sd_kg},
                 {"object", g.object},
                 {"grasps", g.grasps},
                 {"slips", g.slips}});
}

std::string state_text(const Follower& follower, const Counts& counts) {
    json sensors = json::array();
    for (std::uint32_t i = 0; i < follower.n_sensors(); ++i) sensors.push_back(follower.segment().sensor(i).name);
    return dump({{"schema", kSchema},
                 {"online", true},
                 {"daemon", follower.is_alive()},
                 {"why", follower.why()},
                 {"sensors", sensors},
                 {"fault", follower.is_alive() ? json(follower.node().fault) : json()},
                 {"sent", counts.sent},
                 {"dropped", counts.dropped},
                 {"missed", follower.missed()}});
}

std::string last_will_text() { return dump({{"schema", kSchema}, {"online", false}, {"daemon", false}}); }

std::vector<std::pair<std::string, std::string>> discovery(const std::string& root, const Topics& topics,
                                                           const tactiled_sensor& sensor) {
    static constexpr const char* kAxes[] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};
    std::vector<std::pair<std::string, std::string>> messages;
    const std::string id = "tactiled_" + topic_word(topics.node) + "_" + topic_word(sensor.name);
    for (unsigned i = 0; i < 6; ++i) {
        if ((sensor.components >> i & 1u) == 0) continue;
        const std::string values = i < 3 ? "force_N" : "torque_Nm";
        json message{{"name", std::string(sensor.name) + " " + kAxes[i]},
                     {"unique_id", id + "_" + kAxes[i]},
                     {"state_topic", topics.of(sensor.name, "wrench")},
                     {"value_template", "{{ value_json." + values + "[" + std::to_string(i % 3) + "] }}"},
                     {"unit_of_measurement", i < 3 ? "N" : "N\u22C5m"},
                     {"state_class", "measurement"},
                     {"expire_after", 60},
                     {"availability_topic", topics.state()},
                     {"availability_template", "{{ 'online' if value_json.online and value_json.daemon else 'offline' }}"},
                     {"device", {{"identifiers", {"tactiled_" + topic_word(topics.node)}}, {"name", topics.node}}}};
        messages.emplace_back(root + "/sensor/" + id + "/" + kAxes[i] + "/config", dump(message));
    }
    return messages;
}

bool Deadband::passes(const tactiled_sample& sample, std::uint64_t now_ns) {
    bool moved = sample.quality != quality_ || now_ns - last_ns_ >= refresh_ns_;
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
