// Model "hair", method "matrix": gains and all leak terms of each hair.
#include "decoupling/fit/hair_fit.hpp"

namespace tactiled {
namespace {

void fit_hair_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = cap_area_m2(calibration);
    const HairSession session = hair_session_of(rows, calibration, area_m2);
    const auto hairs = fit_hairs(session, calibration, 0, warnings);
    store_scales(session, area_m2, calibration);
    store_response(session, hairs, 0, "leak", calibration);
}

const FitEntry entry{.model = "hair", .method = "matrix", .fit = fit_hair_matrix, .channels = kHair};

}  // namespace
}  // namespace tactiled
