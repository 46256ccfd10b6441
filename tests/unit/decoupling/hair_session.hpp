// A reference hair sensor, written from the paper and not from the code under test: each hair has its own gains and
// azimuth, and a nonlinear response to shear.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "decoupling/fit/hair_fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {

// Cao et al.: dR/R0 at 1 Pa, a hair; noise rms; range; a cap of 6 mm.
inline constexpr double kHairNormal = 3.74e-7, kHairShear = 7.91e-7, kHairNoise = 5.14e-6, kHairRange_Pa = 2000;
inline constexpr double kCap_m2 = std::numbers::pi * 3e-3 * 3e-3;

struct Stress {
    double sigma, tau_x, tau_y;  // Pa; sigma positive under a press
};

inline Wrench force_of(Stress s) { return {s.tau_x * kCap_m2, s.tau_y * kCap_m2, -s.sigma * kCap_m2, kNaN, kNaN, kNaN}; }

struct HairSensor {
    std::array<double, 4> normal{}, shear{}, azimuth{}, zero{}, square{}, cube{};
    double bend = 0;  // share of the reading at full press that appears early and saturates: not a polynomial

    static HairSensor ideal() {
        HairSensor sensor;
        for (std::size_t i = 0; i < 4; ++i) {
            sensor.normal[i] = kHairNormal;
            sensor.shear[i] = kHairShear;
            sensor.azimuth[i] = double(i) * std::numbers::pi / 2;
        }
        return sensor;
    }
    // Gains vary by 3 % (sd) and azimuths by `azimuth_deg`, zeros within 1e-3; shear adds 4 % of the reading at full
    // press by its square, and up to 3 % by its cube, for each hair within half of that more or less.
    static HairSensor asymmetric(unsigned seed, double azimuth_deg) {
        HairSensor sensor = ideal();
        std::mt19937_64 random(seed);
        std::normal_distribution<double> spread(0, 1);
        std::uniform_real_distribution<double> uniform(-1, 1);
        for (std::size_t i = 0; i < 4; ++i) {
            sensor.normal[i] *= 1 + 0.03 * spread(random);
            sensor.shear[i] *= 1 + 0.03 * spread(random);
            sensor.azimuth[i] += azimuth_deg * spread(random) * std::numbers::pi / 180;
            sensor.zero[i] = 1e-3 * uniform(random);
            sensor.square[i] = 0.04 * (1 + 0.5 * uniform(random)) * kHairNormal * kHairRange_Pa;
            sensor.cube[i] = 0.03 * (1 + 0.5 * uniform(random)) * kHairNormal * kHairRange_Pa;
        }
        return sensor;
    }
    // H1 .. H4.
    std::vector<double> reading(Stress s) const {
        std::vector<double> r;
        const double tau = std::hypot(s.tau_x, s.tau_y), alpha = std::atan2(s.tau_y, s.tau_x);
        for (std::size_t i = 0; i < 4; ++i) {
            const double along = tau * std::cos(alpha - azimuth[i]), part = tau / kHairRange_Pa;
            r.push_back(zero[i] + normal[i] * (s.sigma + bend * kHairRange_Pa * -std::expm1(-s.sigma / 700)) -
                        shear[i] * along + square[i] * part * part +
                        cube[i] * std::pow((s.tau_x + s.tau_y) / kHairRange_Pa, 3) / std::numbers::sqrt2);
        }
        return r;
    }
};

// `rows` loads: press 0 .. 2 kPa and shear 0 .. 2 kPa in random directions, all at once, with noise.
inline std::vector<LabelledRow> hair_session(const HairSensor& sensor, int rows, unsigned seed,
                                             double noise_sd = kHairNoise) {
    std::vector<LabelledRow> session;
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::normal_distribution<double> noise(0, 1);
    for (int i = 0; i < rows; ++i) {
        const double alpha = 2 * std::numbers::pi * uniform(random), tau = kHairRange_Pa * uniform(random);
        const Stress stress{kHairRange_Pa * uniform(random), tau * std::cos(alpha), tau * std::sin(alpha)};
        LabelledRow row{.line = i + 2, .channel = sensor.reading(stress), .wrench_S = force_of(stress), .session = 0};
        for (auto& r : row.channel) r += noise_sd * noise(random);
        session.push_back(row);
    }
    return session;
}

inline Rows rows_of(const std::vector<LabelledRow>& session) {
    Rows rows;
    for (const auto& row : session) rows.push_back(&row);
    return rows;
}

inline Calibration hair_calibration(const std::string& method,
                                    std::vector<std::string> channels = {"H1", "H2", "H3", "H4"}) {
    Calibration calibration;
    calibration.path = "hair.toml";
    calibration.model = "hair";
    calibration.method = method;
    calibration.zero.assign(channels.size(), 0.0);
    const bool x = channels.size() > 2 || channels.front() == "H1" || channels.front() == "H3";
    const bool y = channels.size() > 2 || !x;
    if (x) calibration.components.emplace_back("fx");
    if (y) calibration.components.emplace_back("fy");
    calibration.components.emplace_back("fz");
    calibration.sd.assign(calibration.components.size(), 1e-4);
    calibration.channels = std::move(channels);
    return calibration;
}

// The paper's sensor: equal hairs, no leak.
inline Calibration paper_hair(const std::string& method,
                              const std::vector<std::string>& channels = {"H1", "H2", "H3", "H4"}) {
    Calibration calibration = hair_calibration(method, channels);
    calibration.parameters = {{"area_m2", kCap_m2}, {"normal_scale_Pa", 2000}, {"shear_scale_Pa", 2000}};
    if (method == "sum_diff") {
        calibration.parameters["diff_x_per_Pa"] = 2 * kHairShear;
        calibration.parameters["diff_y_per_Pa"] = 2 * kHairShear;
    }
    for (const auto& name : channels) {
        const int i = name[1] - '1';
        const std::array<std::array<double, 2>, 4> away{{{-1, 0}, {0, -1}, {1, 0}, {0, 1}}};
        calibration.tables["gains"].push_back(
            {kHairNormal, away[std::size_t(i)][0] * kHairShear, away[std::size_t(i)][1] * kHairShear});
    }
    calibration.tables["noise"] = {std::vector<double>(channels.size(), kHairNoise)};
    return calibration;
}

inline const std::vector<std::string> kHairMethods{"sum_diff", "matrix", "physics"};

inline Calibration fitted_hair(const std::string& method, const Rows& rows, Calibration calibration = {},
                               std::vector<std::string>* said = nullptr) {
    if (calibration.channels.empty()) calibration = hair_calibration(method);
    calibration.method = method;
    std::vector<std::string> warnings;
    find_fit("hair", method)->fit(rows, calibration, warnings);
    if (said != nullptr) *said = warnings;
    return calibration;
}

inline void expect_force(const Estimate& estimate, Stress s, double tolerance_Pa) {
    const Wrench force = force_of(s);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(estimate.wrench_S[c], force[c], tolerance_Pa * kCap_m2) << c;
}

struct HairErrors {
    std::array<double, 3> rms{}, worst{};  // fx fy fz, % of 2 kPa
    int good = 0, rows = 0;
};

inline HairErrors errors_on(Decoupler& decoupler, const std::vector<LabelledRow>& session, std::uint32_t missing = 0) {
    HairErrors errors;
    for (const auto& row : session) {
        const Estimate estimate = decouple(decoupler, row.channel, missing);
        errors.good += estimate.quality() == TACTILED_GOOD ? 1 : 0;
        ++errors.rows;
        for (std::size_t c = 0; c < 3; ++c) {
            const double error = 100 * (estimate.wrench_S[c] - row.wrench_S[c]) / (kHairRange_Pa * kCap_m2);
            errors.rms[c] += error * error;
            errors.worst[c] = std::max(errors.worst[c], std::abs(error));
        }
    }
    for (double& rms : errors.rms) rms = std::sqrt(rms / errors.rows);
    return errors;
}

}  // namespace tactiled
