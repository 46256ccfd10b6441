#include "decoupling/fit/mlp_network.hpp"
#include "decoupling/solve/dense.hpp"

#include <cmath>
#include <random>
#include <utility>

namespace tactiled {
namespace {

constexpr double kMaxDamping = 1e12;

Eigen::MatrixXd with_bias(const Eigen::MatrixXd& u) {
    Eigen::MatrixXd result(u.rows(), 1 + u.cols());
    result << Eigen::VectorXd::Ones(u.rows()), u;
    return result;
}

Eigen::MatrixXd hidden_values(const MlpNetwork& network, const Eigen::MatrixXd& u) {
    return ((u * network.hidden.rightCols(u.cols()).transpose()).rowwise() + network.hidden.col(0).transpose())
        .array()
        .tanh();
}

// Returns values - y, 0 where y is unknown.
Eigen::MatrixXd errors_of(const Eigen::MatrixXd& values, const Eigen::MatrixXd& y) {
    return y.array().isNaN().select(0, values - y);
}

// Influence function of Huber's loss: the error, limited.
Eigen::MatrixXd influence_of(const Eigen::MatrixXd& error) { return error.cwiseMin(kMlpHuber).cwiseMax(-kMlpHuber); }

}  // namespace

Eigen::MatrixXd MlpNetwork::values(const Eigen::MatrixXd& u) const {
    return (hidden_values(*this, u) * output.rightCols(output.cols() - 1).transpose()).rowwise() + output.col(0).transpose();
}

MlpNetwork mlp_start(const MlpRows& rows, Eigen::Index neurons, double decay, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const Eigen::Index inputs = rows.u.cols();
    std::normal_distribution<double> normal(0, 1 / std::sqrt(double(inputs)));
    MlpNetwork network{.hidden = Eigen::MatrixXd(neurons, 1 + inputs),
                       .output = Eigen::MatrixXd::Zero(rows.y.cols(), 1 + neurons)};
    for (Eigen::Index j = 0; j < neurons; ++j) {
        for (Eigen::Index k = 1; k <= inputs; ++k) network.hidden(j, k) = normal(random);
        // The neuron's argument is zero at one of the rows, so that the tanh is curved within the rows.
        const auto row = Eigen::Index(random() % std::uint64_t(rows.u.rows()));
        network.hidden(j, 0) = -network.hidden.row(j).tail(inputs).dot(rows.u.row(row));
    }
    const Eigen::MatrixXd h = with_bias(hidden_values(network, rows.u));
    for (Eigen::Index c = 0; c < rows.y.cols(); ++c) {
        const Eigen::ArrayXd known = rows.y.col(c).array().isNaN().select(0.0, Eigen::ArrayXd::Ones(rows.y.rows()));
        const Eigen::VectorXd y = rows.y.col(c).array().isNaN().select(0.0, rows.y.col(c));
        Eigen::MatrixXd gram = h.transpose() * (h.array().colwise() * known).matrix();
        gram.diagonal().array() += std::max(decay, 1e-6) * double(rows.u.rows());
        network.output.row(c) = dense::solve_by_ldlt(gram, h.transpose() * y).transpose();
    }
    return network;
}

double mlp_cost(const MlpNetwork& network, const MlpRows& rows, double decay) {
    const Eigen::ArrayXXd size = errors_of(network.values(rows.u), rows.y).array().abs();
    const double loss = (size <= kMlpHuber).select(size.square() / 2, kMlpHuber * (size - kMlpHuber / 2)).sum();
    return loss + decay * double(rows.u.rows()) * (network.hidden.squaredNorm() + network.output.squaredNorm()) / 2;
}

MlpNetwork mlp_gradient(const MlpNetwork& network, const MlpRows& rows, double decay) {
    const Eigen::MatrixXd h = hidden_values(network, rows.u), h1 = with_bias(h);
    const Eigen::MatrixXd influence = influence_of(errors_of(h1 * network.output.transpose(), rows.y));
    const Eigen::MatrixXd of_h =
        (influence * network.output.rightCols(h.cols())).cwiseProduct((1 - h.array().square()).matrix());
    const double n = decay * double(rows.u.rows());
    return {of_h.transpose() * with_bias(rows.u) + n * network.hidden, influence.transpose() * h1 + n * network.output};
}

MlpSolver::MlpSolver(const MlpRows& rows, MlpNetwork start, double decay)
    : rows_(rows), network_(std::move(start)), decay_(decay), cost_(mlp_cost(network_, rows, decay)) {}

bool MlpSolver::step() {
    const Eigen::Index n = rows_.u.rows(), m = network_.hidden.rows(), n1 = network_.hidden.cols();
    const Eigen::Index components = network_.output.rows(), m1 = 1 + m, size = m * n1 + components * m1;
    const Eigen::MatrixXd u = with_bias(rows_.u), h = hidden_values(network_, rows_.u), h1 = with_bias(h);
    const Eigen::MatrixXd error = errors_of(h1 * network_.output.transpose(), rows_.y);
    const Eigen::MatrixXd influence = influence_of(error);
    const Eigen::MatrixXd slope = 1 - h.array().square();
    const Eigen::MatrixXd out = network_.output.rightCols(m);

    // Gradient. Parameters: hidden, neuron by neuron, then output, component by component.
    const MlpNetwork derivative = mlp_gradient(network_, rows_, decay_);
    Eigen::VectorXd gradient(size);
    for (Eigen::Index j = 0; j < m; ++j) gradient.segment(j * n1, n1) = derivative.hidden.row(j);
    for (Eigen::Index c = 0; c < components; ++c) gradient.segment(m * n1 + c * m1, m1) = derivative.output.row(c);

    // Gauss-Newton Hessian. The square root of a row's weight is the mean, over its components, of Huber's weights.
    Eigen::ArrayXd root = Eigen::ArrayXd::Zero(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        for (Eigen::Index c = 0; c < components; ++c)
            if (!std::isnan(rows_.y(i, c))) root[i] += error(i, c) == 0 ? 1 : influence(i, c) / error(i, c);
        root[i] = std::sqrt(root[i] / double(components));
    }
    Eigen::MatrixXd z(n, m * n1);
    for (Eigen::Index j = 0; j < m; ++j) z.middleCols(j * n1, n1) = u.array().colwise() * (slope.col(j).array() * root);
    const Eigen::MatrixXd weighted_h1 = h1.array().colwise() * root;
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(size, size);
    Eigen::MatrixXd zz = Eigen::MatrixXd::Zero(m * n1, m * n1);
    zz.selfadjointView<Eigen::Lower>().rankUpdate(z.transpose());
    const Eigen::MatrixXd hz = weighted_h1.transpose() * z, hh = weighted_h1.transpose() * weighted_h1;
    const Eigen::MatrixXd coupling = out.transpose() * out;
    for (Eigen::Index j = 0; j < m; ++j)
        for (Eigen::Index k = 0; k <= j; ++k)
            hessian.block(j * n1, k * n1, n1, n1) = coupling(j, k) * zz.block(j * n1, k * n1, n1, n1);
    for (Eigen::Index c = 0; c < components; ++c) {
        const Eigen::Index at = m * n1 + c * m1;
        for (Eigen::Index j = 0; j < m; ++j) hessian.block(at, j * n1, m1, n1) = out(c, j) * hz.middleCols(j * n1, n1);
        hessian.block(at, at, m1, m1) = hh;
    }
    hessian.diagonal().array() += decay_ * double(n);

    const Eigen::VectorXd diagonal = hessian.diagonal().array() + 1e-9 * hessian.diagonal().maxCoeff();
    for (; damping_ < kMaxDamping; damping_ *= growth_, growth_ *= 2) {
        Eigen::MatrixXd damped = hessian;
        damped.diagonal() += damping_ * diagonal;
        const std::optional<Eigen::VectorXd> solved = dense::try_solve_by_llt(damped, gradient);
        if (!solved) continue;
        const Eigen::VectorXd step = -*solved;
        MlpNetwork next = network_;
        for (Eigen::Index j = 0; j < m; ++j) next.hidden.row(j) += step.segment(j * n1, n1);
        for (Eigen::Index c = 0; c < components; ++c) next.output.row(c) += step.segment(m * n1 + c * m1, m1);
        const double cost = mlp_cost(next, rows_, decay_);
        if (!(cost < cost_)) continue;
        const double promised = -gradient.dot(step) / 2 + damping_ * step.cwiseAbs2().dot(diagonal) / 2;
        const double gain = promised > 0 ? (cost_ - cost) / promised : 1;
        damping_ = std::max(1e-9, damping_ * std::max(1.0 / 3, 1 - std::pow(2 * gain - 1, 3)));
        growth_ = 2;
        network_ = std::move(next);
        cost_ = cost;
        return true;
    }
    return false;
}

}  // namespace tactiled
