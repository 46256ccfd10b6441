// Least squares against coefficients that NIST certifies: a real load cell, badly scaled.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

TEST(Certified, TheQuadraticOfALoadCellHasNistsCoefficients) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/pontius/pontius.csv");
    std::string line;
    std::getline(file, line);
    std::vector<double> load, deflection;
    while (std::getline(file, line)) {
        load.push_back(std::stod(line));
        deflection.push_back(std::stod(line.substr(line.find(',') + 1)));
    }
    ASSERT_EQ(load.size(), 40u);
    const Eigen::Map<const Eigen::ArrayXd> x(load.data(), 40);
    const Eigen::Map<const Eigen::VectorXd> y(deflection.data(), 40);
    Eigen::MatrixXd a(40, 3);
    a << Eigen::VectorXd::Ones(40), x.matrix(), x.square().matrix();
    const LeastSquares fit = least_squares(a, y);
    ASSERT_TRUE(fit.dependent.empty());
    // NIST StRD, Pontius: B0 B1 B2 and the residual standard deviation.
    const double certified[] = {0.673565789473684E-03, 0.732059160401003E-06, -0.316081871345029E-14};
    for (Eigen::Index i = 0; i < 3; ++i) EXPECT_NEAR(fit.coefficient[i] / certified[i], 1, 1e-10) << "B" << i;
    EXPECT_NEAR((y - a * fit.coefficient).norm() / std::sqrt(37.0) / 0.205177424076185E-03, 1, 1e-9);
}

}  // namespace
}  // namespace tactiled
