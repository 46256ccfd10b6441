#include "decoupling/fit/array_survey.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled {
namespace {

bool is_contact(const Presses& presses, const PressStep& step, std::size_t v, std::size_t i, double value) {
    const double sd = presses.noise[v][i] * std::sqrt(presses.noise_part(step));
    return std::abs(value) > contact_level(presses.taxels * presses.channels.size()) * sd;
}

// The least of two opposite neighbours' values, 0 unless both are in contact: a body that is not hollow presses at least so
// much on the taxel between them.
double enclosed(const Presses& presses, const PressStep& step, std::size_t v, const TaxelPlaces::Neighbours& beside,
                const std::vector<int>& at) {
    double largest = 0;
    for (std::size_t b = 0; b < beside.n_between; ++b) {
        const auto [j, k] = beside.between[b];
        if (at[j] < 0 || at[k] < 0) continue;
        const auto of_j = double(step.value[v][std::size_t(at[j])]), of_k = double(step.value[v][std::size_t(at[k])]);
        if (!is_contact(presses, step, v, j, of_j) || !is_contact(presses, step, v, k, of_k) || of_j * of_k < 0) continue;
        const double least = std::abs(of_j) < std::abs(of_k) ? of_j : of_k;
        if (std::abs(least) > std::abs(largest)) largest = least;
    }
    return largest;
}

// Lists the dead taxels of which a neighbour is in or beside the contact of a step.
std::vector<std::size_t> dead_of(const PressStep& step, const TaxelPlaces& places,
                                 const std::vector<std::uint8_t>& is_dead) {
    std::vector<std::size_t> list;
    for (const std::size_t i : step.taxel)
        for (std::size_t b = 0; b < places.neighbours[i].n; ++b)
            if (const std::size_t j = places.neighbours[i].of[b]; is_dead[j] != 0) list.push_back(j);
    std::ranges::sort(list);
    list.erase(std::ranges::unique(list).begin(), list.end());
    return list;
}

}  // namespace

// A taxel is dead if its response to the presses that enclose it cannot be distinguished from 0, and that of a good one, 1
// or more, could be by twice as much.
TaxelSurvey survey(const Presses& presses, const TaxelPlaces& places, const Calibration& start) {
    const std::size_t n = places.n, values = presses.channels.size();
    TaxelSurvey out;
    const double level = contact_level(n);
    std::vector<double> width2(values, 0), product(n, 0), square(n, 0), noise2(n, 0);
    for (std::size_t v = 0; v < values; ++v) {
        for (const double x : presses.noise[v]) width2[v] += x * x / double(n);
        if (!(width2[v] > 0)) width2[v] = 1;
    }
    out.is_loaded.assign(n, 0);
    std::vector<int> at(n, -1);
    for (const PressStep& step : presses.steps) {
        for (std::size_t k = 0; k < step.taxel.size(); ++k) at[step.taxel[k]] = int(k);
        for (std::size_t k = 0; k < step.taxel.size(); ++k)
            for (std::size_t v = 0; v < values; ++v) {
                const std::size_t i = step.taxel[k];
                const auto value = double(step.value[v][k]);
                const double expected = enclosed(presses, step, v, places.neighbours[i], at);
                if (expected != 0 || is_contact(presses, step, v, i, value)) out.is_loaded[i] = 1;
                product[i] += value * expected / width2[v];
                square[i] += expected * expected / width2[v];
                noise2[i] += std::pow(expected * presses.noise[v][i] / width2[v], 2) * presses.noise_part(step);
            }
        for (const std::size_t i : step.taxel) at[i] = -1;
    }
    out.is_dead = presses.is_missing;
    if (const auto stated = start.tables.find("dead"); stated != start.tables.end())
        for (const double i : stated->second.at(0))
            if (i >= 0 && i < double(n)) out.is_dead[std::size_t(i)] = 1;
    for (std::size_t i = 0; i < n; ++i)
        if (square[i] > 0 && std::abs(product[i]) <= level * std::sqrt(noise2[i]) &&
            2 * level * std::sqrt(noise2[i]) < square[i])
            out.is_dead[i] = 1;
    for (const PressStep& step : presses.steps) out.dead_of.push_back(dead_of(step, places, out.is_dead));
    return out;
}

}  // namespace tactiled
