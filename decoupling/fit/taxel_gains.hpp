// The gains of taxels of one kind, from equations that each contain several of them:
//
//     y = b (1 + e) + noise,    var noise = sum_i v_i (1 + e_i)^2 + hidden + (spread scale)^2
//     e_i ~ N(0, s^2 / u_i),    u_i ~ Gamma(nu / 2, nu / 2),    that is e_i / s ~ Student's t with nu degrees of freedom
//
// A row of b has the force of each taxel in a press, or its moment about the press's place, with the variance v of their
// noise. The tails of the t distribution are heavy, so that it is more likely that one taxel is far from the others than
// that several are somewhat off: a weak taxel keeps its error to itself. The posterior of e and u is sampled by turns
// (Gibbs; Geweke, J. Applied Econometrics 8, S19, 1993), because it can have two maxima where a taxel has little load; gains
// are its means and sd its sd. s and the spread of each kind of equation are those that the equations make most likely
// (Rasmussen, Williams, Gaussian Processes for Machine Learning, chapter 5). The random numbers are the same in each run.
#pragma once
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace tactiled {

struct GainEquations {
    static constexpr std::size_t kForce = 0, kPlace = 1, kKinds = 2;
    using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;
    Matrix b, v;             // equations x taxels, in N or Nm and their squares
    Eigen::VectorXd y;       // N or Nm
    Eigen::VectorXd scale;   // N
    Eigen::VectorXd hidden;  // variance of what dead taxels carry
    std::vector<std::size_t> kind, press;
};

// Equations while they are made: begin() one, and add to it.
class EquationMaker {
public:
    explicit EquationMaker(std::size_t taxels) : taxels_(Eigen::Index(taxels)) {}
    void begin(std::size_t kind, std::size_t press);
    void add_right(double y, double scale) { y_.back() += y, scale_.back() += scale; }
    void add_taxel(std::size_t taxel, double force, double variance);
    // A dead taxel carries what is predicted for it; the errors of those in one equation may have one cause.
    void add_hidden(double force, double sd) { y_.back() -= force, hidden_sd_.back() += std::abs(sd); }
    [[nodiscard]] GainEquations take();

private:
    Eigen::Index taxels_;
    std::vector<Eigen::Triplet<double>> b_, v_;
    std::vector<double> y_, scale_, hidden_sd_;
    std::vector<std::size_t> kind_, press_;
};

class TaxelGains {
public:
    explicit TaxelGains(std::size_t taxels);

    // Sets s, the spreads, the gains and their sd; begins at the present ones. setup: throws Undetermined
    void fit(const GainEquations& equations);
    // The sd of a normal distribution that has the quartiles of the t distribution.
    [[nodiscard]] double bulk_sd() const { return 1.134 * s; }

    struct HeldOut {
        // Mean square of the error over the predicted sd, over the presses; errors of their forces relative to that sd
        double ratio2 = 1;
        std::vector<double> error, of_sd;  // equations of kind kForce, N
    };
    // Leaves each of five parts of the presses out. setup
    [[nodiscard]] HeldOut hold_out(const GainEquations& equations) const;
    // The relative sd of the sum of all presses: that of the factor which all forces have in common. setup: throws
    // Undetermined
    [[nodiscard]] double common_sd(const GainEquations& equations) const;

    Eigen::VectorXd gain, sd;  // one for each taxel
    // 99 % of the samples are beyond the level that noise alone reaches in 1 of 100 arrays.
    std::vector<std::uint8_t> is_far;
    double s = 0.1;
    std::array<double, GainEquations::kKinds> spread{0.03, 0.3e-3};  // relative, m

private:
    using Sparse = Eigen::SparseMatrix<double>;
    using Factor = Eigen::SimplicialLDLT<Sparse>;
    // Weighted sums of the equations: information b' W b, right side b' W (y - b 1).
    struct Normal {
        Sparse information;
        Eigen::VectorXd right;
        double fit = 0;  // part of -2 log likelihood that does not depend on the prior
    };
    struct Sums {  // means over the samples; `far`: the part of them beyond the level
        Eigen::VectorXd error, square, u, far;
    };
    [[nodiscard]] Eigen::VectorXd variance_of(const GainEquations& equations) const;
    [[nodiscard]] Normal normal(const GainEquations& equations, const Eigen::VectorXd& used) const;
    [[nodiscard]] bool factorise(const Normal& normal, const Eigen::VectorXd& u, Factor& out) const;
    [[nodiscard]] double misfit(const GainEquations& equations, Factor& factor) const;
    void search(const GainEquations& equations, double step);
    [[nodiscard]] Sums chain(const Normal& normal, int sweeps, std::uint64_t seed) const;
    [[nodiscard]] Sums sample(const Normal& normal, int sweeps, std::uint64_t seed) const;

    Eigen::VectorXd u_;  // means of the sampled ones
};

}  // namespace tactiled
