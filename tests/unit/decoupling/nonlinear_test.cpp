// The methods of model "generic" beyond its matrix: they model nonlinear sensors, continue linearly outside, and stay
// finite.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "decoupling/auto_method.hpp"
#include "decoupling/fit/corrections.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/mlp_network.hpp"
#include "decoupling/solve/domain.hpp"
#include "made_by_hand.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

// Three nonlinear channels that respond to fx and fz: a bowl, a product and a wave.
std::vector<double> bent(double fx, double fz) {
    return {fx + 0.3 * fz * fz, fz + 0.2 * fx * fz, 0.5 * fx - fz + 0.3 * std::sin(3 * fx)};
}

Labelled bent_rows(int n, double noise_sd, unsigned seed = 1) {
    Labelled labelled;
    labelled.name = "bent.csv";
    labelled.channels = {"A", "B", "C"};
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> noise(0, noise_sd);
    for (int i = 0; i < n; ++i) {
        const double fx = uniform(random), fz = uniform(random);
        LabelledRow row{.line = i + 2, .channel = bent(fx, fz), .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}};
        for (double& channel : row.channel) channel += noise(random);
        labelled.rows.push_back(row);
    }
    return labelled;
}

FitReport fitted(const std::string& method, const Labelled& rows) {
    return fit(rows, {.model = "generic", .method = method, .serial = "", .date = "2026-03-01"});
}

TEST(Nonlinear, EachFindsWhatTheMatrixCannot) {
    const Labelled rows = bent_rows(1000, 1e-3);
    const double matrix = fitted("matrix", rows).components[0].held_out_rms;
    EXPECT_GT(matrix, 0.05);                                                // N: the wave and the bowl
    EXPECT_LT(fitted("quadratic", rows).components[0].held_out_rms, 0.08);  // the bowl, not the wave
    EXPECT_LT(fitted("rbf", rows).components[0].held_out_rms, 0.006);       // noise alone: 0.001 to 0.003
    EXPECT_LT(fitted("mlp", rows).components[0].held_out_rms, 0.03);
}

// The loops process pairs and groups of eight: each size with a remainder, against the formulas of
// decoupling/README.md.
TEST(Nonlinear, TheFormulasHoldForAnyNumberOfChannelsComponentsAndCentres) {
    std::mt19937_64 random(9);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const auto numbers = [&](std::size_t n) {
        std::vector<double> row(n);
        for (double& number : row) number = uniform(random);
        return row;
    };
    const std::vector<std::string> names{"fx", "fy", "fz", "mx", "my", "mz"};
    for (int i = 0; i < 1000; ++i) {
        const std::size_t n = 1 + random() % 11, components = 1 + random() % 6, n_centres = 1 + random() % 19;
        Calibration calibration;
        calibration.path = "skin.toml";
        calibration.model = "generic";
        calibration.method = i % 3 == 0 ? "quadratic" : "rbf";
        for (std::size_t k = 0; k < n; ++k) calibration.channels.push_back("A" + std::to_string(k));
        calibration.zero = numbers(n);
        calibration.components.assign(names.begin(), names.begin() + std::ptrdiff_t(components));
        calibration.channel_least.assign(n, -3);
        calibration.channel_most.assign(n, 3);
        std::vector<double> width = numbers(n);
        for (double& w : width) w = 2 + w;
        auto& tables = calibration.tables;
        tables["width"] = {width};
        calibration.matrix.clear();
        for (std::size_t c = 0; c < components; ++c) {
            calibration.matrix.push_back(numbers(n));
            tables["quadratic"].push_back(numbers(1 + n + n * (n + 1) / 2));
        }
        if (calibration.method == "rbf") {
            if (i % 3 == 1) tables.erase("quadratic");
            for (std::size_t j = 0; j < n_centres; ++j) tables["centres"].push_back(numbers(n));
            for (std::size_t c = 0; c < components; ++c) tables["weights"].push_back(numbers(n_centres));
            calibration.parameters["spread"] = 0.7;
        }
        const std::vector<double> channel = numbers(n);
        const Estimate estimate = decouple(*make_decoupler(calibration), channel);
        std::vector<double> r, u;
        for (std::size_t k = 0; k < n; ++k) r.push_back(channel[k] - calibration.zero[k]), u.push_back(r[k] / width[k]);
        for (std::size_t c = 0; c < components; ++c) {
            double force = 0;
            for (std::size_t k = 0; k < n; ++k) force += calibration.matrix[c][k] * r[k];
            if (tables.count("quadratic") != 0) {
                const double* q = tables["quadratic"][c].data();
                force += *q++;
                for (std::size_t k = 0; k < n; ++k) force += *q++ * u[k];
                for (std::size_t k = 0; k < n; ++k)
                    for (std::size_t j = k; j < n; ++j) force += *q++ * u[j] * u[k];
            }
            for (std::size_t j = 0; calibration.method == "rbf" && j < n_centres; ++j) {
                double d2 = 0;
                for (std::size_t k = 0; k < n; ++k)
                    d2 += (u[k] - tables["centres"][j][k]) * (u[k] - tables["centres"][j][k]);
                force += tables["weights"][c][j] / (1 + d2 / (0.7 * 0.7));
            }
            ASSERT_NEAR(estimate.wrench_S[c], force, 1e-12) << calibration.method << ", " << n << " channels, component "
                                                            << c << " of " << components << ", " << n_centres << " centres";
        }
    }
}

TEST(Nonlinear, GoesOnAsAStraightLineOutsideAndSaysSo) {
    for (const char* method : {"quadratic", "rbf", "mlp"}) {
        const FitReport report = fitted(method, bent_rows(600, 1e-3));
        const auto decoupler = make_decoupler(report.calibration);
        const std::vector<double> edge = bent(1, 1), out = bent(3, 3);
        std::vector<double> far[3];
        for (int step = 0; step < 3; ++step)
            for (std::size_t k = 0; k < 3; ++k) far[step].push_back(out[k] + (step + 1) * (out[k] - edge[k]));
        Estimate e[3];
        for (int step = 0; step < 3; ++step) {
            e[step] = decouple(*decoupler, far[step]);
            EXPECT_EQ(e[step].quality(), TACTILED_UNCERTAIN) << method;
            EXPECT_TRUE((e[step].reasons & TACTILED_OUTSIDE_DOMAIN) != 0) << method;
        }
        for (const std::size_t c : {std::size_t(0), std::size_t(2)})
            EXPECT_NEAR(e[2].wrench_S[c] - e[1].wrench_S[c], e[1].wrench_S[c] - e[0].wrench_S[c], 1e-9) << method;
        EXPECT_LT(std::abs(e[2].wrench_S[2]), 30) << method;  // a square would be at hundreds
    }
}

TEST(Nonlinear, IsFiniteOrBadForAnyBits) {
    std::mt19937_64 random(4);
    for (const char* method : {"quadratic", "rbf", "mlp"}) {
        const auto decoupler = make_decoupler(fitted(method, bent_rows(600, 1e-3)).calibration);
        for (int i = 0; i < 20000; ++i) {
            std::vector<double> channel = bent(0.3, -0.4);
            channel[std::size_t(i) % 3] = std::bit_cast<double>(random());
            const Estimate e = decouple(*decoupler, channel);
            if (e.quality() == TACTILED_BAD)
                EXPECT_TRUE(std::isnan(e.wrench_S[0]) && std::isnan(e.wrench_S[2]));
            else
                EXPECT_TRUE(std::isfinite(e.wrench_S[0]) && std::isfinite(e.wrench_S[2])) << method;
        }
        // No state remains.
        EXPECT_NEAR(decouple(*decoupler, bent(0.3, -0.4)).wrench_S[2], -0.4, 0.1);
    }
}

// In rows with and without a label, and with errors on both sides of the limit of Huber's loss.
TEST(Nonlinear, ANetworksDerivativesAreThoseOfDifferences) {
    std::srand(2);
    MlpRows rows{Eigen::MatrixXd::Random(20, 3), 3 * Eigen::MatrixXd::Random(20, 2)};
    rows.y(4, 1) = kNaN;
    MlpNetwork network{Eigen::MatrixXd::Random(4, 4), 2 * Eigen::MatrixXd::Random(2, 5)};
    const MlpNetwork derivative = mlp_gradient(network, rows, 0.01);
    for (auto [weights, slopes] :
         {std::pair(&network.hidden, &derivative.hidden), std::pair(&network.output, &derivative.output)})
        for (Eigen::Index i = 0; i < weights->size(); ++i) {
            double& weight = weights->data()[i];
            const double old = weight;
            weight = old - 1e-6;
            const double before = mlp_cost(network, rows, 0.01);
            weight = old + 1e-6;
            const double after = mlp_cost(network, rows, 0.01);
            weight = old;
            EXPECT_NEAR(slopes->data()[i], (after - before) / 2e-6, 1e-6);
        }
}

TEST(Auto, FitsAllKeepsAllAndPutsTheMostAccurateFirst) {
    const FitReport report = fitted("auto", bent_rows(1000, 1e-3));
    EXPECT_FALSE(report.warnings.empty());  // one session: each method warns
    for (const auto& warning : report.warnings)
        EXPECT_EQ(std::count(report.warnings.begin(), report.warnings.end(), warning), 1) << warning;
    EXPECT_EQ(report.methods.size(), 4u);
    EXPECT_LE(report.suspects.size(), 5u);  // 0.5 % of rows that are all good
    // Finds the method with the smallest error on held-out rows, mean over the components relative to full scale.
    std::string best;
    double min = std::numeric_limits<double>::infinity();
    for (const auto& each : report.methods) {
        double error = 0;
        for (std::size_t i = 0; i < each.held_out_rms.size(); ++i)
            error += each.held_out_rms[i] / report.components[i].full_scale;
        if (error < min) min = error, best = each.method;
    }
    EXPECT_TRUE(best == "rbf" || best == "mlp") << best;
    EXPECT_EQ(report.calibration.method, best);
    EXPECT_EQ(report.calibration.others.size(), 3u);
    int one_session = 0;
    for (const auto& warning : report.warnings) one_session += warning.find("one session only") != warning.npos ? 1 : 0;
    EXPECT_EQ(one_session, 1);
    const ScratchFile file("");
    save_calibration(report.calibration, file.path());
    Problems problems;
    const Calibration back = load_calibration(file.path(), problems);
    problems.throw_if_any();
    DecouplerFault fault;
    for (const char* method : {"matrix", "quadratic", "rbf", "mlp"}) {
        const auto decoupler = make_decoupler(back, method);
        ASSERT_NE(decoupler, nullptr);
        EXPECT_EQ(decoupler->method(), method);
        // Equal to the fitted one to the last bit.
        const auto direct = make_decoupler(report.calibration, method);
        EXPECT_EQ(decouple(*decoupler, bent(0.5, 0.5)).wrench_S[2], decouple(*direct, bent(0.5, 0.5)).wrench_S[2]);
    }
    // With enough time the most accurate, with none the fastest; the costs are given, because a busy machine may
    // measure any.
    std::vector<MethodCost> costs{{"matrix", 0.05}, {"quadratic", 0.2}, {"rbf", 2}, {"mlp", 4}};
    EXPECT_EQ(make_auto_method(back, 1e4, costs, fault)->method(), best);
    EXPECT_EQ(make_auto_method(back, 1e-6, costs, fault)->method(), "matrix");
    EXPECT_EQ(make_decoupler(back, "auto", 1e9)->method(), best);
    EXPECT_EQ(make_decoupler(back)->method(), best);
    EXPECT_NE(refusal(back, "rbff").find("did you mean \"rbf\"?"), std::string::npos);
}

// 1 Nm is little beside 100 N and much beside 2 Nm.
TEST(Auto, WeighsEachComponentByItsFullScaleAndItsSlope) {
    Calibration calibration = fitted("auto", bent_rows(500, 1e-3)).calibration;
    calibration.full_scale = {100, 2};
    const auto chosen = [&] { return std::string(make_decoupler(calibration, "auto", 1e6)->method()); };
    const auto state = [&](const std::vector<double>& sd_of_rbf, double slope_of_rbf) {
        const auto set = [&](Fit& fit) {
            fit.sd = fit.method == "rbf"      ? sd_of_rbf
                     : fit.method == "matrix" ? std::vector{1.0, 0.1}
                                              : std::vector{90.0, 2.0};
            fit.sd_slope = {0, fit.method == "rbf" ? slope_of_rbf : 0.0};
            fit.held_out_rms.clear();  // like a file without it
        };
        set(calibration);
        for (Fit& other : calibration.others) set(other);
    };
    state({0.1, 0.5}, 0);  // 0.6 in all, but 25 % of 2
    EXPECT_EQ(chosen(), "matrix");
    state({2, 0.05}, 0);
    EXPECT_EQ(chosen(), "rbf");
    state({2, 0.05}, 0.5);
    EXPECT_EQ(chosen(), "matrix");
}

// The matrix of a fit of "quadratic" has ten times the error of the quadratic: its standard deviation would be wrong.
TEST(Auto, AMethodThatWasNotFittedHasNoStandardDeviation) {
    const Calibration quadratic = fitted("quadratic", bent_rows(500, 1e-3)).calibration;
    const Estimate own = decouple(*make_decoupler(quadratic), bent(0.5, 0.5));
    EXPECT_EQ(own.quality(), TACTILED_GOOD);
    const Estimate other = decouple(*make_decoupler(quadratic, "matrix"), bent(0.5, 0.5));
    EXPECT_EQ(other.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(other.reasons, std::uint32_t(TACTILED_UNKNOWN_UNCERTAINTY));
    EXPECT_TRUE(std::isnan(other.sd[2]));
}

// No label of a held-out session is in the calibration that judges it, nor the range of its channels. Ridge, spread, and the
// centres of method rbf, which come from the channels alone, are those of all rows.
TEST(Nonlinear, HeldOutRowsAreJudgedByACalibrationThatNeverSawThem) {
    for (const char* method : {"matrix", "quadratic", "rbf"}) {
        Labelled both = bent_rows(1000, 1e-3), first = both;
        both.sessions = first.sessions = {"narrow", "wide"};
        first.rows.clear();
        for (auto& row : both.rows) {
            row.session = std::abs(row.wrench_S[0]) + std::abs(row.wrench_S[2]) < 0.9 ? 0 : 1;
            if (row.session == 0) first.rows.push_back(row);
        }
        const FitReport report = fitted(method, both);
        FitRequest request{.model = "generic", .method = method, .serial = "", .date = "2026-03-01"};
        Fit& choice = request.start[method];
        choice.parameters = report.calibration.parameters;
        choice.zero = report.calibration.zero;
        for (const char* name : {"ridge", "width", "centres"})
            if (const auto table = report.calibration.tables.find(name); table != report.calibration.tables.end())
                choice.tables.insert(*table);
        const auto narrow = make_decoupler(fit(first, request).calibration);
        int wide = 0;
        for (const auto& [row, estimated] : report.held_out) {
            if (row->session != 1) continue;
            ++wide;
            // Sums of all rows less those of the others, in place of sums of the rows: equal but for rounding.
            const double rounding = method == std::string("rbf") ? 1e-7 : 0;
            EXPECT_NEAR(estimated[2], decouple(*narrow, row->channel).wrench_S[2], rounding) << method << row->line;
        }
        EXPECT_GT(wide, 400);
    }
}

// The part has another zero and another matrix than all rows. Its weights come from sums over all rows less the others; here
// they are beside those of its own features, which are made from the tables alone.
TEST(Nonlinear, RbfOfAPartSolvesTheEquationsOfThatPart) {
    const Labelled all = bent_rows(1000, 1e-3);
    Calibration part = fitted("rbf", all).calibration;
    const std::vector<double> zero_of_all = part.zero;
    Rows rows;
    for (const auto& row : all.rows)
        if (row.wrench_S[0] > -0.3) rows.push_back(&row);
    std::vector<std::string> warnings;
    find_fit("generic", "rbf")->fit(rows, part, warnings);
    const auto n = Eigen::Index(part.channels.size()), m = Eigen::Index(part.tables["centres"].size());
    double moved = 0;
    Eigen::MatrixXd u(Eigen::Index(rows.size()), n);
    for (Eigen::Index k = 0; k < n; ++k) {
        const double width = part.tables["width"][0][std::size_t(k)], zero = part.zero[std::size_t(k)];
        moved = std::max(moved, std::abs(zero - zero_of_all[std::size_t(k)]) / width);
        for (Eigen::Index i = 0; i < u.rows(); ++i) u(i, k) = (rows[std::size_t(i)]->channel[std::size_t(k)] - zero) / width;
    }
    EXPECT_GT(moved, 1e-3);
    Eigen::MatrixXd features(u.rows() + 1 + n + n * (n + 1) / 2 + m, 1 + n + n * (n + 1) / 2 + m);
    features.setZero();
    features.topLeftCorner(u.rows(), features.cols() - m) = quadratic_features(u);
    for (Eigen::Index i = 0; i < u.rows(); ++i)
        for (Eigen::Index j = 0; j < m; ++j) {
            double d2 = 0;
            for (Eigen::Index k = 0; k < n; ++k)
                d2 += std::pow(u(i, k) - part.tables["centres"][std::size_t(j)][std::size_t(k)], 2);
            features(i, features.cols() - m + j) = 1 / (1 + d2 / std::pow(part.parameters["spread"], 2));
        }
    features.bottomRows(features.cols()).diagonal().setConstant(std::sqrt(part.parameters["ridge"] * double(rows.size())));
    for (std::size_t c = 0; c < part.components.size(); ++c) {
        Eigen::VectorXd y = Eigen::VectorXd::Zero(features.rows()), w(features.cols());
        for (Eigen::Index i = 0; i < u.rows(); ++i) {
            y[i] = rows[std::size_t(i)]->wrench_S[component_index(part.components[c])];
            for (std::size_t k = 0; k < std::size_t(n); ++k)
                y[i] -= part.matrix[c][k] * (rows[std::size_t(i)]->channel[k] - part.zero[k]);
        }
        w << Eigen::Map<const Eigen::VectorXd>(part.tables["quadratic"][c].data(), w.size() - m),
            Eigen::Map<const Eigen::VectorXd>(part.tables["weights"][c].data(), m);
        if (w.isZero()) continue;  // no correction
        const Eigen::VectorXd direct = features.householderQr().solve(y);
        // The ridge is that of the features at the zero of all rows, which changes the estimates a little.
        EXPECT_LT((features * (w - direct)).head(u.rows()).cwiseAbs().maxCoeff(), 1e-4) << part.components[c];
    }
}

TEST(Nonlinear, RefusesRowsThatAreTooFew) {
    const Labelled few = bent_rows(29, 1e-3);
    EXPECT_THROW((void)fitted("quadratic", few), Undetermined);  // 10 coefficients
    EXPECT_NO_THROW((void)fitted("matrix", few));
    // Many rows of few loads count as few.
    Labelled posed = bent_rows(29, 1e-3);
    const auto poses = posed.rows;
    posed.rows.clear();
    for (const auto& pose : poses)
        for (int i = 0; i < 100; ++i) posed.rows.push_back(pose);
    EXPECT_THROW((void)fitted("quadratic", posed), Undetermined);
    const FitReport report = fitted("matrix", posed);
    EXPECT_TRUE(has_way(report, "leave poses out (29 poses"));
    // Neighbours are in one group: a single pose between two others is hardly unknown.
    EXPECT_TRUE(std::is_sorted(report.held_out.begin(), report.held_out.end(),
                               [](const HeldOut& a, const HeldOut& b) { return a.row->line < b.row->line; }));
}

TEST(Outliers, TwoSwappedLabelsAreNamedAndLeftOut) {
    Labelled rows;
    rows.name = "cell.csv";
    rows.channels = {"A", "B"};
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise(0, 1e-4);
    for (int i = 0; i < 50; ++i) {
        const double fz = -0.4 * i;
        rows.rows.push_back({.line = i + 2,
                             .channel = {fz + noise(random), 1 - 2 * fz + 0.1 * std::sin(i)},
                             .wrench_S = {kNaN, kNaN, fz, kNaN, kNaN, kNaN}});
    }
    std::swap(rows.rows[10].wrench_S, rows.rows[17].wrench_S);
    const FitReport report = fit(rows, {.model = "generic", .method = "", .serial = "", .date = "2026-03-01"});
    EXPECT_EQ(report.calibration.rows, 48);
    std::string said;
    for (const auto& warning : report.warnings) said += warning + "\n";
    EXPECT_NE(said.find("cell.csv:12"), std::string::npos) << said;
    EXPECT_NE(said.find("cell.csv:19"), std::string::npos) << said;
    EXPECT_LT(report.components[0].held_out_rms, 1e-3);
    // A nonlinear sensor has no outliers, however badly a straight line fits it.
    EXPECT_EQ(fitted("matrix", bent_rows(500, 1e-3)).calibration.rows, 500);
}

}  // namespace
}  // namespace tactiled
