// tactilectl status: prints every sensor once, with the counters of the links and the grasp.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "config/calibration.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/grasp_text.hpp"
#include "node/ctl/liveness.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"
#include "node/modbus/table.hpp"
#include "tactiled/reader.hpp"
#include "tactiled/uncertainty.h"

namespace tactiled::ctl {
namespace {

nlohmann::json lateness_json(const Lateness& counts) {
    nlohmann::json out;
    for (const auto& [name, q] : {std::pair{"p50", 0.5}, {"p99", 0.99}, {"p99.9", 0.999}, {"worst", 1.0}})
        out[name] = lateness_quantile_ns(counts, q) / 1000;
    return out;
}

constexpr const char* kFreshness[] = {"unknown", "request", "cable", "clock", "sequence", "arrival"};

const char* freshness_of(const Segment& segment, std::uint32_t i) {
    const std::uint32_t freshness = tactiled_freshness_of(segment.c(), i);
    return freshness < std::size(kFreshness) ? kFreshness[freshness] : "unknown";
}

std::string age_line(const Segment& segment, std::uint32_t i) {
    const double bound_ms = age_bound_ms(segment, i);
    return fmt::format("age of {}: proved by {}{}\n", segment.sensor(i).name, freshness_of(segment, i),
                       std::isfinite(bound_ms) ? fmt::format(", at most {:.1f} ms", bound_ms) : "");
}

// Returns the number of samples with each reason since the start.
std::string reason_line(const Segment& segment, std::uint32_t i) {
    std::string counts;
    for (unsigned bit = 0; bit < kReasonWords.size(); ++bit)
        if (const auto count = tactiled_reason_count(segment.c(), i, bit); count != 0)
            counts += fmt::format("  {} {}", kReasonWords[bit], count);
    return counts.empty() ? "" : fmt::format("samples of {}:{}\n", segment.sensor(i).name, counts);
}

// Returns the set bits of a register of faults or warnings, as the text of the register map up to a colon, or as the
// names of constants in PLC code.
std::vector<std::string> bit_names(const char* cell, std::uint32_t bits, bool constants) {
    std::vector<std::string> names;
    for (const modbus::Name& bit : modbus::names_of(cell))
        if ((bits >> bit.value & 1u) != 0) names.emplace_back(constants ? bit.id : bit.name.substr(0, bit.name.find(':')));
    return names;
}

// Returns a line where a link's bytes arrive and no frame of them was ever good; else "".
std::string refused_line(const Segment& segment, std::uint32_t sensor, const tactiled_sample& newest) {
    if (newest.quality == TACTILED_GOOD || newest.quality == TACTILED_UNCERTAIN) return "";
    for (std::uint32_t i = 0; i < segment.n_links(); ++i) {
        const auto& link = segment.link(i);
        if (std::string_view(link.name) != segment.sensor(sensor).link) continue;
        const auto count = [&](tactiled_link_count kind) { return __atomic_load_n(&link.count[kind], __ATOMIC_RELAXED); };
        if (count(TACTILED_LINK_BYTES) == 0 || count(TACTILED_LINK_FRAMES) != 0) return "";
        for (const auto kind : {TACTILED_LINK_BAD_CHECKSUM, TACTILED_LINK_BAD_LENGTH, TACTILED_LINK_BAD_VALUE})
            if (count(kind) != 0)
                return fmt::format(
                    "{}: bytes arrive, and every frame of them is refused ({} {}): tactilectl identify shows "
                    "the [[link]] that reads them\n",
                    segment.sensor(sensor).name, kLinkCountNames[kind], count(kind));
        return "";
    }
    return "";
}

std::string as_text(const Segment& segment, const Snapshot& snapshot) {
    const auto& h = segment.header();
    const Liveness liveness = liveness_of(segment);
    const auto& node = snapshot.node;
    const Lateness late = segment.lateness();
    std::string out = fmt::format(
        "{}  tactiled {}  pid {}  epoch {}  heartbeat {}  longest cycle {} us  woken {:.0f} us late, p99 {:.0f} us  "
        "{} cycles missed{}{}{}\n",
        h.name, h.version, h.pid, h.epoch, node.heartbeat, node.worst_cycle_us, lateness_quantile_ns(late, 0.5) / 1000,
        lateness_quantile_ns(late, 0.99) / 1000, node.missed_cycles,
        (node.status & TACTILED_RT_DEGRADED) != 0 ? "  RT_DEGRADED" : "",
        (node.warning & TACTILED_WARN_RELOAD) != 0 ? "  reload refused: see the log" : "",
        (node.status & TACTILED_SIMULATED) != 0 ? "  simulated" : "");
    if (!liveness.runs()) out = fmt::format("{}: {}\n", liveness.word, liveness.why) + out;
    out += fault_lines(node);
    if (const std::string fault = control_fault(segment); liveness.runs() && !fault.empty()) out += fault + "\n";
    out += fmt::format("{:<12} {:>10} {:>10} {:>10} {:>8} {:>8} {:>8} {:>6}  {}\n", "sensor", "fx/N", "fy/N", "fz/N",
                       "sd fz/N", "Hz", "age/ms", "lost", "quality");
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        const auto& s = snapshot.sensor[i];
        out += fmt::format("{:<12} {} {} {} {} {} {} {:>6}  {}\n", segment.sensor(i).name, number(s.force_S_N[0], 10, 3),
                           number(s.force_S_N[1], 10, 3), number(s.force_S_N[2], 10, 3), number(s.sd_force_N[2], 8, 3),
                           number(double(s.rate_Hz), 8, 1), number(age_ms(s, snapshot.taken_ns), 8, 1), s.lost,
                           coloured(s.quality, quality_text(s.quality, s.reasons)));
    }
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if (const std::string refused = refused_line(segment, i, snapshot.sensor[i]); !refused.empty())
            out += refused;
        else
            out += remedy_lines(segment.sensor(i).name, snapshot.sensor[i].reasons);
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) out += age_line(segment, i);
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if (!segment.has_array(i))
            out += fmt::format("damage of {}: {}\n", segment.sensor(i).name,
                               damage_text(tactiled_undetected_of(segment.c(), i)));
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) out += auto_lines(segment, i, snapshot.sensor[i]);
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) out += reason_line(segment, i);
    for (std::uint32_t i = 0; i < segment.n_links(); ++i) {
        const auto& link = segment.link(i);
        out += fmt::format("link {} ({}, {})", link.name, link.driver, link_word(link, liveness));
        for (int kind = 0; kind < TACTILED_LINK_COUNTS; ++kind)
            if (const auto count = __atomic_load_n(&link.count[kind], __ATOMIC_RELAXED); count != 0)
                out += fmt::format("  {} {}", kLinkCountNames[kind], count);
        out += '\n';
    }
    return out + grasp_lines(segment, node.grasp) + tool_lines(node.tool);
}

struct Args {
    std::string node = "gripper";
    bool json = false;
};

int status(const Args& args) {
    std::string why;
    const Segment segment = Segment::try_open(args.node, why);
    Snapshot snapshot;
    if (!segment.is_open() || !segment.snapshot(snapshot)) {
        fmt::print(stderr, "tactilectl: {}\n", why.empty() ? "the daemon is starting" : why);
        return kNotReachable;
    }
    fmt::print("{}{}", args.json ? status_json(segment, snapshot).dump() : as_text(segment, snapshot),
               args.json ? "\n" : "");
    if (const Liveness liveness = liveness_of(segment); !liveness.runs()) {
        fmt::print(stderr, "tactilectl: {}\n", liveness.why);
        return liveness.is_dead() ? kNotReachable : kUnhealthy;
    }
    return is_healthy(segment, snapshot) ? kGood : kUnhealthy;
}

}  // namespace

std::string number(double value, int width, int digits) {
    return std::isfinite(value) ? fmt::format("{:{}.{}f}", value, width, digits) : fmt::format("{:>{}}", "-", width);
}

double age_ms(const tactiled_sample& s, std::uint64_t now_ns) {
    return now_ns > s.t_ns ? double(now_ns - s.t_ns) / 1e6 : 0.0;
}

std::string uncertainty_text(const tactiled_placed& placed) {
    struct Part {
        const char *word, *remedy;
    };
#define TACTILED_TEXT_OF_PART_(part, word, cause, remedy) {word, remedy},
    static constexpr Part kParts[] = {TACTILED_PART_TABLE(TACTILED_TEXT_OF_PART_)};
#undef TACTILED_TEXT_OF_PART_
    const unsigned part = tactiled_largest_part(&placed);
    return part < TACTILED_PARTS ? fmt::format("largest part {}: {}", kParts[part].word, kParts[part].remedy) : "";
}

double age_bound_ms(const Segment& segment, std::uint32_t i) {
    const std::uint32_t bound_us = tactiled_age_bound_us_of(segment.c(), i);
    return bound_us == TACTILED_AGE_UNBOUNDED ? std::numeric_limits<double>::quiet_NaN() : bound_us / 1e3;
}

std::string damage_text(const tactiled_undetected& undetected, std::string channel) {
    if (!std::isfinite(undetected.mean) || undetected.kind >= kDamageKinds.size())
        return "undetected damage of a channel is unknown: calibrate again";
    if (channel.empty()) channel = fmt::format("number {} of the calibration", undetected.channel + 1);
    return fmt::format("a channel {} is GOOD and wrong in {:.1f} % of readings (mean over the channels; {}: {:.1f} %)",
                       kDamageKinds[undetected.kind].text, 100 * double(undetected.mean), channel,
                       100 * double(undetected.worst));
}

nlohmann::json damage_json(const tactiled_undetected& undetected) {
    if (!std::isfinite(undetected.mean) || undetected.kind >= kDamageKinds.size()) return nullptr;
    return {{"kind", kDamageKinds[undetected.kind].key},
            {"mean", undetected.mean},
            {"worst", undetected.worst},
            {"worst_channel", undetected.channel}};
}

const char* link_word(const tactiled_link& link, const Liveness& liveness) {
    return !liveness.runs() ? "not read" : link.state == TACTILED_LINK_OPEN ? "open" : "closed";
}

std::string remedy_lines(const std::string& name, std::uint32_t reasons) {
    std::string out;
    for (std::size_t bit = 0; bit < kReasonTexts.size(); ++bit)
        if ((reasons >> bit & 1u) != 0)
            out += fmt::format("{}: {}; remedy: {}\n", name, kReasonTexts[bit].meaning, kReasonTexts[bit].remedy);
    return out;
}

std::string fault_lines(const tactiled_node& node) {
    std::string out;
    if (const auto faults = bit_names("global.FAULT", node.fault, false); !faults.empty())
        out += fmt::format("FAULT  {}  (latched: tactilectl clear)\n", fmt::join(faults, ", "));
    if (const auto warnings = bit_names("global.WARN", node.warning, false); !warnings.empty())
        out += fmt::format("WARN   {}\n", fmt::join(warnings, ", "));
    return out;
}

nlohmann::json status_json(const Segment& segment, const Snapshot& snapshot) {
    const auto& h = segment.header();
    const Liveness liveness = liveness_of(segment);
    nlohmann::json out{{"schema", 1},
                       {"node", h.name},
                       {"version", h.version},
                       {"pid", h.pid},
                       {"daemon", liveness.word},
                       {"fault", bit_names("global.FAULT", snapshot.node.fault, true)},
                       {"warning", bit_names("global.WARN", snapshot.node.warning, true)},
                       {"epoch", h.epoch},
                       {"heartbeat", snapshot.node.heartbeat},
                       {"sequence", snapshot.node.sequence},
                       {"cycles", snapshot.node.cycles},
                       {"missed_cycles", snapshot.node.missed_cycles},
                       {"worst_cycle_us", snapshot.node.worst_cycle_us},
                       {"lateness_us", lateness_json(segment.lateness())},
                       {"rt_degraded", (snapshot.node.status & TACTILED_RT_DEGRADED) != 0},
                       {"grasp", grasp_json(segment, snapshot.node.grasp)},
                       {"tool", tool_json(segment, snapshot.node.tool)},
                       {"reload_refused", (snapshot.node.warning & TACTILED_WARN_RELOAD) != 0},
                       {"simulated", (snapshot.node.status & TACTILED_SIMULATED) != 0}};
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        const auto& s = snapshot.sensor[i];
        nlohmann::json sensor{{"name", segment.sensor(i).name},
                              {"model", segment.sensor(i).model},
                              {"method", segment.sensor(i).method},
                              {"link", segment.sensor(i).link},
                              {"quality", quality_text(s.quality, s.reasons)},
                              {"age_ms", age_ms(s, snapshot.taken_ns)},
                              {"freshness", freshness_of(segment, i)},
                              {"age_bound_ms", age_bound_ms(segment, i)},
                              {"rate_Hz", s.rate_Hz},
                              {"force_S_N", s.force_S_N},
                              {"torque_S_Nm", s.torque_S_Nm},
                              {"sd_force_N", s.sd_force_N},
                              {"uncertainty", uncertainty_text(snapshot.placed(i))},
                              {"raw_force_S_N", s.raw_force_S_N},
                              {"lost", s.lost},
                              {"tare_count", s.tare_count}};
        for (unsigned bit = 0; bit < kReasonWords.size(); ++bit)
            sensor["samples"][kReasonWords[bit]] = tactiled_reason_count(segment.c(), i, bit);
        if (nlohmann::json damage = damage_json(tactiled_undetected_of(segment.c(), i)); !damage.is_null())
            sensor["undetected_damage"] = std::move(damage);
        if (segment.has_array(i)) sensor["taxels"] = segment.c()->array[i].n_taxels;
        if (nlohmann::json front = auto_json(segment, i, s); !front.is_null()) sensor["auto"] = std::move(front);
        out["sensors"].push_back(std::move(sensor));
    }
    for (std::uint32_t i = 0; i < segment.n_links(); ++i) {
        const auto& link = segment.link(i);
        nlohmann::json l{
            {"name", link.name}, {"driver", link.driver}, {"open", liveness.runs() && link.state == TACTILED_LINK_OPEN}};
        for (int kind = 0; kind < TACTILED_LINK_COUNTS; ++kind)
            l[kLinkCountNames[kind]] = __atomic_load_n(&link.count[kind], __ATOMIC_RELAXED);
        out["links"].push_back(std::move(l));
    }
    return out;
}

bool is_healthy(const Segment& segment, const Snapshot& snapshot) {
    if (snapshot.taken_ns - snapshot.node.t_ns > std::uint64_t(segment.header().watchdog_ms) * 1'000'000u) return false;
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if (snapshot.sensor[i].quality == TACTILED_BAD || snapshot.sensor[i].quality == TACTILED_NO_VALUE) return false;
    return true;
}

Run add_status(Command verb) {
    auto args = std::make_shared<Args>();
    add_node_option(verb, args->node);
    verb.add_flag("--json", args->json, "one JSON object");
    return [args] { return status(*args); };
}

}  // namespace tactiled::ctl
