// Straightforward code for the linear methods, from the paper or a textbook: Eigen's dynamic matrices, allocated at
// each sample, and the pseudo-inverse computed at each sample. Without quality, standard deviation and missing
// channels.
#pragma once
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/table/sign_table.hpp"

namespace naive {

inline Eigen::VectorXd vector_of(const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), Eigen::Index(values.size()));
}

inline Eigen::MatrixXd matrix_of(const std::vector<std::vector<double>>& rows) {
    Eigen::MatrixXd matrix(Eigen::Index(rows.size()), Eigen::Index(rows.front().size()));
    for (std::size_t i = 0; i < rows.size(); ++i) matrix.row(Eigen::Index(i)) = vector_of(rows[i]).transpose();
    return matrix;
}

inline tactiled::Wrench wrench_of(const tactiled::Calibration& calibration, const Eigen::VectorXd& loads) {
    tactiled::Wrench wrench = tactiled::kUnseen;
    for (std::size_t i = 0; i < calibration.components.size(); ++i)
        wrench[tactiled::component_index(calibration.components[i])] = loads[Eigen::Index(i)];
    return wrench;
}

// wrench = M (channel - zero): generic/matrix.
class Affine {
public:
    explicit Affine(const tactiled::Calibration& c)
        : calibration_(c), matrix_(matrix_of(c.matrix)), zero_(vector_of(c.zero)) {}
    tactiled::Wrench operator()(const std::vector<double>& channel) {
        return wrench_of(calibration_, matrix_ * (vector_of(channel) - zero_));
    }

private:
    tactiled::Calibration calibration_;
    Eigen::MatrixXd matrix_;
    Eigen::VectorXd zero_;
};

// load = pinv(W G) W (channel - zero), W = 1 / noise: table/linear and table/matrix.
class PseudoInverse {
public:
    explicit PseudoInverse(const tactiled::Calibration& c) : calibration_(c), zero_(vector_of(c.zero)) {
        const auto n = Eigen::Index(c.channels.size());
        noise_ = Eigen::VectorXd::Ones(n);
        if (c.tables.count("forward") != 0) {
            gains_ = matrix_of(c.tables.at("forward"));
            noise_ = vector_of(c.tables.at("noise").front());
            return;
        }
        gains_ = Eigen::MatrixXd::Zero(n, 3);
        for (Eigen::Index k = 0; k < n; ++k) {
            const auto gauge = tactiled::table_gauge(c.channels[std::size_t(k)]);
            const double tangential = c.parameters.at(gauge->inner ? "tangential_inner" : "tangential_outer");
            gains_(k, 0) = gauge->along_x * tangential;
            gains_(k, 1) = gauge->along_y * tangential;
            gains_(k, 2) = -c.parameters.at(gauge->inner ? "normal_inner" : "normal_outer");  // a press is fz < 0
        }
    }
    tactiled::Wrench operator()(const std::vector<double>& channel) {
        const Eigen::MatrixXd weighted = noise_.cwiseInverse().asDiagonal() * gains_;
        const Eigen::VectorXd reading = noise_.cwiseInverse().asDiagonal() * (vector_of(channel) - zero_);
        const Eigen::MatrixXd inverse = weighted.jacobiSvd(Eigen::ComputeThinU | Eigen::ComputeThinV)
                                            .solve(Eigen::MatrixXd::Identity(gains_.rows(), gains_.rows()));
        return wrench_of(calibration_, inverse * reading);
    }

private:
    tactiled::Calibration calibration_;
    Eigen::MatrixXd gains_;
    Eigen::VectorXd zero_, noise_;
};

}  // namespace naive
