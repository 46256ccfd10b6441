#include "node/web/messages.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>

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
    void sample(const std::string& labels, double value) {
        const std::string number = std::isnan(value)   ? "NaN"
                                   : std::isinf(value) ? (value > 0 ? "+Inf" : "-Inf")
                                                       : fmt::format("{}", value);
        fmt::format_to(std::back_inserter(out), "{}{}{}{} {}\n", name_, labels.empty() ? "" : "{", labels,
                       labels.empty() ? "" : "}", number);
    }
    std::string out;

private:
    const char* name_ = "";
};

std::string label(const char* key, std::string_view value) { return fmt::format("{}=\"{}\"", key, escaped(value)); }

void put_sensors(Page& page, const View& view) {
    const auto each = [&](auto&& put) {
        for (std::uint32_t i = 0; i < view.n_sensors(); ++i)
            put(view.snapshot.sensor[i], label("sensor", view.segment->sensor(i).name), i);
    };
    const auto axes = [&](const char* name, const char* help, auto values) {
        page.metric(name, "gauge", help);
        each([&](const tactiled_sample& s, const std::string& sensor, std::uint32_t) {
            for (std::size_t c = 0; c < 3; ++c) page.sample(sensor + "," + label("axis", kAxes[c]), (s.*values)[c]);
        });
    };
    page.metric("tactiled_sensor_quality", "gauge", "1 for the quality of the newest sample, 0 for the others.");
    each([&](const tactiled_sample& s, const std::string& sensor, std::uint32_t) {
        for (const std::uint32_t quality : {TACTILED_NO_VALUE, TACTILED_GOOD, TACTILED_UNCERTAIN, TACTILED_BAD})
            page.sample(sensor + "," + label("quality", ctl::quality_text(quality, 0)), s.quality == quality ? 1 : 0);
    });
    axes("tactiled_sensor_force_newtons", "Tared force of the world on the sensor, frame S; NaN: no value.",
         &tactiled_sample::force_S_N);
    axes("tactiled_sensor_force_uncertainty_newtons", "One standard uncertainty of the force.",
         &tactiled_sample::sd_force_N);
    axes("tactiled_sensor_torque_newton_meters", "Tared torque, frame S.", &tactiled_sample::torque_S_Nm);
    axes("tactiled_sensor_torque_uncertainty_newton_meters", "One standard uncertainty of the torque.",
         &tactiled_sample::sd_torque_Nm);
    page.metric("tactiled_sensor_age_seconds", "gauge", "Age of the newest sample.");
    each([&](const auto& s, const auto& sensor, auto) { page.sample(sensor, ctl::age_ms(s, view.taken_ns) / 1000); });
    page.metric("tactiled_sensor_age_bound_seconds", "gauge", "Largest possible age of the newest frame; NaN: not known.");
    each([&](const auto&, const auto& sensor, auto i) { page.sample(sensor, ctl::age_bound_ms(*view.segment, i) / 1000); });
    page.metric("tactiled_sensor_rate_hertz", "gauge", "Samples in a second, measured.");
    each([&](const auto& s, const auto& sensor, auto) { page.sample(sensor, double(s.rate_Hz)); });
    page.metric("tactiled_sensor_temperature_celsius", "gauge", "Temperature; NaN: not measured.");
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
    page.metric("tactiled_wakeup_lateness_seconds", "gauge", "How late the loop woke, since the start of the daemon.");
    const Lateness late = view.segment->lateness();
    for (const double q : {0.5, 0.99, 0.999})
        page.sample(label("quantile", fmt::format("{}", q)), lateness_quantile_ns(late, q) / 1e9);
    const auto& g = node.grasp;
    page.metric("tactiled_grip_state", "gauge", "1 for the state of the gripper.");
    for (const std::uint32_t state : {0u, 1u, 2u, 3u, 4u, 5u, 6u, std::uint32_t(TACTILED_GRIP_UNKNOWN)})
        page.sample(label("state", ctl::grip_state_text(state)), g.state == state ? 1 : 0);
    one("tactiled_weight_kilograms", "gauge", "Weight of the object; NaN: not known.", g.weight_kg);
    one("tactiled_weight_uncertainty_kilograms", "gauge", "One standard uncertainty of the weight.", g.weight_sd_kg);
    one("tactiled_grip_newtons", "gauge", "Normal force of a jaw.", double(g.grip_N));
    one("tactiled_grasps_total", "counter", "Grasps.", g.grasps);
    one("tactiled_slips_total", "counter", "Gross slips of all jaws.", g.slips);
}

}  // namespace

std::string metrics_text(const View& view, const std::string& node_name, std::size_t streams) {
    Page page;
    page.metric("tactiled_up", "gauge", "1 while the daemon publishes.");
    page.sample(label("node", node_name), view.is_alive ? 1 : 0);
    page.metric("tactiled_web_streams", "gauge", "Pages that are open.");
    page.sample("", double(streams));
    page.metric("tactiled_web_missed_samples_total", "counter", "Samples that this program was too slow to see.");
    page.sample("", double(view.missed));
    if (!view.segment->is_open()) return page.out;
    page.metric("tactiled_info", "gauge", "Name and version of the daemon.");
    page.sample(label("node", view.segment->header().name) + "," + label("version", view.segment->header().version), 1);
    put_node(page, view);
    put_sensors(page, view);
    put_links(page, view);
    return page.out;
}

}  // namespace tactiled::web
