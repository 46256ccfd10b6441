// The channels as a function of their leading principal components, for the monitor of a calibration.
#pragma once
#include "decoupling/fit/fit.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {

// Channels are in units of a quarter of their range, about the standard deviation of loads over the whole range.

// The principal components of some rows, largest first. Differences between sessions are no load, so each session is
// taken from its own mean; loads that came one after the other may come together, up to the full scale of each component.
// `variance`: noise and zero of each channel.
struct Axes {
    Eigen::RowVectorXd mean;
    Eigen::MatrixXd direction;  // channels x channels, in columns
    Eigen::VectorXd sd;
};
Axes axes_of(const Rows& rows, const Eigen::MatrixXd& channel, const Eigen::VectorXd& variance,
             const std::vector<std::string>& components);

// Features are the first m scores, and their products on request.
struct Surface {
    Eigen::RowVectorXd mean, feature_mean;
    Eigen::MatrixXd scores;        // channels x scores
    Eigen::MatrixXd coefficients;  // features x channels
    Eigen::MatrixXd whitening;     // products only, lower triangle
    bool has_products;
};
Surface surface_of(const Axes& axes, const Eigen::MatrixXd& channel, Eigen::Index m, bool with_products);

// Distances of rows from a surface.
struct Distances {
    Eigen::VectorXd scores;    // |t|
    Eigen::MatrixXd residual;  // rows x channels, divided by the root of `growth`
    Eigen::VectorXd growth;    // factor of the residual's variance: the prediction is worse where features are large
};
Distances distances(const Surface& surface, const Eigen::MatrixXd& channel);

// Returns W with W a W' = 1 for a covariance `a`: a lower triangle.
Eigen::MatrixXd inverse_factor(const Eigen::MatrixXd& covariance);

}  // namespace tactiled
