#include "drivers/sim/choose.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

namespace tactiled::sim {
namespace {

std::vector<std::string> names_in(const std::string& request) {
    std::vector<std::string> names;
    for (std::size_t begin = 0; begin <= request.size();) {
        const std::size_t end = std::min(request.find(',', begin), request.size());
        names.push_back(request.substr(begin, end - begin));
        begin = end + 1;
    }
    return names;
}

void require_known(const std::vector<std::string>& names) {
    std::vector<std::string> known;
    for (const EffectEntry* effect : chain()) known.emplace_back(effect->name);
    for (const auto& name : names)
        if (find_effect(name) == nullptr) {
            const auto nearest = nearest_name(name, known);
            throw SetupError(
                nearest ? fmt::format("no effect \"{}\"; did you mean \"{}\"?", name, *nearest)
                        : fmt::format("no effect \"{}\"; there are: auto, all, none, {}", name, fmt::join(known, ", ")));
        }
}

// The effect with the most time for the least error comes first. Ties in the order of the chain: the same everywhere.
std::vector<std::size_t> in_order_of_use(const std::vector<Decision>& decisions) {
    std::vector<std::size_t> order(decisions.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        const auto use = [&](std::size_t i) { return decisions[i].bound.change_N / decisions[i].effect->instructions; };
        return use(a) < use(b);
    });
    return order;
}

// Another time finds all that follows elsewhere, so effects of time are asked when the bounds of all are known.
void bound_time(const Scene& scene, const Sensor& sensor, const Extent& extent, Choice& choice) {
    std::vector<double> stated_N(chain().size(), 0);
    const auto number = [](const Decision& d) {
        return std::size_t(std::find(chain().begin(), chain().end(), d.effect) - chain().begin());
    };
    for (const Decision& d : choice.decisions) stated_N[number(d)] = d.bound.change_N;
    for (Decision& d : choice.decisions) {
        if (d.effect->stage != Stage::time) continue;
        Setting setting = scene.setting(number(d), sensor, extent);
        setting.stated_N = stated_N;
        d.bound = d.effect->bound(setting);
    }
}

}  // namespace

double guaranteed_error_N(const std::vector<Decision>& decisions) {
    double error = 0;
    for (const Decision& d : decisions) {
        if (!d.on)
            error += d.bound.change_N;
        else if (error > 0)
            error = error * d.bound.gain + d.bound.jump_N;
    }
    return error;
}

void leave_out(std::vector<Decision>& decisions, double wanted_N) {
    const auto order = in_order_of_use(decisions);
    for (bool again = true; again;) {
        again = false;
        for (const std::size_t i : order) {
            Decision& d = decisions[i];
            if (!d.on) continue;
            d.on = false;
            const bool fits = d.bound.change_N == 0 || guaranteed_error_N(decisions) <= wanted_N;
            d.on = !fits;
            d.why = !fits ? "needed" : d.bound.change_N == 0 ? "cannot occur here" : "within the wanted accuracy";
            again |= fits;
        }
    }
}

Choice choose(const Scene& scene, const Sensor& sensor, const Extent& extent, const std::string& request) {
    Choice choice{{}, scene.wanted_N(sensor), 0};
    const bool list = request != "auto" && request != "all" && request != "none";
    const auto names = list ? names_in(request) : std::vector<std::string>{};
    require_known(names);
    Extent reach = extent;
    Before before;
    for (std::size_t i = 0; i < chain().size(); ++i) {
        const EffectEntry& effect = *chain()[i];
        if ((effect.models >> unsigned(sensor.model) & 1u) == 0) continue;
        const bool asked = std::find(names.begin(), names.end(), effect.name) != names.end();
        const bool on = request == "all" || request == "auto" || asked;
        Setting setting = scene.setting(i, sensor, reach);
        setting.before = before;
        const Bound bound = effect.bound(setting);
        pass_on(bound, effect.stage, reach, before);
        choice.decisions.push_back({&effect, bound, on,
                                    list               ? (asked ? "asked for" : "not asked for")
                                    : request == "all" ? "all"
                                                       : "none"});
    }
    bound_time(scene, sensor, extent, choice);
    if (request == "auto") leave_out(choice.decisions, choice.wanted_N);
    choice.guaranteed_N = guaranteed_error_N(choice.decisions);
    return choice;
}

}  // namespace tactiled::sim
