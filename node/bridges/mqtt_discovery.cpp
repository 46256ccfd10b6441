#include "node/bridges/mqtt_discovery.hpp"

#include <array>
#include <nlohmann/json.hpp>

#include "node/bridges/edge.hpp"

namespace tactiled::bridges::mqtt {
namespace {

using nlohmann::json;

struct Axis {
    const char *name, *field, *unit;
    int index;
};
constexpr std::array<Axis, 6> kAxes{{{"Fx", "force_N", "N", 0},
                                     {"Fy", "force_N", "N", 1},
                                     {"Fz", "force_N", "N", 2},
                                     {"Mx", "torque_Nm", "N\u22C5m", 0},
                                     {"My", "torque_Nm", "N\u22C5m", 1},
                                     {"Mz", "torque_Nm", "N\u22C5m", 2}}};

// Available by a message that fulfils `condition` and whose time is not over: a broker or a network that stood still
// delivers messages of that time later, which expire_after takes for new ones.
json available(const std::string& topic, const std::string& condition) {
    return {{"topic", topic},
            {"value_template",
             "{{ 'online' if " + condition + "value_json.valid_until_s > now().timestamp() else 'offline' }}"}};
}

json while_online(const Topics& topics) { return available(topics.state(), "value_json.online and value_json.daemon and "); }

// The topic of the value itself, so that one message brings the value and takes it away.
json while_good(const std::string& topic) {
    return available(topic, "value_json.quality == '" + std::string(edge_of(TACTILED_GOOD).word) + "' and ");
}

// A topic that the broker never retains: it shows that the bridge sends now.
json while_sent(const std::string& topic) { return available(topic, ""); }

class Announcer {
public:
    Announcer(const std::string& root, const Topics& topics, const std::string& part)
        : root_(root),
          topics_(topics),
          id_("tactiled_" + topic_word(topics.node) + (part.empty() ? "" : "_" + topic_word(part))) {}

    void add(const char* component, const std::string& what, const std::string& name, const std::string& topic,
             const std::string& value, const json& available, json more) {
        more.update({{"name", name},
                     {"unique_id", id_ + "_" + what},
                     {"state_topic", topic},
                     {"value_template", "{{ " + value + " }}"},
                     {"expire_after", kExpiryS},
                     {"availability", json::array({while_online(topics_), available})},
                     {"availability_mode", "all"},
                     {"device", {{"identifiers", {"tactiled_" + topic_word(topics_.node)}}, {"name", topics_.node}}}});
        made_.emplace_back(root_ + "/" + component + "/" + id_ + "/" + what + "/config",
                           more.dump(-1, ' ', false, json::error_handler_t::replace));
    }

    // The components of a wrench whose bits are set.
    void add_axes(const std::string& name, const std::string& topic, std::uint32_t components) {
        for (std::size_t i = 0; i < kAxes.size(); ++i)
            if ((components >> i & 1u) != 0)
                add("sensor", kAxes[i].name, name + " " + kAxes[i].name, topic,
                    "value_json." + std::string(kAxes[i].field) + "[" + std::to_string(kAxes[i].index) + "]",
                    while_good(topic), {{"unit_of_measurement", kAxes[i].unit}, {"state_class", "measurement"}});
    }

    [[nodiscard]] Announcements take() { return std::move(made_); }

private:
    std::string root_;
    const Topics& topics_;
    std::string id_;
    Announcements made_;
};

}  // namespace

Announcements discovery(const std::string& root, const Topics& topics, const tactiled_sensor& sensor) {
    const std::string name = sensor.name, quality = topics.of(name, "quality");
    json words = json::array();
    for (const QualityEdge& edge : kQualityEdges) words.push_back(edge.word);
    Announcer announcer(root, topics, name);
    announcer.add_axes(name, topics.of(name, "wrench"), sensor.components);
    announcer.add("sensor", "quality", name + " quality", quality, "value_json.quality", while_sent(quality),
                  {{"device_class", "enum"}, {"options", words}});
    return announcer.take();
}

Announcements discovery(const std::string& root, const Topics& topics, bool has_grasp, bool has_tool) {
    const std::string grasp = topics.of_node("grasp"), weight = topics.of_node("weight");
    Announcer announcer(root, topics, "");
    if (has_grasp) {
        announcer.add("sensor", "grasp", "grasp", grasp, "value_json.state", while_good(grasp), json::object());
        announcer.add("sensor", "slips", "slips", grasp, "value_json.slips", while_good(grasp),
                      {{"state_class", "total_increasing"}});
        announcer.add("sensor", "weight", "weight", weight, "value_json.weight_kg", while_good(weight),
                      {{"unit_of_measurement", "kg"}, {"device_class", "weight"}, {"state_class", "measurement"}});
    }
    if (has_tool) announcer.add_axes("tool", topics.of_node("tool"), 0x3F);
    announcer.add("binary_sensor", "fault", "fault", topics.state(), "'OFF' if value_json.fault == 0 else 'ON'",
                  while_sent(grasp), {{"device_class", "problem"}});
    return announcer.take();
}

}  // namespace tactiled::bridges::mqtt
