#include "node/web/api.hpp"

#include <nlohmann/json.hpp>
#include <span>

#include "node/ctl/status_text.hpp"

namespace tactiled::web {
namespace {

constexpr auto kReplace = nlohmann::json::error_handler_t::replace;

nlohmann::json words(std::span<const char* const> all, std::uint32_t bits) {
    nlohmann::json list = nlohmann::json::array();
    for (std::size_t bit = 0; bit < all.size(); ++bit)
        if ((bits >> bit & 1u) != 0 && all[bit] != nullptr) list.push_back(all[bit]);
    return list;
}

}  // namespace

std::string status_body(const View& view, const std::string& node_name) {
    nlohmann::json out{
        {"schema", 1}, {"node", node_name}, {"sensors", nlohmann::json::array()}, {"links", nlohmann::json::array()}};
    if (view.segment->is_open()) out.update(ctl::status_json(*view.segment, view.snapshot));
    out["alive"] = view.is_alive;
    out["why"] = view.why;
    out["wall_ms"] = view.wall_ms;
    out["t_s"] = double(view.taken_ns) / 1e9;
    const auto& node = view.snapshot.node;
    out["faults"] = words(kFaultWords, node.fault);
    out["warnings"] = words(kWarningWords, node.warning);
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

}  // namespace tactiled::web
