// Required density of the influence map of method "map": thinned maps against readings of the finite elements at points that
// no thinned map has.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "tests/bench/costs/influence.hpp"
#include "tests/bench/costs/turns.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kMax_m = 0.9e-3;  // from the middle: the rim begins there
constexpr double kEnough = 0.1;    // error of the force in nine of ten contacts

// The rows of a polar map: the centre and rings of equally many points.
struct Polar {
    std::size_t rings = 0, angles = 0;
    std::vector<std::size_t> row;  // row of the centre, then by ring and angle
    [[nodiscard]] std::size_t at(std::size_t ring, std::size_t angle) const { return row[1 + (ring - 1) * angles + angle]; }
};

Polar polar_of(const std::vector<std::vector<double>>& rows) {
    Polar polar;
    const auto radius = [&](std::size_t i) { return std::hypot(rows[i][0], rows[i][1]); };
    const auto cycle = [&](std::size_t i) {
        const double t = std::atan2(rows[i][1], rows[i][0]);
        return t < -1e-9 ? t + 2 * std::numbers::pi : t;
    };
    for (std::size_t i = 0; i < rows.size(); ++i) polar.row.push_back(i);
    double max_m = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) max_m = std::max(max_m, radius(i));
    for (std::size_t i = 0; i < rows.size(); ++i) polar.angles += radius(i) > max_m * (1 - 1e-6) ? 1 : 0;
    polar.rings = (rows.size() - 1) / polar.angles;
    const double spacing_m = max_m / double(polar.rings);
    const auto ring = [&](std::size_t i) { return std::lround(radius(i) / spacing_m); };
    std::sort(polar.row.begin(), polar.row.end(),
              [&](std::size_t a, std::size_t b) { return ring(a) != ring(b) ? ring(a) < ring(b) : cycle(a) < cycle(b); });
    return polar;
}

Calibration thinned(Calibration calibration, const Polar& polar, std::size_t ring_step, std::size_t angle_step) {
    const auto rows = calibration.tables.at("influence");
    std::vector<std::vector<double>> kept{rows[polar.row[0]]};
    for (std::size_t ring = ring_step; ring <= polar.rings; ring += ring_step)
        for (std::size_t angle = 0; angle < polar.angles; angle += angle_step) kept.push_back(rows[polar.at(ring, angle)]);
    calibration.tables["influence"] = kept;
    return calibration;
}

struct Errors {
    std::vector<double> force, point_um;  // error of the force vector, relative
};
// First touches, each from rest.
Errors errors_of(Decoupler& decoupler, const std::vector<PlateContact>& contacts) {
    Errors errors;
    const std::vector<double> rest(8, 0.0);
    std::uint64_t t_ns = 0;
    for (const auto& contact : contacts) {
        (void)decoupler.decouple({.channel = rest, .t_ns = ++t_ns});
        const Estimate e = decoupler.decouple({.channel = contact.reading, .t_ns = ++t_ns});
        double squares = 0, force2 = 0;
        for (std::size_t c = 0; c < 3; ++c) {
            squares += std::pow(e.wrench_S[c] - contact.force_N[c], 2);
            force2 += contact.force_N[c] * contact.force_N[c];
        }
        errors.force.push_back(std::sqrt(squares / force2));
        // Without a point, the error is the distance from the middle.
        const bool found = std::isfinite(e.cop_S_m[0]);
        errors.point_um.push_back(
            1e6 * std::hypot((found ? e.cop_S_m[0] : 0) - contact.x_m, (found ? e.cop_S_m[1] : 0) - contact.y_m));
    }
    return errors;
}

Cost measure(const CostSetup& setup) {
    const Calibration whole = influence_calibration(setup);
    const auto& rows = whole.tables.at("influence");
    const Polar polar = polar_of(rows);
    if (polar.rings != 20 || polar.angles != 48)
        throw SetupError(fmt::format("--influence: the map has {} rings of {} points; this cost thins one of 20 rings of 48",
                                     polar.rings, polar.angles));
    std::vector<PlateContact> contacts;
    for (std::size_t ring = 1; ring <= polar.rings; ring += 2)
        for (std::size_t angle = 1; angle < polar.angles; angle += 2)
            for (std::size_t seed = 0; seed < 3; ++seed) {
                const auto contact = contact_at_row(whole, polar.at(ring, angle), seed);
                if (std::hypot(contact.x_m, contact.y_m) < kMax_m) contacts.push_back(contact);
            }
    if (setup.samples > 0 && setup.samples < contacts.size()) {  // evenly thinned
        std::vector<PlateContact> fewer;
        for (std::size_t i = 0; i < setup.samples; ++i) fewer.push_back(contacts[i * contacts.size() / setup.samples]);
        contacts = fewer;
    }
    struct Step {
        std::size_t ring, angle;
    };
    std::vector<std::shared_ptr<Decoupler>> decouplers;
    std::vector<Contender> resting;
    std::vector<Errors> errors;
    std::vector<std::size_t> points;
    const std::vector<double> held = contact_at_row(whole, polar.at(8, 5), 0).reading;
    for (const Step step : {Step{1, 1}, Step{2, 1}, Step{2, 2}, Step{2, 4}, Step{4, 4}, Step{4, 6}}) {
        const Calibration calibration = thinned(whole, polar, step.ring, step.angle);
        points.push_back(calibration.tables.at("influence").size());
        decouplers.push_back(make_decoupler(calibration));
        errors.push_back(errors_of(*decouplers.back(), contacts));
        resting.push_back([decoupler = decouplers.back(), &held](std::size_t first, std::size_t last) {
            double sum = 0;  // a contact at a constant place with a varying press
            std::vector<double> reading(8);
            for (std::size_t i = first; i < last; ++i) {
                const double scale = 1 + 0.3 * std::sin(0.02 * double(i));
                for (std::size_t k = 0; k < 8; ++k) reading[k] = scale * held[k];
                sum += decoupler->decouple({.channel = reading, .t_ns = 1'000'000 + i}).wrench_S[2];
            }
            return sum;
        });
    }
    const auto ns = ns_alternating(resting, setup.samples_or(20'000));
    Cost cost;
    cost.columns = {"map", "points", "force_error_median", "force_error_90", "point_median_um", "point_90_um", "ns"};
    Figure::Series median{"half of the contacts are better", Symbol::circle, Stroke::solid},
        ninety{"nine of ten are better", Symbol::square, Stroke::solid},
        enough{"10 % of the force", Symbol::none, Stroke::dashed, {}, kInk};
    std::size_t chosen = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        // The whole map contains all points, so no point is left to test it.
        const bool judged = i > 0;
        const auto share = [&](const std::vector<double>& of, double part) { return judged ? quantile(of, part) : kNaN; };
        const double half = share(errors[i].force, 0.5), max = share(errors[i].force, 0.9);
        cost.rows.push_back(
            {fmt::format("{} points", points[i]),
             {double(points[i]), half, max, share(errors[i].point_um, 0.5), share(errors[i].point_um, 0.9), ns[i]}});
        if (!judged) continue;
        median.points.push_back(
            {double(points[i]), 100 * half, fmt::format("{} points, {:.2f} us", points[i], ns[i] / 1000)});
        ninety.points.push_back({double(points[i]), 100 * max, ""});
        if (max <= kEnough) chosen = i;
    }
    enough.points = {{double(points.back()), 100 * kEnough, ""}, {double(points[1]), 100 * kEnough, ""}};
    cost.figure = {"Method map: error of the force against the map's density",
                   {"points of finite elements in the map (it is asked at others)", true},
                   {"error of the force, % of it", true},
                   {median, ninety, enough}};
    const auto &enough_at = cost.rows[chosen].values, &next = cost.rows[std::min(chosen + 1, cost.rows.size() - 1)].values,
               &all = cost.rows.front().values;
    cost.advice = fmt::format(
        "Compute {:g} points or more: half of the contacts between them are within {:.1f} % of the force, nine of "
        "ten within {:.1f} % (with {:g} points {:.1f} and {:.0f} %); a denser map costs finite elements and no time "
        "in the loop ({:.2f} us a sample, with {:g} points {:.2f} us).",
        enough_at[0], 100 * enough_at[1], 100 * enough_at[2], next[0], 100 * next[1], 100 * next[2], enough_at[5] / 1000,
        all[0], all[5] / 1000);
    return cost;
}

}  // namespace

extern const CostEntry map_cost;
const CostEntry map_cost{"map", "density of the influence map: points against error against time",
                         "decoupling/costs_map.svg", measure};

}  // namespace tactiled::ctl
