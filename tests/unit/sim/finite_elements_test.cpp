// The forward models against finite elements of the documents' sensors (tests/data/fem/README.md), with numbers that
// they were not made from: other loads, directions and materials. Each test prints its errors.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "drivers/sim/effects/influence.hpp"
#include "drivers/sim/simulation.hpp"

namespace tactiled::sim {
namespace {

using Row = std::map<std::string, std::string>;

double number(const Row& row, const std::string& column) { return std::stod(row.at(column)); }

std::vector<std::string> cells_of(const std::string& line) {
    std::vector<std::string> cells(1);
    bool quoted = false;
    for (const char c : line) {
        if (c == '"')
            quoted = !quoted;
        else if (c == ',' && !quoted)
            cells.emplace_back();
        else if (c != '\r')
            cells.back() += c;
    }
    return cells;
}

std::vector<Row> rows_of(const std::string& name) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/fem/" + name);
    std::string line;
    std::getline(file, line);
    const auto columns = cells_of(line);
    std::vector<Row> rows;
    while (std::getline(file, line)) {
        const auto cells = cells_of(line);
        Row& row = rows.emplace_back();
        for (std::size_t i = 0; i < columns.size(); ++i) row[columns[i]] = cells.at(i);
    }
    EXPECT_FALSE(rows.empty()) << name;
    return rows;
}

// Returns the channels under one steady load, minus their zeros.
std::vector<double> channels_under(const std::string& sensor, double press_N, double shear_N, double direction_deg,
                                   const std::string& effects = "none", double x_m = 0, double y_m = 0) {
    Problems problems;
    const Scene scene =
        read_scene(Options::parse_text(fmt::format("format = 1\ntitle = \"steady\"\n[[sensor]]\nname = \"s\"\n{}\n"
                                                   "[[motion]]\ndo = \"move\"\nx_m = {}\ny_m = {}\nin_s = 0.01\n"
                                                   "[[motion]]\ndo = \"press\"\nto_N = {}\nin_s = 0.01\n"
                                                   "[[motion]]\ndo = \"shear\"\nto_N = {}\ndirection_deg = {}\nin_s = 0.01\n"
                                                   "[[motion]]\ndo = \"hold\"\nfor_s = 0.01\n",
                                                   sensor, x_m, y_m, press_N, shear_N, direction_deg),
                                       "steady.toml", problems),
                   problems);
    Simulation simulation(scene, effects);
    std::vector<double> last;
    for (const Block* b = &simulation.advance(0); b->n > 0; b = &simulation.advance(0)) {
        last.clear();
        for (std::size_t k = 0; k < scene.sensors[0].n(); ++k)
            last.push_back(b->channel[k][b->n - 1] - scene.sensors[0].zero[k]);
    }
    return last;
}

struct Errors {
    std::map<std::string, double> worst{};  // per gauge, % of the largest reading of its row
    double all = 0;
    void take(const std::string& gauge, double percent) {
        worst[gauge] = std::max(worst[gauge], std::abs(percent));
        all = std::max(all, std::abs(percent));
    }
    void print(const std::string& what) const {
        std::string line = fmt::format("    {:45}", what);
        for (const auto& [gauge, percent] : worst) line += fmt::format(" {} {:.2f}", gauge, percent);
        fmt::print("{} % of the row's largest reading\n", line);
    }
};

Errors table_errors(const std::string& kind) {
    Errors errors;
    for (const Row& row : rows_of("table_gauges_grid.csv")) {
        if (row.at("case").rfind(kind, 0) != 0) continue;
        const double shear = std::hypot(number(row, "Fx_N"), number(row, "Fy_N"));
        const double direction = std::atan2(number(row, "Fy_N"), number(row, "Fx_N")) * 180 / 3.14159265358979323846;
        const auto reads = channels_under("model = \"table\"\nsample = \"foil\"", -number(row, "Fz_N"), shear, direction);
        double largest = 0;
        std::array<double, 8> truth{};
        for (std::size_t k = 0; k < 8; ++k) {
            truth[k] = number(row, fmt::format("R{}_axial_ustrain", k + 1));
            largest = std::max(largest, std::abs(truth[k]));
        }
        for (std::size_t k = 0; k < 8; ++k)
            errors.take(fmt::format("R{}", k + 1), 100 * (reads[k] / 2 * 1e6 - truth[k]) / largest);
    }
    errors.print("table, " + kind);
    return errors;
}

TEST(FiniteElements, TableUnderAPressAndUnderAForceInAnyDirection) {
    EXPECT_LT(table_errors("N_uniform").all, 0.01);  // the gains are from the same run: this checks signs and units
    EXPECT_LT(table_errors("T_top").all, 0.3);       // they contain only 0 and 90 degrees; the mesh has no symmetry
}

// A knife edge on the rim (as Lee measured) is another load than a traction on the top: no model with one sensitivity
// has both.
TEST(FiniteElements, TableUnderAForceOnItsRimIsAnotherLoad) {
    const double worst = table_errors("T_side").all;
    EXPECT_GT(worst, 40);
    EXPECT_LT(worst, 100);
}

TEST(FiniteElements, TableUnderAnEccentricPressIsAPressAndAMoment) {
    std::map<std::string, Row> cases;
    for (const Row& row : rows_of("table_gauges_grid.csv")) cases[row.at("case")] = row;
    Errors errors;
    // 1 N at x = -0.3 mm: My = -x fz = -0.3 N mm; at y = 0.3 mm: Mx = y fz = -0.3 N mm.
    const auto reads = channels_under("model = \"table\"\nsample = \"foil\"", 1, 0, 0, "none", -0.3e-3, 0.3e-3);
    for (std::size_t k = 0; k < 8; ++k) {
        const std::string column = fmt::format("R{}_axial_ustrain", k + 1);
        const double truth =
            number(cases["N_uniform"], column) - 0.3 * number(cases["M_y"], column) - 0.3 * number(cases["M_x"], column);
        errors.take(fmt::format("R{}", k + 1), 100 * (reads[k] / 2 * 1e6 - truth) / 600);
    }
    errors.print("table, a press at (-0.3, 0.3) mm");
    EXPECT_LT(errors.all, 0.2);
}

const std::string kOnMap = "model = \"table\"\nsample = \"foil\"\ninfluence = \"" TACTILED_SOURCE_DIR
                           "/config/calibration/table_influence.toml\"\n";

// A press on a disc of 0.3 mm in the middle: 2332 ustrain/N in the inner gauges, linear (the same elements and mesh
// as table_influence.csv, another load). The map uses the disc's radius, not a square's of that width or a disc's of
// twice that.
TEST(FiniteElements, TableUnderASmallPatchReadsItsShape) {
    const auto reads = channels_under(kOnMap + "[body]\nshape = \"edge\"\nradius_m = 0.15e-3", 1, 0, 0, "contact_patch");
    for (const std::size_t inner : {0u, 2u, 4u, 6u}) EXPECT_NEAR(reads[inner] / 2 * 1e6, 2332, 0.01 * 2332) << inner;
    const auto larger = channels_under(kOnMap + "[body]\nshape = \"edge\"\nradius_m = 0.3e-3", 1, 0, 0, "contact_patch");
    EXPECT_LT(larger[0] / 2 * 1e6, 2100);
}

// A press that grows along one axis, as a sum of patches: the moments' rows are loads that the map was not made from.
TEST(FiniteElements, TableUnderALinearPressureIsASumOfPatches) {
    const Scene scene = [&] {
        Problems problems;
        return read_scene(Options::parse_text("format = 1\ntitle = \"map\"\n[[sensor]]\nname = \"s\"\n" + kOnMap +
                                                  "[[motion]]\ndo = \"hold\"\nfor_s = 1\n",
                                              "map.toml", problems),
                          problems);
    }();
    const InfluenceMap map(scene.sensors[0].table);
    std::map<std::string, Row> cases;
    for (const Row& row : rows_of("table_gauges_grid.csv")) cases[row.at("case")] = row;
    Errors errors;
    for (const std::string& name : {std::string("M_x"), std::string("M_y")}) {
        constexpr int kRings = 40, kAngles = 96;
        constexpr double kRadius_mm = 0.93, kPi = 3.14159265358979;
        std::array<double, 8> sum{};
        for (int i = 0; i < kRings; ++i)
            for (int j = 0; j < kAngles; ++j) {
                const double h = kRadius_mm / kRings, r = (i + 0.5) * h, turn = 2 * kPi * (j + 0.5) / kAngles;
                const double x = r * std::cos(turn), y = r * std::sin(turn), area = r * h * 2 * kPi / kAngles;
                // Fz > 0 of a pressure 4 y / (pi R^4) has Mx = 1 N mm, of -4 x / (pi R^4) My.
                const double N = (name == "M_x" ? y : -x) * 4 / (kPi * std::pow(kRadius_mm, 4)) * area;
                const auto strain = map.mean(x * 1e-3, y * 1e-3, 1e-6);
                for (std::size_t k = 0; k < 8; ++k) sum[k] += N * strain[3 * k + 2] * 1e6;
            }
        for (std::size_t k = 0; k < 8; ++k)
            errors.take(fmt::format("R{}", k + 1),
                        100 * (sum[k] - number(cases[name], fmt::format("R{}_axial_ustrain", k + 1))) / 531);
    }
    errors.print("table, linear pressure as patches");
    EXPECT_LT(errors.all, 2);  // the outer gauges are where the map's cells are coarse
    for (const char* inner : {"R1", "R3", "R5", "R7"}) EXPECT_LT(errors.worst[inner], 0.5) << inner;
}

// Two readings define the sample (1 kPa of press, 1 kPa of shear along 0 degrees, at 750 kPa); the others are
// compared: 13 directions, combined and oblique stress, two other elastomers.
TEST(FiniteElements, HairsInAnyDirectionUnderCombinedStressInThreeElastomers) {
    const auto rows = rows_of("hair_strains.csv");
    double normal = 0, shear = 0;
    for (const Row& row : rows) {
        if (number(row, "E_kPa") != 750) continue;
        if (row.at("case") == "normal" && number(row, "normal_kPa") == 1) normal = number(row, "hair1_total_ustrain");
        if (row.at("case") == "shear" && number(row, "shear_kPa") == 1) shear = number(row, "hair1_total_ustrain");
    }
    ASSERT_GT(normal, 0);
    ASSERT_GT(shear, 0);
    std::map<std::string, Errors> by_case;
    for (const Row& row : rows) {
        // 1 m2: N is Pa, so 1 kPa is 1000 N
        const auto reads = channels_under(
            fmt::format("model = \"hair\"\narea_m2 = 1\nnormal_per_Pa = {}\nshear_per_Pa = {}\nyoung_Pa = {}", normal * 1e-9,
                        shear * 1e-9, number(row, "E_kPa") * 1000),
            number(row, "normal_kPa") * 1000, number(row, "shear_kPa") * 1000, number(row, "shear_angle_deg") + 180);
        double largest = 1e-9;
        for (std::size_t k = 0; k < 4; ++k)
            largest = std::max(largest, std::abs(number(row, fmt::format("hair{}_total_ustrain", k + 1))));
        if (largest < 1) continue;  // the unloaded rows
        for (std::size_t k = 0; k < 4; ++k)
            by_case[row.at("case")].take(
                fmt::format("H{}", k + 1),
                100 * (reads[k] * 1e6 - number(row, fmt::format("hair{}_total_ustrain", k + 1))) / largest);
    }
    for (const auto& [name, errors] : by_case) {
        errors.print("hair, " + name);
        EXPECT_LT(errors.all, 1) << name;
    }
    EXPECT_GE(by_case.size(), 5u);
}

// These define the sample: geometry, capacitances at rest, stroke at 0.5 N, displacement at the first step of shear.
// The rest of both curves is compared: 20 N of press and all steps of shear, all five electrodes.
TEST(FiniteElements, PadUnderAPressAndUnderAShear) {
    const std::string sensor =
        "model = \"capacitive\"\ndisc_radius_m = 0.004\ninner_radius_m = 0.0025\nouter_radius_m = 0.0055\nopening_deg = 80\n"
        "centre_radius_m = 0.002\ngap_m = 0.003\npiezo_V_per_N = 0\ncentre_pF = 0.1038474\nsector_pF = 0.0562600\n"
        "strain_per_N = 0.0326\nshift_per_N_m = 0.83784e-3\npress_pF_per_N = 0.0033854\nshear_pF_per_N = 0.035603\n";
    const std::vector<std::pair<std::string, std::string>> columns{
        {"C1", "C1_pF(+x)"}, {"C2", "C2_pF(-x)"}, {"C3", "C3_pF(+y)"}, {"C4", "C4_pF(-y)"}, {"Cn", "Cn_pF"}};
    std::map<std::string, Errors> by_load;
    for (const std::string effects :
         {"large_deflection,exact_overlap,gap_gain", "bonded_layer,large_deflection,exact_overlap,gap_gain"})
        for (const Row& row : rows_of("cap_curves.csv")) {
            if (row.at("model") != "bonded" && row.at("model").rfind("guided", 0) != 0) continue;
            const double press = number(row, "Fn_N"), shear = number(row, "Fs_N");
            if (press + shear == 0) continue;
            const auto reads = channels_under(sensor, press, shear, 0, effects);
            double largest = 0;
            for (const auto& [name, column] : columns)
                largest = std::max(largest, std::abs(number(row, column) - (name == "Cn" ? 0.1038473385 : 0.0562506417)));
            for (std::size_t k = 0; k < columns.size(); ++k) {
                const double rest = k == 4 ? 0.1038473385 : 0.0562506417;
                by_load[row.at("load") + (effects[0] == 'b' ? "" : ", without bonded_layer") +
                        (press > 10  ? ", 10 .. 20 N"
                         : press > 0 ? ", to 10 N"
                                     : "")]
                    .take(columns[k].first, 100 * (reads[k] - (number(row, columns[k].second) - rest)) / largest);
            }
        }
    for (const auto& [name, errors] : by_load) errors.print("capacitive, " + name);
    EXPECT_LT(by_load.at("normal, to 10 N").all, 2.5);
    EXPECT_LT(by_load.at("normal, without bonded_layer, to 10 N").all, 3.5);
    EXPECT_LT(by_load.at("shear +x").all, 0.5);
}

}  // namespace
}  // namespace tactiled::sim
