// Model "hair", method "physics": the difference between the measured sensitivities and those of the geometry, which
// comes from `calibration.parameters` if it is stated there, else from the documents (HairPhysics).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "decoupling/fit/hair_fit.hpp"

namespace tactiled {
namespace {

constexpr auto kBeforehand = hair_geometry_parameters(true);

double mean(const std::vector<double>& numbers) {
    double sum = 0;
    for (const double number : numbers) sum += number;
    return sum / double(numbers.size());
}

void fit_hair_physics(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = cap_area_m2(calibration);
    const HairSession session = hair_session_of(rows, calibration, area_m2);
    std::map<std::string, double> parameters{{"area_m2", area_m2}};
    const HairPhysics physics = hair_physics(known_beforehand(calibration, kBeforehand));
    for (const HairGeometry& each : kHairGeometry) parameters[each.parameter.name] = physics.*each.member;
    const auto hairs = fit_hairs(session, calibration, kLeakTerms, warnings);
    // Readings determine only two numbers of the geometry, D_sigma and D_tau: each gets a correction, and each hair
    // its own part of it.
    std::vector<double> normal, shear;
    for (std::size_t k = 0; k < hairs.size(); ++k) {
        const std::size_t i = session.hair[k], axis = i % 2 + 1;
        normal.push_back(hairs[k].gain[0] / session.scale_Pa[0]);
        if (session.asked[axis])
            shear.push_back(-hairs[k].gain[axis] * (kHairCos[i] + kHairSin[i]) / session.scale_Pa[axis]);
    }
    const double mean_normal = mean(normal), mean_shear = mean(shear);
    if (!(mean_normal > 0) || !(mean_shear > 0))
        throw Undetermined(
            fmt::format("the hairs answer {:.3g}/Pa to a press and {:.3g}/Pa to a shear away from them; physics "
                        "has both above 0: check the signs of the labels and the order of the hairs, or fit "
                        "method matrix",
                        mean_normal, mean_shear));
    parameters["correction_normal"] = mean_normal / normal_sensitivity_per_Pa(physics);
    parameters["correction_shear"] = mean_shear / shear_sensitivity_per_Pa(physics);
    for (const char* name : {"correction_normal", "correction_shear"})
        if (!std::isfinite(parameters[name]))
            throw Undetermined("the geometry in the parameters makes no finite sensitivity");
        else if (parameters[name] < 0.1 || parameters[name] > 10)
            warnings.push_back(fmt::format("{} is {:.3g}: the geometry or the elastomer is not that of this sensor", name,
                                           parameters[name]));
    std::vector<std::vector<double>> own;
    std::size_t at = 0;
    for (std::size_t k = 0; k < hairs.size(); ++k) {
        const double own_shear = session.asked[session.hair[k] % 2 + 1] ? shear[at++] / mean_shear : 1;
        own.push_back({normal[k] / mean_normal, own_shear});
    }
    calibration.tables["hair_gain"] = std::move(own);
    calibration.parameters = std::move(parameters);
}

void put_elastomer(const std::string& name, Fit& start) { start.parameters = hair_parameters(name); }

const FitEntry entry{
    .model = "hair",
    .method = "physics",
    .fit = fit_hair_physics,
    .channels = kHair,
    .option = {"elastomer", "method physics of model hair: PDMS, Ecoflex or hydrogel to start from", put_elastomer}};

}  // namespace

std::map<std::string, double> hair_parameters(std::string_view elastomer, const HairPhysics& start) {
    std::map<std::string, double> parameters{{"area_m2", kHairCapArea_m2}};
    for (const HairGeometry& each : kHairGeometry) parameters[each.parameter.name] = start.*each.member;
    std::vector<std::string> names;
    for (const Elastomer& known : kElastomers) {
        names.emplace_back(known.name);
        if (known.name == elastomer) {
            parameters["elastomer_kPa"] = known.young_kPa;
            return parameters;
        }
    }
    const auto near = nearest_name(elastomer, names);
    throw SetupError(
        fmt::format("elastomer \"{}\" is unknown; {}", elastomer,
                    near ? fmt::format("did you mean \"{}\"?", *near) : fmt::format("known are {}", fmt::join(names, " "))));
}

}  // namespace tactiled
