// Eigen's decompositions of matrices of any size, compiled once, in dense.cpp: each file that instantiates them takes
// 10 s longer to compile.
#pragma once
#include <Eigen/Dense>

extern template class Eigen::JacobiSVD<Eigen::MatrixXd>;
extern template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;
