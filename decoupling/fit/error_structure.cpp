#include "decoupling/fit/error_structure.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "decoupling/fit/groups.hpp"
#include "decoupling/solve/load_scale.hpp"

namespace tactiled {
namespace {

// The errors of the held-out rows in units of their stated sd, in the order of the file: NaN where one is not known.
struct Errors {
    std::vector<HeldOut> rows;
    std::vector<std::size_t> load;  // number of each row's load
    Eigen::MatrixXd of_sd;          // rows x components
};

Errors errors_of(const Validation& validation, const Calibration& calibration) {
    Errors errors{.rows = validation.drifted.empty() ? validation.rows : validation.drifted, .load = {}, .of_sd = {}};
    std::ranges::stable_sort(errors.rows, {}, [](const HeldOut& one) { return one.row->line; });
    Rows rows;
    for (const HeldOut& one : errors.rows) rows.push_back(one.row);
    errors.load = loads_of(rows);
    const auto n = Eigen::Index(calibration.components.size());
    errors.of_sd.resize(Eigen::Index(rows.size()), n);
    for (Eigen::Index i = 0; i < errors.of_sd.rows(); ++i) {
        const HeldOut& one = errors.rows[std::size_t(i)];
        for (Eigen::Index k = 0; k < n; ++k) {
            const std::size_t c = component_index(calibration.components[std::size_t(k)]);
            errors.of_sd(i, k) =
                (one.estimated_S[c] - one.row->wrench_S[c]) / stated_sd(calibration, std::size_t(k), one.estimated_S);
        }
    }
    return errors;
}

// Returns the noise of each component: the second difference of three rows of one load, e - 2 e' + e'', has six times the
// variance of their noise, and no part of an error that a load has in common or that drifts. The smaller one of the lighter
// and the heavier half of the loads, because what is taken for noise is taken to average.
std::vector<double> noise_of(const Errors& errors, const Calibration& calibration) {
    constexpr std::size_t kEnough = 30;  // second differences: their rms is known within 20 %
    struct Step {
        double load;
        Eigen::Index row;
    };
    std::vector<Step> steps;
    for (std::size_t i = 2; i < errors.rows.size(); ++i)
        if (errors.load[i] == errors.load[i - 2] && errors.rows[i].row->line == errors.rows[i - 2].row->line + 2)
            steps.push_back({LoadScale(calibration).of(errors.rows[i].row->wrench_S), Eigen::Index(i)});
    if (steps.size() < 2 * kEnough) return {};
    std::ranges::stable_sort(steps, {}, &Step::load);
    std::vector<double> noise;
    for (std::size_t k = 0; k < calibration.components.size(); ++k) {
        const std::size_t c = component_index(calibration.components[k]);
        const auto mean_square = [&](std::size_t begin, std::size_t end) {
            double sum = 0;
            std::size_t n = 0;
            for (std::size_t s = begin; s < end; ++s) {
                const auto error = [&](std::size_t back) {
                    const HeldOut& one = errors.rows[std::size_t(steps[s].row) - back];
                    return one.estimated_S[c] - one.row->wrench_S[c];
                };
                const double bend = error(0) - 2 * error(1) + error(2);
                if (!std::isfinite(bend)) continue;
                sum += bend * bend / 6;
                ++n;
            }
            return n < kEnough ? 0 : sum / double(n);
        };
        const std::size_t half = steps.size() / 2;
        noise.push_back(std::sqrt(std::min(mean_square(0, half), mean_square(half, steps.size()))));
    }
    return noise;
}

// Returns the correlation of each pair of components: the rows above the diagonal. Missing labels may make the matrix
// indefinite; it is then mixed with that of independent errors.
std::vector<double> correlation_of(const Errors& errors) {
    const Eigen::Index n = errors.of_sd.cols();
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(n, n);
    for (Eigen::Index a = 0; a < n; ++a)
        for (Eigen::Index b = a + 1; b < n; ++b) {
            double both = 0, of_a = 0, of_b = 0;
            for (Eigen::Index i = 0; i < errors.of_sd.rows(); ++i) {
                const double x = errors.of_sd(i, a), y = errors.of_sd(i, b);
                if (!std::isfinite(x * y)) continue;
                both += x * y;
                of_a += x * x;
                of_b += y * y;
            }
            if (of_a > 0 && of_b > 0) matrix(a, b) = matrix(b, a) = both / std::sqrt(of_a * of_b);
        }
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues()[0];
    const double kept = least < 0 ? 1 / (1 - least) : 1;
    std::vector<double> result;
    for (Eigen::Index a = 0; a < n; ++a)
        for (Eigen::Index b = a + 1; b < n; ++b) result.push_back(std::clamp(kept * matrix(a, b), -1.0, 1.0));
    return result;
}

// A load that was held: its place in full scales, and the mean of the errors of its rows.
struct Held {
    Eigen::VectorXd place, error;
};

std::vector<Held> loads_held(const Errors& errors, const Calibration& calibration) {
    std::vector<Held> held;
    const Eigen::Index n = errors.of_sd.cols();
    for (std::size_t begin = 0, end = 0; begin < errors.rows.size(); begin = end) {
        while (end < errors.rows.size() && errors.load[end] == errors.load[begin]) ++end;
        const auto rows = errors.of_sd.middleRows(Eigen::Index(begin), Eigen::Index(end - begin));
        Held one{.place = Eigen::VectorXd::Zero(n), .error = rows.colwise().mean().transpose()};
        if (!one.error.allFinite()) continue;
        for (Eigen::Index k = 0; k < n; ++k)
            one.place[k] = errors.rows[begin].estimated_S[component_index(calibration.components[std::size_t(k)])] /
                           calibration.full_scale[std::size_t(k)];
        held.push_back(std::move(one));
    }
    return held;
}

// Returns {alike, within} by least squares over pairs of loads: the products of their errors, by the distance of the loads.
// `alike` is that of the component that repeats worst, because what is taken for alike is taken to cancel.
std::vector<double> alike_of(const std::vector<Held>& held) {
    constexpr std::size_t kEnough = 20, kPairs = 50'000;
    if (held.size() < kEnough) return {};
    Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(held.front().error.size());
    for (const Held& one : held) squares += one.error.array().square() / double(held.size());
    if (!(squares > 0).all()) return {};
    std::vector<std::pair<const Held*, const Held*>> pairs;
    std::mt19937_64 random(1);
    std::uniform_int_distribution<std::size_t> any(0, held.size() - 1);
    for (std::size_t p = 0; p < kPairs; ++p)
        if (const Held& a = held[any(random)], &b = held[any(random)]; &a != &b) pairs.emplace_back(&a, &b);
    double best = std::numeric_limits<double>::infinity();
    std::vector<double> result;
    for (double within = 4; within > 0.02; within /= std::numbers::sqrt2) {
        Eigen::ArrayXd both = Eigen::ArrayXd::Zero(squares.size());
        double of_kernel = 0;
        for (const auto& [a, b] : pairs) {
            const double kernel = 1 / (1 + (a->place - b->place).squaredNorm() / (within * within));
            both += kernel * a->error.array() * b->error.array() / squares;
            of_kernel += kernel * kernel;
        }
        // The sum of squares that remains is less by this, for each component.
        const Eigen::ArrayXd alike = (both / of_kernel).max(0).min(1);
        const double left = (alike * (alike * of_kernel - 2 * both)).sum();
        if (!(left < best)) continue;
        best = left;
        result = {alike.minCoeff(), within};
    }
    return result;
}

}  // namespace

void set_error_structure(const Validation& validation, Calibration& calibration) {
    for (auto* each : {&calibration.sd_noise, &calibration.correlation, &calibration.alike}) each->clear();
    if (calibration.sd.empty()) return;
    const Errors errors = errors_of(validation, calibration);
    calibration.sd_noise = noise_of(errors, calibration);
    for (std::size_t i = 0; i < calibration.sd_noise.size(); ++i)
        calibration.sd_noise[i] = std::min(calibration.sd_noise[i], calibration.sd[i]);
    calibration.correlation = correlation_of(errors);
    calibration.alike = alike_of(loads_held(errors, calibration));
}

}  // namespace tactiled
