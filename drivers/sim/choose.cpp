#include "drivers/sim/choose.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <numeric>

namespace tactiled::sim {
namespace {

struct Named {
    std::string effect, level;  // level: empty = the effect itself
};

std::vector<Named> names_in(const std::string& request) {
    std::vector<Named> names;
    for (std::size_t begin = 0; begin <= request.size();) {
        const std::size_t end = std::min(request.find(',', begin), request.size());
        const std::string word = request.substr(begin, end - begin);
        const std::size_t colon = std::min(word.find(':'), word.size());
        names.push_back({word.substr(0, colon), colon < word.size() ? word.substr(colon + 1) : ""});
        begin = end + 1;
    }
    return names;
}

void require_known(const std::vector<Named>& names) {
    std::vector<std::string> known;
    for (const EffectEntry* effect : chain()) known.emplace_back(effect->name);
    for (const auto& [name, level] : names)
        if (find_effect(name) == nullptr) {
            const auto nearest = nearest_name(name, known);
            throw SetupError(
                nearest ? fmt::format("no effect \"{}\"; did you mean \"{}\"?", name, *nearest)
                        : fmt::format("no effect \"{}\"; there are: auto, all, none, {}", name, fmt::join(known, ", ")));
        }
}

std::size_t level_of(const Decision& d, const std::string& name) {
    if (name.empty()) return Decision::kItself;
    std::vector<std::string_view> there;
    for (std::size_t i = 0; i < d.levels.size(); ++i) {
        if (d.levels[i].name == name) return i;
        there.push_back(d.levels[i].name);
    }
    throw SetupError(fmt::format("effect \"{}\" has no level \"{}\" here; {}", d.effect->name, name,
                                 there.empty() ? "it has none" : fmt::format("it has {}", fmt::join(there, ", "))));
}

// One combination of decisions on the effects up to a place in the chain.
struct Way {
    double error_N = 0, cost_ns = 0;
    int before = -1;  // index of its predecessor in the previous place
    bool on = false;
    std::size_t level = Decision::kItself;
};

constexpr int kCells = 500;

int cell_of(double error_N, double wanted_N) {
    return error_N <= 0 ? 0 : 1 + std::min(kCells - 1, int(error_N / wanted_N * kCells));
}

double handed_on(const Bound& bound, double error_N) { return error_N > 0 ? error_N * bound.gain + bound.jump_N : 0; }

void set(Decision& d, bool on, std::size_t level) {
    d.on = on;
    d.level = level;
    d.why = on ? "needed" : d.bound.change_N == 0 ? "cannot occur here" : "within the wanted accuracy";
}

// Switches d to the first cheaper state with which the whole keeps the guarantee: off, then each level, then the
// effect itself.
bool lower(std::vector<Decision>& decisions, Decision& d, double wanted_N) {
    const bool on = d.on;
    const std::size_t level = d.level;
    const double spent_ns = d.spent_ns();
    if (!on) return false;
    set(d, false, Decision::kItself);
    if (guaranteed_error_N(decisions) <= wanted_N) return true;
    for (std::size_t i = 0; i < d.levels.size(); ++i) {
        set(d, true, i);
        if (d.spent_ns() < spent_ns && guaranteed_error_N(decisions) <= wanted_N) return true;
    }
    set(d, on, level);
    return false;
}

// The bound of an effect of which a part may be worse.
void take_worse(Bound& bound, const Bound& other) {
    for (double Bound::*member : {&Bound::change_N, &Bound::gain, &Bound::jump_N, &Bound::own_N, &Bound::own_rate_N_s,
                                  &Bound::load_gain, &Bound::coupling, &Bound::stretch, &Bound::slack_s})
        bound.*member = std::max(bound.*member, other.*member);
    for (std::size_t axis = 0; axis < kAxes; ++axis) bound.load[axis] = std::max(bound.load[axis], other.load[axis]);
}

// The sensors of which the effects are bounded: the taxels of an array, or the sensor itself.
std::vector<Sensor> parts_of(const Sensor& sensor) {
    std::vector<Sensor> parts;
    parts.reserve(std::max<std::size_t>(sensor.taxels(), 1));
    for (std::size_t i = 0; i < sensor.taxels(); ++i) parts.push_back(sensor.taxel_at(i));
    if (parts.empty()) parts.push_back(sensor);
    return parts;
}

void require_in_arrays(const Sensor& sensor, const std::vector<Named>& names) {
    for (const Named& named : names)
        if (sensor.is_array() && in_array(*find_effect(named.effect)) == InArray::not_at_all)
            throw SetupError(fmt::format("effect \"{}\" works on single sensors; \"{}\" is an array of taxels", named.effect,
                                         sensor.name));
}

// A change of time affects all later effects, so the effects of time are bounded after all others.
void bound_time(const Scene& scene, const Sensor& sensor, const Extent& extent, Choice& choice) {
    std::vector<double> stated_N(chain().size(), 0);
    for (const Decision& d : choice.decisions) stated_N[d.number()] = d.bound.change_N;
    for (Decision& d : choice.decisions) {
        if (d.effect->stage != Stage::time) continue;
        Setting setting = scene.setting(d.number(), sensor, extent);
        setting.stated_N = stated_N;
        d.bound = d.effect->bound(setting);
    }
}

}  // namespace

std::size_t Decision::number() const {
    return std::size_t(std::find(chain().begin(), chain().end(), effect) - chain().begin());
}

std::vector<std::size_t> by_cost(const std::vector<Decision>& decisions) {
    std::vector<std::size_t> order(decisions.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return decisions[a].spent_ns() > decisions[b].spent_ns(); });
    return order;
}

double guaranteed_error_N(const std::vector<Decision>& decisions) {
    double error = 0;
    for (const Decision& d : decisions) error = (d.on ? handed_on(d.bound, error) : error) + d.error_N();
    return error;
}

void leave_out(std::vector<Decision>& decisions, double wanted_N) {
    std::vector<std::vector<Way>> places;
    std::vector<Way> ways{Way{}};
    for (const Decision& d : decisions) {
        std::array<int, kCells + 1> best;
        best.fill(-1);
        std::vector<Way> next;
        for (std::size_t i = 0; i < ways.size(); ++i) {
            const auto go = [&](bool on, std::size_t level, double error_N, double more_ns) {
                if (!(error_N <= wanted_N)) return;
                const Way way{error_N, ways[i].cost_ns + more_ns, int(i), on, level};
                int& at = best[std::size_t(cell_of(error_N, wanted_N))];
                if (at < 0) {
                    at = int(next.size());
                    next.push_back(way);
                } else if (Way& other = next[std::size_t(at)];
                           way.cost_ns < other.cost_ns || (way.cost_ns == other.cost_ns && way.error_N < other.error_N)) {
                    other = way;
                }
            };
            const double on_N = handed_on(d.bound, ways[i].error_N);
            go(false, Decision::kItself, ways[i].error_N + d.bound.change_N, 0);
            if (d.bound.change_N == 0) continue;  // the effect cannot occur here
            for (std::size_t k = 0; k < d.levels.size(); ++k) go(true, k, on_N + d.levels[k].error_N, d.level_cost_ns[k]);
            go(true, Decision::kItself, on_N, d.cost_ns);
        }
        places.push_back(std::move(ways));
        ways = std::move(next);
    }
    // With all effects on the error is 0, so there is a solution.
    Way way = *std::min_element(ways.begin(), ways.end(), [](const Way& a, const Way& b) { return a.cost_ns < b.cost_ns; });
    for (std::size_t i = decisions.size(); i-- > 0;) {
        set(decisions[i], way.on, way.level);
        if (i > 0) way = places[i][std::size_t(way.before)];
    }
    // The merging of cells may have dropped better combinations: try the most expensive effect first.
    const std::vector<std::size_t> order = by_cost(decisions);
    for (bool again = true; again;) {
        again = false;
        for (const std::size_t i : order) again |= lower(decisions, decisions[i], wanted_N);
    }
}

Choice choose(const Scene& scene, const Sensor& sensor, const Extent& extent, const std::string& request) {
    Choice choice{{}, scene.wanted_N(sensor), 0};
    const bool list = request != "auto" && request != "all" && request != "none";
    const auto names = list ? names_in(request) : std::vector<Named>{};
    require_known(names);
    require_in_arrays(sensor, names);
    const std::vector<Sensor> parts = parts_of(sensor);
    Extent reach = extent;
    Before before;
    for (std::size_t i = 0; i < chain().size(); ++i) {
        const EffectEntry& effect = *chain()[i];
        const bool in_taxels = sensor.is_array() && in_array(effect) == InArray::each_taxel;
        if ((effect.models >> unsigned(sensor.model) & 1u) == 0) continue;
        if (sensor.is_array() && in_array(effect) == InArray::not_at_all) continue;
        const auto named = std::find_if(names.begin(), names.end(), [&](const Named& n) { return n.effect == effect.name; });
        const bool asked = named != names.end(), on = request == "all" || request == "auto" || asked;
        const auto setting_of = [&](const Sensor& part) {
            Setting setting = scene.setting(i, part, reach);
            setting.before = before;
            return setting;
        };
        // The levels of all taxels are equal: they do not depend on random numbers.
        const Setting setting = setting_of(in_taxels ? parts.front() : sensor);
        Decision& d = choice.decisions.emplace_back();
        d.effect = &effect;
        d.bound = effect.bound(setting);
        for (std::size_t k = 1; in_taxels && k < parts.size(); ++k) take_worse(d.bound, effect.bound(setting_of(parts[k])));
        d.on = on;
        d.why = list ? (asked ? "asked for" : "not asked for") : request == "all" ? "all" : "none";
        d.cost_ns = cost_ns(effect, "", sensor.model);
        if (effect.levels != nullptr && d.bound.change_N > 0 && (request == "auto" || (asked && !named->level.empty())))
            d.levels = effect.levels(setting);
        for (const Level& level : d.levels) d.level_cost_ns.push_back(cost_ns(effect, level.name, sensor.model));
        if (asked) d.level = level_of(d, named->level);
        pass_on(d.bound, effect.stage, reach, before);
    }
    bound_time(scene, sensor, extent, choice);
    if (request == "auto") leave_out(choice.decisions, choice.wanted_N);
    choice.guaranteed_N = guaranteed_error_N(choice.decisions);
    if (request == "auto" && !sensor.is_array()) let_rest(scene, sensor, choice);
    return choice;
}

}  // namespace tactiled::sim
