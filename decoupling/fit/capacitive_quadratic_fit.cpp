// Model "capacitive", method "quadratic": C = C0 + b F + a F^2 (thesis, eq. XXXIII and XXXIV), and the response of
// each side electrode to a press.
#include <fmt/format.h>

#include <cmath>

#include "decoupling/capacitive/methods.hpp"
#include "decoupling/fit/capacitive_fit.hpp"

namespace tactiled {
namespace {

void fit_quadratic(const Rows& rows, Calibration& calibration, std::vector<std::string>&) {
    std::string fault;
    const Wiring wiring = electrode_wiring(calibration, fault);
    if (!fault.empty()) throw Undetermined(fault);
    const auto sees = [&](const char* name) {
        return std::find(calibration.components.begin(), calibration.components.end(), name) != calibration.components.end();
    };
    if (wiring[kCentre] < 0 || !sees("fz"))
        throw Undetermined("method \"quadratic\" needs the channel Cn and the label fz_N");
    calibration.zero.assign(calibration.channels.size(), 0.0);
    calibration.matrix.clear();
    calibration.parameters.clear();
    calibration.tables.clear();
    calibration.condition = 0;
    double max_press = 0, max_shear = 0;
    // Fits the curve of electrode e over its own shear (axis 0, 1; 2 = none) and the press; returns its slopes
    // without the constant.
    const auto fit_curve = [&](std::size_t e, std::size_t axis) {
        const auto channel = std::size_t(wiring[e]);
        std::vector<const LabelledRow*> whole;
        for (const auto* row : rows)
            if (std::isfinite(row->wrench_S[2]) && (axis == 2 || std::isfinite(row->wrench_S[axis]))) whole.push_back(row);
        const Eigen::Index columns = axis == 2 ? 2 : 4;
        if (Eigen::Index(whole.size()) <= columns)
            throw Undetermined(
                fmt::format("{} rows for the {} coefficients of {}", whole.size(), columns + 1, kElectrode[e].name));
        Eigen::MatrixXd x(Eigen::Index(whole.size()), columns);
        Eigen::VectorXd y(x.rows());
        for (Eigen::Index i = 0; i < x.rows(); ++i) {
            const LabelledRow& row = *whole[std::size_t(i)];
            const double press = 0.0 - row.wrench_S[2];
            x(i, columns - 2) = press;
            x(i, columns - 1) = press * press;
            max_press = std::max(max_press, press);
            if (axis < 2) {
                const double shear = row.wrench_S[axis] * (axis == 0 ? kElectrode[e].along_x : kElectrode[e].along_y);
                x(i, 0) = shear;
                x(i, 1) = shear * shear;
                max_shear = std::max(max_shear, std::abs(shear));
            }
            y[i] = row.channel[channel];
        }
        const Affine fitted = affine_fit(x, y);
        if (!fitted.slope.dependent.empty())
            throw Undetermined(
                fmt::format("{}: its loads do not vary independently: press and, for C1 .. C4, shear both ways are "
                            "needed at three levels or more",
                            kElectrode[e].name));
        calibration.zero[channel] = fitted.constant;
        calibration.condition = std::max(calibration.condition, fitted.slope.condition);
        return fitted.slope.coefficient;
    };
    const Eigen::VectorXd normal = fit_curve(kCentre, 2);
    if (!(normal[0] > 0))
        throw Undetermined(fmt::format("Cn falls by {:.3g} a N of press: it must rise (a press has fz < 0)", -normal[0]));
    if (!(max_press > 0)) throw Undetermined("no row has a press (fz_N < 0)");
    calibration.parameters["normal_b"] = normal[0];
    calibration.parameters["normal_a"] = normal[1];
    if (sees("fx") || sees("fy")) {
        std::vector<std::vector<double>> side(kCentre, {1, 0, 0, 0});  // b = 1 for an axis that is not a component
        for (std::size_t e = 0; e < kCentre; ++e) {
            if (!sees(e < 2 ? "fx" : "fy")) continue;
            if (wiring[e] < 0) throw Undetermined(fmt::format("channels lacks {}", kElectrode[e].name));
            const Eigen::VectorXd curve = fit_curve(e, e / 2);
            if (!(curve[0] > 0))
                throw Undetermined(
                    fmt::format("{} falls by {:.3g} a N of force towards it; C1 lies on +x, C2 on -x, C3 on +y, C4 on "
                                "-y (the thesis numbers C1 and C2 the other way)",
                                kElectrode[e].name, -curve[0]));
            side[e].assign(curve.data(), curve.data() + 4);
        }
        calibration.tables["side"] = side;
        calibration.parameters["shear_range_N"] = max_shear;
    }
    calibration.parameters["normal_range_N"] = max_press;
}

const FitEntry entry{.model = "capacitive", .method = "quadratic", .fit = fit_quadratic, .channels = kElectrodeOfPad};

}  // namespace
}  // namespace tactiled
