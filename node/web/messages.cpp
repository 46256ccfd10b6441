#include "node/web/messages.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>

#include "node/bridges/edge.hpp"
#include "node/ctl/array_text.hpp"
#include "node/ctl/grasp_text.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"
#include "node/web/assets.hpp"

namespace tactiled::web {
namespace {

constexpr auto kReplace = nlohmann::json::error_handler_t::replace;  // a name that is no UTF-8

// JSON by hand: this is written 30 times a second.
class Text {
public:
    explicit Text(std::string& out) : out_(out) {}
    Text& raw(std::string_view text) {
        out_ += text;
        return *this;
    }
    template <class T>
    Text& whole(std::string_view key, T value) {
        fmt::format_to(std::back_inserter(out_), "\"{}\":{},", key, value);
        return *this;
    }
    Text& number(std::string_view key, double value) {
        fmt::format_to(std::back_inserter(out_), "\"{}\":", key);
        put(value);
        out_ += ',';
        return *this;
    }
    template <class T>
    Text& list(std::string_view key, std::span<const T> values) {
        fmt::format_to(std::back_inserter(out_), "\"{}\":[", key);
        for (const T value : values) {
            put(double(value));
            out_ += ',';
        }
        return end(']').raw(",");
    }
    Text& text(std::string_view key, const std::string& value) {
        fmt::format_to(std::back_inserter(out_), "\"{}\":{},", key, nlohmann::json(value).dump(-1, ' ', false, kReplace));
        return *this;
    }
    // Replaces the comma after the last entry.
    Text& end(char bracket) {
        if (out_.back() == ',') out_.pop_back();
        out_ += bracket;
        return *this;
    }

private:
    void put(double value) {
        if (std::isfinite(value))
            fmt::format_to(std::back_inserter(out_), "{:.7g}", value);
        else
            out_ += "null";
    }
    std::string& out_;
};

void put_sensor(Text& text, const View& view, std::uint32_t i) {
    const tactiled_sample& s = view.snapshot.sensor[i];
    const Interval& interval = view.interval[i];
    text.raw("{").whole("quality", s.quality).whole("reasons", s.reasons);
    text.whole("worst", interval.quality).whole("all_reasons", interval.reasons);
    text.list<double>("force_N", s.force_S_N).list<double>("torque_Nm", s.torque_S_Nm);
    text.list<double>("sd_force_N", s.sd_force_N).list<double>("sd_torque_Nm", s.sd_torque_Nm);
    text.text("uncertainty", ctl::uncertainty_text(view.snapshot.placed(i)));
    text.list<float>("low", interval.low).list<float>("high", interval.high);
    text.number("age_ms", ctl::age_ms(s, view.taken_ns)).number("age_bound_ms", ctl::age_bound_ms(*view.segment, i));
    text.number("rate_Hz", double(s.rate_Hz));
    text.whole("lost", s.lost).whole("tares", s.tare_count).whole("state", s.state);
    text.number("peak_N", double(s.peak_N)).number("temperature_C", double(s.temperature_C));
    text.list<double>("cop_m", s.cop_S_m).number("residual", s.residual).end('}').raw(",");
}

void put_grasp(Text& text, const View& view) {
    const Segment& segment = *view.segment;
    const tactiled_grasp& g = view.snapshot.node.grasp;
    text.raw("\"grasp\":{").text("state", ctl::grip_state_text(g.state)).number("weight_kg", g.weight_kg);
    text.number("weight_sd_kg", g.weight_sd_kg).text("weight_state", ctl::weight_state_text(g.weight_state));
    text.text("quality", bridges::edge_of(view.grasp_quality()).word);
    text.text("weight_quality", bridges::edge_of(view.weight_quality()).word);
    const std::string object(g.object, ::strnlen(g.object, sizeof g.object));
    text.text("object", object).whole("object_id", g.object_id).number("probability", double(g.object_probability));
    text.number("grip_N", double(g.grip_N)).number("recommended_N", double(g.recommended_grip_N));
    text.number("friction", double(g.friction)).number("friction_sd", double(g.friction_sd));
    text.whole("grasps", g.grasps).whole("slips", g.slips).raw("\"jaws\":[");
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        text.raw("{").text("slip", ctl::slip_state_text(g.slip_state[i])).whole("slips", g.slip_count[i]);
        text.whole("latched", g.slip_latch >> i & 1u).number("friction_use", double(g.friction_use[i])).end('}').raw(",");
    }
    text.end(']').end('}').raw(",");
}

void put_links(Text& text, const Segment& segment) {
    text.raw("\"links\":[");
    for (std::uint32_t i = 0; i < segment.n_links(); ++i) {
        const auto& link = segment.link(i);
        text.raw("{").whole("open", __atomic_load_n(&link.state, __ATOMIC_RELAXED) == TACTILED_LINK_OPEN).raw("\"count\":[");
        for (const auto& count : link.count) text.raw(fmt::format("{},", __atomic_load_n(&count, __ATOMIC_RELAXED)));
        text.end(']').end('}').raw(",");
    }
    text.end(']').raw(",");
}

}  // namespace

std::string hello_message(const View& view, const std::string& run, bool has_commands) {
    const Segment& segment = *view.segment;
    nlohmann::json out{{"run", run},
                       {"page", std::string(assets_version())},
                       {"t_s", double(view.taken_ns) / 1e9},
                       {"commands", has_commands},
                       {"reasons", ctl::kReasonWords},
                       {"link_counts", ctl::kLinkCountNames},
                       {"taxel_states", ctl::kTaxelStates},
                       {"sensors", nlohmann::json::array()},
                       {"links", nlohmann::json::array()}};
    for (const auto& text : ctl::kReasonTexts) out["meanings"].push_back(text.meaning);
    for (const char* word : kFaultWords) out["faults"].push_back(word != nullptr ? word : "");
    for (const char* word : kWarningWords) out["warnings"].push_back(word != nullptr ? word : "");
    if (segment.is_open()) {
        out["node"] = segment.header().name;
        out["version"] = segment.header().version;
        out["pid"] = segment.header().pid;
        out["epoch"] = segment.header().epoch;
    }
    for (std::uint32_t i = 0; i < view.n_sensors(); ++i) {
        const auto& s = segment.sensor(i);
        out["sensors"].push_back({{"name", s.name},
                                  {"model", s.model},
                                  {"method", s.method},
                                  {"serial", s.serial},
                                  {"link", s.link},
                                  {"stale_ms", s.stale_ms},
                                  {"components", s.components},
                                  {"full_scale", s.full_scale},
                                  {"damage", ctl::damage_json(tactiled_undetected_of(segment.c(), i))},
                                  {"taxels", segment.has_array(i) ? segment.c()->array[i].n_taxels : 0}});
    }
    for (std::uint32_t i = 0; i < view.n_links(); ++i)
        out["links"].push_back({{"name", segment.link(i).name},
                                {"driver", segment.link(i).driver},
                                {"simulated", segment.link(i).simulated != 0}});
    return "event: hello\ndata: " + out.dump(-1, ' ', false, kReplace) + "\n\n";
}

void append_past(const View& view, const History& history, std::uint32_t sensor, std::string& out) {
    out += "event: past\ndata: ";
    history.encode(sensor, view.segment->sensor(sensor).components, out);
    out += "\n\n";
}

std::uint64_t append_changes(const Timeline& timeline, std::uint64_t revision, std::string& out) {
    out += "event: changes\ndata: ";
    const std::uint64_t newest = timeline.encode(revision, out);
    out += "\n\n";
    return newest;
}

std::string frame_message(const View& view, bool links) {
    std::string out = "data: {";
    Text text(out);
    fmt::format_to(std::back_inserter(out), "\"t_s\":{:.4f},", double(view.taken_ns) / 1e9);
    text.whole("wall_ms", view.wall_ms).whole("alive", view.is_alive).text("why", view.why);
    if (view.segment->is_open()) {
        const auto& node = view.snapshot.node;
        text.whole("heartbeat", node.heartbeat).whole("status", node.status).whole("fault", node.fault);
        text.whole("warning", node.warning).whole("worst_cycle_us", node.worst_cycle_us);
        text.whole("missed_cycles", node.missed_cycles);
        put_grasp(text, view);
        if (links) put_links(text, *view.segment);
    }
    text.raw("\"sensors\":[");
    for (std::uint32_t i = 0; i < view.n_sensors(); ++i) put_sensor(text, view, i);
    text.end(']').end('}').raw("\n\n");
    return out;
}

std::string status_body(const View& view, const std::string& node_name) {
    nlohmann::json out{
        {"schema", 1}, {"node", node_name}, {"sensors", nlohmann::json::array()}, {"links", nlohmann::json::array()}};
    if (view.segment->is_open()) {
        out.update(ctl::status_json(*view.segment, view.snapshot));
        out["grasp"]["quality"] = bridges::edge_of(view.grasp_quality()).word;
        out["grasp"]["weight_quality"] = bridges::edge_of(view.weight_quality()).word;
    }
    out["alive"] = view.is_alive;
    out["why"] = view.why;
    out["wall_ms"] = view.wall_ms;
    out["t_s"] = double(view.taken_ns) / 1e9;
    const auto& node = view.snapshot.node;
    out["faults"] = words_of(kFaultWords, node.fault);
    out["warnings"] = words_of(kWarningWords, node.warning);
    for (std::uint32_t i = 0; i < view.n_sensors(); ++i) {
        const auto& about = view.segment->sensor(i);
        const auto& s = view.snapshot.sensor[i];
        nlohmann::json& sensor = out["sensors"][i];
        sensor["stale_ms"] = about.stale_ms;
        sensor["serial"] = about.serial;
        sensor["components"] = about.components;
        sensor["full_scale"] = about.full_scale;
        sensor["sd_torque_Nm"] = s.sd_torque_Nm;
        sensor["cop_S_m"] = s.cop_S_m;
        sensor["residual"] = s.residual;
        sensor["temperature_C"] = s.temperature_C;
        sensor["peak_N"] = s.peak_N;
        sensor["contact"] = (s.state & TACTILED_CONTACT) != 0;
        sensor["overload"] = (s.state & TACTILED_OVERLOAD) != 0;
        sensor["sequence"] = s.sequence;
        sensor["epoch"] = s.epoch;
    }
    return out.dump(2, ' ', false, kReplace) + '\n';
}

std::string events_body(const Timeline& timeline) {
    std::string out = R"({"schema":1,"events":)";
    timeline.encode(0, out);
    return out + "}\n";
}

std::string array_body(const View& view, std::uint32_t sensor) {
    std::string out = R"({"schema":1,)";
    Text text(out);
    Array array;
    view.segment->latest(sensor, array);
    ctl::append_array_json(*view.segment, sensor, array, out);
    text.raw(fmt::format("\"t_s\":{:.4f},", double(monotonic_ns()) / 1e9)).whole("wall_ms", view.wall_ms).end('}').raw("\n");
    return out;
}

std::string places_body(const View& view, std::uint32_t sensor) {
    std::string out = R"({"schema":1,)";
    ctl::append_places_json(*view.segment, sensor, out);
    Text(out).end('}').raw("\n");
    return out;
}

int find_array(const View& view, const std::string& sensor) {
    const int index = view.segment->is_open() ? view.segment->find(sensor) : -1;
    return index >= 0 && view.segment->has_array(std::uint32_t(index)) ? index : -1;
}

}  // namespace tactiled::web
