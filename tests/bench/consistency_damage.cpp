// Channels of a recording that the calibration has not seen, damaged while the rows run.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <random>
#include <sstream>
#include <vector>

#include "consistency.hpp"
#include "decoupling/fit/fit.hpp"

namespace tactiled {
namespace {

// Damages the channels of a row in one of several cases. `part`: of the recording, 0 .. 1, that has passed.
using Damage = std::function<void(std::vector<double>& channel, std::size_t which, double part)>;
struct Kind {
    const char* name;
    std::size_t cases;
    Damage damage;
};

// The rows of the calibration: range of each channel, and its value under the smallest load.
struct Seen {
    std::vector<double> min, max, rest;
    [[nodiscard]] double span(std::size_t k) const { return max[k] - min[k]; }
};

Seen seen_in(const Labelled& labelled) {
    Seen seen;
    seen.min = seen.max = seen.rest = labelled.rows.front().channel;
    double least = std::numeric_limits<double>::infinity();
    for (const LabelledRow& row : labelled.rows) {
        double load = 0;
        for (const double f : row.wrench_S) load += std::isfinite(f) ? std::abs(f) : 0;
        if (load < least) seen.rest = row.channel;
        least = std::min(least, load);
        for (std::size_t k = 0; k < seen.min.size(); ++k) {
            seen.min[k] = std::min(seen.min[k], row.channel[k]);
            seen.max[k] = std::max(seen.max[k], row.channel[k]);
        }
    }
    return seen;
}

std::vector<std::vector<std::size_t>> random_groups(std::size_t n, std::size_t size, std::size_t count, unsigned seed) {
    std::mt19937 random(seed);
    std::vector<std::vector<std::size_t>> groups;
    while (groups.size() < count) {
        std::vector<std::size_t> all(n);
        for (std::size_t k = 0; k < n; ++k) all[k] = k;
        std::shuffle(all.begin(), all.end(), random);
        groups.emplace_back(all.begin(), all.begin() + std::ptrdiff_t(size));
    }
    return groups;
}

// The kinds of damage for which the monitor was made.
std::vector<Kind> designed_for(const Seen& seen) {
    const std::size_t n = seen.rest.size();
    const auto pairs = random_groups(n, 2, 40, 3);
    return {{"undamaged", 1, [](auto&, auto, auto) {}},
            {"at rest", n, [=](auto& channel, std::size_t k, auto) { channel[k] = seen.rest[k]; }},
            {"at zero", n, [](auto& channel, std::size_t k, auto) { channel[k] = 0; }},
            {"half gain", n, [](auto& channel, std::size_t k, auto) { channel[k] *= 0.5; }},
            {"turned round", n, [](auto& channel, std::size_t k, auto) { channel[k] *= -1; }},
            {"shifted by 20 %", n, [=](auto& channel, std::size_t k, auto) { channel[k] += 0.2 * seen.span(k); }},
            {"exchanged", pairs.size(),
             [=](auto& channel, std::size_t i, auto) { std::swap(channel[pairs[i][0]], channel[pairs[i][1]]); }}};
}

// Kinds for which nothing was made. Changes are those of the channel less its value at rest.
std::vector<Kind> not_designed_for(const Seen& seen) {
    const std::size_t n = seen.rest.size();
    const auto pairs = random_groups(n, 2, 30, 11), threes = random_groups(n, 3, 30, 12);
    const auto change = [=](std::vector<double>& channel, std::size_t k, double gain) {
        channel[k] = seen.rest[k] + gain * (channel[k] - seen.rest[k]);
    };
    return {
        {"two at half gain", pairs.size(),
         [=](auto& channel, std::size_t i, auto) {
             for (const std::size_t k : pairs[i]) change(channel, k, 0.5);
         }},
        {"two stuck at rest", pairs.size(),
         [=](auto& channel, std::size_t i, auto) {
             for (const std::size_t k : pairs[i]) channel[k] = seen.rest[k];
         }},
        {"two turned round", pairs.size(),
         [=](auto& channel, std::size_t i, auto) {
             for (const std::size_t k : pairs[i]) change(channel, k, -1);
         }},
        {"three in turn", threes.size(),
         [=](auto& channel, std::size_t i, auto) {
             std::swap(channel[threes[i][0]], channel[threes[i][1]]);
             std::swap(channel[threes[i][1]], channel[threes[i][2]]);
         }},
        {"drift to 30 %", n, [=](auto& channel, std::size_t k, double part) { channel[k] += 0.3 * part * seen.span(k); }},
        {"saturates early", n,
         [=](auto& channel, std::size_t k, auto) {
             channel[k] = std::clamp(channel[k], seen.rest[k] - 0.4 * seen.span(k), seen.rest[k] + 0.4 * seen.span(k));
         }},
        // Every fifth stretch of 1 % of the recording.
        {"intermittent", n,
         [=](auto& channel, std::size_t k, double part) {
             if (int(100 * part) % 5 == 0) channel[k] = seen.rest[k];
         }},
        {"all +5 % of range", 1,
         [=](auto& channel, auto, auto) {
             for (std::size_t k = 0; k < n; ++k) channel[k] += 0.05 * seen.span(k);
         }},
        {"all -5 % of range", 1,
         [=](auto& channel, auto, auto) {
             for (std::size_t k = 0; k < n; ++k) channel[k] -= 0.05 * seen.span(k);
         }},
        {"all +5 or -5 %", 20,
         [=](auto& channel, std::size_t i, auto) {
             std::mt19937 random(unsigned(20 + i));
             for (std::size_t k = 0; k < n; ++k) channel[k] += (random() % 2 == 0 ? 0.05 : -0.05) * seen.span(k);
         }},
        {"all gains 0.8", 1,
         [=](auto& channel, auto, auto) {
             for (std::size_t k = 0; k < n; ++k) change(channel, k, 0.8);
         }},
        {"all gains 1.25", 1,
         [=](auto& channel, auto, auto) {
             for (std::size_t k = 0; k < n; ++k) change(channel, k, 1.25);
         }},
    };
}

void judge(const Calibration& calibration, const Kind& kind, const Labelled& rows) {
    std::size_t samples = 0, good = 0, wrong = 0, beyond = 0;
    double worst = 0;
    for (std::size_t which = 0; which < kind.cases; ++which) {
        const auto decoupler = make_decoupler(calibration);
        for (std::size_t i = 0; i < rows.rows.size(); ++i) {
            const LabelledRow& row = rows.rows[i];
            std::vector<double> channel = row.channel;
            kind.damage(channel, which, double(i) / double(rows.rows.size()));
            const Estimate e = decoupler->decouple({.channel = channel, .t_ns = row.t_ns});
            ++samples;
            if (e.quality() != TACTILED_GOOD) continue;
            ++good;
            bool is_wrong = false, is_beyond = false;
            for (std::size_t n = 0; n < calibration.components.size(); ++n) {
                const std::size_t c = component_index(calibration.components[n]);
                const double error = std::abs(e.wrench_S[c] - row.wrench_S[c]);
                if (!std::isfinite(error)) continue;
                is_wrong = is_wrong || error > 0.1 * calibration.full_scale[n];
                is_beyond = is_beyond || error > 5 * e.sd[c];
                worst = std::max(worst, error / calibration.full_scale[n]);
            }
            wrong += is_wrong;
            beyond += is_beyond;
        }
    }
    fmt::print("{:<10} {:<18} GOOD {:>6.2f} %  wrong {:>5.2f} %  beyond 5 sd {:>5.2f} %  worst {:>5.1f} %\n",
               calibration.method, kind.name, percent(good, samples), percent(wrong, samples), percent(beyond, samples),
               100 * worst);
    std::fflush(stdout);
}

}  // namespace

void judge_damage(const std::string& fit_file, const std::string& judge_file, const std::string& methods) {
    const Labelled seen = read_labelled(fit_file, {}), unseen = read_labelled(judge_file, {});
    const Seen range = seen_in(seen);
    std::stringstream names(methods.empty() ? "matrix,quadratic,rbf,mlp" : methods);
    for (std::string method; std::getline(names, method, ',');) {
        const FitReport report = fit(seen, {.model = "generic", .method = method, .serial = "", .date = ""});
        for (const std::string& warning : report.warnings) fmt::print("{}: {}\n", method, warning);
        print_costs({{.model = "generic",
                      .candidates = {{"generic", method, method, report.calibration}},
                      .trials = {{"judged", unseen}},
                      .refused = {}}});
        for (const Kind& kind : designed_for(range)) judge(report.calibration, kind, unseen);
        for (const Kind& kind : not_designed_for(range)) judge(report.calibration, kind, unseen);
    }
}

}  // namespace tactiled
