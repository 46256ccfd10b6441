// The gains of taxels of one kind, from equations that each contain several of them:
//
//     y = b (1 + e) + noise,   e_i ~ N(0, s^2),   var noise = sum_i v_i (1 + e_i)^2 + within + (spread scale)^2
//
// A row of b has the force of each taxel in a press, or its moment about the press's place, with the variance v of their
// noise. s and the spread of each kind of equation are those that the equations make most likely (empirical Bayes). A taxel
// that leaves the distribution of the others has a prior of its own. Sparse Cholesky factors; see Rasmussen, Williams,
// Gaussian Processes for Machine Learning, chapter 5, for the likelihood.
#pragma once
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <array>
#include <cstddef>
#include <vector>

namespace tactiled {

struct GainEquations {
    static constexpr std::size_t kForce = 0, kPlace = 1, kKinds = 2;
    using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;
    Matrix b, v;             // equations x taxels, in N or Nm and their squares
    Eigen::VectorXd y;       // N or Nm
    Eigen::VectorXd within;  // variance of the moment from unknown places within the taxels, (Nm)^2
    Eigen::VectorXd scale;   // N
    std::vector<std::size_t> kind, press, component;
};

class TaxelGains {
public:
    // `spread`: start values by kind. setup
    explicit TaxelGains(std::size_t taxels);

    // Sets s, the spreads, the gains and their sd; begins at the present ones. setup: throws Undetermined
    void fit(const GainEquations& equations);

    struct HeldOut {
        // Mean square of the error over the predicted sd, over the presses; errors of their forces relative to that sd
        double ratio2 = 1;
        std::vector<double> error, of_sd;  // equations of kind kForce, N
    };
    // Leaves each of five parts of the presses out. setup
    [[nodiscard]] HeldOut hold_out(const GainEquations& equations) const;
    // The sd of the factor that all forces have in common. setup: throws Undetermined
    [[nodiscard]] double common_sd(const GainEquations& equations) const;

    Eigen::VectorXd gain, sd;         // one for each taxel
    std::vector<std::uint8_t> other;  // has a prior of its own: its gain is far from those of the others
    double s = 0.1;
    std::array<double, GainEquations::kKinds> spread{0.03, 0.3e-3};  // relative, m

private:
    using Factor = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;
    struct Solution {
        Factor factor;
        Eigen::VectorXd error, prior, weight;  // e of each taxel, 1 / its prior variance; 1 / variance of each equation
        double fit = 0;                        // -2 log likelihood, less a constant
    };
    [[nodiscard]] Eigen::VectorXd variance_of(const GainEquations& equations) const;
    [[nodiscard]] bool solve(const GainEquations& equations, const Eigen::VectorXd& used, Solution& out) const;
    void search(const GainEquations& equations);
    bool find_others();

    Eigen::VectorXd own_;  // variance of a prior of its own
};

// Diagonal of x' A^-1 x for the columns of x. setup
Eigen::VectorXd quadratic_forms(const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>& a,
                                const Eigen::SparseMatrix<double>& x);

}  // namespace tactiled
