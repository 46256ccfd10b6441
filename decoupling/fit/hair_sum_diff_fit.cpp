// Model "hair", method "sum_diff": gains and intercept of each hair, and the line of DIFF of each pair.
#include <fmt/format.h>

#include <algorithm>

#include "decoupling/fit/hair_fit.hpp"

namespace tactiled {
namespace {

void fit_hair_sum_diff(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = cap_area_m2(calibration);
    const HairSession session = hair_session_of(rows, calibration, area_m2);
    for (std::size_t axis = 0; axis < 2; ++axis)
        if (session.asked[axis + 1] && !(has_hair(session, axis) && has_hair(session, axis + 2)))
            throw Undetermined(fmt::format("method sum_diff needs H{} and H{} for f{}; with other hairs fit method matrix",
                                           axis + 1, axis + 3, axis == 0 ? 'x' : 'y'));
    constexpr std::size_t kFirst = kLeakTerms - kInterceptTerms;
    const auto hairs = fit_hairs(session, calibration, kFirst, warnings);
    store_scales(session, area_m2, calibration);
    store_response(session, hairs, kFirst, "intercept", calibration);
    // S_d: the straight line of DIFF against its own shear, as in Cao et al.; the slopes of the hairs at 0 would
    // neglect the curvature.
    for (std::size_t axis = 0; axis < 2; ++axis) {
        if (!session.asked[axis + 1]) continue;
        const auto near = std::find(session.hair.begin(), session.hair.end(), axis) - session.hair.begin();
        const auto far = std::find(session.hair.begin(), session.hair.end(), axis + 2) - session.hair.begin();
        Eigen::MatrixXd a(Eigen::Index(session.rows.size()), 2);
        Eigen::VectorXd y(a.rows());
        for (std::size_t r = 0; r < session.rows.size(); ++r) {
            a.row(Eigen::Index(r)) << 1, session.load[r][axis + 1];
            y[Eigen::Index(r)] = (session.rows[r]->channel[std::size_t(far)] - calibration.zero[std::size_t(far)]) -
                                 (session.rows[r]->channel[std::size_t(near)] - calibration.zero[std::size_t(near)]);
        }
        const RobustFit line = robust_least_squares(a, y);
        if (!line.solved.dependent.empty()) throw Undetermined("a shear force is always the same");
        calibration.parameters[axis == 0 ? "diff_x_per_Pa" : "diff_y_per_Pa"] =
            line.solved.coefficient[1] / session.scale_Pa[axis + 1];
    }
}

const FitEntry entry{.model = "hair", .method = "sum_diff", .fit = fit_hair_sum_diff, .channels = kHair};

}  // namespace
}  // namespace tactiled
