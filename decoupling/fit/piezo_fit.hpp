// The common parts of the fit of model "piezo", method "fused". decoupling/piezo/README.md lists the fitted
// parameters and the requirements on a recording.
//
// Curve, zero and leak of the film Vp are fitted by simulating Vp from the applied press, so that noise of a reading
// never becomes an input. Curve and zero of Cn are fitted to the mean press in each of its windows. leak_tau_s,
// fusion_tau_s and window_s are kept if they are stated. The fit is refused if the press never changes fast or is
// never held, because gain and leak cannot be separated then.
#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {

// Returns the signal of a film for a drive q at times t_s (not decreasing), 0 before: charge.hpp, step by step; and
// its derivative by the logarithm of the leak's time constant.
struct FilmResponse {
    std::vector<double> v, dv_dlog_tau;
};
FilmResponse film_response(std::span<const double> t_s, std::span<const double> q, double tau_s);

// Rows that follow each other in time without a gap.
struct PiezoRun {
    std::vector<double> t_s, press_N, Vp, Cn;
};
// Cn at the time of a new value, with the means of the press and of its square over the window that ended then.
struct CentreReading {
    double mean_N, mean_square_N2, Cn;
};
// Returns the mean interval between rows, s. setup
double row_interval_s(const std::vector<PiezoRun>& runs);
// Returns the interval between new values of a reading that repeats its last value in between, s. setup: throws
// Undetermined
double conversion_interval_s(const std::vector<PiezoRun>& runs);
std::vector<CentreReading> centre_readings(const std::vector<PiezoRun>& runs, double window_s);

// Fits zero, curve and window of Cn and stores them in the calibration. setup: throws Undetermined
void fit_centre(const std::vector<PiezoRun>& runs, double range_N, std::size_t Cn, Calibration& calibration);

// Splits at a new session, at a clock that goes back and at a gap. setup: throws Undetermined
std::vector<PiezoRun> piezo_runs(const Rows& rows, std::size_t Vp, std::size_t Cn);

// ---- weights against spikes, and the standard deviations of a fit ----

inline constexpr int kRounds = 3;  // iterations of the weights
// Gain and leak must be known to this share, one standard deviation: a leak that is 20 % off changes the gain at 0.1
// Hz by 9 %.
inline constexpr double kSureEnough = 0.05;

// Returns the square roots of the weights of Cauchy's loss.
inline Eigen::VectorXd root_weights(const Eigen::VectorXd& errors) {
    const double sd = robust_sd(errors);
    if (!(sd > 0)) return Eigen::VectorXd::Ones(errors.size());
    return (1 + (errors.array() / (kCauchyOfSpikes * sd)).square()).rsqrt();
}

// Returns the factor by which correlated errors increase all standard deviations.
inline double neighbours_factor(const Eigen::VectorXd& errors) {
    const Eigen::Index n = errors.size() - 1;
    const double rho = errors.head(n).dot(errors.tail(n)) / std::max(errors.squaredNorm(), 1e-300);
    return std::sqrt((1 + std::clamp(rho, 0.0, 0.999)) / (1 - std::clamp(rho, 0.0, 0.999)));
}

inline double sd_of_rows(const Eigen::VectorXd& errors, const Eigen::VectorXd& y) {
    return std::max(robust_sd(errors), 1e-9 * y.cwiseAbs().maxCoeff()) * neighbours_factor(errors);
}

// Standard deviations of the results of a fit with the columns of `x`.
class Sds {
public:
    Sds(const Eigen::MatrixXd& x, double sd_of_rows) : length_(x.colwise().norm()), sd_(sd_of_rows) {
        // The singular values of the small R are those of the tall matrix.
        const Eigen::HouseholderQR<Eigen::MatrixXd> qr(Eigen::MatrixXd(x.array().rowwise() / length_.array()));
        const Eigen::MatrixXd r = qr.matrixQR().topRows(x.cols()).triangularView<Eigen::Upper>();
        svd_.compute(r, Eigen::ComputeFullV);
    }
    // Returns the standard deviation of a linear function of the coefficients.
    [[nodiscard]] double of(const Eigen::RowVectorXd& function) const {
        const Eigen::RowVectorXd scaled = function.array() / length_.array();
        return sd_ * (scaled * svd_.matrixV()).cwiseQuotient(svd_.singularValues().transpose()).norm();
    }
    // Returns the larger of two standard deviations of a curve with the coefficients 1 (b) and 2 (a), divided by the range:
    // of the mean slope over 0 .. range, and of the distance of the middle from a straight line, a range^2 / 4.
    [[nodiscard]] double of_curve(double range, bool has_curvature) const {
        Eigen::RowVectorXd slope = Eigen::RowVectorXd::Unit(length_.size(), 1);
        if (!has_curvature) return of(slope);
        slope[2] = range;
        return std::max(of(slope), of(Eigen::RowVectorXd::Unit(length_.size(), 2) * (range / 4)));
    }
    [[nodiscard]] double condition() const {
        return svd_.singularValues()[0] / svd_.singularValues()[svd_.singularValues().size() - 1];
    }

private:
    Eigen::RowVectorXd length_;
    double sd_;
    Eigen::JacobiSVD<Eigen::MatrixXd> svd_;
};

}  // namespace tactiled
