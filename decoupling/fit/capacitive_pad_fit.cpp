// Model "capacitive", methods "ratio" and "overlap": the same unknowns, with the overlap to first order or exact.
// capacitive_fit.hpp has the equations. There are 14 unknowns: five zeros and active capacitances, K and q of the
// compression law, shear stiffness and its exponent p. A press alone hardly separates the active part of a
// capacitance from the stiffness (they differ at the third order of v), so weak priors fix the combinations that the
// data leave open: each has the weight of one reading.
#include "decoupling/fit/capacitive_fit.hpp"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/capacitive/methods.hpp"
#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

struct RowError {
    CapacitiveModel model;
    const LabelledRow* row;
    Wiring wiring;
    double noise;
    template <typename T>
    bool operator()(const T* p, T* error) const {
        T reading[kElectrodes];
        model(p, row->wrench_S, reading);
        for (std::size_t e = 0; e < kElectrodes; ++e) error[e] = (reading[e] - row->channel[std::size_t(wiring[e])]) / noise;
        return true;
    }
};

struct Prior {
    double log_active;
    template <typename T>
    bool operator()(const T* p, T* error) const {
        error[0] = p[kStiffening] / 0.3;  // finite elements: 0.1
        error[1] = p[kExponent];          // G A / d: 1; finite elements: -0.4
        error[2] = p[kLogActive + int(kCentre)] - log_active;
        return true;
    }
};

// Start values: slopes of the affine fit; half of Cn is active.
std::array<double, kUnknowns> first_guess(const Rows& rows, const Wiring& wiring, double pair_gain, double& noise) {
    Eigen::MatrixXd loads(Eigen::Index(rows.size()), 3);
    for (Eigen::Index i = 0; i < loads.rows(); ++i) {
        const Wrench& force = rows[std::size_t(i)]->wrench_S;
        loads.row(i) << force[0], force[1], -force[2];
    }
    std::array<double, kUnknowns> p{};
    std::array<Eigen::VectorXd, kElectrodes> slope;
    double squares = 0;
    for (std::size_t e = 0; e < kElectrodes; ++e) {
        Eigen::VectorXd readings(loads.rows());
        for (Eigen::Index i = 0; i < loads.rows(); ++i) readings[i] = rows[std::size_t(i)]->channel[std::size_t(wiring[e])];
        const Affine fitted = affine_fit(loads, readings);
        if (!fitted.slope.dependent.empty())
            throw Undetermined("fx_N, fy_N and fz_N do not vary independently of each other");
        slope[e] = fitted.slope.coefficient;
        p[kZero + e] = fitted.constant;
        squares += ((loads * slope[e]).array() + fitted.constant - readings.array()).matrix().squaredNorm();
        const double towards = kElectrode[e].along_x * slope[e][0] + kElectrode[e].along_y * slope[e][1];
        if (!(slope[e][2] > 0))
            throw Undetermined(fmt::format("{} falls by {:.3g} a N of press: it must rise (a press has fz < 0)",
                                           kElectrode[e].name, -slope[e][2]));
        if (e != kCentre && !(towards > 0))
            throw Undetermined(
                fmt::format("{} falls by {:.3g} a N of force towards it; C1 lies on +x, C2 on -x, C3 on +y, C4 on "
                            "-y (the thesis numbers C1 and C2 the other way)",
                            kElectrode[e].name, -towards));
    }
    if (!(p[kZero + kCentre] > 0))
        throw Undetermined("Cn at rest is not above 0: absolute capacitances are needed, not tared ones");
    noise = std::sqrt(squares / double(rows.size() * kElectrodes));
    const double stiffness = 0.5 * p[kZero + kCentre] / slope[kCentre][2];
    p[kLogStiffness] = std::log(stiffness);
    double log_shear = 0;
    for (std::size_t e = 0; e < kElectrodes; ++e) {
        const double active = slope[e][2] * stiffness;
        p[kLogActive + e] = std::log(active);
        if (e != kCentre) log_shear += std::log(active * pair_gain / std::abs(slope[e][e / 2])) / kCentre;
    }
    p[kLogShear] = log_shear;
    return p;
}

// Condition number of the data alone, with columns scaled to length 1, so that the influence of the priors is
// visible.
double condition_of(ceres::Problem& problem, const std::vector<ceres::ResidualBlockId>& data) {
    ceres::Problem::EvaluateOptions options;
    options.residual_blocks = data;
    options.apply_loss_function = false;
    ceres::CRSMatrix sparse;
    if (!problem.Evaluate(options, nullptr, nullptr, nullptr, &sparse)) return 0;
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
    for (int i = 0; i < sparse.num_rows; ++i)
        for (int at = sparse.rows[std::size_t(i)]; at < sparse.rows[std::size_t(i) + 1]; ++at)
            a(i, sparse.cols[std::size_t(at)]) = sparse.values[std::size_t(at)];
    for (Eigen::Index k = 0; k < a.cols(); ++k)
        if (const double length = a.col(k).norm(); length > 0) a.col(k) /= length;
    const Eigen::VectorXd s = a.colPivHouseholderQr()
                                  .matrixR()
                                  .topRows(a.cols())
                                  .triangularView<Eigen::Upper>()
                                  .toDenseMatrix()
                                  .jacobiSvd()
                                  .singularValues();
    return s[s.size() - 1] > 0 ? s[0] / s[s.size() - 1] : std::numeric_limits<double>::infinity();
}

// Root mean square of the errors within three of their typical size, so that outliers do not increase the noise.
double robust_rms(std::vector<double> errors) {
    for (auto& error : errors) error = std::abs(error);
    const auto middle = errors.begin() + std::ptrdiff_t(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    const double typical = kRobustSd * *middle;
    double squares = 0;
    std::size_t n = 0;
    for (const double error : errors)
        if (error <= 5 * typical) {
            squares += error * error;
            ++n;
        }
    return std::sqrt(squares / double(n));
}

FittedPad solve(const Rows& rows, const Wiring& wiring, const CapacitiveModel& model, double pair_gain, bool together) {
    FittedPad fitted{};
    fitted.p = first_guess(rows, wiring, pair_gain, fitted.noise);
    const double log_active = fitted.p[kLogActive + kCentre];
    double largest = 0;
    for (const auto* row : rows)
        for (const int k : wiring) largest = std::max(largest, std::abs(row->channel[std::size_t(k)]));
    const double min_noise = 1e-7 * largest;  // simulated data without noise must not cause a division by 0
    for (int round = 0; round < 3; ++round) {
        fitted.noise = std::max(fitted.noise, min_noise);
        ceres::Problem problem;
        std::vector<ceres::ResidualBlockId> data;
        for (const auto* row : rows)
            data.push_back(problem.AddResidualBlock(new ceres::AutoDiffCostFunction<RowError, kElectrodes, kUnknowns>(
                                                        new RowError{model, row, wiring, fitted.noise}),
                                                    new ceres::CauchyLoss(kCauchyOfSpikes), fitted.p.data()));
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Prior, 3, kUnknowns>(new Prior{log_active}), nullptr,
                                 fitted.p.data());
        if (!together) {
            fitted.p[kExponent] = 0;
            problem.SetManifold(fitted.p.data(), new ceres::SubsetManifold(kUnknowns, {kExponent}));
        }
        problem.SetParameterLowerBound(fitted.p.data(), kStiffening, -1.95);
        problem.SetParameterUpperBound(fitted.p.data(), kStiffening, 0.95);
        problem.SetParameterLowerBound(fitted.p.data(), kExponent, -4);
        problem.SetParameterUpperBound(fitted.p.data(), kExponent, 4);
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::DENSE_QR;
        options.logging_type = ceres::SILENT;
        options.max_num_iterations = 200;
        options.function_tolerance = 1e-12;
        ceres::Solver::Summary summary;
        ceres::Solve(options, &problem, &summary);
        if (!summary.IsSolutionUsable()) throw Undetermined("the fit does not converge: " + summary.message);
        fitted.condition = condition_of(problem, data);
        std::vector<double> errors;
        for (const auto* row : rows) {
            double reading[kElectrodes];
            model(fitted.p.data(), row->wrench_S, reading);
            for (std::size_t e = 0; e < kElectrodes; ++e)
                errors.push_back(reading[e] - row->channel[std::size_t(wiring[e])]);
        }
        fitted.noise = robust_rms(std::move(errors));
    }
    fitted.noise = std::max(fitted.noise, min_noise);
    return fitted;
}

}  // namespace

bool is_electrode(std::string_view name) { return electrode_index(name) < kElectrodes; }

FittedPad fit_pad(const Rows& rows, const ElectrodeGeometry* geometry, double pair_gain, Calibration& calibration,
                  std::vector<std::string>& warnings) {
    if (calibration.components != std::vector<std::string>{"fx", "fy", "fz"})
        throw Undetermined("this method needs the labels fx_N, fy_N and fz_N, and no others");
    std::string fault;
    const Wiring wiring = electrode_wiring(calibration, fault);
    for (std::size_t e = 0; e < kElectrodes; ++e)
        if (fault.empty() && wiring[e] < 0)
            fault = fmt::format("channels lacks {}; needed are C1 C2 C3 C4 Cn", kElectrode[e].name);
    if (!fault.empty()) throw Undetermined(fault);
    Rows whole;
    double max_press = 0, max_shear = 0;
    for (const auto* row : rows) {
        const Wrench& force = row->wrench_S;
        if (!std::isfinite(force[0] + force[1] + force[2])) continue;
        whole.push_back(row);
        max_press = std::max(max_press, -force[2]);
        max_shear = std::max(max_shear, std::hypot(force[0], force[1]));
    }
    if (whole.size() < kUnknowns)
        throw Undetermined(
            fmt::format("{} rows have fx_N, fy_N and fz_N together; {} unknowns", whole.size(), int(kUnknowns)));
    const bool together = std::any_of(whole.begin(), whole.end(), [&](const LabelledRow* row) {
        return -row->wrench_S[2] > 0.2 * max_press && std::hypot(row->wrench_S[0], row->wrench_S[1]) > 0.2 * max_shear;
    });
    if (!together)
        warnings.emplace_back(
            "no row has press and shear together: how the shear stiffness changes under a press is assumed "
            "(shear_gap_exponent = 0)");
    const FittedPad fitted = solve(whole, wiring, {geometry}, pair_gain, together);

    calibration.zero.assign(calibration.channels.size(), 0.0);
    calibration.matrix.clear();
    calibration.tables.clear();
    auto& out = calibration.parameters;
    out.clear();
    for (std::size_t e = 0; e < kElectrodes; ++e) {
        calibration.zero[std::size_t(wiring[e])] = fitted.p[kZero + e];
        out[kStrayParameters[e].name] = fitted.p[kZero + e] - std::exp(fitted.p[kLogActive + e]);
    }
    out["normal_stiffness_N"] = std::exp(fitted.p[kLogStiffness]);
    out["stiffening"] = fitted.p[kStiffening];
    out["shear_gap_exponent"] = fitted.p[kExponent];
    calibration.condition = fitted.condition;
    return fitted;
}

}  // namespace tactiled
