// Model "table": gauges that are dead, saturated, missing or nearly collinear; one point on a plate.
#include <Eigen/Dense>
#include <cmath>

#include "decoupling/solve/play_hysteresis.hpp"
#include "decoupling/table/influence_map.hpp"
#include "decoupling/table/point_contact.hpp"
#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"

namespace tactiled::stability {
namespace {

constexpr double kNormal = 19366e-6, kTangential = 10847e-6;  // 1/N, as methods.cpp
constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

Calibration inner_four(const std::string& method = "linear") {
    Calibration c = calibration_of("table/linear");
    c.method = method;
    c.channels = {"R1", "R3", "R5", "R7"};
    c.zero.assign(4, 0.0);
    c.parameters.erase("tangential_outer");
    return c;
}

std::vector<double> four(double fx, double fy, double n) {
    return {kNormal * n - kTangential * fx, kNormal * n - kTangential * fy, kNormal * n + kTangential * fx,
            kNormal * n + kTangential * fy};
}

std::vector<double> eight(double fx, double fy, double n) {
    const auto r = four(fx, fy, n);
    const double to = 8582e-6;
    return {r[0], to * fx, r[1], to * fy, r[2], -to * fx, r[3], -to * fy};
}

// The pseudo-inverse of four gauges as printed, whatever they say.
double textbook_fx(const std::vector<double>& r) { return (r[2] - r[0]) / (2 * kTangential); }
double textbook_n(const std::vector<double>& r) { return (r[0] + r[1] + r[2] + r[3]) / (4 * kNormal); }

void add_gauges_lost(Cases& cases) {
    constexpr std::uint32_t kDropped = TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
    auto dead = four(0.3, -0.2, 1);
    dead[2] = 0;
    // Three gauges, condition 5.3 of their scaled gains: 64 roundings of it.
    const double within = 64 * 6 * std::numeric_limits<double>::epsilon();
    cases.marked("H12", "R5 dead, reads 0: Fx",
                 {as_good(textbook_fx(dead)), published(estimate_of(inner_four(), dead), 0), kDropped, 0.3, within});
    auto clipped = four(0.3, -0.2, 1);
    for (double& r : clipped) r = std::min(r, 0.0205);
    cases.marked("H13", "two of four gauges at their rail: N",
                 {as_good(textbook_n(clipped)), published(estimate_of(inner_four(), clipped, 0, 0b0110), 2)});
    auto one = four(0.3, -0.2, 1);
    one[2] = 0.0205;
    cases.marked("H13b", "one of four gauges at its rail: Fx",
                 {as_good(textbook_fx(one)), published(estimate_of(inner_four(), one, 0, 0b0100), 0), TACTILED_SATURATED,
                  0.3, within});
    auto missing = four(0.3, -0.2, 1);
    missing[1] = kNoNumber;
    cases.marked("T1", "three of four gauges, one not a number: N",
                 {as_good(textbook_n(missing)), published(estimate_of(inner_four(), missing), 2), TACTILED_MISSING_CHANNEL,
                  -1.0, within});
    auto two = eight(0.3, -0.2, 1);
    two[5] = 0, two[0] = 0.0161;  // R6 dead, R1 saturated
    const Calibration matrix = calibration_of("table/matrix");
    cases.marked("T2", "eight gauges, one dead and one at its rail: Fx",
                 {as_good((two[4] - two[0]) / (2 * kTangential)), published(estimate_of(matrix, two, 0, 0b1), 0),
                  kDropped | TACTILED_SATURATED, 0.3, within});
    auto three = four(0.3, -0.2, 1);
    three[2] = 0;  // R5 dead and R1 saturated: three gauges cannot contradict each other
    cases.marked(
        "T3", "four gauges, one dead and one at its rail",
        {as_good(textbook_fx(three)), published(estimate_of(inner_four(), three, 0, 0b0001), 0), TACTILED_SATURATED});
    auto wrong = four(0.3, -0.2, 1);
    wrong[2] *= 1.5;  // a gauge that came off: four cannot show which one
    cases.marked("T4", "four gauges, one reads half as much again",
                 {as_good(textbook_fx(wrong)), published(estimate_of(inner_four(), wrong), 0),
                  TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY});
    // H10: columns that differ by 1e-9 of their length. The textbook inverts G'G, whose condition number is 1e20.
    Calibration collinear = calibration_of("table/matrix");
    collinear.channels = {"R1", "R3", "R5", "R7"};
    collinear.zero.assign(4, 0.0);
    collinear.components = {"fx", "fy"};
    collinear.sd = {0.01, 0.01};
    collinear.full_scale = {1, 1};
    collinear.tables["forward"] = {{1, 1}, {1, 1 + 1e-9}, {1, 1 - 1e-9}, {1, 1}};
    cases.refused("H10", "four gauges whose gains are collinear to 1e-9", std::numeric_limits<double>::infinity(),
                  refusal_of(collinear), "do not determine fx fy");
}

void add_offsets_and_sizes(Cases& cases) {
    // Counts of a converter with a large rest: the channels are exact, less their zeros they are exact, so kappa is 1.
    Calibration c = inner_four();
    c.zero.assign(4, 8388000.0);
    c.parameters = {{"normal_inner", 250.0}, {"tangential_inner", 140.0}, {"noise", 0.5}};
    const std::vector<double> counts{8388000, 8388001, 8388002, 8388001};
    const float offset = float((counts[2] - 8388000.3) - (counts[0] - 8388000.3));
    cases.value("T5", "two counts of shear on a zero of 8,388,000 counts",
                {double(float(counts[2]) / 280.0f - float(counts[0]) / 280.0f + 0 * offset),
                 estimate_of(c, counts).wrench_S[0], Real(2) / 280, 1, 8, 0, Textbook::single});
    // Denormal readings: their own grid is 2^-1074.
    std::vector<double> tiny = four(1, 0, 0);
    for (double& r : tiny) r *= 1e-307;
    const Real reference = (Real(tiny[2]) - Real(tiny[0])) / (2 * Real(kTangential));
    const double norm = std::sqrt(tiny[0] * tiny[0] + tiny[2] * tiny[2]);
    cases.value("T6", "readings of 1e-309",
                {tiny[2] / norm * norm / kTangential, estimate_of(inner_four(), tiny).wrench_S[0], reference, 1, 16,
                 64 * 4.94e-324 / std::abs(tiny[2])});
    const std::vector<double> huge = four(1e160, 0, 2e160);  // their squares are infinite
    const Estimate estimate = estimate_of(inner_four(), huge);
    cases.marked("T7", "readings of 1e158, whose squares overflow",
                 {as_good(textbook_fx(huge)), published(estimate, 0), TACTILED_DISAGREEMENT | TACTILED_OUTSIDE_DOMAIN});
    // At rest every gauge shows noise; an angle of it would jump about. 0 = no direction.
    Calibration signs = inner_four("signs");
    const std::vector<double> rest{1e-5, -2e-5, 1.5e-5, 0.5e-5};
    cases.value("T8", "direction at rest, from noise",
                {std::atan2(rest[3] - rest[1], rest[2] - rest[0]), double(estimate_of(signs, rest).direction), 0, 1, 0});
}

// Play operators as Krejci defines them: what the product's own are judged by, in 100 digits, and what a textbook's inverse
// iterates over, in double.
template <typename T>
struct WrittenOut {
    const PlayOperators& plays;
    T state[4]{};
    T next(const T& value) {
        T sum = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            const T min = value - T(plays.threshold[i]), max = value + T(plays.threshold[i]);
            if (state[i] < min) state[i] = min;
            if (state[i] > max) state[i] = max;
            sum += T(plays.weight[i]) * state[i];
        }
        return sum;
    }
};

// The same load again and again through plays and their inverse: equal extrema wipe each other out, or an error grows.
void add_hysteresis(Cases& cases) {
    PlayOperators plays;
    plays.n = 4;
    plays.threshold = {0, 0.05, 0.1, 0.2};
    plays.weight = {0.95, 0.02, 0.02, 0.01};
    const PlayOperators undo = plays.inverse();
    // The textbook's inverse: a fixed-point iteration over the model, which remembers the guesses, too.
    WrittenOut<Real> forward{plays};
    WrittenOut<double> guessed{plays};
    PlayState back;
    double ours = 0, naive = 0;
    for (int i = 0; i <= 20'000; ++i) {
        const auto y = double(forward.next(Real(i % 2 == 0 ? 0.7 : -0.3)));
        ours = back.next(undo, y);
        for (int k = 0; k < 30; ++k) naive += y - guessed.next(naive);
    }
    cases.value("T9", "hysteresis undone after 20,000 turns at the same two extremes", {naive, ours, Real(0.7), 1, 16});
}

struct PlateCase {
    double x_m, y_m;
    std::array<double, 3> force;
};

// The map's own reading of a contact; for two contacts, the sum. The product's own interpolation: these cases judge
// the search alone.
std::vector<double> plate_reading(const InfluenceMap& map, const PlateCase& contact) {
    InfluenceMap::At at;
    map.at(contact.x_m, contact.y_m, at);
    std::vector<double> r(8);
    for (int k = 0; k < 8; ++k)
        for (int c = 0; c < 3; ++c) r[std::size_t(k)] += at.value(k, c) * contact.force[std::size_t(c)];
    return r;
}

// Gauss-Newton from wherever the last contact was, here near the opposite edge, without a bound on its steps: fz.
double newton(const InfluenceMap& map, const std::vector<double>& r) {
    const Eigen::Map<const Gauges> y(r.data());
    Eigen::Vector2d p(-7e-4, 3e-4);
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    for (int i = 0; i < 30; ++i) {
        InfluenceMap::At at;
        map.at(p.x(), p.y(), at);
        force = at.value.colPivHouseholderQr().solve(y);
        Eigen::Matrix<double, 8, 5> a;
        a << at.value, at.dx * force, at.dy * force;
        const Eigen::Matrix<double, 5, 1> step = a.colPivHouseholderQr().solve(y - at.value * force);
        p += step.tail<2>();
    }
    return force.z();
}

// The greatest error of fz, in N, that one step of Gauss-Newton leaves from 1 um beside the point: where the product says
// that it may stop, and go along linearly.
double left_by_a_last_step(const InfluenceMap& map, const std::vector<double>& r, const PlateCase& contact) {
    double max = 0;
    for (int i = 0; i < 16; ++i) {
        InfluenceMap::At at;
        map.at(contact.x_m + 1e-6 * std::cos(i * M_PI / 8), contact.y_m + 1e-6 * std::sin(i * M_PI / 8), at);
        const Eigen::Map<const Gauges> y(r.data());
        const Eigen::Vector3d force = at.value.colPivHouseholderQr().solve(y);
        Eigen::Matrix<double, 8, 5> a;
        a << at.value, at.dx * force, at.dy * force;
        const Eigen::Matrix<double, 5, 1> step = a.colPivHouseholderQr().solve(y - at.value * force);
        max = std::max(max, std::abs(force.z() + step[2] - contact.force[2]));
    }
    return max;
}

void add_plate(Cases& cases) {
    const Calibration c = calibration_of("table/map");
    std::string fault;
    const InfluenceMap map = *influence_of(c, fault);
    const struct {
        const char *id, *what;
        PlateCase at;
    } points[] = {{"T10", "a first touch far from the middle, no start known: fz", {6.3e-4, -3.1e-4, {0.2, 0.1, -1}}},
                  {"T11", "a first touch beside a column, in a narrow valley: fz", {3.4e-4, 2.0e-4, {0.05, 0.1, -0.8}}},
                  {"T12", "a first touch exactly in the middle, a saddle by symmetry: fz", {0, 0, {0, 0, -0.5}}}};
    for (const auto& one : points) {
        const auto r = plate_reading(map, one.at);
        // Unknowns in units of the force and of a ring, readings in units of their length.
        InfluenceMap::At at;
        map.at(one.at.x_m, one.at.y_m, at);
        const Eigen::Vector3d f(one.at.force[0], one.at.force[1], one.at.force[2]);
        Eigen::Matrix<double, 8, 5> a;
        a << at.value * f.norm(), at.dx * f * map.spacing_m(), at.dy * f * map.spacing_m();
        const Eigen::JacobiSVD<Eigen::MatrixXd> svd{Eigen::MatrixXd(a)};
        const double length = Eigen::Map<const Gauges>(r.data()).norm(), min = svd.singularValues()[4];
        const double kappa = length / min / std::abs(f.z()) * f.norm();
        const double slack = left_by_a_last_step(map, r, one.at) / std::abs(f.z());
        cases.value(one.id, one.what, {newton(map, r), estimate_of(c, r).wrench_S[2], one.at.force[2], kappa, 64, slack});
    }
    const auto rim = plate_reading(map, {9.6e-4, 0, {0.1, 0, -1}});
    cases.marked("T13", "a point beyond the plate's edge",
                 {as_good(newton(map, rim)), published(estimate_of(c, rim), 2), TACTILED_OUTSIDE_DOMAIN});
    auto both = plate_reading(map, {6e-4, 1e-4, {0, 0, -0.5}});
    const auto other = plate_reading(map, {-5e-4, -2e-4, {0, 0.1, -0.6}});
    for (std::size_t k = 0; k < 8; ++k) both[k] += other[k];
    cases.marked("T14", "two points at once: no point explains it",
                 {as_good(newton(map, both)), published(estimate_of(c, both), 2), TACTILED_UNKNOWN_UNCERTAINTY});
    // Without contact, the centre of pressure is 0/0.
    const std::vector<double> rest(8, 1e-7);
    const Estimate at_rest = estimate_of(c, rest);
    const double naive_x = (rest[4] - rest[0]) / (rest[0] + rest[2] - rest[4] - rest[6]);
    cases.value("T15", "centre of pressure with no force: none is claimed",
                {naive_x, std::isnan(at_rest.cop_S_m[0]) && at_rest.quality() != TACTILED_BAD ? 0.0 : 1.0, 0, 1, 0});
}

}  // namespace

void add_table_cases(Cases& cases) {
    add_gauges_lost(cases);
    add_offsets_and_sizes(cases);
    add_hysteresis(cases);
    add_plate(cases);
}

}  // namespace tactiled::stability
