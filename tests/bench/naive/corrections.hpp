// Straightforward code for the nonlinear methods of model "generic": vectors of vectors, a new one at each step.
#pragma once
#include <cmath>
#include <vector>

#include "naive/linear.hpp"

namespace naive {

using Numbers = std::vector<double>;
using Table = std::vector<Numbers>;

inline double dot(const Numbers& a, const Numbers& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
}

inline Numbers quadratic(const Table& q, const Numbers& u) {
    Numbers features{1}, out;
    for (double x : u) features.push_back(x);
    for (std::size_t k = 0; k < u.size(); ++k)
        for (std::size_t j = k; j < u.size(); ++j) features.push_back(u[k] * u[j]);
    for (const auto& row : q) out.push_back(dot(row, features));
    return out;
}

inline Numbers rbf(const Table& centres, const Table& weights, double spread, const Numbers& u) {
    Numbers basis, out;
    for (const auto& centre : centres) {
        double distance = 0;
        for (std::size_t k = 0; k < u.size(); ++k) distance += std::pow(u[k] - centre[k], 2);
        basis.push_back(1 / (1 + std::pow(std::sqrt(distance) / spread, 2)));
    }
    for (const auto& row : weights) out.push_back(dot(row, basis));
    return out;
}

inline Numbers layer(const Table& weights, const Numbers& in) {
    Numbers with_bias{1}, out;
    with_bias.insert(with_bias.end(), in.begin(), in.end());
    for (const auto& row : weights) out.push_back(dot(row, with_bias));
    return out;
}

// The affine map and what the method adds.
class Corrected {
public:
    explicit Corrected(const tactiled::Calibration& c) : calibration_(c), affine_(c) {}
    tactiled::Wrench operator()(const Numbers& channel) {
        tactiled::Wrench wrench = affine_(channel);
        Numbers u;
        for (std::size_t k = 0; k < channel.size(); ++k)
            u.push_back((channel[k] - calibration_.zero[k]) / calibration_.tables.at("width").front()[k]);
        const auto add = [&](const Numbers& more) {
            for (std::size_t i = 0; i < more.size(); ++i)
                wrench[tactiled::component_index(calibration_.components[i])] += more[i];
        };
        const auto& tables = calibration_.tables;
        if (tables.count("quadratic") != 0) add(quadratic(tables.at("quadratic"), u));
        if (tables.count("centres") != 0)
            add(rbf(tables.at("centres"), tables.at("weights"), calibration_.parameters.at("spread"), u));
        if (tables.count("layer2") != 0) {
            Numbers hidden = layer(tables.at("layer1"), u);
            for (double& value : hidden) value = std::tanh(value);
            add(layer(tables.at("layer2"), hidden));
        }
        return wrench;
    }

private:
    tactiled::Calibration calibration_;
    Affine affine_;
};

}  // namespace naive
