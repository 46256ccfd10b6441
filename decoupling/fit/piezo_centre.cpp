// Fits the centre electrode of model "piezo": Cn = zero + normal_b N + normal_a N^2, the mean over its converter's
// window.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "decoupling/capacitive/methods.hpp"
#include "decoupling/fit/piezo_fit.hpp"
#include "decoupling/piezo/parameters.hpp"

namespace tactiled {
namespace {

// A window longer than one row must reduce the residual to this share: noise alone favours none.
constexpr double kSurelyLess = 0.95, kLongestWindow_s = 1;
constexpr int kWindowSteps = 48;  // four per octave

// Returns the rms residual of the curve of Cn with that window.
double left_with(const std::vector<PiezoRun>& runs, double window_s) {
    const std::vector<CentreReading> readings = centre_readings(runs, window_s);
    if (readings.size() < 3 * kRowsPerCoefficient) return std::numeric_limits<double>::infinity();
    Eigen::MatrixXd x(Eigen::Index(readings.size()), 3);
    Eigen::VectorXd y(x.rows());
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
        const CentreReading& reading = readings[std::size_t(i)];
        x.row(i) << 1, reading.mean_N, reading.mean_square_N2;
        y[i] = reading.Cn;
    }
    return (y - x * least_squares(x, y).coefficient).norm() / std::sqrt(double(x.rows()));
}

// Returns the time between new values of Cn. With noise or a running mean each row has a new value; the window is
// then the one with the smallest residual of the curve.
double window_of(const std::vector<PiezoRun>& runs) {
    const double interval_s = std::clamp(conversion_interval_s(runs), kWindow.min, kWindow.max);
    if (interval_s > 1.5 * row_interval_s(runs)) return interval_s;
    double best_s = interval_s, min = kSurelyLess * left_with(runs, interval_s);
    for (int step = 1; step <= kWindowSteps; ++step) {
        const double window_s = interval_s * std::exp2(step / 4.0);
        if (window_s > kLongestWindow_s) break;
        if (const double left = left_with(runs, window_s); left < min) {
            min = left;
            best_s = window_s;
        }
    }
    return best_s;
}

}  // namespace

void fit_centre(const std::vector<PiezoRun>& runs, double range_N, std::size_t Cn, Calibration& calibration) {
    const CalibrationData known = known_beforehand(calibration, kKnownOfPiezo);
    const double window_s = known.has("window_s") ? known["window_s"] : window_of(runs);
    const std::vector<CentreReading> readings = centre_readings(runs, window_s);
    const auto n = Eigen::Index(readings.size());
    if (readings.size() < 3 * kRowsPerCoefficient)
        throw Undetermined(
            fmt::format("{} new values of Cn for 3 coefficients; at least {} are needed", n, 3 * kRowsPerCoefficient));
    Eigen::MatrixXd x(n, 3);
    Eigen::VectorXd y(n), weight = Eigen::VectorXd::Ones(n), errors;
    for (Eigen::Index i = 0; i < n; ++i) {
        const CentreReading& reading = readings[std::size_t(i)];
        x.row(i) << 1, reading.mean_N, reading.mean_square_N2;
        y[i] = reading.Cn;
    }
    LeastSquares fitted;
    for (int round = 0; round <= kRounds; ++round) {
        fitted = least_squares(weight.asDiagonal() * x, weight.asDiagonal() * y);
        if (!fitted.dependent.empty())
            throw Undetermined("Cn: the press must take three levels or more, each for some windows of its converter");
        errors = y - x * fitted.coefficient;
        weight = root_weights(errors);
    }
    const double slope = fitted.coefficient[1], mean_slope = slope + range_N * fitted.coefficient[2];
    const Sds sds(weight.asDiagonal() * x, sd_of_rows(errors, y));
    if (!(sds.of_curve(range_N, true) < kSureEnough * std::abs(mean_slope)))
        throw Undetermined(fmt::format(
            "the curve of Cn would be known to {:.2g} % only: the press must take three levels or more, each for some "
            "windows of its converter ({:.3g} s)",
            100 * sds.of_curve(range_N, true) / std::abs(mean_slope), window_s));
    if (!(slope > 0))
        throw Undetermined(fmt::format("Cn falls by {:.3g} a N of press: it must rise (a press has fz < 0)", -slope));
    calibration.zero[Cn] = fitted.coefficient[0];
    calibration.parameters["normal_b"] = slope;
    calibration.parameters["normal_a"] = fitted.coefficient[2];
    calibration.parameters["normal_range_N"] = range_N;
    calibration.parameters["window_s"] = window_s;
    calibration.condition = std::max(calibration.condition, fitted.condition);
}

}  // namespace tactiled
