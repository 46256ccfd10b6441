// Model "table", method "linear": one normal and one tangential gain for the inner gauges, another pair for the outer
// ones, and a zero each. Readings are fitted from forces, because the noise is in the readings.
#include <fmt/format.h>

#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/table_fit.hpp"
#include "decoupling/table/sign_table.hpp"

namespace tactiled {
namespace {

struct Gauge {
    std::size_t channel;
    TableGauge sign;
};

// Returns N and the tangential force with the gauge's sign.
Eigen::RowVector2d loads(const Gauge& gauge, const LabelledRow& row) {
    return {-row.wrench_S[2], gauge.sign.along_x * row.wrench_S[0] + gauge.sign.along_y * row.wrench_S[1]};
}

struct Gains {
    double normal, tangential, condition, squares;  // squares: sum of squared residuals
};

// Fits r = zero + normal * N + tangential * T to all gauges of one ring together; each has its own zero.
Gains fit_ring(const Rows& rows, const std::vector<Gauge>& gauges, const char* ring, std::vector<double>& zero) {
    const auto n = Eigen::Index(rows.size());
    Eigen::MatrixXd a(n * Eigen::Index(gauges.size()), 2);
    Eigen::VectorXd y(a.rows());
    std::vector<Eigen::RowVector2d> mean_load;
    std::vector<double> mean_reading;
    for (std::size_t g = 0; g < gauges.size(); ++g) {
        auto block = a.middleRows(Eigen::Index(g) * n, n);
        auto readings = y.segment(Eigen::Index(g) * n, n);
        for (Eigen::Index i = 0; i < n; ++i) {
            block.row(i) = loads(gauges[g], *rows[std::size_t(i)]);
            readings[i] = rows[std::size_t(i)]->channel[gauges[g].channel];
        }
        mean_load.emplace_back(block.colwise().mean());
        mean_reading.push_back(readings.mean());
        block.rowwise() -= mean_load.back();
        readings.array() -= mean_reading.back();
    }
    const LeastSquares solved = least_squares(a, y);
    if (!solved.dependent.empty())
        throw Undetermined(
            fmt::format("the {} gauges: normal and tangential force do not vary independently of each other", ring));
    for (std::size_t g = 0; g < gauges.size(); ++g)
        zero[gauges[g].channel] = mean_reading[g] - mean_load[g].dot(solved.coefficient);
    return {solved.coefficient[0], solved.coefficient[1], solved.condition, (a * solved.coefficient - y).squaredNorm()};
}

}  // namespace

void fit_table_linear(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    if (calibration.components != std::vector<std::string>{"fx", "fy", "fz"})
        throw Undetermined("model \"table\" needs the labels fx_N, fy_N and fz_N, and no others");
    const Rows whole = rows_with(rows, {0, 1, 2});
    if (whole.size() < 3) throw Undetermined("fewer than 3 rows have fx_N, fy_N and fz_N together");
    std::vector<Gauge> inner, outer;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const TableGauge sign = *table_gauge(calibration.channels[k]);
        (sign.inner ? inner : outer).push_back({k, sign});
    }
    calibration.zero.assign(calibration.channels.size(), 0.0);
    calibration.matrix.clear();
    calibration.parameters.clear();
    const Gains inner_gains = fit_ring(whole, inner, "inner", calibration.zero);
    calibration.parameters["normal_inner"] = inner_gains.normal;
    calibration.parameters["tangential_inner"] = inner_gains.tangential;
    calibration.condition = inner_gains.condition;
    double squares = inner_gains.squares;
    if (!outer.empty()) {
        const Gains outer_gains = fit_ring(whole, outer, "outer", calibration.zero);
        calibration.parameters["normal_outer"] = outer_gains.normal;
        calibration.parameters["tangential_outer"] = outer_gains.tangential;
        calibration.condition = std::max(calibration.condition, outer_gains.condition);
        squares += outer_gains.squares;
    }
    for (const char* name : {"normal_inner", "tangential_inner", "tangential_outer"})
        if (const auto found = calibration.parameters.find(name);
            found != calibration.parameters.end() && !(found->second > 0))
            throw Undetermined(
                fmt::format("the fit of {} is {:.3g}: the signs of the gauges or of the labels are not those of the "
                            "sign table (a press has fz < 0), or gauges are swapped",
                            name, found->second));
    const double readings = double(whole.size() * calibration.channels.size());
    const double noise = std::sqrt(squares / readings);
    calibration.parameters["noise"] = noise;
    // A common gain for four gauges is an assumption; report when it is a poor one.
    if (noise > 0.1 * inner_gains.normal)
        warnings.push_back(fmt::format(
            "the gauges leave {:.3g} rms of their readings unexplained, {:.0f} % of what 1 N makes: their gains "
            "differ, or the contact is not the one of the sign table; model \"generic\" fits each gauge for itself",
            noise, 100 * noise / inner_gains.normal));
}

bool is_gauge(std::string_view name) { return table_gauge(name).has_value(); }

namespace {

const FitEntry entry{.model = "table", .method = "linear", .fit = fit_table_linear, .channels = kGauge};

}  // namespace
}  // namespace tactiled
