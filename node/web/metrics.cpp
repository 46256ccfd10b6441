#include "node/web/messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>

#include "node/bridges/edge.hpp"
#include "node/ctl/grasp_text.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"
#include "node/web/timeline.hpp"

namespace tactiled::web {
namespace {

constexpr const char* kAxes[] = {"x", "y", "z"};

std::string escaped(std::string_view text) {
    std::string out;
    for (const char c : text) {
        if (c == '\\' || c == '"') out += '\\';
        if (c == '\n')
            out += "\\n";
        else
            out += c;
    }
    return out;
}

class Page {
public:
    // Begins a metric; all samples of it follow.
    void metric(const char* name, const char* type, const char* help) {
        name_ = name;
        fmt::format_to(std::back_inserter(out), "# HELP {} {}\n# TYPE {} {}\n", name, help, name, type);
    }
    // A value that is not known has no sample, so that no query, alert or panel takes an earlier one for it.
    void sample(const std::string& labels, double value) {
        if (std::isnan(value)) return;
        const std::string number = std::isinf(value) ? (value > 0 ? "+Inf" : "-Inf") : fmt::format("{}", value);
        fmt::format_to(std::back_inserter(out), "{}{}{}{} {}\n", name_, labels.empty() ? "" : "{", labels,
                       labels.empty() ? "" : "}", number);
    }
    std::string out;

private:
    const char* name_ = "";
};

std::string label(const char* key, std::string_view value) { return fmt::format("{}=\"{}\"", key, escaped(value)); }

// The label `quality` of a value: a GOOD and an UNCERTAIN value are samples of different series. "" for a value that is
// BAD, which has no sample.
std::string mark(std::uint32_t quality) {
    const bool has_value = quality == TACTILED_GOOD || quality == TACTILED_UNCERTAIN;
    return has_value ? label("quality", bridges::edge_of(quality).word) : "";
}

void put_qualities(Page& page, const std::string& labels, std::uint32_t quality) {
    for (const std::uint32_t each : {TACTILED_NO_VALUE, TACTILED_GOOD, TACTILED_UNCERTAIN, TACTILED_BAD})
        page.sample(labels + label("quality", bridges::edge_of(each).word), quality == each ? 1 : 0);
}

void put_axes(Page& page, const std::string& labels, std::uint32_t quality, const double (&values)[3]) {
    const std::string marked = mark(quality);
    if (marked.empty()) return;
    for (std::size_t c = 0; c < 3; ++c)
        page.sample(fmt::format("{}{},{}", labels, label("axis", kAxes[c]), marked), values[c]);
}

// One sample for each bit, with the word that `word_of` gives for it.
template <class WordOf>
void put_bits(Page& page, const std::string& labels, const char* key, unsigned n_bits, std::uint32_t value, WordOf word_of) {
    for (unsigned bit = 0; bit < n_bits; ++bit) page.sample(labels + label(key, word_of(1u << bit)), value >> bit & 1u);
}

void put_sensors(Page& page, const View& view) {
    const auto each = [&](auto&& put) {
        for (std::uint32_t i = 0; i < view.n_sensors(); ++i)
            put(view.snapshot.sensor[i], label("sensor", view.segment->sensor(i).name), i);
    };
    const auto axes = [&](const char* name, const char* help, auto values) {
        page.metric(name, "gauge", help);
        each([&](const tactiled_sample& s, const std::string& sensor, std::uint32_t) {
            put_axes(page, sensor + ",", s.quality, s.*values);
        });
    };
    page.metric("tactiled_sensor_quality", "gauge", "1 for the quality of the newest sample, 0 for the others.");
    each([&](const auto& s, const auto& sensor, auto) { put_qualities(page, sensor + ",", s.quality); });
    page.metric("tactiled_sensor_reason", "gauge", "1 for each reason of the newest sample.");
    each([&](const auto& s, const auto& sensor, auto) {
        put_bits(page, sensor + ",", "reason", ctl::kReasonWords.size(), s.reasons,
                 [](std::uint32_t bit) { return ctl::kReasonWords[std::size_t(std::countr_zero(bit))]; });
    });
    axes("tactiled_sensor_force_newtons", "Tared force of the world on the sensor, frame S; no sample: no value.",
         &tactiled_sample::force_S_N);
    axes("tactiled_sensor_force_uncertainty_newtons", "One standard uncertainty of the force.",
         &tactiled_sample::sd_force_N);
    axes("tactiled_sensor_torque_newton_meters", "Tared torque, frame S.", &tactiled_sample::torque_S_Nm);
    axes("tactiled_sensor_torque_uncertainty_newton_meters", "One standard uncertainty of the torque.",
         &tactiled_sample::sd_torque_Nm);
    page.metric("tactiled_sensor_age_seconds", "gauge", "Age of the newest sample.");
    each([&](const auto& s, const auto& sensor, auto) { page.sample(sensor, ctl::age_ms(s, view.taken_ns) / 1000); });
    page.metric("tactiled_sensor_age_bound_seconds", "gauge",
                "Largest possible age of the newest frame; no sample: not known.");
    each([&](const auto&, const auto& sensor, auto i) { page.sample(sensor, ctl::age_bound_ms(*view.segment, i) / 1000); });
    page.metric("tactiled_sensor_rate_hertz", "gauge", "Samples in a second, measured.");
    each([&](const auto& s, const auto& sensor, auto) { page.sample(sensor, double(s.rate_Hz)); });
    page.metric("tactiled_sensor_temperature_celsius", "gauge", "Temperature; no sample: not measured.");
    each([&](const auto& s, const auto& sensor, auto) { page.sample(sensor, double(s.temperature_C)); });
    page.metric("tactiled_sensor_contact", "gauge", "1 while the sensor is touched.");
    each([&](const auto& s, const auto& sensor, auto) { page.sample(sensor, (s.state & TACTILED_CONTACT) != 0 ? 1 : 0); });
    page.metric("tactiled_sensor_samples_total", "counter", "Samples published since the start of the daemon.");
    each([&](const auto&, const auto& sensor, auto i) { page.sample(sensor, double(view.snapshot.node.count[i])); });
    page.metric("tactiled_sensor_lost_frames_total", "counter", "Frames of the sensor known to be lost.");
    each([&](const auto& s, const auto& sensor, auto) { page.sample(sensor, s.lost); });
    page.metric("tactiled_sensor_reason_samples_total", "counter", "Samples with a reason; a 32-bit counter that wraps.");
    each([&](const auto&, const auto& sensor, auto i) {
        for (unsigned bit = 0; bit < ctl::kReasonWords.size(); ++bit)
            page.sample(sensor + "," + label("reason", ctl::kReasonWords[bit]),
                        tactiled_reason_count(view.segment->c(), i, bit));
    });
}

void put_links(Page& page, const View& view) {
    page.metric("tactiled_link_open", "gauge", "1 while the device is open.");
    for (std::uint32_t i = 0; i < view.n_links(); ++i)
        page.sample(label("link", view.segment->link(i).name),
                    __atomic_load_n(&view.segment->link(i).state, __ATOMIC_RELAXED) == TACTILED_LINK_OPEN ? 1 : 0);
    page.metric("tactiled_link_events_total", "counter", "Counters of a link, by kind; 32 bits, which wrap.");
    for (std::uint32_t i = 0; i < view.n_links(); ++i)
        for (std::size_t kind = 0; kind < TACTILED_LINK_COUNTS; ++kind)
            page.sample(label("link", view.segment->link(i).name) + "," + label("kind", ctl::kLinkCountNames[kind]),
                        __atomic_load_n(&view.segment->link(i).count[kind], __ATOMIC_RELAXED));
}

void put_node(Page& page, const View& view) {
    const auto& node = view.snapshot.node;
    const auto one = [&](const char* name, const char* type, const char* help, double value) {
        page.metric(name, type, help);
        page.sample("", value);
    };
    one("tactiled_heartbeats_total", "counter", "Advances each 100 ms while the loop runs and a sensor delivers.",
        node.heartbeat);
    one("tactiled_cycles_total", "counter", "Cycles of the pipeline.", double(node.cycles));
    one("tactiled_missed_cycles_total", "counter", "Periods that the pipeline slept through.", double(node.missed_cycles));
    one("tactiled_worst_cycle_seconds", "gauge", "Longest cycle of the last second.", node.worst_cycle_us / 1e6);
    const auto bits = [&](const char* name, const char* help, const auto& words, std::uint32_t value) {
        page.metric(name, "gauge", help);
        for (std::size_t bit = 0; bit < words.size(); ++bit)
            if (words[bit] != nullptr) page.sample(label("kind", words[bit]), value >> bit & 1u);
    };
    bits("tactiled_fault", "1 for each latched fault.", kFaultWords, node.fault);
    bits("tactiled_warning", "1 for each warning.", kWarningWords, node.warning);
    one("tactiled_rt_degraded", "gauge", "1: real-time priority or locked memory was refused.",
        (node.status & TACTILED_RT_DEGRADED) != 0 ? 1 : 0);
    one("tactiled_simulated", "gauge", "1: a link is simulated or replayed.",
        (node.status & TACTILED_SIMULATED) != 0 ? 1 : 0);
    page.metric("tactiled_wakeup_lateness_seconds", "summary", "How late the loop woke, since the start of the daemon.");
    const Lateness late = view.segment->lateness();
    for (const double q : {0.5, 0.99, 0.999})
        page.sample(label("quantile", fmt::format("{}", q)), lateness_quantile_ns(late, q) / 1e9);
}

void put_grasp(Page& page, const View& view) {
    const auto& g = view.snapshot.node.grasp;
    const auto one = [&](const char* name, const char* type, const char* help, const std::string& labels, double value) {
        page.metric(name, type, help);
        page.sample(labels, value);
    };
    const std::uint32_t of_grasp = view.grasp_quality(), of_weight = view.weight_quality();
    const std::string grasp_word = "," + label("quality", bridges::edge_of(of_grasp).word),
                      weight_word = "," + label("quality", bridges::edge_of(of_weight).word);
    page.metric("tactiled_grip_state", "gauge", "1 for the state of the gripper, with the quality of the grasp.");
    for (const std::uint32_t state : {0u, 1u, 2u, 3u, 4u, 5u, 6u, std::uint32_t(TACTILED_GRIP_UNKNOWN)})
        page.sample(label("state", ctl::grip_state_text(state)) + grasp_word, g.state == state ? 1 : 0);
    page.metric("tactiled_weight_state", "gauge", "1 for the state of the weight, with the quality of the weight.");
    for (std::uint32_t state = 0; state <= TACTILED_WEIGHT_TEMPERATURE; ++state)
        page.sample(label("state", ctl::weight_state_text(state)) + weight_word, g.weight_state == state ? 1 : 0);
    page.metric("tactiled_weight_doubt", "gauge", "1 for each reason for which the weight is not stable.");
    put_bits(page, "", "kind", 8, g.weight_doubts, &ctl::doubts_text);
    const std::string weight = mark(of_weight);
    const double none = std::numeric_limits<double>::quiet_NaN();
    one("tactiled_weight_kilograms", "gauge",
        "Weight of the object; uncertain: not stable, or a sensor is not good; no sample: not known.", weight,
        weight.empty() ? none : g.weight_kg);
    one("tactiled_weight_uncertainty_kilograms", "gauge", "One standard uncertainty of the weight.", weight,
        weight.empty() ? none : g.weight_sd_kg);
    one("tactiled_grip_newtons", "gauge", "Normal force of a jaw; uncertain: a sensor of the node is not good.",
        mark(of_grasp), g.state == TACTILED_GRIP_UNKNOWN ? none : double(g.grip_N));
    one("tactiled_grasps_total", "counter", "Grasps.", "", g.grasps);
    one("tactiled_slips_total", "counter", "Gross slips of all jaws.", "", g.slips);
}

// The wrench on the gripper; samples only where the configuration has a [tool].
void put_tool(Page& page, const tactiled_tool& tool) {
    const bool has_tool = tool.quality != TACTILED_NO_VALUE;
    page.metric("tactiled_tool_quality", "gauge", "1 for the quality of the wrench on the gripper, 0 for the others.");
    if (has_tool) put_qualities(page, "", tool.quality);
    page.metric("tactiled_tool_reason", "gauge", "1 for each reason for which the wrench has a weakness or no value.");
    if (has_tool) put_bits(page, "", "reason", 7, tool.why, &ctl::tool_why_text);
    const auto axes = [&](const char* name, const char* help, const double(&values)[3]) {
        page.metric(name, "gauge", help);
        put_axes(page, "", tool.quality, values);
    };
    axes("tactiled_tool_force_newtons", "Force of the world on the gripper, frame G; no sample: no value.", tool.force_G_N);
    axes("tactiled_tool_force_uncertainty_newtons", "One standard uncertainty of the force.", tool.sd_force_N);
    axes("tactiled_tool_torque_newton_meters", "Torque of the world on the gripper, frame G.", tool.torque_G_Nm);
    axes("tactiled_tool_torque_uncertainty_newton_meters", "One standard uncertainty of the torque.", tool.sd_torque_Nm);
}

}  // namespace

std::string metrics_text(const View& view, const std::string& node_name, std::size_t streams) {
    Page page;
    page.metric("tactiled_up", "gauge", "1 while the daemon publishes; the metrics of a daemon that does not are left out.");
    page.sample(label("node", node_name), view.is_alive ? 1 : 0);
    page.metric("tactiled_web_streams", "gauge", "Pages that are open.");
    page.sample("", double(streams));
    page.metric("tactiled_web_missed_samples_total", "counter", "Samples that this program was too slow to see.");
    page.sample("", double(view.missed));
    if (!view.is_alive) return page.out;
    page.metric("tactiled_info", "gauge", "Name and version of the daemon.");
    page.sample(label("node", view.segment->header().name) + "," + label("version", view.segment->header().version), 1);
    put_node(page, view);
    put_grasp(page, view);
    put_tool(page, view.snapshot.node.tool);
    put_sensors(page, view);
    put_links(page, view);
    return page.out;
}

}  // namespace tactiled::web
