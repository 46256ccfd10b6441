// The residuals of a network with one hidden layer, for Ceres; their derivatives are checked against differences by a test.
#pragma once
#include <ceres/cost_function.h>

#include <Eigen/Dense>
#include <cmath>
#include <utility>

namespace tactiled {

// One row: network(u) - y a component, 0 where y is NaN. Parameters: hidden (neurons x (1 + inputs), a neuron's bias
// first), output (components x (1 + neurons), likewise).
class MlpRow final : public ceres::CostFunction {
public:
    MlpRow(Eigen::VectorXd u, Eigen::VectorXd y, int neurons) : u_(std::move(u)), y_(std::move(y)), neurons_(neurons) {
        set_num_residuals(int(y_.size()));
        mutable_parameter_block_sizes()->push_back(neurons * (1 + int(u_.size())));
        mutable_parameter_block_sizes()->push_back(int(y_.size()) * (1 + neurons));
    }
    bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
        using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        const Eigen::Index n = u_.size(), components = y_.size();
        const Eigen::Map<const RowMajor> hidden(parameters[0], neurons_, 1 + n);
        const Eigen::Map<const RowMajor> output(parameters[1], components, 1 + neurons_);
        const Eigen::VectorXd h = (hidden.col(0) + hidden.rightCols(n) * u_).array().tanh();
        const Eigen::VectorXd value = output.col(0) + output.rightCols(neurons_) * h;
        for (Eigen::Index c = 0; c < components; ++c) residuals[c] = std::isnan(y_[c]) ? 0 : value[c] - y_[c];
        if (jacobians == nullptr) return true;
        for (Eigen::Index c = 0; c < components; ++c) {
            const double known = std::isnan(y_[c]) ? 0 : 1;
            if (jacobians[0] != nullptr) {
                Eigen::Map<RowMajor> row(jacobians[0] + c * hidden.size(), neurons_, 1 + n);
                const Eigen::VectorXd slope =
                    known * output.row(c).tail(neurons_).transpose().array() * (1 - h.array().square());
                row.col(0) = slope;
                row.rightCols(n) = slope * u_.transpose();
            }
            if (jacobians[1] != nullptr) {
                Eigen::Map<RowMajor> row(jacobians[1] + c * output.size(), components, 1 + neurons_);
                row.setZero();
                row(c, 0) = known;
                row.row(c).tail(neurons_) = known * h.transpose();
            }
        }
        return true;
    }

private:
    Eigen::VectorXd u_, y_;
    int neurons_;
};

// sqrt(weight) times each parameter.
class Decay final : public ceres::CostFunction {
public:
    Decay(int n, double weight) : n_(n), root_(std::sqrt(weight)) {
        set_num_residuals(n);
        mutable_parameter_block_sizes()->push_back(n);
    }
    bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
        for (int i = 0; i < n_; ++i) residuals[i] = root_ * parameters[0][i];
        if (jacobians != nullptr && jacobians[0] != nullptr) {
            Eigen::Map<Eigen::MatrixXd> jacobian(jacobians[0], n_, n_);
            jacobian.setZero();
            jacobian.diagonal().setConstant(root_);
        }
        return true;
    }

private:
    int n_;
    double root_;
};

}  // namespace tactiled
