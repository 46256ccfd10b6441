// Synthetic labelled recordings for the tests of the fits: a load cell, a six-axis sensor, a curved sensor.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <set>
#include <string>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

inline FitRequest by(const std::string& method) {
    return {.model = "generic", .method = method, .serial = "", .channel_unit = "V", .date = "2026-03-01"};
}

// Returns true if the rows were held out in this way, too.
inline bool has_way(const FitReport& report, const std::string& how) {
    return std::any_of(report.ways.begin(), report.ways.end(),
                       [&](const auto& way) { return way.refused.empty() && way.how.starts_with(how); });
}

inline bool warns(const FitReport& report, const std::string& what) {
    return std::any_of(report.warnings.begin(), report.warnings.end(),
                       [&](const std::string& warning) { return warning.find(what) != warning.npos; });
}

inline std::string refusal(const Labelled& labelled, const FitRequest& request) {
    try {
        (void)fit(labelled, request);
    } catch (const Undetermined& error) { return error.what(); }
    return "";
}

inline std::set<std::int64_t> lines_of(const FitReport& report, bool left_out_only = false) {
    std::set<std::int64_t> lines;
    for (const Suspect& suspect : report.suspects)
        if (suspect.left_out || !left_out_only) lines.insert(suspect.row->line);
    return lines;
}

// A load cell with 2 % of crosstalk, loaded with weights up and down, one axis after the other; noise relative to
// full scale.
struct Cell {
    static constexpr double kScale_N[3] = {50, 50, 100};
    std::mt19937_64 random;
    std::normal_distribution<double> normal{0, 1};
    double mix[3][3];
    explicit Cell(unsigned seed) : random(seed) {
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) mix[i][j] = i == j ? 1 : 0.02 * normal(random);
    }
    Labelled recording(int sessions, int turns, double zero_sd, double noise) {
        Labelled labelled;
        labelled.name = "cell.csv";
        labelled.channels = {"A", "B", "C"};
        for (int session = 0; session < sessions; ++session) {
            if (sessions > 1) labelled.sessions.push_back("day " + std::to_string(session));
            double zero[3];
            for (double& z : zero) z = zero_sd * normal(random);
            for (int turn = 0; turn < turns; ++turn)
                for (int axis = 0; axis < 3; ++axis)
                    for (const int level : {0, 1, 2, 3, 4, 5, 4, 3, 2, 1}) {
                        double load[3];
                        for (double& part : load) part = 0.002 * normal(random) * level / 5;
                        load[axis] = (axis == 2 || turn % 2 == 0 ? -1 : 1) * level / 5.0;
                        LabelledRow row{.line = std::int64_t(labelled.rows.size()) + 2,
                                        .channel = {},
                                        .wrench_S = kUnseen,
                                        .session = std::size_t(session)};
                        for (int i = 0; i < 3; ++i) {
                            row.channel.push_back(zero[i] + noise * normal(random) + mix[i][0] * load[0] +
                                                  mix[i][1] * load[1] + mix[i][2] * load[2]);
                            row.wrench_S[std::size_t(i)] = kScale_N[i] * load[i];
                        }
                        labelled.rows.push_back(row);
                    }
        }
        return labelled;
    }
};

inline double percent_of_full_scale(const FitReport& report) {
    double worst = 0;
    for (const auto& c : report.components) worst = std::max(worst, 100 * c.held_out_rms / c.full_scale);
    return worst;
}

// Six axes, one after the other: no stretch of time and no group of poses can be left out.
inline Labelled six_axes(unsigned seed, double noise) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    double mix[6][6];
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) mix[i][j] = (i == j ? 1 : 0) + 0.1 * normal(random);
    const double scale[6] = {100, 100, 200, 5, 5, 5};
    Labelled labelled;
    labelled.name = "six.csv";
    labelled.channels = {"A", "B", "C", "D", "E", "F"};
    for (int n = 0; n < 59; ++n) {
        double load[6]{};
        if (n >= 5) {
            const int step[9] = {1, 2, 3, 3, 2, 1, -1, -2, -3};
            load[(n - 5) / 9] = step[(n - 5) % 9] / 3.0;
        }
        LabelledRow row{.line = n + 2, .channel = {}, .wrench_S = kUnseen};
        for (int i = 0; i < 6; ++i) {
            double reading = noise * normal(random);
            for (int j = 0; j < 6; ++j) reading += mix[i][j] * load[j];
            row.channel.push_back(reading);
            row.wrench_S[std::size_t(i)] = scale[i] * load[i];
        }
        labelled.rows.push_back(row);
    }
    return labelled;
}

inline Labelled waves(int rows, double noise_sd, unsigned seed, bool bent) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> noise(0, noise_sd);
    Labelled labelled;
    labelled.name = "waves.csv";
    labelled.channels = {"A", "B", "C"};
    for (int i = 0; i < rows; ++i) {
        const double fx = uniform(random), fz = uniform(random), b = bent ? 0.3 : 0;
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {fx + b * fz * fz + noise(random), fz + b * fx * fz + noise(random),
                                             0.5 * fx - fz + b * std::sin(3 * fx) + noise(random)},
                                 .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}});
    }
    return labelled;
}

}  // namespace tactiled
