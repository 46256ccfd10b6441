// The text output of `tactilectl simulate`: the choice as text, the whole report as JSON, the list of effects.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

std::vector<std::string> models_of(const sim::EffectEntry& effect) {
    std::vector<std::string> names;
    for (const sim::Model model : {sim::Model::table, sim::Model::hair, sim::Model::capacitive, sim::Model::taxel})
        if ((effect.models >> unsigned(model) & 1u) != 0) names.emplace_back(name_of(model));
    return names;
}

nlohmann::json extent_json(const sim::Extent& e) {
    nlohmann::json json{{"length_s", e.length_s},
                        {"reverses", e.reverses},
                        {"frequency_Hz", e.frequency_Hz},
                        {"speed_m_s", e.speed_m_s},
                        {"slide_m", e.slide_m},
                        {"x_m", e.x_m},
                        {"y_m", e.y_m},
                        {"ambient_K", e.ambient_K},
                        {"body_K", e.body_K},
                        {"acceleration_m_s2", e.acceleration_m_s2}};
    const char* axis[] = {"fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm"};
    for (std::size_t a = 0; a < sim::kAxes; ++a)
        json["load"][axis[a]] = {{"most", e.max[a]}, {"span", e.span[a]}, {"rate", e.rate[a]}, {"jump", e.jump[a]}};
    return json;
}

nlohmann::json levels_json(const sim::Decision& decision) {
    auto json = nlohmann::json::array();
    for (std::size_t i = 0; i < decision.levels.size(); ++i)
        json.push_back({{"name", decision.levels[i].name},
                        {"error_N", decision.levels[i].error_N},
                        {"cost_ns", decision.level_cost_ns[i]}});
    return json;
}

nlohmann::json forces_json(const std::array<double, 3>& force) {
    return {{"fx_N", force[0]}, {"fy_N", force[1]}, {"fz_N", force[2]}};
}

// The reason, and when an effect is active that rests in a part of the scene.
std::string why(const sim::Scene& scene, const sim::Choice& choice, const sim::Decision& d) {
    std::string text(d.why);
    if (!d.on || d.active_share == 1) return text;
    const char* separator = ": ";
    for (const auto& [begin_s, end_s] : active_s(scene, choice, d)) {
        text += fmt::format("{}{:.3g} .. {:.3g} s", separator, begin_s, end_s);
        separator = ", ";
    }
    return text;
}

}  // namespace

std::string name_of(const sim::Decision& decision) {
    std::string name(decision.effect->name);
    if (decision.on && decision.level != sim::Decision::kItself)
        name += fmt::format(":{}", decision.levels[decision.level].name);
    return name;
}

const char* name_of(sim::Stage stage) {
    static constexpr const char* kNames[] = {"time", "contact", "material", "transducer", "converter", "link"};
    return kNames[std::size_t(stage)];
}

const char* name_of(sim::Model model) {
    static constexpr const char* kNames[] = {"table", "hair", "capacitive", "taxel"};
    return kNames[std::size_t(model)];
}

std::string choice_text(const sim::Simulation& simulation, const std::vector<std::size_t>& sensors) {
    const sim::Scene& scene = simulation.scene();
    std::string text =
        fmt::format("{}: {} samples at {:g} Hz, seed {}\n", scene.title, scene.samples, scene.rate_Hz, scene.seed);
    for (const std::size_t i : sensors) {
        const sim::Sensor& sensor = scene.sensors[i];
        const sim::Choice& choice = simulation.choice(i);
        text += fmt::format("\n{} ({}): error by what is left out at most {:.3g} N; {:.3g} N wanted\n", sensor.name,
                            name_of(sensor.model), choice.guaranteed_N, choice.wanted_N);
        text += fmt::format("{:28} {:>10} {:>13} {:>13} {:>8}  {}\n", "effect:level", "stage", "without it, N",
                            "error now, N", "cost, ns", "why");
        for (const auto& d : choice.decisions)
            text += fmt::format("{:28} {:>10} {:>13.3g} {:>13.3g} {:>8.3g}  {}: {}\n", name_of(d), name_of(d.effect->stage),
                                d.bound.change_N, d.error_N(), d.spent_ns(), d.on ? "on" : "off", why(scene, choice, d));
    }
    return text;
}

std::string effects_text() {
    std::string text;
    for (const sim::EffectEntry* e : sim::chain()) {
        text += fmt::format("{}{}: {}\n", text.empty() ? "" : "\n", e->name, e->title);
        text += fmt::format("  stage {}, {}, {:g} instructions a sample; for {}\n", name_of(e->stage), cost_class(*e),
                            e->instructions, fmt::join(models_of(*e), ", "));
        text += fmt::format("  {}\n  source: {}\n", e->equation, e->source);
        for (const auto& p : e->parameters)
            text += fmt::format("  {} = {}: {} ({:g} .. {:g})\n", p.name,
                                std::isnan(p.usual) ? "by model" : fmt::format("{:g}", p.usual), p.meaning, p.min, p.max);
    }
    return text;
}

nlohmann::json effects_json() {
    nlohmann::json json{{"schema", 1}, {"effects", nlohmann::json::array()}};
    for (const sim::EffectEntry* e : sim::chain()) {
        nlohmann::json effect{{"name", e->name},
                              {"title", e->title},
                              {"stage", name_of(e->stage)},
                              {"models", models_of(*e)},
                              {"cost_class", cost_class(*e)},
                              {"instructions", e->instructions},
                              {"equation", e->equation},
                              {"source", e->source},
                              {"parameters", nlohmann::json::array()}};
        for (const auto& p : e->parameters)
            effect["parameters"].push_back({{"name", p.name},
                                            {"meaning", p.meaning},
                                            {"default", p.usual},  // null: depends on the sensor's model
                                            {"least", p.min},
                                            {"most", p.max}});
        json["effects"].push_back(effect);
    }
    return json;
}

nlohmann::json scene_json(const Report& report) {
    const sim::Scene& scene = report.simulation.scene();
    nlohmann::json json{{"schema", 1},
                        {"scene", scene.file},
                        {"title", scene.title},
                        {"seed", scene.seed},
                        {"rate_Hz", scene.rate_Hz},
                        {"samples", scene.samples},
                        {"effects", report.effects},
                        {"sensors", nlohmann::json::array()}};
    for (std::size_t k = 0; k < report.sensors.size(); ++k) {
        const sim::Sensor& sensor = scene.sensors[report.sensors[k]];
        const sim::Choice& choice = report.simulation.choice(report.sensors[k]);
        const Measured& m = report.measured[k];
        nlohmann::json one{{"name", sensor.name},
                           {"model", name_of(sensor.model)},
                           {"wanted_N", choice.wanted_N},
                           {"guaranteed_N", choice.guaranteed_N},
                           {"difference_N", m.difference_N},
                           {"samples_compared", m.samples},
                           {"none_ns", m.none_ns},
                           {"chosen_ns", m.chosen_ns},
                           {"all_ns", m.all_ns},
                           {"linear_ns", m.linear_ns},
                           {"extent", extent_json(scene.motion.extent(sensor))},
                           {"effects", nlohmann::json::array()}};
        for (std::size_t d = 0; d < choice.decisions.size(); ++d) {
            const sim::Decision& decision = choice.decisions[d];
            const bool time = decision.effect->stage == sim::Stage::time;
            one["effects"].push_back(
                {{"name", decision.effect->name},
                 {"stage", name_of(decision.effect->stage)},
                 {"cost_class", cost_class(*decision.effect)},
                 {"instructions", decision.effect->instructions},
                 {"bound_N", decision.bound.change_N},
                 {"gain", decision.bound.gain},
                 {"jump_N", decision.bound.jump_N},
                 {"on", decision.on},
                 {"level", decision.on && decision.level != sim::Decision::kItself
                               ? nlohmann::json(decision.levels[decision.level].name)
                               : nlohmann::json(nullptr)},
                 {"levels", levels_json(decision)},
                 {"error_N", decision.error_N()},
                 {"cost_ns", decision.cost_ns},
                 {"spent_ns", decision.spent_ns()},
                 {"without_N", forces_json(m.force_N[d])},
                 {"why", decision.why},
                 {"active_s", decision.on ? nlohmann::json(active_s(scene, choice, decision)) : nlohmann::json::array()},
                 {"share_N", time ? std::nan("") : m.share_N[d]},
                 {"time_ns", d < m.time_ns.size() ? m.time_ns[d] : std::nan("")}});
        }
        json["sensors"].push_back(one);
    }
    return json;
}

}  // namespace tactiled::ctl
