// Eigen's decompositions of matrices of any size, compiled once, in dense.cpp: in each file that names them they take 10 s more.
#pragma once
#include <Eigen/Dense>

extern template class Eigen::JacobiSVD<Eigen::MatrixXd>;
extern template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;
