// The fit of method mlp, and the order of methods that `auto` tries.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "decoupling/accuracy.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/validate.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

Calibration of_waves(const Labelled& labelled) {
    Calibration calibration;
    calibration.model = "generic";
    calibration.method = "mlp";
    calibration.path = "mlp.toml";
    calibration.channels = labelled.channels;
    calibration.components = {"fx", "fz"};
    return calibration;
}

TEST(Mlp, NoRandomStartEndsAtZeroOrAboveItsAffinePart) {
    const Labelled seen = waves(900, 3e-3, 1, true), unseen = waves(500, 3e-3, 2, true);
    Rows rows, others;
    for (const auto& row : seen.rows) rows.push_back(&row);
    for (const auto& row : unseen.rows) others.push_back(&row);
    for (int seed = 1; seed <= 25; ++seed) {
        Calibration calibration = of_waves(seen);
        calibration.parameters = {{"seed", double(seed)}};
        set_domain(rows, calibration);
        std::vector<std::string> warnings;
        find_fit("generic", "mlp")->fit(rows, calibration, warnings);
        for (const auto& output : calibration.tables.at("layer2"))
            EXPECT_TRUE(std::any_of(output.begin() + 1, output.end(), [](double w) { return w != 0; })) << seed;
        Calibration part = calibration;
        part.method = "matrix";
        const Wrench error = rms_error(calibration, others), before = rms_error(part, others);
        for (const std::size_t c : {0u, 2u}) EXPECT_LT(error[c], 0.3 * before[c]) << seed;
    }
}

TEST(Mlp, ANetworkThatGainsNothingIsLeftOutAndNamed) {
    const Labelled seen = waves(900, 3e-3, 1, false);
    Rows rows;
    for (const auto& row : seen.rows) rows.push_back(&row);
    Calibration calibration = of_waves(seen);
    set_domain(rows, calibration);
    std::vector<std::string> warnings;
    find_fit("generic", "mlp")->fit(rows, calibration, warnings);
    for (const auto& output : calibration.tables.at("layer2"))
        EXPECT_TRUE(std::all_of(output.begin(), output.end(), [](double w) { return w == 0; }));
    EXPECT_TRUE(std::any_of(warnings.begin(), warnings.end(), [](const std::string& text) {
        return text.find("keeps method matrix for fx, fz") != std::string::npos;
    }));
}

TEST(Mlp, IsRefusedWhereItGainsNothingOrHasMoreWeightsThanRows) {
    EXPECT_NE(refusal(waves(900, 3e-3, 1, false), by("mlp")).find("method mlp gains nothing"), std::string::npos);
    Labelled poses = waves(47 * 20, 1e-3, 1, true);
    for (std::size_t i = 0; i < poses.rows.size(); ++i)
        poses.rows[i] = poses.rows[i / 20 * 20], poses.rows[i].line = std::int64_t(i) + 2;
    EXPECT_NE(refusal(poses, by("mlp")).find("47 independent rows for the 20 weights"), std::string::npos)
        << refusal(poses, by("mlp"));
}

TEST(Auto, PutsTheLeastHeldOutErrorFirst) {
    const FitReport report = fit(waves(900, 3e-3, 1, true), by("auto"));
    double before = inaccuracy(report.calibration);
    EXPECT_EQ(report.calibration.held_out_rms.size(), 2u);
    for (const Fit& other : report.calibration.others) {
        const double next = inaccuracy(report.calibration.with_method(other.method));
        EXPECT_LE(before, next);
        before = next;
    }
    const auto rms = [&](const Fit& fit) {
        return fit.held_out_rms[0] / report.calibration.full_scale[0] +
               fit.held_out_rms[1] / report.calibration.full_scale[1];
    };
    EXPECT_NEAR(inaccuracy(report.calibration), rms(report.calibration) / 2, 1e-12);
}

}  // namespace
}  // namespace tactiled
