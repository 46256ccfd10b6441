// The fits of model "capacitive", with finite elements and with the models' own readings.
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <random>

#include "capacitive_pads.hpp"
#include "decoupling/fit/capacitive_fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

std::vector<std::vector<std::string>> cells_of(const std::string& name) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/fem/" + name);
    std::vector<std::vector<std::string>> rows;
    std::string line;
    std::getline(file, line);
    while (std::getline(file, line)) {
        std::vector<std::string> cells;
        std::string cell;
        bool quoted = false;
        for (const char c : line) {
            if (c == '"')
                quoted = !quoted;
            else if (c == ',' && !quoted)
                cells.push_back(std::exchange(cell, ""));
            else
                cell += c;
        }
        cells.push_back(cell);
        rows.push_back(cells);
    }
    return rows;
}

double interpolate(const std::map<double, double>& table, double at) {
    auto above = table.lower_bound(at);
    if (above == table.begin()) ++above;
    if (above == table.end()) --above;
    const auto below = std::prev(above);
    return std::lerp(below->second, above->second, (at - below->first) / (above->first - below->first));
}

// Press from cap_curves.csv (bonded, neo-Hookean), the force for a shift and its influence on the press from
// cap_shear.csv (two levels of compression, linear in between and beyond), areas from cap_overlap.csv. No formula of
// the models is used.
struct FiniteElements {
    std::map<double, double> gap_change_mm, Cn_pF;           // by N
    std::map<double, double> shear_N[2], press_change_N[2];  // by mm of shift; free, and at 0.413 mm
    double compressed_mm = 0.4132776854622177;
    struct Area {
        double shift_mm, azimuth_deg, mm2[4];
    };
    std::vector<Area> areas;

    FiniteElements() {
        for (const auto& row : cells_of("cap_curves.csv"))
            if (row[0] == "normal" && row[1] == "bonded") {
                gap_change_mm[std::stod(row[2])] = std::stod(row[4]);
                Cn_pF[std::stod(row[2])] = std::stod(row[6]);
            }
        std::map<double, double> fz[2];
        for (const auto& row : cells_of("cap_shear.csv")) {
            const int level = row[0].starts_with("Fz free") ? 0 : 1;
            shear_N[level][std::stod(row[1])] = std::stod(row[3]);
            fz[level][std::stod(row[1])] = std::stod(row[4]);
        }
        shear_N[1][0] = 0;
        // Fz at no shift, from a parabola through the first and the last: the shear runs have a coarser mesh, 5.6 % stiffer,
        // so that only the change is used.
        const double at_rest = (16 * fz[1].at(0.25) - fz[1].at(1.0)) / 15;
        for (const auto& [mm, N] : fz[0]) press_change_N[0][mm] = -N;
        for (const auto& [mm, N] : fz[1]) press_change_N[1][mm] = at_rest - N;
        press_change_N[1][0] = 0;
        for (const auto& row : cells_of("cap_overlap.csv"))
            areas.push_back({std::stod(row[0]),
                             std::stod(row[1]),
                             {std::stod(row[2]), std::stod(row[3]), std::stod(row[4]), std::stod(row[5])}});
    }

    // Rotations by 90 degrees and the mirror image give 0, 22.5 and 45 degrees everywhere.
    [[nodiscard]] LabelledRow row(const Area& area, int quarter, bool mirrored, double press_N) const {
        const double gap_mm = 3 - interpolate(gap_change_mm, press_N),
                     share = interpolate(gap_change_mm, press_N) / compressed_mm;
        const auto at_share = [&](const std::map<double, double>* table) {
            return std::lerp(interpolate(table[0], area.shift_mm), interpolate(table[1], area.shift_mm), share);
        };
        const double shear = at_share(shear_N), press = press_N + at_share(press_change_N);
        const double angle = (mirrored ? -1 : 1) * area.azimuth_deg * kHalfTurn_rad / 180 + quarter * kHalfTurn_rad / 2;
        // C1 +x, C3 +y, C2 -x, C4 -y in the order of the angle.
        const int counter_clockwise[4] = {0, 2, 1, 3};
        std::array<double, 4> by_angle{area.mm2[0], area.mm2[mirrored ? 3 : 2], area.mm2[1], area.mm2[mirrored ? 2 : 3]};
        LabelledRow result{.line = 0, .channel = std::vector<double>(5)};
        const double rest_mm2 = 6.806784082778003, rest_pF = 0.056250641692087745;
        for (int k = 0; k < 4; ++k)
            result.channel[std::size_t(counter_clockwise[(k + quarter) % 4])] =
                0.35 + rest_pF * by_angle[std::size_t(k)] / rest_mm2 * 3 / gap_mm;
        result.channel[4] = 0.37 + interpolate(Cn_pF, press_N);
        result.wrench_S = {shear * std::cos(angle), shear * std::sin(angle), -press, kNaN, kNaN, kNaN};
        return result;
    }
};

struct Rms {
    double shear_N, press_N;
};
Rms rms_of(const Calibration& calibration, const Rows& rows) {
    const auto decoupler = make_decoupler(calibration);
    Rms rms{0, 0};
    for (const auto* row : rows) {
        const Estimate estimate = decouple(*decoupler, row->channel);
        rms.shear_N +=
            (std::pow(estimate.wrench_S[0] - row->wrench_S[0], 2) + std::pow(estimate.wrench_S[1] - row->wrench_S[1], 2)) /
            2;
        rms.press_N += std::pow(estimate.wrench_S[2] - row->wrench_S[2], 2);
    }
    return {std::sqrt(rms.shear_N / double(rows.size())), std::sqrt(rms.press_N / double(rows.size()))};
}

std::vector<LabelledRow> fem_rows(bool on_axis, double noise_pF, unsigned seed) {
    static const FiniteElements fem;
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, noise_pF);
    std::vector<LabelledRow> rows;
    for (const double press : {0.0, 1.0, 2.5, 5.0, 7.5, 10.0})
        for (const auto& area : fem.areas) {
            if ((area.azimuth_deg == 0) != on_axis || (area.shift_mm == 0) > on_axis) continue;
            for (int quarter = 0; quarter < 4; ++quarter)
                for (const bool mirrored : {false, true}) {
                    if (mirrored && area.azimuth_deg != 22.5) continue;
                    // On the axes, as in a calibration: press alone, shear alone, and shear under 5 N.
                    if (on_axis && area.shift_mm > 0 && press != 0 && press != 5) continue;
                    rows.push_back(fem.row(area, quarter, mirrored, press));
                    for (auto& pF : rows.back().channel) pF += noise(random);
                }
        }
    return rows;
}

Rows pointers_to(const std::vector<LabelledRow>& rows) {
    Rows result;
    for (const auto& row : rows) result.push_back(&row);
    return result;
}

using FitFunction = void (*)(const Rows&, Calibration&, std::vector<std::string>&);
FitFunction fit_of(const char* method) { return find_fit("capacitive", method)->fit; }
constexpr const char* kMethods[] = {"quadratic", "ratio", "overlap"};

void state_geometry(Calibration& calibration) {
    for (const char* name : {"disc_radius_m", "inner_radius_m", "outer_radius_m", "opening_rad", "centre_radius_m", "gap_m"})
        calibration.parameters[name] = overlap_calibration().parameters.at(name);
}

TEST(CapacitiveFit, OverlapIsBetterThanQuadraticOffTheAxisOnFiniteElements) {
    const double noise_pF = 4e-6 * 10;  // ten times the converter's resolution of 4 aF
    const auto on_axis = fem_rows(true, noise_pF, 1), off_axis = fem_rows(false, noise_pF, 2);
    std::map<std::string, Rms> on, off;
    std::printf(
        "finite elements, %zu rows on the axes, %zu off: rms %% of 1.2 N shear, of 10 N press\n"
        "                 shear on    off   press on    off\n",
        on_axis.size(), off_axis.size());
    for (const char* name : kMethods) {
        Calibration calibration = capacitive_calibration(name);
        if (calibration.method == "overlap") state_geometry(calibration);
        std::vector<std::string> warnings;
        fit_of(name)(pointers_to(on_axis), calibration, warnings);
        for (const auto& warning : warnings) ADD_FAILURE() << warning;
        on[name] = rms_of(calibration, pointers_to(on_axis));
        off[name] = rms_of(calibration, pointers_to(off_axis));
        if (calibration.method == "overlap") {
            const auto decoupler = make_decoupler(calibration);
            for (const auto& row : off_axis) EXPECT_EQ(decouple(*decoupler, row.channel).quality(), TACTILED_GOOD);
        }
        std::printf("%-12s %10.3f %8.3f %8.3f %8.3f   condition %.3g\n", name, 100 * on[name].shear_N / 1.2,
                    100 * off[name].shear_N / 1.2, 10 * on[name].press_N, 10 * off[name].press_N, calibration.condition);
    }
    Calibration assumed = capacitive_calibration("overlap");
    std::vector<std::string> warnings;
    fit_of("overlap")(pointers_to(on_axis), assumed, warnings);
    EXPECT_EQ(warnings.size(), 1u);
    const Rms wrong = rms_of(assumed, pointers_to(off_axis));
    std::printf("overlap, assumed geometry (wrong by 20 %%): off the axes %.3f shear, %.3f press\n",
                100 * wrong.shear_N / 1.2, 10 * wrong.press_N);
    EXPECT_LT(wrong.shear_N, off["quadratic"].shear_N);
    EXPECT_LT(20 * off["overlap"].shear_N, off["quadratic"].shear_N);
    EXPECT_LT(off["overlap"].shear_N, 0.01 * 1.2);
    EXPECT_LT(off["overlap"].press_N, 0.7 * off["quadratic"].press_N);
    EXPECT_LT(off["overlap"].shear_N, off["ratio"].shear_N);
}

// A sensor of the models themselves: the calibration reads the forces of held-out readings.
TEST(CapacitiveFit, OverlapIsFittedThroughNoiseAndSwappedLabels) {
    const Calibration truth = overlap_calibration();
    std::mt19937 random(7);
    std::uniform_real_distribution<double> any(-1, 1);
    std::normal_distribution<double> noise(0, 2e-5);
    std::vector<LabelledRow> rows, fresh;
    for (int i = 0; i < 600; ++i) {
        const double u = 1.15 + 0.2 * any(random), dx = 0.8 * any(random), dy = 0.8 * any(random);
        LabelledRow row{.line = i, .channel = pad_reading(truth, u, dx, dy)};
        const Pad force = pad_force(u, dx, dy);
        row.wrench_S = {force.fx, force.fy, force.fz, kNaN, kNaN, kNaN};
        for (auto& pF : row.channel) pF += noise(random);
        (i < 300 ? rows : fresh).push_back(row);
    }
    std::swap(rows[10].wrench_S, rows[200].wrench_S);
    Calibration calibration = capacitive_calibration("overlap");
    state_geometry(calibration);
    std::vector<std::string> warnings;
    fit_of("overlap")(pointers_to(rows), calibration, warnings);
    EXPECT_NEAR(calibration.parameters.at("noise"), 2e-5, 0.4e-5);
    EXPECT_NEAR(calibration.parameters.at("shear_gap_exponent"), -0.4, 0.1);
    EXPECT_NEAR(calibration.parameters.at("shear_stiffness_N_per_m"), 1195, 60);
    const Rms rms = rms_of(calibration, pointers_to(fresh));
    EXPECT_LT(rms.shear_N, 0.002);
    EXPECT_LT(rms.press_N, 0.02);
}

TEST(CapacitiveFit, DerivativesOfTheModelAreThoseOfDifferences) {
    const ElectrodeGeometry geometry{4e-3, 2.5e-3, 6e-3, 1.4, 2e-3, 3e-3};
    const double at[kUnknowns] = {0.3, 0.31, 0.32, 0.33, 0.5, -2.9, -2.8, -2.9, -2.9, -2.3, 3.4, 0.1, 1.6, -0.4};
    using Jet = ceres::Jet<double, kUnknowns>;
    for (const bool exact : {false, true})
        for (const Wrench force : {Wrench{0.6, -0.4, -5}, Wrench{-0.2, 0.9, -0.5}, Wrench{0, 0, -8}, Wrench{3, 1, 0}}) {
            const CapacitiveModel model{exact ? &geometry : nullptr};
            Jet p[kUnknowns], reading[kElectrodes];
            for (int i = 0; i < kUnknowns; ++i) p[i] = Jet(at[i], i);
            model(p, force, reading);
            for (int i = 0; i < kUnknowns; ++i) {
                double more[kUnknowns], less[kUnknowns], above[kElectrodes], below[kElectrodes];
                std::copy(at, at + kUnknowns, more);
                std::copy(at, at + kUnknowns, less);
                more[i] += 1e-5;
                less[i] -= 1e-5;
                model(more, force, above);
                model(less, force, below);
                for (std::size_t e = 0; e < kElectrodes; ++e)
                    EXPECT_NEAR(reading[e].v[i], (above[e] - below[e]) / 2e-5, 2e-8)
                        << exact << " unknown " << i << " electrode " << e;
            }
        }
}

TEST(CapacitiveFit, RefusesWhatDataOrGeometryDoNotDetermine) {
    const auto refusal = [](FitFunction fit, const std::vector<LabelledRow>& rows, Calibration calibration) {
        std::vector<std::string> warnings;
        try {
            fit(pointers_to(rows), calibration, warnings);
        } catch (const Undetermined& what) { return std::string(what.what()); }
        return std::string(warnings.empty() ? "accepted" : "warned: " + warnings.front());
    };
    auto rows = fem_rows(true, 4e-5, 3);
    Calibration calibration = capacitive_calibration("overlap");
    EXPECT_NE(refusal(fit_of("overlap"), rows, calibration).find("geometry is not stated"), std::string::npos);
    calibration.parameters["disc_radius_m"] = 4e-3;
    EXPECT_NE(refusal(fit_of("overlap"), rows, calibration).find("missing: inner_radius_m"), std::string::npos);
    state_geometry(calibration);
    calibration.channels = {"C2", "C1", "C3", "C4", "Cn"};
    for (const char* name : kMethods)
        EXPECT_NE(refusal(fit_of(name), rows, calibration).find("C1 lies on +x"), std::string::npos) << name;
    calibration.channels = kChannels;
    auto flipped = rows;
    for (auto& row : flipped) row.wrench_S[2] = -row.wrench_S[2];
    for (const char* name : kMethods)
        EXPECT_NE(refusal(fit_of(name), flipped, calibration).find("it must rise"), std::string::npos) << name;
    for (auto& row : rows) row.wrench_S[1] = 0;
    for (const char* name : kMethods)
        EXPECT_NE(refusal(fit_of(name), rows, calibration).find("independently"), std::string::npos) << name;
    calibration.components = {"fz"};
    EXPECT_NE(refusal(fit_of("ratio"), rows, calibration).find("labels"), std::string::npos);
    EXPECT_EQ(refusal(fit_of("quadratic"), rows, calibration), "accepted");
}

}  // namespace
}  // namespace tactiled
