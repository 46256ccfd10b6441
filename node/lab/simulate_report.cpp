// The page of `simulate --report`: for each sensor the scene's settings, the required effects with reasons, their
// cost, and the actual error.
#include <fmt/format.h>

#include <filesystem>

#include "node/lab/chart/text.hpp"
#include "node/lab/report/html.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

std::string scene_facts(const Report& report) {
    const sim::Scene& scene = report.simulation.scene();
    return html_facts(
        {{"scene", html_text(std::filesystem::path(scene.file).filename().string())},
         {"effects", html_text(report.effects)},
         {"length", fmt::format("{} samples at {}, {}", html_number(double(scene.samples), 12),
                                html_number(scene.rate_Hz, "Hz"), html_number(double(scene.samples) / scene.rate_Hz, "s"))},
         {"seed", html_number(double(scene.seed), 17)}});
}

std::string sensor_facts(const sim::Sensor& sensor, const sim::Choice& choice, const Measured& m) {
    std::size_t on = 0;
    double sum_ns = m.linear_ns;
    for (std::size_t d = 0; d < choice.decisions.size(); ++d) {
        if (!choice.decisions[d].on) continue;
        ++on;
        if (d < m.time_ns.size()) sum_ns += m.time_ns[d];
    }
    return html_facts(
        {{"model", name_of(sensor.model)},
         {"effects on", fmt::format("{} of {}", html_number(double(on)), html_number(double(choice.decisions.size())))},
         {"wanted accuracy", html_number(choice.wanted_N, "N")},
         {"guaranteed: no channel differs from all effects by more than", html_number(choice.guaranteed_N, "N")},
         {"measured: largest difference from all effects, whole scene, all channels",
          fmt::format("{} over {} samples", html_number(m.difference_N, "N"), html_number(double(m.samples), 12))},
         {"a sample costs", fmt::format("{} without effects, {} with these, {} with all", html_number(m.none_ns, "ns"),
                                        html_number(m.chosen_ns, "ns"), html_number(m.all_ns, "ns"))},
         {"linear model and those effects, each timed alone", html_number(sum_ns, "ns")}},
        "facts-" + sensor.name);
}

std::string stated(const sim::Sensor& sensor, const sim::Extent& e) {
    std::string rows = html_row({"load", "most", "span", "rate", "jump"}, "th");
    const char* axis[] = {"fx", "fy", "fz", "mx", "my"};
    for (std::size_t a = 0; a < sim::kAxes; ++a) {
        const char* unit = a < sim::kMx ? "N" : "Nm";
        rows += html_row({axis[a], html_number(e.max[a], unit), html_number(e.span[a], unit),
                          html_number(e.rate[a], a < sim::kMx ? "N/s" : "Nm/s"), html_number(e.jump[a], unit)});
    }
    Facts facts{{"length", html_number(e.length_s, "s")},
                {"comes back", e.reverses ? "yes" : "no"},
                {"highest frequency", html_number(e.frequency_Hz, "Hz")},
                {"sliding", fmt::format("{}, path {}", html_number(e.speed_m_s, "m/s"), html_number(e.slide_m, "m"))},
                {"shear beyond friction, beyond kinetic friction",
                 fmt::format("{}, {}", html_number(e.shear_excess_N, "N"), html_number(e.kinetic_excess_N, "N"))},
                {"centre of contact", fmt::format("|x| {}, |y| {}", html_number(e.x_m, "m"), html_number(e.y_m, "m"))},
                {"surroundings, body against them",
                 fmt::format("{}, {}", html_number(e.ambient_K, "K"), html_number(e.body_K, "K"))},
                {"acceleration", html_number(e.acceleration_m_s2, "m/s²")}};
    return "<h3>Content of the scene</h3>\n<p>Largest values at this sensor, by the scene's text alone: nothing was run "
           "for "
           "them. The bounds are made of these.</p>\n" +
           html_table(rows, "load-" + sensor.name) + html_facts(facts, "extent-" + sensor.name);
}

std::string effects_table(const sim::Sensor& sensor, const sim::Choice& choice, const Measured& m) {
    std::string rows = html_row({"effect", "what", "stage", "force without it, N: fx", "fy", "fz", "at most, N", "", "level",
                                 "error now, N", "cost, ns", "measured, ns", "measured share, N", "why"},
                                "th");
    for (std::size_t d = 0; d < choice.decisions.size(); ++d) {
        const sim::Decision& decision = choice.decisions[d];
        const sim::EffectEntry& effect = *decision.effect;
        const bool lowered = decision.on && decision.level != sim::Decision::kItself;
        rows += html_row({html_text(effect.name), html_text(effect.title), name_of(effect.stage),
                          html_number(m.force_N[d][0], 2), html_number(m.force_N[d][1], 2), html_number(m.force_N[d][2], 2),
                          html_number(decision.bound.change_N, 3), decision.on ? "<strong>on</strong>" : "off",
                          lowered       ? html_text(decision.levels[decision.level].name)
                          : decision.on ? "full"
                                        : "–",
                          html_number(decision.error_N(), 3), html_number(decision.spent_ns(), 3),
                          d < m.time_ns.size() ? html_number(m.time_ns[d], 3) : "–",
                          effect.stage == sim::Stage::time ? "–" : html_number(m.share_N[d], 3), html_text(decision.why)});
    }
    return "<h3>Effects</h3>\n" + html_table(rows, "effects-" + sensor.name);
}

std::string what_when(const sim::Scene& scene, const std::string& effects, std::size_t number) {
    return "<h3>What they did when</h3>\n<figure class=\"wide\">\n" +
           figure_svg(timeline_figure(scene, effects, number), Place::page) +
           "<figcaption>What the body does, and below it a line where each effect ran, with a bar where it "
           "changed a channel by more than a hundredth of the wanted accuracy; its largest change in N. Effects that were "
           "left out stand below with the reason.</figcaption>\n</figure>\n";
}

constexpr const char* kHowToRead = R"(<h2>How to read the numbers</h2>
<ul>
<li>N stands for a channel's change too: its change in its own unit over its response to the axis that it responds to least, of
those that it responds to at all. So an error is rather named too large than too small.</li>
<li>Force without it: run of this scene's first samples (at most 60,000) with the chosen effects, and again without this one,
or with it where it was not chosen; the largest difference of the force that the sensor's gains make of the channels.</li>
<li>At most: the bound, the largest change that the effect can make to any channel in any scene that states the same.</li>
<li>Level, error now: a cheaper model of the effect, and how far it can be off; of an effect that is off, its bound. The
guaranteed error is the sum of these, handed on along the chain.</li>
<li>Cost: ns a sample, measured for all effects and levels in one run and kept in a table, so that the choice is the same on
every machine. The choice is the cheapest set with which the guaranteed error stays within the wanted accuracy.</li>
<li>Measured share: the largest change that the effect made to a channel, in a run of the whole scene with all effects. Of
what moves the instant of a sample it is not measured (–).</li>
<li>Measured ns: a sample of the sensor, by reading the clock after each step of a block of 64 samples in a run with all
effects; the median over pieces of 1024 samples, the clock's own time taken off. It is of this machine and this run.</li>
<li>What a sample costs: the median of pieces of whole runs, without, with the chosen and with all effects in turn.</li>
</ul>
)";

}  // namespace

std::string scene_html(const Report& report) {
    const sim::Scene& scene = report.simulation.scene();
    std::string page = scene_facts(report);
    for (std::size_t k = 0; k < report.sensors.size(); ++k) {
        const sim::Sensor& sensor = scene.sensors[report.sensors[k]];
        const sim::Choice& choice = report.simulation.choice(report.sensors[k]);
        page += "<h2>Sensor " + html_text(sensor.name) + "</h2>\n" + sensor_facts(sensor, choice, report.measured[k]);
        page += what_when(scene, report.effects, report.sensors[k]) + effects_table(sensor, choice, report.measured[k]);
        page += stated(sensor, scene.motion.extent(sensor));
    }
    return html_page("Scene " + scene.title, page + kHowToRead);
}

}  // namespace tactiled::ctl
