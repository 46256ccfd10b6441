// Model "piezo", method "fused". For a given leak, all other unknowns of the film are linear:
//
//     Vp = zero + b v(N) + a v(N^2) + c_run exp(-t/tau),     v = film_response()
//
// c_run is the charge that the film still had when a run began; it is projected out for each run. tau is searched
// along one line.
#include "decoupling/fit/piezo_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "decoupling/capacitive/methods.hpp"
#include "decoupling/piezo/parameters.hpp"

namespace tactiled {
namespace {

// Relative to the spread that a film without a leak would show. Below this, the effects that the model neglects are
// as large as the film's signal, for any noise: 2 % of full scale (the error of the thesis' film).
constexpr double kMinPassed = 0.03;
// Rms distance of the square of a press from a straight line, for a press in ranges. All presses equally often:
// 0.075; a third level half-way in one of a hundred rows: 0.025.
constexpr double kMinBend = 0.03;

// The film at one tau. Columns of x: 1, v(N), v(N^2) (only with a curvature) and, if requested, dVp/dlog tau.
class Film {
public:
    explicit Film(const std::vector<PiezoRun>& runs) : runs_(runs) {
        for (const PiezoRun& run : runs) n_ += Eigen::Index(run.t_s.size());
        weight_.setOnes(n_);
    }

    struct Solved {
        Eigen::VectorXd coefficient;  // zero b a; empty where the columns depend on each other
        Eigen::VectorXd errors;       // V, without weights
        double cost = std::numeric_limits<double>::infinity();
        std::vector<std::size_t> dependent;
    };
    [[nodiscard]] Solved solve(double tau_s) const {
        const auto [x, y, decay] = columns(tau_s);
        Solved solved;
        const LeastSquares fitted = least_squares(without_past(x, decay), without_past(y, decay));
        solved.dependent = fitted.dependent;
        if (!fitted.dependent.empty()) return solved;
        solved.coefficient = fitted.coefficient;
        const Eigen::VectorXd weighted = without_past(y - x * fitted.coefficient, decay);
        solved.errors = weighted.cwiseQuotient(weight_);
        solved.cost = weighted.squaredNorm();
        return solved;
    }

    // Returns the tau with the minimum cost in an interval. A coarse search comes first, because there may be several
    // minima.
    [[nodiscard]] double search(double low_s, double high_s) const {
        constexpr int kCoarse = 6;  // per decade
        const int n = 2 + int(std::ceil(kCoarse * std::log10(high_s / low_s)));
        const double step = std::log(high_s / low_s) / (n - 1);
        const auto cost = [&](double at) { return solve(low_s * std::exp(at)).cost; };
        double best = 0, min = cost(0);
        for (int i = 1; i < n; ++i)
            if (const double here = cost(i * step); here < min) min = here, best = i * step;
        double a = std::max(0.0, best - step), b = std::min((n - 1) * step, best + step);
        constexpr double kGolden = 0.6180339887498949;
        double c = b - kGolden * (b - a), d = a + kGolden * (b - a), at_c = cost(c), at_d = cost(d);
        while (b - a > 1e-5) {
            if (at_c < at_d)
                b = d, d = c, at_d = at_c, c = b - kGolden * (b - a), at_c = cost(c);
            else
                a = c, c = d, at_c = at_d, d = a + kGolden * (b - a), at_d = cost(d);
        }
        return low_s * std::exp((a + b) / 2);
    }

    // Standard deviations of the gain's mean slope over 0 .. range and of tau, both relative, and the condition
    // number.
    struct Sureness {
        double gain, tau, condition;
    };
    [[nodiscard]] Sureness sureness(double tau_s, const Solved& solved, double range_N, bool tau_is_stated) const {
        const auto [x, y, decay] = columns(tau_s);
        Eigen::MatrixXd all = x;
        if (!tau_is_stated) {
            all.conservativeResize(Eigen::NoChange, x.cols() + 1);
            all.rightCols(1) = dVp_dlog_tau(tau_s, solved.coefficient, y - x * solved.coefficient, decay);
        }
        all = without_past(all, decay);
        const Sds sds(all, sd_of_rows(solved.errors, y));
        const double a = has_curvature ? solved.coefficient[2] : 0;
        return {sds.of_curve(range_N, has_curvature) / std::abs(solved.coefficient[1] + range_N * a),
                tau_is_stated ? 0 : sds.of(Eigen::RowVectorXd::Unit(all.cols(), all.cols() - 1)), sds.condition()};
    }

    void weigh(const Eigen::VectorXd& errors) { weight_ = root_weights(errors); }

    // Standard deviation of the film's signal, relative to that of a film without a leak.
    [[nodiscard]] double passed(double tau_s) const {
        double shown = 0, there = 0;
        for (const PiezoRun& run : runs_) {
            const auto n = Eigen::Index(run.t_s.size());
            const auto v = film_response(run.t_s, run.press_N, tau_s).v;
            const auto spread = [n](const std::vector<double>& values) {
                const Eigen::Map<const Eigen::ArrayXd> all(values.data(), n);
                return (all - all.mean()).square().sum();
            };
            shown += spread(v);
            there += spread(run.press_N);
        }
        return std::sqrt(shown / there);
    }

    bool has_curvature = true;

private:
    struct Columns {
        Eigen::MatrixXd x;
        Eigen::VectorXd y, decay;  // decay: exp(-t/tau) since the run began
    };
    [[nodiscard]] Columns columns(double tau_s) const {
        Columns all{Eigen::MatrixXd(n_, has_curvature ? 3 : 2), Eigen::VectorXd(n_), Eigen::VectorXd(n_)};
        Eigen::Index at = 0;
        for (const PiezoRun& run : runs_) {
            const auto n = Eigen::Index(run.t_s.size());
            const auto put = [&](const std::vector<double>& q, Eigen::Index column) {
                all.x.col(column).segment(at, n) =
                    Eigen::Map<const Eigen::VectorXd>(film_response(run.t_s, q, tau_s).v.data(), n);
            };
            all.x.col(0).segment(at, n).setOnes();
            put(run.press_N, 1);
            if (has_curvature) put(squares(run.press_N), 2);
            all.y.segment(at, n) = Eigen::Map<const Eigen::VectorXd>(run.Vp.data(), n);
            all.decay.segment(at, n) = (Eigen::Map<const Eigen::ArrayXd>(run.t_s.data(), n) / -tau_s).exp();
            at += n;
        }
        return all;
    }

    // `errors` still contain the initial charge of the film: c_run exp(-t/tau), with the derivative c_run exp(-t/tau)
    // t/tau.
    [[nodiscard]] Eigen::VectorXd dVp_dlog_tau(double tau_s, const Eigen::VectorXd& coefficient,
                                               const Eigen::VectorXd& errors, const Eigen::VectorXd& decay) const {
        Eigen::VectorXd result(n_);
        Eigen::Index at = 0;
        for (const PiezoRun& run : runs_) {
            const auto n = Eigen::Index(run.t_s.size());
            std::vector<double> q(run.press_N);
            for (double& N : q) N = N * (coefficient[1] + (has_curvature ? coefficient[2] * N : 0));
            const Eigen::VectorXd w = weight_.segment(at, n).cwiseProduct(decay.segment(at, n));
            const double held = w.dot(weight_.segment(at, n).cwiseProduct(errors.segment(at, n))) / w.squaredNorm();
            result.segment(at, n) =
                Eigen::Map<const Eigen::ArrayXd>(film_response(run.t_s, q, tau_s).dv_dlog_tau.data(), n) +
                held * decay.segment(at, n).array() * Eigen::Map<const Eigen::ArrayXd>(run.t_s.data(), n) / tau_s;
            at += n;
        }
        return result;
    }

    static std::vector<double> squares(std::vector<double> values) {
        for (double& value : values) value *= value;
        return values;
    }

    // Returns the weighted columns without, for each run, their part along its weighted decay, so that the initial
    // charge has no influence.
    [[nodiscard]] Eigen::MatrixXd without_past(const Eigen::MatrixXd& columns, const Eigen::VectorXd& decay) const {
        Eigen::MatrixXd rest = weight_.asDiagonal() * columns;
        Eigen::Index at = 0;
        for (const PiezoRun& run : runs_) {
            const auto n = Eigen::Index(run.t_s.size());
            const Eigen::VectorXd along = weight_.segment(at, n).cwiseProduct(decay.segment(at, n)).normalized();
            const Eigen::RowVectorXd amount = along.transpose() * rest.middleRows(at, n);
            rest.middleRows(at, n) -= along * amount;
            at += n;
        }
        return rest;
    }

    const std::vector<PiezoRun>& runs_;
    Eigen::Index n_ = 0;
    Eigen::VectorXd weight_;  // square roots of the weights
};

void fit_film(const std::vector<PiezoRun>& runs, double range_N, std::size_t Vp, Calibration& calibration,
              std::vector<std::string>& warnings) {
    double longest_s = 0;
    for (const PiezoRun& run : runs) longest_s = std::max(longest_s, run.t_s.back());
    const CalibrationData known = known_beforehand(calibration, kKnownOfPiezo);
    const bool tau_is_stated = known.has("leak_tau_s");
    const double low_s = kMinTau_s, high_s = std::clamp(10 * longest_s, 10 * kMinTau_s, kMaxTau_s);
    Film film(runs);
    double tau_s = tau_is_stated ? known["leak_tau_s"] : film.search(low_s, high_s);
    Film::Solved solved = film.solve(tau_s);
    for (int round = 0; round < kRounds && solved.dependent.empty(); ++round) {
        film.weigh(solved.errors);
        if (!tau_is_stated) tau_s = film.search(std::max(low_s, tau_s / 2), std::min(high_s, tau_s * 2));
        solved = film.solve(tau_s);
    }
    if (solved.dependent.empty() && solved.coefficient[2] < 0) {
        // The model allows no curvature of that sign; a curvature that is only noise can be neglected.
        film.has_curvature = false;
        if (solved.coefficient[1] > 0 && -solved.coefficient[2] * range_N > kSureEnough * solved.coefficient[1])
            warnings.emplace_back("Vp rises less and less with the press; its curve is taken as a straight line");
        if (!tau_is_stated) tau_s = film.search(low_s, high_s);
        solved = film.solve(tau_s);
    }
    if (!solved.dependent.empty())
        throw Undetermined("the gain of Vp cannot be determined: the press must take three levels or more, and change fast");
    const auto sure = film.sureness(tau_s, solved, range_N, tau_is_stated);
    const double passed = film.passed(tau_s);
    // !(a < b) is also true for NaN
    if (!(sure.gain < kSureEnough) || !(passed > kMinPassed))
        throw Undetermined(fmt::format(
            "Vp does not follow fast changes of the press: of its spread, {:.1f} % pass a leak of {:.3g} s, and "
            "the gain would be known to {:.2g} %. Where there are none, press and let go within less than the leak, "
            "at three levels or more; where there are, is the film connected, and one film all the time?",
            100 * passed, tau_s, 100 * sure.gain));
    if (!(solved.coefficient[1] > 0))
        throw Undetermined(fmt::format(
            "Vp falls by {:.3g} a N of sudden press: it must rise (a press has fz < 0); exchange the film's leads",
            -solved.coefficient[1]));
    if (!(sure.tau < kSureEnough) || (!tau_is_stated && (tau_s > high_s / 1.1 || tau_s < low_s * 1.1)))
        throw Undetermined(
            fmt::format("the leak of Vp is known to {:.2g} % only: after a sudden press, hold it until Vp has fallen to "
                        "a third (longest stretch without a gap: {:.3g} s), or state it: --set leak_tau_s=SECONDS",
                        100 * sure.tau, longest_s));
    calibration.zero[Vp] = solved.coefficient[0];
    calibration.parameters["gain_b"] = solved.coefficient[1];
    calibration.parameters["gain_a"] = film.has_curvature ? solved.coefficient[2] : 0;
    calibration.parameters["leak_tau_s"] = tau_s;
    calibration.condition = std::max(calibration.condition, sure.condition);
}

// A curve needs three levels. With two, windows in which the press jumped would look like a third level.
void check_levels(const std::vector<PiezoRun>& runs, double range_N) {
    std::vector<double> press_N;
    for (const PiezoRun& run : runs) press_N.insert(press_N.end(), run.press_N.begin(), run.press_N.end());
    const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(press_N.data(), Eigen::Index(press_N.size())) / range_N;
    const Eigen::VectorXd y = x.cwiseAbs2();
    const Affine line = affine_fit(x, y);
    if (line.slope.dependent.empty()) {
        const Eigen::ArrayXd left = y.array() - line.constant - line.slope.coefficient[0] * x.array();
        if (left.matrix().norm() > kMinBend * std::sqrt(double(y.size()))) return;
    }
    throw Undetermined("the press must take three levels or more, far from each other: nearly all rows are of two");
}

void fit_piezo(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    if (calibration.components != std::vector<std::string>{"fz"})
        throw Undetermined("model \"piezo\" measures only fz: leave the other labels' columns out");
    const auto channel = [&](const char* name) {
        const auto at = std::find(calibration.channels.begin(), calibration.channels.end(), name);
        if (at == calibration.channels.end()) throw Undetermined(fmt::format("channels lacks {}; needed are Vp Cn", name));
        return std::size_t(at - calibration.channels.begin());
    };
    const std::size_t Vp = channel("Vp"), Cn = channel("Cn");
    const std::vector<PiezoRun> runs = piezo_runs(rows, Vp, Cn);
    double range_N = 0;
    for (const PiezoRun& run : runs) range_N = std::max(range_N, *std::max_element(run.press_N.begin(), run.press_N.end()));
    if (!(range_N > 0)) throw Undetermined("no row has a press (fz_N < 0)");
    std::erase_if(calibration.parameters, [](const auto& parameter) {
        return std::none_of(kKnownOfPiezo.begin(), kKnownOfPiezo.end(),
                            [&](const Parameter& known) { return parameter.first == known.name; });
    });
    calibration.zero.assign(calibration.channels.size(), 0.0);
    calibration.matrix.clear();
    calibration.tables.clear();
    calibration.condition = 0;
    check_levels(runs, range_N);
    fit_centre(runs, range_N, Cn, calibration);
    fit_film(runs, range_N, Vp, calibration, warnings);
}

bool is_film_or_centre(std::string_view name) { return name == "Vp" || name == "Cn"; }

const FitEntry entry{.model = "piezo",
                     .method = "fused",
                     .fit = fit_piezo,
                     .channels = {is_film_or_centre, "a channel of model \"piezo\" (Vp, Cn)"},
                     .remembers = true};

}  // namespace
}  // namespace tactiled
