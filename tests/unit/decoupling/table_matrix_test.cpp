// Methods "matrix" and "linear" against finite elements of the table sensor.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <numbers>
#include <random>

#include "decoupling/fit/table_fit.hpp"
#include "decoupling/table/influence_map.hpp"
#include "fem_table.hpp"

namespace tactiled {
namespace {

const std::vector<std::string> kAll{"fx", "fy", "fz", "mx", "my"};

Calibration matrix_calibration(std::vector<std::string> channels, std::vector<std::string> components) {
    Calibration calibration;
    calibration.path = "matrix.toml";
    calibration.model = "table";
    calibration.method = "matrix";
    calibration.zero.assign(channels.size(), 0.0);
    const auto compliance = fem_compliance();
    for (const auto& channel : channels) {
        std::vector<double> row;
        for (const auto& component : components)
            row.push_back(compliance[std::size_t(channel[1] - '1')]
                                    [std::size_t(std::find(kAll.begin(), kAll.end(), component) - kAll.begin())]);
        calibration.tables["forward"].push_back(row);
    }
    calibration.parameters["noise"] = 1e-6;
    for (const auto& component : components) calibration.sd.push_back(component[0] == 'm' ? 1e-5 : 0.01);
    calibration.channels = std::move(channels);
    calibration.components = std::move(components);
    return calibration;
}

std::vector<double> strains_of(const std::array<double, 5>& load) {
    std::vector<double> result;
    for (const auto& row : fem_compliance()) {
        double sum = 0;
        for (std::size_t j = 0; j < 5; ++j) sum += row[j] * load[j];
        result.push_back(sum);
    }
    return result;
}

constexpr std::array<double, 5> kLoad{0.3, -0.2, -1.0, 2e-4, -1e-4};  // N, Nm

void expect_load(const Estimate& estimate, const std::array<double, 5>& load, double tolerance) {
    for (std::size_t c = 0; c < 5; ++c) EXPECT_NEAR(estimate.wrench_S[c], load[c], tolerance * (c < 3 ? 1 : 1e-3)) << c;
    EXPECT_TRUE(std::isnan(estimate.wrench_S[5]));  // mz: never
}

TEST(TableMatrix, ReadsForcesAndMomentsOfEightGauges) {
    const auto decoupler = make_decoupler(matrix_calibration(all_gauges(), kAll));
    const Estimate estimate = decouple(*decoupler, strains_of(kLoad));
    expect_load(estimate, kLoad, 1e-12);
    EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
    EXPECT_LT(estimate.residual, 1e-6);
}

TEST(TableMatrix, Superposes) {
    const auto decoupler = make_decoupler(matrix_calibration(all_gauges(), kAll));
    const auto a = strains_of({0.3, 0, -0.5, 1e-4, 0}), b = strains_of({-0.1, 0.2, -0.4, 0, 2e-4});
    std::vector<double> sum;
    for (std::size_t k = 0; k < 8; ++k) sum.push_back(a[k] + b[k]);
    expect_load(decouple(*decoupler, sum), {0.2, 0.2, -0.9, 1e-4, 2e-4}, 1e-12);
}

// All 256 subsets: solved with a standard deviation that is not smaller, or BAD; and the standard deviations equal
// the effect of noise.
TEST(TableMatrix, SolvesFromAnySubsetOrIsBad) {
    const auto decoupler = make_decoupler(matrix_calibration(all_gauges(), kAll));
    const auto whole = strains_of(kLoad);
    int solved = 0;
    for (std::uint32_t usable = 0; usable < 256; ++usable) {
        const Estimate estimate = decouple(*decoupler, whole, 0xFFu & ~usable);
        SCOPED_TRACE(usable);
        if (std::popcount(usable) < 5 || (usable & 0b10101010u) == 0) {
            EXPECT_EQ(estimate.quality(), TACTILED_BAD);
            EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        }
        if (estimate.quality() == TACTILED_BAD) continue;
        ++solved;
        expect_load(estimate, kLoad, 1e-10);
        if (usable == 0xFF) continue;
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        double more = 0;
        for (std::size_t c = 0; c < 5; ++c) more += estimate.sd[c] / (c < 3 ? 0.01 : 1e-5);
        EXPECT_GT(more, 5.001);
    }
    std::printf("8 gauges, fx fy fz mx my: %d of 256 subsets are solved\n", solved);
    EXPECT_GE(solved, 9);  // all, and each with one gauge missing
}

TEST(TableMatrix, TheStandardDeviationGrowsAsTheErrorDoes) {
    const auto decoupler = make_decoupler(matrix_calibration(all_gauges(), {"fx", "fy", "fz"}));
    std::mt19937_64 random(1);
    std::normal_distribution<double> noise(0, 1e-6);
    const auto spread = [&](std::uint32_t missing) {
        Wrench squares{};
        for (int i = 0; i < 40000; ++i) {
            std::vector<double> reading(8);
            for (auto& r : reading) r = noise(random);
            const Estimate estimate = decouple(*decoupler, reading, missing);
            for (std::size_t c = 0; c < 3; ++c) squares[c] += estimate.wrench_S[c] * estimate.wrench_S[c];
        }
        return squares;
    };
    const Wrench all = spread(0);
    for (const std::uint32_t missing : {1u, 2u, 0b11u, 0b10000001u}) {
        const Wrench some = spread(missing);
        const Estimate estimate = decouple(*decoupler, std::vector<double>(8, 0.0), missing);
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(estimate.sd[c] / 0.01, std::sqrt(some[c] / all[c]), 0.03) << missing << " " << c;
    }
}

// Finite elements: with the inner four, Fx 1 N is R1 -725 R5 +723, My 1.37 N mm is the same.
TEST(TableMatrix, TheInnerFourDoNotTellFxFromMy) {
    const std::string why = refusal(matrix_calibration(inner_gauges(), {"fx", "fz", "my"}));
    EXPECT_NE(why.find("do not determine fx my"), std::string::npos) << why;
    const auto decoupler = make_decoupler(matrix_calibration(inner_gauges(), {"fx", "fy", "fz"}));
    const auto whole = strains_of({0.3, -0.2, -1, 0, 0});
    const Estimate estimate = decouple(*decoupler, {whole[0], whole[2], whole[4], whole[6]});
    EXPECT_NEAR(estimate.wrench_S[0], 0.3, 1e-12);
    EXPECT_TRUE(std::isnan(estimate.wrench_S[4]));
    EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
    // Eight gauges of which the outer ones are lost.
    const auto eight = make_decoupler(matrix_calibration(all_gauges(), kAll));
    EXPECT_EQ(decouple(*eight, whole, 0b10101010u).quality(), TACTILED_BAD);
}

TEST(TableMatrix, FindsADeadGaugeAndDropsOneAtItsSaturationLimit) {
    const auto decoupler = make_decoupler(matrix_calibration(all_gauges(), kAll));
    for (const std::size_t k : {0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u}) {
        auto reading = strains_of(kLoad);
        reading[k] = 0;
        const Estimate dead = decouple(*decoupler, reading);
        SCOPED_TRACE(k);
        expect_load(dead, kLoad, 1e-10);
        EXPECT_EQ(dead.reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL});
        reading[k] = 1e-5;
        const Estimate rail = decouple(*decoupler, reading, 0, 1u << k);
        expect_load(rail, kLoad, 1e-10);
        EXPECT_EQ(rail.reasons, std::uint32_t{TACTILED_SATURATED});
    }
}

TEST(TableMatrix, IsFiniteOrBadForEveryPatternOfBrokenNumbers) {
    const auto decoupler = make_decoupler(matrix_calibration(all_gauges(), kAll));
    const double inf = std::numeric_limits<double>::infinity();
    const std::array<double, 7> kinds{4e-4, kNaN, inf, -inf, 1e308, -1e200, 5e-324};
    std::mt19937 random(3);
    for (int i = 0; i < 20000; ++i) {
        std::vector<double> reading;
        for (int k = 0; k < 8; ++k) reading.push_back(kinds[random() % kinds.size()]);
        const Estimate estimate = decouple(*decoupler, reading, std::uint32_t(random() & random() & random()),
                                           std::uint32_t(random() & random() & random()));
        for (std::size_t c = 0; c < 5; ++c)
            ASSERT_EQ(std::isfinite(estimate.wrench_S[c]), estimate.quality() != TACTILED_BAD);
    }
}

// Finite elements at every 22.5 degrees of a tangential force on the plate's top, with a periodic cubic in between.
TEST(TableMatrix, ReadsEveryDirectionWithinTwoPercent) {
    std::vector<std::vector<double>> grid;
    for (const auto& cells : fem_rows("table_gauges_grid.csv")) {
        if (cells[0].rfind("T_top_", 0) != 0) continue;
        std::vector<double> row;
        for (std::size_t k = 0; k < 8; ++k) row.push_back(1e-6 * std::stod(cells[10 + k]));
        grid.push_back(row);
    }
    ASSERT_EQ(grid.size(), 16u);
    Calibration linear = table_calibration(all_gauges());
    linear.parameters = {
        {"normal_inner", 422.2e-6}, {"tangential_inner", 724.0e-6}, {"tangential_outer", 572.8e-6}, {"noise", 1e-6}};
    const Calibration matrix = matrix_calibration(all_gauges(), {"fx", "fy", "fz"});
    for (const auto& [calibration, name] : {std::pair{linear, "linear"}, std::pair{matrix, "matrix"}}) {
        const auto decoupler = make_decoupler(calibration);
        double worst = 0;
        for (int degree = 0; degree < 360; ++degree) {
            const double at = degree / 22.5, t = at - std::floor(at);
            const int i = int(at);
            const std::array<double, 4> w{-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2,
                                          -(t + 1) * t * (t - 2) / 2, (t + 1) * t * (t - 1) / 6};
            for (const double newton : {0.1, 1.0, 3.0}) {
                std::vector<double> reading(8, 0.0);
                for (int j = 0; j < 4; ++j)
                    for (std::size_t k = 0; k < 8; ++k)
                        reading[k] += newton * w[std::size_t(j)] * grid[std::size_t((i + j + 15) % 16)][k];
                const Estimate estimate = decouple(*decoupler, reading);
                const double angle = degree * std::numbers::pi / 180;
                worst = std::max(worst, std::hypot(estimate.wrench_S[0] - newton * std::cos(angle),
                                                   estimate.wrench_S[1] - newton * std::sin(angle), estimate.wrench_S[2]) /
                                            newton);
            }
        }
        std::printf("%s, 360 directions of a top load: at most %.2f %% of the magnitude wrong\n", name, 100 * worst);
        EXPECT_LT(worst, 0.02);
    }
}

// ---- fit

std::vector<LabelledRow> labelled_loads(int rows, const std::vector<double>& noise, bool one_point) {
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> unit(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    std::vector<LabelledRow> result;
    for (int i = 0; i < rows; ++i) {
        std::array<double, 5> load{unit(random), unit(random), -1 - unit(random), 3e-4 * unit(random), 3e-4 * unit(random)};
        if (one_point) load[3] = 2e-4 * load[2], load[4] = -1e-4 * load[2];
        LabelledRow row{.line = i + 2, .channel = strains_of(load)};
        for (std::size_t k = 0; k < 8; ++k) row.channel[k] += 5e-5 * double(k) + noise[k] * normal(random);
        for (std::size_t c = 0; c < 5; ++c) row.wrench_S[c] = load[c];
        result.push_back(row);
    }
    return result;
}

TEST(TableMatrix, IsFittedAndTrustsTheQuietGauges) {
    std::vector<double> noise(8, 1e-6);
    noise[2] = 50e-6;
    const auto rows = labelled_loads(400, noise, false);
    Calibration calibration;
    calibration.path = "fitted";
    calibration.model = "table";
    calibration.method = "matrix";
    calibration.channels = all_gauges();
    calibration.components = kAll;
    std::vector<std::string> warnings;
    find_fit("table", "matrix")->fit(pointers(rows), calibration, warnings);
    EXPECT_NEAR(calibration.tables.at("noise")[0][2], 50e-6, 5e-6);
    const auto compliance = fem_compliance();
    for (std::size_t k = 0; k < 8; ++k) {
        EXPECT_NEAR(calibration.zero[k], 5e-5 * double(k), 20 * noise[k]);
        EXPECT_NEAR(calibration.tables.at("forward")[k][0], compliance[k][0], noise[k]);
        EXPECT_NEAR(calibration.tables.at("forward")[k][4], compliance[k][4], 1e4 * noise[k]);
    }
    const auto weighted = make_decoupler(calibration);
    Calibration equal = calibration;
    equal.tables.erase("noise");
    const auto unweighted = make_decoupler(equal);
    double weighted2 = 0, unweighted2 = 0;
    for (const auto& row : rows) {
        weighted2 += std::pow(decouple(*weighted, row.channel).wrench_S[3] - row.wrench_S[3], 2);
        unweighted2 += std::pow(decouple(*unweighted, row.channel).wrench_S[3] - row.wrench_S[3], 2);
    }
    EXPECT_LT(weighted2, unweighted2 / 9);
}

TEST(TableMatrix, TheFitRefusesMomentsThatFollowFromTheForces) {
    const auto rows = labelled_loads(200, std::vector<double>(8, 1e-6), true);
    Calibration calibration;
    calibration.model = "table";
    calibration.method = "matrix";
    calibration.channels = all_gauges();
    calibration.components = kAll;
    std::vector<std::string> warnings;
    EXPECT_THROW(find_fit("table", "matrix")->fit(pointers(rows), calibration, warnings), Undetermined);
    calibration.components = {"fx", "fy", "fz", "mz"};
    EXPECT_THROW(find_fit("table", "matrix")->fit(pointers(rows), calibration, warnings), Undetermined);
}

TEST(TableMap, IsFittedWithAScaleAndAZeroForEachGauge) {
    std::string fault;
    Calibration calibration = map_calibration();
    const auto map = influence_of(calibration, fault);
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> unit(-1, 1);
    const std::array<double, 8> scale{1.1, 0.9, 1, 1.05, 0.95, 1.2, 0.8, 1};
    std::vector<LabelledRow> rows;
    for (int i = 0; i < 300; ++i) {
        const double x = 0.6e-3 * unit(random), y = 0.6e-3 * unit(random);
        const Eigen::Vector3d f(0.3 * unit(random), 0.3 * unit(random), -1 - 0.8 * unit(random));
        InfluenceMap::At at;
        map->at(x, y, at);
        const Eigen::Matrix<double, 8, 1> strain = at.value * f;
        LabelledRow row{.line = i + 2, .channel = {}};
        for (int k = 0; k < 8; ++k)
            row.channel.push_back(1e-4 * k + scale[std::size_t(k)] * strain[k] + 1e-6 * unit(random));
        row.wrench_S = {f.x(), f.y(), f.z(), y * f.z(), -x * f.z(), kNaN};
        rows.push_back(row);
    }
    Calibration fitted = calibration;
    fitted.tables.clear();
    fitted.parameters.clear();
    std::vector<std::string> warnings;
    EXPECT_THROW(find_fit("table", "map")->fit(pointers(rows), fitted, warnings), Undetermined);  // no influence
    add_influence(TACTILED_SOURCE_DIR "/config/calibration/table_influence.toml", fitted);
    find_fit("table", "map")->fit(pointers(rows), fitted, warnings);
    for (std::size_t k = 0; k < 8; ++k) {
        EXPECT_NEAR(fitted.tables.at("gauge_scale")[0][k], scale[k] / 2, 0.001);  // the file's gauge factor is 2
        EXPECT_NEAR(fitted.zero[k], 1e-4 * double(k), 1e-6);
    }
    int close = 0;
    const auto decoupler = make_decoupler(fitted);
    for (const auto& row : rows) {
        const auto& w = decouple(*decoupler, row.channel).wrench_S;
        close += std::hypot(w[0] - row.wrench_S[0], w[1] - row.wrench_S[1], w[2] - row.wrench_S[2]) < 0.03 ? 1 : 0;  // N
    }
    EXPECT_GT(close, 270);  // of 300
}

// Hysteresis adds a small value to all loads; the search would take it for another place if there was no unloaded row
// before.
TEST(TableMap, TakesForNoiseOnlyWhatNoPointExplainsAndTheZeroFromRest) {
    std::string fault;
    Calibration calibration = map_calibration();
    const auto map = influence_of(calibration, fault);
    const Influence uniform = map->mean();
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> unit(-1, 1);
    std::vector<LabelledRow> rows;
    for (int i = 0; i < 300; ++i) {
        const bool rests = i < 30;
        const double x = 0.5e-3 * unit(random), y = 0.5e-3 * unit(random);
        const Eigen::Vector3d f = rests ? Eigen::Vector3d(0, 0, 0)
                                        : Eigen::Vector3d(0.3 * unit(random), 0.3 * unit(random), -1 - 0.8 * unit(random));
        InfluenceMap::At at;
        map->at(x, y, at);
        const Eigen::Matrix<double, 8, 1> strain = at.value * f, added = uniform * Eigen::Vector3d(0, 0, rests ? 0 : -0.1);
        LabelledRow row{.line = i + 2, .channel = {}};
        for (int k = 0; k < 8; ++k) row.channel.push_back(1e-4 * k + strain[k] + added[k] + 1e-5 * unit(random));
        row.wrench_S = {f.x(), f.y(), f.z(), y * f.z(), -x * f.z(), kNaN};
        rows.push_back(row);
    }
    Calibration fitted = calibration;
    std::vector<std::string> warnings;
    find_fit("table", "map")->fit(pointers(rows), fitted, warnings);
    for (std::size_t k = 0; k < 8; ++k) EXPECT_NEAR(fitted.zero[k], 1e-4 * double(k), 5e-6);
    EXPECT_NEAR(fitted.parameters.at("noise"), 1e-5 / std::sqrt(3), 2e-6);
}

}  // namespace
}  // namespace tactiled
