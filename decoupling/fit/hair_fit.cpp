#include "decoupling/fit/hair_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/least_squares.hpp"
#include "decoupling/hair/setup.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr int kReweightings = 20;
// Minimum noise of a hair, relative to its rms reading: rows without noise would otherwise get infinite weights.
constexpr double kMinNoise = 1e-4;

}  // namespace

RobustFit robust_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& y) {
    RobustFit result{.solved = least_squares(a, y)};
    if (!result.solved.dependent.empty()) return result;
    for (int i = 0; i < kReweightings; ++i) {
        const Eigen::VectorXd error = y - a * result.solved.coefficient;
        result.sd = robust_sd(error) * std::sqrt(double(a.rows()) / double(a.rows() - a.cols()));
        if (!(result.sd > 1e-13 * y.cwiseAbs().maxCoeff())) break;  // only rounding is left
        const Eigen::VectorXd weight = (1 + (error / (kCauchyEfficient * result.sd)).array().square()).rsqrt();
        const LeastSquares next = least_squares(weight.asDiagonal() * a, weight.cwiseProduct(y));
        if (!next.dependent.empty()) break;
        const double change = (a * (next.coefficient - result.solved.coefficient)).cwiseAbs().maxCoeff();
        result.solved.coefficient = next.coefficient;
        if (change < 1e-3 * result.sd / std::sqrt(double(a.rows()))) break;
    }
    return result;
}

bool has_hair(const HairSession& session, std::size_t hair) {
    return std::find(session.hair.begin(), session.hair.end(), hair) != session.hair.end();
}

HairSession hair_session_of(const Rows& rows, const Calibration& calibration, double area_m2) {
    HairSession session;
    for (const auto& name : calibration.channels) {
        const std::size_t hair = hair_index(name);
        if (hair == 4 || has_hair(session, hair))
            throw Undetermined(fmt::format("channel {} is no hair of model \"hair\" (H1 .. H4, each once)", name));
        session.hair.push_back(hair);
    }
    for (const auto& name : calibration.components) {
        const std::size_t c = component_index(name);
        if (c > 2) throw Undetermined(fmt::format("a hair sensor does not measure {}: leave its column out", name));
        session.asked[(c + 1) % 3] = true;
    }
    if (!session.asked[0] || !(session.asked[1] || session.asked[2]))
        throw Undetermined("model \"hair\" needs the labels fz_N and at least one of fx_N fy_N");
    for (std::size_t axis = 0; axis < 2; ++axis)
        if (session.asked[axis + 1] && !has_hair(session, axis) && !has_hair(session, axis + 2))
            throw Undetermined(fmt::format("H{} and H{} are missing, so f{} cannot be measured: leave its column out",
                                           axis + 1, axis + 3, axis == 0 ? 'x' : 'y'));
    HairLoad min{}, max{};
    for (const auto* row : rows) {
        HairLoad load{};
        for (std::size_t j = 0; j < 3; ++j)
            if (session.asked[j]) load[j] = (j == 0 ? -row->wrench_S[2] : row->wrench_S[j - 1]) / area_m2;
        if (!std::isfinite(load[0] + load[1] + load[2])) continue;
        session.rows.push_back(row);
        session.load.push_back(load);
        for (std::size_t j = 0; j < 3; ++j) {
            min[j] = std::min(min[j], load[j]);
            max[j] = std::max(max[j], load[j]);
        }
    }
    if (session.rows.empty()) throw Undetermined("no row has all labels together");
    if (!(max[0] > 0)) throw Undetermined("no row is a press (fz < 0)");
    const double shear = std::max({max[1], -min[1], max[2], -min[2]});
    if (!(shear > 0)) throw Undetermined("no row has a shear force");
    session.scale_Pa = {max[0], shear, shear};
    session.pull_Pa = std::max(0.0, -min[0]);
    for (HairLoad& load : session.load)
        for (std::size_t j = 0; j < 3; ++j) load[j] /= session.scale_Pa[j];
    return session;
}

HairFit fit_hair(const HairSession& session, std::size_t channel, std::size_t first) {
    struct Term {
        std::size_t axis, leak;  // one of the two is valid; the other is 3 or kLeakTerms
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
        throw Undetermined(fmt::format("{} rows with all labels for {} coefficients per hair; at least {} are needed", n,
                                       terms.size() + 1, kRowsPerCoefficient * (terms.size() + 1)));
    Eigen::VectorXd y(static_cast<Eigen::Index>(n));
    for (std::size_t r = 0; r < n; ++r) y[Eigen::Index(r)] = session.rows[r]->channel[channel];
    const double centre = y.mean();  // prevents a large zero from costing digits
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
        const RobustFit robust = robust_least_squares(a, y);
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
        fit.noise = std::max({robust.sd, kMinNoise * std::sqrt(y.squaredNorm() / double(n)), 1e-300});
        return fit;
    }
}

bool is_hair(std::string_view name) { return hair_index(name) < 4 || name == kHairDummy; }

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
