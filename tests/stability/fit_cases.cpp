// Hard cases of calibrations: badly scaled, collinear or repeated data, wrong labels, axes without load.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <boost/multiprecision/eigen.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/fit/recursive.hpp"
#include "decoupling/fit/row_sums.hpp"
#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"

namespace tactiled::stability {
namespace {

using RealMatrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using RealVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

// In 100 digits the normal equations are good enough.
RealVector exact_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& y) {
    const RealMatrix A = a.cast<Real>();
    const RealMatrix gram = A.transpose() * A;
    const RealVector right = A.transpose() * y.cast<Real>();
    return Eigen::PartialPivLU<RealMatrix>(gram).solve(right);
}

double normal_equations(const Eigen::MatrixXd& a, const Eigen::VectorXd& y, Eigen::Index i) {
    const Eigen::MatrixXd gram = a.transpose() * a;
    const Eigen::VectorXd right = a.transpose() * y;
    return Eigen::PartialPivLU<Eigen::MatrixXd>(gram).solve(right)[i];
}

// Condition of coefficient i of a least-squares problem whose columns are scaled to length 1: how errors of the
// columns and of y reach it (Golub and Van Loan, 5.3.8, with a small residual). It does not use the code under test.
double kappa_of(const Eigen::MatrixXd& a, const Eigen::VectorXd& y, const RealVector& exact, Eigen::Index i) {
    const Eigen::VectorXd lengths = a.colwise().norm();
    const Eigen::VectorXd scaled = exact.cast<double>().array() * lengths.array();
    const RealVector unexplained = y.cast<Real>() - a.cast<Real>() * exact;
    const Eigen::VectorXd rest = unexplained.cast<double>();
    const Eigen::MatrixXd unit = a.array().rowwise() / lengths.transpose().array();
    const Eigen::VectorXd s = Eigen::JacobiSVD<Eigen::MatrixXd>(unit).singularValues();
    const double k = s[0] / s[s.size() - 1];
    return (k * scaled.norm() + k * k * rest.norm() + k * y.norm()) / std::abs(scaled[i]);
}

void compare(Cases& cases, const char* id, const char* what, const Eigen::MatrixXd& a, const Eigen::VectorXd& y,
             Eigen::Index i) {
    const RealVector exact = exact_least_squares(a, y);
    cases.value(id, what,
                {normal_equations(a, y, i), least_squares(a, y).coefficient[i], exact[i], kappa_of(a, y, exact, i), 8});
}

void add_least_squares(Cases& cases) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/pontius/pontius.csv");
    std::string line;
    std::getline(file, line);
    std::vector<double> load, deflection;
    while (std::getline(file, line)) {
        load.push_back(std::stod(line));
        deflection.push_back(std::stod(line.substr(line.find(',') + 1)));
    }
    const auto n = Eigen::Index(load.size());
    const Eigen::Map<const Eigen::ArrayXd> x(load.data(), n);
    const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(deflection.data(), n);
    Eigen::MatrixXd a(n, 3);
    a << Eigen::VectorXd::Ones(n), x.matrix(), x.square().matrix();
    compare(cases, "H11", "NIST's load cell, a quadratic with columns of 1 to 1e13: B0", a, y, 0);
    // H10 as far as the product goes: three gains that differ by 1e-6.
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> any(-1, 1);
    Eigen::MatrixXd near(60, 3);
    Eigen::VectorXd force(60);
    for (Eigen::Index i = 0; i < 60; ++i) {
        const double common = any(random);
        near.row(i) << common + 1e-6 * any(random), common + 1e-6 * any(random), any(random);
        force[i] = 0.3 * near(i, 0) - 0.2 * near(i, 1) + near(i, 2);
    }
    compare(cases, "H10b", "two channels that differ by 1e-6: a gain", near, force, 0);
    Eigen::MatrixXd hilbert(12, 5);
    for (Eigen::Index i = 0; i < 12; ++i)
        for (Eigen::Index j = 0; j < 5; ++j) hilbert(i, j) = 1 / double(i + j + 1);
    compare(cases, "F1", "Hilbert's matrix, 12 x 5", hilbert, hilbert * Eigen::VectorXd::Ones(5), 2);
    // Channels with a rest of 1e9 and a signal of 1: the means taken off twice.
    const int m = 50;
    Eigen::MatrixXd raised(m, 1);
    Eigen::VectorXd label(m);
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (int i = 0; i < m; ++i) {
        raised(i, 0) = 1e9 + 0.1 * i;
        label[i] = 0.5 * i + 1;
        sx += raised(i, 0), sy += label[i], sxx += raised(i, 0) * raised(i, 0), sxy += raised(i, 0) * label[i];
    }
    Eigen::MatrixXd with_one(m, 2);
    with_one << Eigen::VectorXd::Ones(m), raised;
    cases.value("F2", "a gain from a channel of 1e9 +- 2.5",
                {(m * sxy - sx * sy) / (m * sxx - sx * sx), affine_fit(raised, label).slope.coefficient[0],
                 exact_least_squares(with_one, label)[1], 2, 16});
}

Normal normal_of(const Eigen::MatrixXd& features) {
    Normal normal(features.cols(), 0);
    normal.add(features, Eigen::MatrixXd(features.rows(), 0));
    return normal;
}

void add_kernels(Cases& cases) {
    // H15, H37: 12 kernels with a spread of 50 on [0, 1], and every row twice: a Gram matrix of condition 1e30. With
    // a ridge its condition is 1 / ridge; the predictions are compared, as the weights themselves are not used.
    constexpr Eigen::Index n = 12;
    Eigen::MatrixXd features(2 * n, n);
    Eigen::VectorXd y(2 * n);
    const auto kernel = [](double x, double centre) { return 1 / (1 + (x - centre) * (x - centre) / 2500); };
    Eigen::VectorXd at(n);
    for (Eigen::Index i = 0; i < 2 * n; ++i) {
        const double x = double(i % n) / double(n - 1);
        y[i] = std::sin(3 * x) + x * x;
        for (Eigen::Index j = 0; j < n; ++j) features(i, j) = kernel(x, double(j) / double(n - 1));
    }
    for (Eigen::Index j = 0; j < n; ++j) at[j] = kernel(0.4567, double(j) / double(n - 1));
    const double ridge = 1e-7;
    const Eigen::VectorXd right = features.transpose() * y;
    const double ours = at.dot(normal_of(features).solve(right, ridge).col(0));
    RealMatrix gram = features.cast<Real>().transpose() * features.cast<Real>();
    gram.diagonal().array() += Real(ridge) * Real(2.0 * double(n));
    const RealVector exact_right = features.cast<Real>().transpose() * y.cast<Real>();
    const RealVector w = Eigen::PartialPivLU<RealMatrix>(gram).solve(exact_right);
    const Eigen::MatrixXd plain = features.transpose() * features;
    cases.value("H15", "kernels with a spread of 50 widths, a prediction",
                {at.dot(Eigen::PartialPivLU<Eigen::MatrixXd>(plain).solve(right)), ours, at.cast<Real>().dot(w),
                 double(n) / ridge, 8});
    Eigen::MatrixXd twice(6, 3);
    twice << 1, 1, 0.2, 0.5, 0.5, 1, 0.1, 0.1, 0.3, 0.9, 0.9, 0.4, 0.3, 0.3, 0.8, 0.7, 0.7, 0.1;
    const Eigen::VectorXd target = twice * Eigen::Vector3d(0.5, 0.5, -1);
    RealMatrix twice_gram = twice.cast<Real>().transpose() * twice.cast<Real>();
    twice_gram.diagonal().array() += Real(1e-9) * 6;
    const RealVector exact_target = twice.cast<Real>().transpose() * target.cast<Real>();
    const RealVector v = Eigen::PartialPivLU<RealMatrix>(twice_gram).solve(exact_target);
    const Eigen::VectorXd twice_right = twice.transpose() * target;
    const Eigen::Vector3d there(1, 1, 0);  // a row whose two equal channels are 1
    const Eigen::MatrixXd twice_plain = twice.transpose() * twice;
    const Eigen::VectorXd naive = Eigen::PartialPivLU<Eigen::MatrixXd>(twice_plain).solve(twice_right);
    // Equal channels ask for the sum of their weights alone, so the ridge's own direction has no part in it: what counts is
    // the condition of the Gram matrix of that sum and the third.
    Eigen::MatrixXd asked(6, 2);
    asked << std::sqrt(2.0) * twice.col(0), twice.col(2);
    const Eigen::Vector2d s = Eigen::JacobiSVD<Eigen::MatrixXd>(asked).singularValues();
    const double kappa = s[0] * s[0] / (s[1] * s[1]);
    cases.value("H37", "the same kernel twice: a prediction",
                {there.dot(naive), there.dot(normal_of(twice).solve(twice_right, 1e-9).col(0)), v[0] + v[1], kappa, 64});
}

// The covariance form that every textbook prints.
struct TextbookRecursion {
    Eigen::Matrix3d P = 1e6 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    void update(const Eigen::Vector3d& x, double y, double forget) {
        const Eigen::Vector3d Px = P * x;
        const Eigen::Vector3d gain = Px / (forget + x.dot(Px));
        w += gain * (y - x.dot(w));
        P = ((P - gain * Px.transpose()) / forget).eval();
    }
};

void add_recursion(Cases& cases) {
    const Eigen::Vector3d truth(0.3, -0.2, 1);
    // H38: one direction excited by 1, one by 1e-3, one (2 -1 -1) never. Its predictions are judged; 1 / (1 - forget)
    // rows are remembered, each a rounding of R, whose condition is 1e3 in what is excited.
    {
        RecursiveLeastSquares recursive(Eigen::Vector3d::Zero(), 0.999);
        TextbookRecursion textbook;
        Eigen::VectorXd x(3);
        for (long i = 0; i < cases.updates; ++i) {
            const double s = 1e-3 * std::sin(double(i % 1'000'000) * 0.37);
            x << 1, 1 + s, 1 - s;
            recursive.update(x, x.dot(truth));
            textbook.update(x, x.dot(truth), 0.999);
        }
        x << 1, 1.001, 0.999;
        const Real exact = Real(truth[0]) + Real(1.001) * Real(truth[1]) + Real(0.999) * Real(truth[2]);
        // Held back to a start of 0 by kHold^2 = 1e-6 beside the 5e-4 of information of the poorly excited direction, which
        // is 1e-3 of the prediction: 1.2 * 1e-3 / 500 / 1.1; and beside 3,000 of the well excited one.
        cases.value("H38", fmt::format("a recursion with poor excitation, {} updates: a prediction", cases.updates),
                    {x.dot(textbook.w), x.dot(recursive.coefficient()), exact, 1e6, 8, 1.2e-3 / 500 / 1.1 + 1e-6 / 1000});
    }
    // H17: nothing excites it for 100,000 rows at 0.99; then three rows do.
    RecursiveLeastSquares recursive(truth, 0.99);
    TextbookRecursion textbook;
    for (int i = 0; i < 100'000; ++i) {
        recursive.update(Eigen::Vector3d::Zero(), 0);
        textbook.update(Eigen::Vector3d::Zero(), 0, 0.99);
    }
    const Eigen::Vector3d moved(0.5, -0.2, 1);
    for (int i = 0; i < 300; ++i) {
        const Eigen::Vector3d x(std::sin(i), std::cos(1.7 * i), std::sin(0.3 * i + 1));
        recursive.update(x, x.dot(moved));
        textbook.update(x, x.dot(moved), 0.99);
    }
    // 1e-6 of hold beside about 50 of information, 0.2 apart.
    cases.value("H17", "100,000 rows that excite nothing, then 300 that do: a weight",
                {textbook.w[0], recursive.coefficient()[0], Real(0.5), 10, 100, 3e-8});
}

// Rows of a session: fz (and fy) from channels, as a bench records them.
Labelled bench(std::size_t n, std::size_t channels, const std::function<void(std::size_t, LabelledRow&)>& fill) {
    Labelled labelled;
    labelled.name = "bench.csv";
    for (std::size_t k = 0; k < channels; ++k) labelled.channels.push_back(fmt::format("B{}", k + 1));
    for (std::size_t i = 0; i < n; ++i) {
        LabelledRow row{.line = std::int64_t(i) + 2,
                        .channel = std::vector<double>(channels),
                        .wrench_S = kUnseen,
                        .session = 0,
                        .t_ns = i * 1'000'000};
        fill(i, row);
        labelled.rows.push_back(row);
    }
    return labelled;
}

std::string refusal_of_fit(const Labelled& labelled, const std::string& method) {
    FitRequest request;
    request.model = "generic";
    request.method = method;
    try {
        (void)fit(labelled, request);
        return "";
    } catch (const std::exception& error) { return error.what(); }
}

double load_of(std::size_t i) { return 10 * std::sin(double(i) * 0.7) + 3 * std::cos(double(i) * 1.3); }

void add_labels(Cases& cases) {
    FitRequest request;
    request.model = "generic";
    request.method = "matrix";
    // R1: 2 of 50 labels swapped. R11: one misread by 30 %. The rest is exact, so the gain is, once they are left out.
    const auto swapped = bench(50, 1, [](std::size_t i, LabelledRow& row) {
        row.channel[0] = 2 * load_of(i);
        row.wrench_S[1] = load_of(i == 15 ? 17 : i == 17 ? 15 : i);
    });
    const auto misread = bench(50, 1, [](std::size_t i, LabelledRow& row) {
        row.channel[0] = 2 * load_of(i);
        row.wrench_S[1] = load_of(i) * (i == 2 ? 1.3 : 1);
    });
    const struct {
        const char *id, *what;
        const Labelled& rows;
    } wrong[] = {{"R1", "two of 50 labels swapped: the gain", swapped},
                 {"R11", "one of 50 labels misread by 30 %: the gain", misread}};
    for (const auto& one : wrong) {
        Eigen::MatrixXd x(50, 1);
        Eigen::VectorXd y(50);
        for (Eigen::Index i = 0; i < 50; ++i)
            x(i, 0) = one.rows.rows[std::size_t(i)].channel[0], y[i] = one.rows.rows[std::size_t(i)].wrench_S[1];
        const FitReport report = fit(one.rows, request);
        // Labels of 13 N are doubles rounded to 2^-53 each; 50 of them.
        cases.value(one.id, one.what,
                    {affine_fit(x, y).slope.coefficient[0], report.calibration.matrix[0][0], Real(0.5), 1, 50});
    }
    // H31: the spread of labels on a large offset.
    const auto offset = bench(16, 1, [](std::size_t i, LabelledRow& row) {
        row.wrench_S[2] = 1e9 + double(std::array{4, 7, 13, 16}[i % 4]);
        row.channel[0] = row.wrench_S[2] + std::sin(double(i));
    });
    double sum = 0, squares = 0;
    for (const auto& row : offset.rows) sum += row.wrench_S[2], squares += row.wrench_S[2] * row.wrench_S[2];
    cases.value("H31", "spread of labels with an offset of 1e9",
                {std::sqrt(squares / 16 - sum / 16 * (sum / 16)), fit(offset, request).components[0].spread,
                 sqrt(Real(45) / 2), 1, 8});
}

void add_refusals(Cases& cases) {
    const auto refuse = [&](const char* id, const char* what, double naive, const Labelled& labelled, const char* method,
                            const char* because) {
        cases.refused(id, what, naive, refusal_of_fit(labelled, method), because);
    };
    // The shortest solution of the textbook's pseudo-inverse.
    refuse("F3", "an axis that nobody loaded", 0,
           bench(60, 2,
                 [](std::size_t i, LabelledRow& row) {
                     row.channel = {load_of(i), load_of(i + 5)};
                     row.wrench_S[1] = 0, row.wrench_S[2] = load_of(i);
                 }),
           "matrix", "always 0");
    refuse("F4", "two axes that were only loaded together", 0.5,
           bench(60, 2,
                 [](std::size_t i, LabelledRow& row) {
                     row.channel = {load_of(i), load_of(i) + 0.1 * load_of(i + 5)};
                     row.wrench_S[1] = load_of(i), row.wrench_S[2] = 2 * load_of(i);
                 }),
           "matrix", "follow from each other");
    refuse("F5", "a channel that repeats another", 0.5,
           bench(60, 2,
                 [](std::size_t i, LabelledRow& row) {
                     row.channel = {load_of(i), 3 * load_of(i) + 1};
                     row.wrench_S[2] = load_of(i);
                 }),
           "matrix", "combination of each other");
    refuse("R3", "2,000 rows of 47 poses for a quadratic of 8 channels, 45 coefficients", 4.15,
           bench(1974, 8,
                 [](std::size_t i, LabelledRow& row) {
                     const std::size_t pose = i / 42;
                     for (std::size_t k = 0; k < 8; ++k) row.channel[k] = load_of(pose + 3 * k) + 1e-3 * load_of(7 * i + k);
                     row.wrench_S[2] = load_of(pose);
                 }),
           "quadratic", "independent rows");
    refuse("H37b", "kernels from 200 rows of three loads", 1,
           bench(200, 1,
                 [](std::size_t i, LabelledRow& row) {
                     row.wrench_S[2] = double(i / 70);
                     row.channel[0] = row.wrench_S[2] + 1e-3 * load_of(i);
                 }),
           "rbf", "3 loads");
}

}  // namespace

void add_fit_cases(Cases& cases) {
    add_least_squares(cases);
    add_kernels(cases);
    add_recursion(cases);
    add_labels(cases);
    add_refusals(cases);
}

}  // namespace tactiled::stability
