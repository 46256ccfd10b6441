#include "drivers/sim/choose.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

namespace tactiled::sim {
namespace {

std::vector<std::string> names_in(const std::string& wish) {
    std::vector<std::string> names;
    for (std::size_t begin = 0; begin <= wish.size();) {
        const std::size_t end = std::min(wish.find(',', begin), wish.size());
        names.push_back(wish.substr(begin, end - begin));
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

// What costs most for the least error first. Ties in the order of the chain: the same everywhere.
std::vector<std::size_t> in_order_of_use(const std::vector<Decision>& decisions) {
    std::vector<std::size_t> order(decisions.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        const auto use = [&](std::size_t i) { return decisions[i].bound.change_N / decisions[i].effect->instructions; };
        return use(a) < use(b);
    });
    return order;
}

void choose_automatically(Choice& choice) {
    for (const std::size_t i : in_order_of_use(choice.decisions)) {
        Decision& d = choice.decisions[i];
        d.on = false;
        d.why = d.bound.change_N == 0 ? "cannot occur here" : "within the wanted accuracy";
        if (d.bound.change_N == 0 || guaranteed_error_N(choice.decisions) <= choice.wanted_N) continue;
        d.on = true;
        d.why = "needed";
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

Choice choose(const Scene& scene, const Sensor& sensor, const Extent& extent, const std::string& wish) {
    Choice choice{{}, scene.wanted_N(sensor), 0};
    const bool list = wish != "auto" && wish != "all" && wish != "none";
    const auto names = list ? names_in(wish) : std::vector<std::string>{};
    require_known(names);
    for (std::size_t i = 0; i < chain().size(); ++i) {
        const EffectEntry& effect = *chain()[i];
        if ((effect.models >> unsigned(sensor.model) & 1u) == 0) continue;
        const bool asked = std::find(names.begin(), names.end(), effect.name) != names.end();
        const bool on = wish == "all" || wish == "auto" || asked;
        choice.decisions.push_back({&effect, effect.bound(scene.setting(i, sensor, extent)), on,
                                    list            ? (asked ? "asked for" : "not asked for")
                                    : wish == "all" ? "all"
                                                    : "none"});
    }
    if (wish == "auto") choose_automatically(choice);
    choice.guaranteed_N = guaranteed_error_N(choice.decisions);
    return choice;
}

}  // namespace tactiled::sim
