// The features of method "rbf" of model "generic" in a fit: the quadratic, and basis functions around centres.
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Features of the readings r: the quadratic of u = (r - zero) / width, then one around each centre.
struct Basis {
    Eigen::RowVectorXd zero, width;
    Eigen::MatrixXd centres;  // values of u, one centre per row
    double spread;

    [[nodiscard]] Eigen::MatrixXd features_of(const Eigen::MatrixXd& u) const;
    // Returns u with another zero, less u with this one.
    [[nodiscard]] Eigen::RowVectorXd shift_to(const Eigen::RowVectorXd& other) const;
    // Returns true if the features are the same but for rounding.
    [[nodiscard]] bool is_near(const Basis& other) const;
};

// Returns n centres of the rows of u: k-means++ and Lloyd's iterations over a few rows per centre, always with the same
// random numbers. A centre that loses all its rows keeps its place.
Eigen::MatrixXd k_means(const Eigen::MatrixXd& u, Eigen::Index n);

// Rewrites the coefficients q of a quadratic of u as those of a quadratic of u + shift.
void shift_quadratic(const Eigen::RowVectorXd& shift, Eigen::Ref<Eigen::VectorXd> q);

}  // namespace tactiled
