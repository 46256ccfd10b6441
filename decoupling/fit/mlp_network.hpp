// A network with one hidden layer of tanh and linear outputs, and its fit by least squares.
#pragma once
#include <cstdint>

#include "decoupling/solve/dense.hpp"

namespace tactiled {

// value = output . (1, tanh(hidden . (1, u))); a row a neuron and a row a component, the bias first.
struct MlpNetwork {
    Eigen::MatrixXd hidden;  // neurons x (1 + inputs)
    Eigen::MatrixXd output;  // components x (1 + neurons)

    [[nodiscard]] Eigen::MatrixXd values(const Eigen::MatrixXd& u) const;  // rows x components
};

// Rows of inputs and wanted values; NaN where a value is unknown.
struct MlpRows {
    Eigen::MatrixXd u;  // rows x inputs
    Eigen::MatrixXd y;  // rows x components
};

// A random hidden layer whose neurons bend within the rows, and the outputs that fit them best. An output layer of zeros
// would let no gradient through to the hidden one.
MlpNetwork mlp_start(const MlpRows& rows, Eigen::Index neurons, double decay, std::uint64_t seed);

// The function that mlp_step() lowers: sum over the known values of Huber's loss (kMlpHuber) of the error, and
// decay * rows * (sum of squared weights) / 2.
double mlp_cost(const MlpNetwork& network, const MlpRows& rows, double decay);
inline constexpr double kMlpHuber = 2;

// Its derivative by each weight. setup
MlpNetwork mlp_gradient(const MlpNetwork& network, const MlpRows& rows, double decay);

// Levenberg-Marquardt. The Hessian is that of Gauss and Newton with one weight a row; the gradient is exact.
class MlpSolver {
public:
    MlpSolver(const MlpRows& rows, MlpNetwork start, double decay);

    // Lowers the cost by one step. False, and the network stays, where no step of any length lowers it: a minimum.
    bool step();
    [[nodiscard]] const MlpNetwork& network() const noexcept { return network_; }
    [[nodiscard]] double cost() const noexcept { return cost_; }

private:
    const MlpRows& rows_;
    MlpNetwork network_;
    double decay_, cost_;
    double damping_ = 1e-2, growth_ = 2;  // as Nielsen (1999) lets them follow the gain of a step
};

}  // namespace tactiled
