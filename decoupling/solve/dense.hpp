// Eigen's decompositions of matrices of any size, compiled once, in dense.cpp: 10 s more in each file that names them.
#pragma once
#include <Eigen/Dense>

extern template class Eigen::JacobiSVD<Eigen::MatrixXd>;
extern template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;
