// A network with one hidden layer of tanh and linear outputs, and its fit by least squares.
#pragma once
#include <cstdint>

#include "decoupling/solve/dense.hpp"

namespace tactiled {

// value = output . (1, tanh(hidden . (1, u))); one row per neuron and one row per component, the bias first.
struct MlpNetwork {
    Eigen::MatrixXd hidden;  // neurons x (1 + inputs)
    Eigen::MatrixXd output;  // components x (1 + neurons)

    [[nodiscard]] Eigen::MatrixXd values(const Eigen::MatrixXd& u) const;  // rows x components
};

// Rows of inputs and target values; NaN where a value is unknown.
struct MlpRows {
    Eigen::MatrixXd u;  // rows x inputs
    Eigen::MatrixXd y;  // rows x components
};

// Returns a random hidden layer whose neurons are curved within the rows, and the outputs that fit them best. An
// output layer of zeros would give no gradient for the hidden layer.
MlpNetwork mlp_start(const MlpRows& rows, Eigen::Index neurons, double decay, std::uint64_t seed);

// Returns the function that mlp_step() minimises: sum over the known values of Huber's loss (kMlpHuber) of the error,
// plus decay * rows * (sum of squared weights) / 2.
double mlp_cost(const MlpNetwork& network, const MlpRows& rows, double decay);
inline constexpr double kMlpHuber = 2;

// Returns its derivative by each weight. setup
MlpNetwork mlp_gradient(const MlpNetwork& network, const MlpRows& rows, double decay);

// Levenberg-Marquardt. The Hessian is that of Gauss and Newton with one weight per row; the gradient is exact.
class MlpSolver {
public:
    MlpSolver(const MlpRows& rows, MlpNetwork start, double decay);

    // Makes one step that lowers the cost. Returns false without a change if no step of any length lowers it: a
    // minimum.
    bool step();
    [[nodiscard]] const MlpNetwork& network() const noexcept { return network_; }
    [[nodiscard]] double cost() const noexcept { return cost_; }

private:
    const MlpRows& rows_;
    MlpNetwork network_;
    double decay_, cost_;
    double damping_ = 1e-2, growth_ = 2;  // adapted to the gain of each step as in Nielsen (1999)
};

}  // namespace tactiled
