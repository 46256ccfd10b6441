#include "node/ctl/grasp_text.hpp"

#include <fmt/format.h>

#include <cmath>

#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kColumns = 80;

template <std::size_t N>
const char* word(const char* const (&words)[N], std::uint32_t value) {
    return value < N ? words[value] : "unknown";
}

std::string number(double value, int digits, const char* unit) {
    return std::isfinite(value) ? fmt::format("{:.{}f}{}", value, digits, unit) : "-";
}

}  // namespace

const char* grip_state_text(std::uint32_t state) {
    static constexpr const char* kWords[] = {"open", "contact", "grasped", "lifting", "holding", "slipping", "lost"};
    return word(kWords, state);
}

const char* weight_state_text(std::uint32_t state) {
    static constexpr const char* kWords[] = {"none", "estimating", "stable", "overload", "not-observable", "temperature"};
    return word(kWords, state);
}

const char* slip_state_text(std::uint32_t state) {
    static constexpr const char* kWords[] = {"none", "incipient", "gross"};
    return word(kWords, state);
}

std::string doubts_text(std::uint32_t doubts) {
    static constexpr const char* kWords[] = {"balance", "shares", "dead-shear", "negative",
                                             "creeps",  "moves",  "across",     "late"};
    return words_of(doubts, kWords);
}

std::string grasp_lines(const Segment& segment, const tactiled_grasp& g) {
    if (g.state == TACTILED_GRIP_UNKNOWN && g.t_ns == 0) return "";  // there is no [grasp], or no data yet
    const std::string object = g.object_id == 0 ? "unknown"
                                                : fmt::format("{} ({}) {}", g.object, g.object_id,
                                                              number(double(g.object_probability) * 100, 1, " %"));
    std::string lines[] = {
        fmt::format("grasp {}  weight {} +- {} ({})  object {}", grip_state_text(g.state), number(g.weight_kg, 4, " kg"),
                    number(g.weight_sd_kg, 4, " kg"), weight_state_text(g.weight_state), object),
        fmt::format("  grip {}  recommended {}  friction {} +- {}  grasps {}", number(double(g.grip_N), 2, " N"),
                    number(double(g.recommended_grip_N), 2, " N"), number(double(g.friction), 2, ""),
                    number(double(g.friction_sd), 2, ""), g.grasps),
        fmt::format("  slips {}", g.slips)};
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if (g.slip_state[i] != TACTILED_SLIP_UNKNOWN)
            lines[2] += fmt::format("  {} {} {}{}", segment.sensor(i).name, g.slip_count[i],
                                    slip_state_text(g.slip_state[i]), (g.slip_latch >> i & 1u) != 0 ? " (latched)" : "");
    std::string text;
    for (const std::string& line : lines) text += fmt::format("{:.{}}\n", line, kColumns);
    if (g.weight_doubts == 0) return text;
    std::string doubts = fmt::format("  weight in doubt: {}", doubts_text(g.weight_doubts));
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if ((g.doubtful >> i & 1u) != 0) doubts += fmt::format("  jaw {}", segment.sensor(i).name);
    return text + fmt::format("{:.{}}\n", doubts, kColumns);
}

nlohmann::json grasp_json(const Segment& segment, const tactiled_grasp& g) {
    nlohmann::json out{{"state", grip_state_text(g.state)},
                       {"weight_state", weight_state_text(g.weight_state)},
                       {"weight_kg", g.weight_kg},
                       {"weight_sd_kg", g.weight_sd_kg},
                       {"object_id", g.object_id},
                       {"object", g.object},
                       {"object_probability", g.object_probability},
                       {"grip_N", g.grip_N},
                       {"recommended_grip_N", g.recommended_grip_N},
                       {"friction", g.friction},
                       {"friction_sd", g.friction_sd},
                       {"grasps", g.grasps},
                       {"slips", g.slips},
                       {"weight_doubts", doubts_text(g.weight_doubts)}};
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        out["jaws"][segment.sensor(i).name] = {{"slip", slip_state_text(g.slip_state[i])},
                                               {"slips", g.slip_count[i]},
                                               {"slip_latched", (g.slip_latch >> i & 1u) != 0},
                                               {"doubtful", (g.doubtful >> i & 1u) != 0},
                                               {"friction_use", g.friction_use[i]}};
    return out;
}

}  // namespace tactiled::ctl
