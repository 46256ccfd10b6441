#include <fmt/format.h>

#include "decoupling/fit/hair_fit.hpp"
#include "decoupling/hair/setup.hpp"

namespace tactiled {

bool is_hair(std::string_view name) { return hair_index(name) < 4; }

double cap_area_m2(const Calibration& calibration) {
    constexpr std::array<Parameter, 1> kBeforehand{{{kArea.name, kArea.what, kArea.min, kArea.max, kHairCapArea_m2}}};
    return known_beforehand(calibration, kBeforehand)[kArea.name];
}

std::vector<HairFit> fit_hairs(const HairSession& session, Calibration& calibration, std::size_t first,
                               std::vector<std::string>& warnings) {
    std::vector<HairFit> hairs;
    calibration.zero.clear();
    calibration.matrix.clear();
    calibration.tables.clear();
    calibration.condition = 0;
    std::vector<double> noise;
    bool whole = true;
    for (std::size_t k = 0; k < session.hair.size(); ++k) {
        const HairFit& hair = hairs.emplace_back(fit_hair(session, k, first));
        calibration.zero.push_back(hair.zero);
        noise.push_back(hair.noise);
        calibration.condition = std::max(calibration.condition, hair.condition);
        whole = whole && hair.whole;
        const std::string& name = calibration.channels[k];
        if (!(hair.gain[0] > 0))
            warnings.push_back(fmt::format("{} falls under a press: is a press fz < 0 in the labels?", name));
        const std::size_t i = session.hair[k], axis = i % 2 + 1;
        if (session.asked[axis] && hair.gain[axis] * (kHairCos[i] + kHairSin[i]) > 0)
            warnings.push_back(
                fmt::format("{} rises under a shear towards it: H{} and H{} are swapped, the sensor is turned "
                            "by 180 degrees, or its hairs are curled the other way",
                            name, i + 1, (i + 2) % 4 + 1));
    }
    if (!whole)
        warnings.emplace_back(
            "the rows do not determine all terms of second and third order: those are 0; load the axes in more "
            "steps, and together");
    calibration.tables["noise"] = {noise};
    return hairs;
}

void store_scales(const HairSession& session, double area_m2, Calibration& calibration) {
    calibration.parameters = {
        {"area_m2", area_m2}, {"normal_scale_Pa", session.scale_Pa[0]}, {"shear_scale_Pa", session.scale_Pa[1]}};
    if (session.pull_Pa > 0) calibration.parameters["pull_scale_Pa"] = session.pull_Pa;
}

void store_response(const HairSession& session, const std::vector<HairFit>& hairs, std::size_t first, const char* name,
                    Calibration& calibration) {
    std::vector<std::vector<double>> gains, leaks;
    for (const HairFit& hair : hairs) {
        auto& row = gains.emplace_back();
        for (std::size_t j = 0; j < 3; ++j) row.push_back(hair.gain[j] / session.scale_Pa[j]);
        leaks.emplace_back(hair.leak.begin() + std::ptrdiff_t(first), hair.leak.end());
    }
    calibration.tables["gains"] = std::move(gains);
    calibration.tables[name] = std::move(leaks);
}

}  // namespace tactiled
