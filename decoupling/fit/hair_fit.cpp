#include "decoupling/fit/hair_fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "decoupling/domain.hpp"
#include "decoupling/hair_stages.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kRowsPerCoefficient = 3;
// Cauchy's weight at 95 % efficiency on normal noise.
constexpr double kCauchy = 2.385;
constexpr int kReweightings = 20;
// A hair's noise is taken as at least this part of its rms reading: rows without noise are no reason for infinite weights.
constexpr double kLeastNoise = 1e-4;

// Least squares in which rows far from the rest lose their weight. `sd`: robust, of a reading.
struct Robust {
    LeastSquares solved;
    double sd = 0;
};

Robust robust_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& y) {
    Robust result{.solved = least_squares(a, y)};
    if (!result.solved.dependent.empty()) return result;
    for (int i = 0; i < kReweightings; ++i) {
        const Eigen::VectorXd error = y - a * result.solved.coefficient;
        std::vector<double> sizes(error.data(), error.data() + error.size());
        for (double& size : sizes) size = std::abs(size);
        std::nth_element(sizes.begin(), sizes.begin() + std::ptrdiff_t(sizes.size() / 2), sizes.end());
        result.sd = 1.4826 * sizes[sizes.size() / 2] * std::sqrt(double(a.rows()) / double(a.rows() - a.cols()));
        if (!(result.sd > 1e-13 * y.cwiseAbs().maxCoeff())) break;  // rounding
        const Eigen::VectorXd weight = (1 + (error / (kCauchy * result.sd)).array().square()).rsqrt();
        const LeastSquares next = least_squares(weight.asDiagonal() * a, weight.cwiseProduct(y));
        if (!next.dependent.empty()) break;
        const double change = (a * (next.coefficient - result.solved.coefficient)).cwiseAbs().maxCoeff();
        result.solved.coefficient = next.coefficient;
        if (change < 1e-3 * result.sd / std::sqrt(double(a.rows()))) break;
    }
    return result;
}

// The labels as stresses, the wiring, and the range.
struct Session {
    Rows rows;
    std::vector<std::size_t> hair;  // of a channel
    std::vector<HairLoad> load;     // of a row; parts of full scale
    std::array<bool, 3> asked{};    // sigma, tau_x, tau_y
    HairLoad scale_Pa{};
    double pull_Pa = 0;
};

bool has(const Session& session, std::size_t hair) {
    return std::find(session.hair.begin(), session.hair.end(), hair) != session.hair.end();
}

double parameter(const Calibration& calibration, const char* name, double otherwise) {
    const auto found = calibration.parameters.find(name);
    return found == calibration.parameters.end() ? otherwise : found->second;
}

Session session_of(const Rows& rows, const Calibration& calibration, double area_m2) {
    Session session;
    for (const auto& name : calibration.channels) {
        const std::size_t hair = hair_index(name);
        if (hair == 4 || has(session, hair))
            throw Undetermined(fmt::format("channel {} is no hair of model \"hair\" (H1 .. H4, each once)", name));
        session.hair.push_back(hair);
    }
    for (const auto& name : calibration.components) {
        const std::size_t c = component_index(name);
        if (c > 2) throw Undetermined(fmt::format("a hair sensor does not see {}: leave its column out", name));
        session.asked[(c + 1) % 3] = true;
    }
    if (!session.asked[0] || !(session.asked[1] || session.asked[2]))
        throw Undetermined("model \"hair\" needs the labels fz_N and at least one of fx_N fy_N");
    for (std::size_t axis = 0; axis < 2; ++axis)
        if (session.asked[axis + 1] && !has(session, axis) && !has(session, axis + 2))
            throw Undetermined(fmt::format("H{} and H{} are not there, so f{} cannot be seen: leave its column out",
                                           axis + 1, axis + 3, axis == 0 ? 'x' : 'y'));
    HairLoad least{}, most{};
    for (const auto* row : rows) {
        HairLoad load{};
        for (std::size_t j = 0; j < 3; ++j)
            if (session.asked[j]) load[j] = (j == 0 ? -row->wrench_S[2] : row->wrench_S[j - 1]) / area_m2;
        if (!std::isfinite(load[0] + load[1] + load[2])) continue;
        session.rows.push_back(row);
        session.load.push_back(load);
        for (std::size_t j = 0; j < 3; ++j) {
            least[j] = std::min(least[j], load[j]);
            most[j] = std::max(most[j], load[j]);
        }
    }
    if (session.rows.empty()) throw Undetermined("no row has all labels together");
    if (!(most[0] > 0)) throw Undetermined("no row is a press (fz < 0)");
    const double shear = std::max({most[1], -least[1], most[2], -least[2]});
    if (!(shear > 0)) throw Undetermined("no row has a shear force");
    session.scale_Pa = {most[0], shear, shear};
    session.pull_Pa = std::max(0.0, -least[0]);
    for (HairLoad& load : session.load)
        for (std::size_t j = 0; j < 3; ++j) load[j] /= session.scale_Pa[j];
    return session;
}

// One hair: zero, gains (dR/R0 at full scale), leak; terms that the rows do not determine are 0.
struct HairFit {
    double zero = 0, noise = 0, condition = 0;
    HairLoad gain{};
    LeakTerms leak{};
    bool whole = true;  // all terms that were asked for are determined
};

// `first`: of the leak terms that may be used; kLeakTerms = none.
HairFit fit_hair(const Session& session, std::size_t channel, std::size_t first) {
    struct Term {
        std::size_t axis, leak;  // one of the two; 3 and kLeakTerms where not
        int order;
    };
    std::vector<Term> terms;
    for (std::size_t j = 0; j < 3; ++j)
        if (session.asked[j]) terms.push_back({j, kLeakTerms, 1});
    for (const int order : {2, 3})
        for (std::size_t i = first; i < kLeakTerms; ++i) {
            const auto& e = kLeakExponents[i];
            bool known = e[0] + e[1] + e[2] == order;
            for (std::size_t j = 0; j < 3; ++j) known = known && (e[j] == 0 || session.asked[j]);
            if (known) terms.push_back({3, i, order});
        }
    HairFit fit;
    const std::size_t n = session.rows.size();
    while (n < kRowsPerCoefficient * (terms.size() + 1) && terms.back().order > 1) {
        const int order = terms.back().order;
        while (terms.back().order == order) terms.pop_back();
        fit.whole = false;
    }
    if (n < kRowsPerCoefficient * (terms.size() + 1))
        throw Undetermined(fmt::format("{} rows with all labels for {} coefficients a hair; at least {} are needed", n,
                                       terms.size() + 1, kRowsPerCoefficient * (terms.size() + 1)));
    Eigen::VectorXd y(static_cast<Eigen::Index>(n));
    for (std::size_t r = 0; r < n; ++r) y[Eigen::Index(r)] = session.rows[r]->channel[channel];
    const double centre = y.mean();  // a large zero costs no digits
    y.array() -= centre;
    for (;;) {
        Eigen::MatrixXd a(Eigen::Index(n), Eigen::Index(terms.size() + 1));
        for (std::size_t r = 0; r < n; ++r) {
            const LeakTerms products = leak_terms(session.load[r]);
            a(Eigen::Index(r), 0) = 1;
            for (std::size_t t = 0; t < terms.size(); ++t)
                a(Eigen::Index(r), Eigen::Index(t + 1)) =
                    terms[t].axis < 3 ? session.load[r][terms[t].axis] : products[terms[t].leak];
        }
        const Robust robust = robust_least_squares(a, y);
        if (!robust.solved.dependent.empty()) {
            const std::size_t last = robust.solved.dependent.back();
            if (last == 0 || terms[last - 1].order == 1)
                throw Undetermined("normal and shear forces do not vary independently of each other");
            terms.erase(terms.begin() + std::ptrdiff_t(last - 1));
            fit.whole = false;
            continue;
        }
        fit.zero = centre + robust.solved.coefficient[0];
        for (std::size_t t = 0; t < terms.size(); ++t) {
            const double value = robust.solved.coefficient[Eigen::Index(t + 1)];
            (terms[t].axis < 3 ? fit.gain[terms[t].axis] : fit.leak[terms[t].leak]) = value;
        }
        fit.condition = robust.solved.condition;
        fit.noise = std::max({robust.sd, kLeastNoise * std::sqrt(y.squaredNorm() / double(n)), 1e-300});
        return fit;
    }
}

std::vector<HairFit> fit_hairs(const Session& session, Calibration& calibration, std::size_t first,
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

void store_scales(const Session& session, double area_m2, Calibration& calibration) {
    calibration.parameters = {
        {"area_m2", area_m2}, {"normal_scale_Pa", session.scale_Pa[0]}, {"shear_scale_Pa", session.scale_Pa[1]}};
    if (session.pull_Pa > 0) calibration.parameters["pull_scale_Pa"] = session.pull_Pa;
}

// `first` of the leak terms goes into the table of that name.
void store_response(const Session& session, const std::vector<HairFit>& hairs, std::size_t first, const char* name,
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
    const Session session = session_of(rows, calibration, area_m2);
    for (std::size_t axis = 0; axis < 2; ++axis)
        if (session.asked[axis + 1] && !(has(session, axis) && has(session, axis + 2)))
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
        const Robust line = robust_least_squares(a, y);
        if (!line.solved.dependent.empty()) throw Undetermined("a shear force is always the same");
        calibration.parameters[axis == 0 ? "diff_x_per_Pa" : "diff_y_per_Pa"] =
            line.solved.coefficient[1] / session.scale_Pa[axis + 1];
    }
}

void fit_hair_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = parameter(calibration, "area_m2", kHairCapArea_m2);
    const Session session = session_of(rows, calibration, area_m2);
    const auto hairs = fit_hairs(session, calibration, 0, warnings);
    store_scales(session, area_m2, calibration);
    store_response(session, hairs, 0, "leak", calibration);
}

void fit_hair_physics(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const double area_m2 = parameter(calibration, "area_m2", kHairCapArea_m2);
    const Session session = session_of(rows, calibration, area_m2);
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
