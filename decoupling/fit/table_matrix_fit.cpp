// Model "table", method "matrix": a forward gain for each gauge and component, a zero and a noise for each gauge.
// Components: any labelled ones of fx fy fz mx my.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/table_fit.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {

std::unique_ptr<Decoupler> decoupler_of_fit(const Calibration& calibration, std::string_view method) {
    std::string fault;
    auto decoupler = make_method(*find_method("table", method), calibration, fault);
    if (decoupler == nullptr) throw Undetermined(fault);
    return decoupler;
}

namespace {

void fit_table_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>&) {
    for (const auto& name : calibration.components)
        if (name == "mz") throw Undetermined("the gauges of a table sensor do not measure mz: leave the column mz_Nm out");
    const std::vector<std::size_t> components = component_indices(calibration.components);
    const Rows whole = rows_with(rows, components);
    const auto n = Eigen::Index(whole.size()), loads = Eigen::Index(calibration.components.size());
    if (n < 3 * (loads + 1)) throw Undetermined(fmt::format("{} rows have all labels; {} are needed", n, 3 * (loads + 1)));
    const Eigen::MatrixXd x = labels_of(whole, components), readings = channels_of(whole);
    auto& forward = calibration.tables["forward"];
    auto& noise = calibration.tables["noise"];
    forward.clear();
    noise.assign(1, {});
    calibration.zero.clear();
    calibration.parameters.clear();
    calibration.matrix.clear();
    calibration.condition = 0;
    double greatest = 0;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const Eigen::VectorXd y = readings.col(Eigen::Index(k));
        const Affine fitted = affine_fit(x, y);
        if (!fitted.slope.dependent.empty()) {
            std::vector<std::string> names;
            for (const std::size_t j : fitted.slope.dependent) names.push_back(calibration.components[j]);
            throw Undetermined(
                fmt::format("the labels of {} follow from each other: load the axes independently, or leave one "
                            "out (a point that never moves ties the moments to the forces)",
                            fmt::join(names, " ")));
        }
        calibration.zero.push_back(fitted.constant);
        forward.emplace_back(fitted.slope.coefficient.data(), fitted.slope.coefficient.data() + loads);
        const Eigen::VectorXd rest = (x * fitted.slope.coefficient).array() + fitted.constant - y.array();
        noise.front().push_back(std::sqrt(rest.squaredNorm() / double(n - loads - 1)));
        greatest = std::max(greatest, noise.front().back());
        calibration.condition = std::max(calibration.condition, fitted.slope.condition);
    }
    // The weight of a gauge is limited to a hundred times that of the worst one, because few rows may have no
    // residual by chance.
    for (double& sd : noise.front()) sd = std::max({sd, greatest / 100, 1e-300});
    (void)decoupler_of_fit(calibration, "matrix");
}

const FitEntry entry{.model = "table", .method = "matrix", .fit = fit_table_matrix, .channels = kGauge};

}  // namespace
}  // namespace tactiled
