#include "decoupling/fit/hair_fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/hair_rows.hpp"

namespace tactiled {
namespace {

double parameter(const Calibration& calibration, const char* name, double otherwise) {
    const auto found = calibration.parameters.find(name);
    return found == calibration.parameters.end() ? otherwise : found->second;
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

// `first` of the leak terms goes into the table of that name.
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

double mean(const std::vector<double>& numbers) {
    double sum = 0;
    for (const double number : numbers) sum += number;
    return sum / double(numbers.size());
}

constexpr std::array<const char*, 10> kPhysicsNames{"radius_m", "width_m",  "thickness_m", "root_distance_m", "k_x_Pa",
                                                    "k_y_Pa",   "friction", "pi_l_per_Pa", "elastomer_kPa",   "poisson"};
std::array<double, 10> values_of(const HairPhysics& p) {
    return {p.radius_m, p.width_m,  p.thickness_m, p.root_distance_m, p.k_x_Pa,
            p.k_y_Pa,   p.friction, p.pi_l_per_Pa, p.elastomer_kPa,   p.poisson};
}

}  // namespace

void fit_hair_sum_diff(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = parameter(calibration, "area_m2", kHairCapArea_m2);
    const HairSession session = hair_session_of(rows, calibration, area_m2);
    for (std::size_t axis = 0; axis < 2; ++axis)
        if (session.asked[axis + 1] && !(has_hair(session, axis) && has_hair(session, axis + 2)))
            throw Undetermined(fmt::format("method sum_diff needs H{} and H{} for f{}; with other hairs fit method matrix",
                                           axis + 1, axis + 3, axis == 0 ? 'x' : 'y'));
    constexpr std::size_t kFirst = kLeakTerms - kInterceptTerms;
    const auto hairs = fit_hairs(session, calibration, kFirst, warnings);
    store_scales(session, area_m2, calibration);
    store_response(session, hairs, kFirst, "intercept", calibration);
    // S_d: the straight line of DIFF against its own shear, as Cao et al. draw it; slopes of the hairs at 0 would miss
    // the bend.
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

void fit_hair_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = parameter(calibration, "area_m2", kHairCapArea_m2);
    const HairSession session = hair_session_of(rows, calibration, area_m2);
    const auto hairs = fit_hairs(session, calibration, 0, warnings);
    store_scales(session, area_m2, calibration);
    store_response(session, hairs, 0, "leak", calibration);
}

void fit_hair_physics(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = parameter(calibration, "area_m2", kHairCapArea_m2);
    const HairSession session = hair_session_of(rows, calibration, area_m2);
    std::map<std::string, double> parameters{{"area_m2", area_m2}};
    const auto defaults = values_of(HairPhysics{});
    std::array<double, 10> v;
    for (std::size_t i = 0; i < v.size(); ++i)
        parameters[kPhysicsNames[i]] = v[i] = parameter(calibration, kPhysicsNames[i], defaults[i]);
    const HairPhysics physics{.radius_m = v[0],
                              .width_m = v[1],
                              .thickness_m = v[2],
                              .root_distance_m = v[3],
                              .k_x_Pa = v[4],
                              .k_y_Pa = v[5],
                              .friction = v[6],
                              .pi_l_per_Pa = v[7],
                              .elastomer_kPa = v[8],
                              .poisson = v[9]};
    const auto hairs = fit_hairs(session, calibration, kLeakTerms, warnings);
    // Only two numbers of the geometry can be told from readings, D_sigma and D_tau: each gets its correction, and each
    // hair its own part of it.
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

std::map<std::string, double> hair_parameters(std::string_view elastomer, const HairPhysics& start) {
    std::map<std::string, double> parameters{{"area_m2", kHairCapArea_m2}};
    const auto values = values_of(start);
    for (std::size_t i = 0; i < values.size(); ++i) parameters[kPhysicsNames[i]] = values[i];
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
