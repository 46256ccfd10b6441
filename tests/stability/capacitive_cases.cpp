// Model "capacitive": roots of a quadratic near and past its vertex, a gap that closes, areas that hardly change.
#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/constants/constants.hpp>
#include <cmath>

#include "decoupling/capacitive/pad.hpp"
#include "decoupling/capacitive/sector_overlap.hpp"
#include "decoupling/solve/curve.hpp"
#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"

namespace tactiled::stability {
namespace {

// fz from Cn alone.
Calibration centre(double b, double a, double range_N) {
    Calibration c = calibration_of("capacitive/quadratic");
    c.channels = {"Cn"};
    c.zero = {1.3039};
    c.components = {"fz"};
    c.sd = {0.05};
    c.full_scale = {};
    c.parameters = {{"normal_b", b}, {"normal_a", a}, {"normal_range_N", range_N}};
    c.tables.clear();
    return c;
}

double printed_root(double a, double b, double y) { return (-b + std::sqrt(b * b + 4 * a * y)) / (2 * a); }
Real exact_root(double a, double b, double y) {
    return 2 * Real(y) / (Real(b) + sqrt(Real(b) * Real(b) + 4 * Real(a) * Real(y)));
}

void add_roots(Cases& cases) {
    // The channel less its zero is exact; from there on the root nearest to 0 loses nothing, however flat the curve.
    const double tiny = 1.303900001 - 1.3039;
    cases.value("H02", "1e-9 pF of the thesis' curve: fz",
                {-printed_root(0.0008, 0.0405, tiny), estimate_of(centre(0.0405, 0.0008, 10), {1.303900001}).wrench_S[2],
                 -exact_root(0.0008, 0.0405, tiny)});
    const double y = 1.7039 - 1.3039;
    cases.value("H03", "curvature of 1e-18: fz",
                {-printed_root(1e-18, 0.0405, y), estimate_of(centre(0.0405, 1e-18, 10), {1.7039}).wrench_S[2],
                 -exact_root(1e-18, 0.0405, y)});
    cases.value(
        "H03b", "no curvature at all: fz",
        {-printed_root(0, 0.0405, y), estimate_of(centre(0.0405, 0, 10), {1.7039}).wrench_S[2], -exact_root(0, 0.0405, y)});
    cases.value("H05", "discriminant of nearly equal roots (Kahan)",
                {189812534.0 * 189812534.0 - 4 * 94906265.625 * 94906268.375,
                 discriminant(94906265.625, 189812534.0, -94906268.375), Real(7.5625), 1, 2});
    // Just before the vertex: b^2 + 4 a y is 1e-13 of b^2.
    const double a = -0.0008, b = 0.0405, at = b * b / (4 * -a) * (1 - 1e-13), read = 1.3039 + at, left = read - 1.3039;
    cases.value("C1", "1e-13 before the vertex of a falling curve: fz",
                {-printed_root(a, b, left), estimate_of(centre(b, a, 30), {read}).wrench_S[2], -exact_root(a, b, left)});
    const Estimate past = estimate_of(centre(b, a, 30), {1.3039 + 1.01 * b * b / (4 * -a)});
    cases.marked("C2", "past the vertex, no root",
                 {as_good(-printed_root(a, b, 1.01 * b * b / (4 * -a))), published(past, 2),
                  TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY});
    // H04: a falling side electrode below its least capacitance, its partner missing.
    Calibration sides = calibration_of("capacitive/quadratic");
    sides.parameters["shear_range_N"] = 3;
    const std::vector<double> below{1.1776, kNaN, 1.2285, 1.2285, 1.3039};
    cases.marked("H04", "a falling electrode below its vertex",
                 {as_good(printed_root(0.0071, 0.038, 1.1776 - 1.2285)), published(estimate_of(sides, below), 0),
                  TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY, -0.038 / 2 / 0.0071, 1e-12});
    // Huge readings: straight on, and said so.
    cases.marked("C3", "Cn at 1e300 pF",
                 {as_good(-printed_root(0.0008, 0.0405, 1e300)),
                  published(estimate_of(centre(0.0405, 0.0008, 10), {1e300}), 2), TACTILED_OUTSIDE_DOMAIN});
}

void add_gap(Cases& cases) {
    const PadLaw pad{31, 0, 400, 0};
    const auto law = [](const Real& v) {
        const Real u = 1 + v;
        return Real(31) * (u * u - 1 / u) / 3;
    };
    const double u = 1 + 1e-15;
    cases.value("H06", "press of a gap that closed by 1e-15 of itself",
                {31.0 / 3 * (u * u - 1 / u), pad.press_N(1e-15), law(Real(1e-15))});
    // H07: 1 zF = 1e-9 pF of 0.1038 pF: closeness is C / C0 in the textbook, its change here.
    Calibration c = calibration_of("capacitive/ratio");
    c.parameters["stiffening"] = 0;
    const double rest = c.zero[4], active = rest - 0.4, read = rest + 1e-9;
    std::vector<double> channel = c.zero;
    channel[4] = read;
    const Real v = (Real(read) - Real(rest)) / Real(active);
    const double textbook_u = (read - 0.4) / active;
    cases.value(
        "H07", "displacement from 1e-9 pF: fz",
        {-31.0 / 3 * (textbook_u * textbook_u - 1 / textbook_u), estimate_of(c, channel).wrench_S[2], -law(v), 1, 16});
    // The gap closes: C grows without end; and opens without end.
    channel[4] = 0.4 + 0.1038 * 40;
    cases.marked("C4", "a gap of a fortieth: the pad is none any more",
                 {as_good(-31.0 / 3 * 1600), published(estimate_of(c, channel), 2),
                  TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY});
    channel[4] = 0.4;
    cases.marked("C5", "an endless gap, where (C1 - C2) / Cn is x / 0",
                 {as_good((channel[0] - channel[1]) / (channel[4] - 0.4)), published(estimate_of(c, channel), 0),
                  TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY});
    // H23, H23b: a bonded disc with the bulk modulus, not Poisson's ratio, as its parameter; E = 0.1 MPa. 1 - 2 nu is exact
    // in double, and errors of K reach the modulus by 3 E / (K + 3 E) < 1.
    for (const double nu : {0.49, 0.4999, 0.4999999}) {
        const double bulk = 1e5 / (3 * (1 - 2 * nu));
        const Real apparent = Real(1e5) * 3;
        cases.value(fmt::format("H23 {}", nu), fmt::format("modulus of a bonded disc as wide as thick, nu = {}", nu),
                    {kNaN, bonded_disc_modulus(1e5, bulk, 1), apparent / (1 + apparent * 3 * (1 - 2 * Real(nu)) / Real(1e5)),
                     1, 8, 0, Textbook::none});
    }
    cases.value("H23b", "the same with K = 1 GPa",
                {kNaN, bonded_disc_modulus(1e5, 1e9, 1), Real(3e5) / (1 + Real(3e5) / Real(1e9)), 1, 8, 0, Textbook::none});
}

// Area that a disc of radius R at (dx, dy) shares with a sector, less that at rest: as one writes it down, with the angles
// where the edge is cut by acos and two areas subtracted. In 100 digits it is the reference, in double the textbook.
template <typename T>
T area_change(T inner, T outer, T from, T to, T R, T dx, T dy) {
    using std::acos, std::atan2, std::sqrt, std::abs, std::sin, std::cos, std::asin, std::min, std::max;
    const T d = sqrt(dx * dx + dy * dy), towards = atan2(dy, dx), pi = boost::math::constants::pi<T>();
    std::vector<T> cut{from, to};
    for (const T& a : {inner, outer}) {
        if (a == 0) continue;
        const T cosine = (a * a + d * d - R * R) / (2 * a * d);
        if (!(abs(cosine) < 1)) continue;
        for (const T& angle : {T(acos(cosine)), T(-acos(cosine))})
            for (int turn = -1; turn <= 1; ++turn) {
                const T at = towards + angle + 2 * pi * turn;
                if (from < at && at < to) cut.push_back(at);
            }
    }
    std::sort(cut.begin(), cut.end());
    T area = 0;
    for (std::size_t i = 0; i + 1 < cut.size(); ++i) {
        const T a = cut[i] - towards, b = cut[i + 1] - towards, middle = (a + b) / 2;
        const T edge = d * cos(middle) + sqrt(R * R - d * d * sin(middle) * sin(middle));
        // The integral of rho^2 / 2.
        const auto integral = [&](const T& t) -> T {
            const T u = d * sin(t), S = sqrt(R * R - u * u);
            return (d * d * sin(t) * cos(t) + u * S + R * R * (t + asin(u / R))) / 2;
        };
        if (edge <= inner)
            area += inner * inner / 2 * (b - a);
        else if (edge >= outer)
            area += outer * outer / 2 * (b - a);
        else
            area += integral(b) - integral(a);
    }
    const T rest = min(max(R, inner), outer);
    return area - rest * rest / 2 * (to - from);
}

void add_areas(Cases& cases) {
    // H08: a shift of 1 pm changes 30 mm^2 by 6e-15 m^2.
    const Sector sector(0.003, 0.01, 0, 0.7);
    cases.value("H08", "change of an area by a shift of 1 pm",
                {area_change<double>(0.003, 0.01, -0.7, 0.7, 0.005, 1e-12, 0), overlap(sector, 0.005, 1e-12, 0).change,
                 area_change<Real>(0.003, 0.01, Real(0) - Real(0.7), Real(0.7), Real(0.005), Real(1e-12), 0), 1, 16});
    const Real pi_double(3.14159265358979323846);
    cases.value("H09", "area of an annulus of 5 mm that is 0.1 nm wide",
                {3.14159265358979323846 * (0.0050000000001 * 0.0050000000001 - 0.005 * 0.005),
                 area_at_rest(Sector(0.005, 0.0050000000001, 0, 3.14159265358979323846), 0.006),
                 pi_double * (Real(0.0050000000001) - Real(0.005)) * (Real(0.0050000000001) + Real(0.005))});
    // The edge passes the sector's inner radius, which differs from the disc's by 1e-9 of it, under a shift of 2e-9.
    const double R = 0.005, inner = 0.005 * (1 - 1e-9), shift = 0.005 * 2e-9;
    const Sector edge(inner, 0.01, 0, 1.2);
    const Real exact = area_change<Real>(Real(inner), Real(0.01), Real(0) - Real(1.2), Real(1.2), Real(R), 0, Real(shift));
    // The edge is cut at cos = (a^2 + d^2 - R^2) / 2 a d with R - a = 5e-12 m, which doubles resolve to 2^-53 R:
    // kappa.
    cases.value("C6", "an edge that passes an electrode's rim at a grazing shift",
                {area_change<double>(inner, 0.01, -1.2, 1.2, R, 0, shift), overlap(edge, R, 0, shift).change, exact, 8, 64});
    cases.value("C7", "a shift of exactly 0",
                {area_change<double>(0.003, 0.01, -0.7, 0.7, 0.005, 0, 0), overlap(sector, 0.005, 0, 0).change, 0, 1, 0});
}

// Returns the readings of the electrodes of calibration "overlap" for a closeness and a shift (disc radii).
std::vector<double> pad_reading(const Calibration& c, double u, double x, double y) {
    const double half = c.parameters.at("opening_rad") / 2, pi = 3.14159265358979323846;
    const double R = c.parameters.at("disc_radius_m");
    std::vector<double> r;
    for (std::size_t e = 0; e < 5; ++e) {
        const double centres[] = {0, pi, pi / 2, -pi / 2, 0};
        const Real in = e == 4 ? Real(0) : Real(c.parameters.at("inner_radius_m")) / Real(R);
        const Real out = Real(e == 4 ? c.parameters.at("centre_radius_m") : c.parameters.at("outer_radius_m")) / Real(R);
        const Real from = Real(centres[e]) - Real(e == 4 ? pi : half), to = Real(centres[e]) + Real(e == 4 ? pi : half);
        const Real edge = std::min(out, Real(1)), rest = (edge * edge - in * in) * (to - from) / 2;
        const Real grown = area_change<Real>(in, out, from, to, Real(1), Real(x), Real(y)) / rest;
        constexpr const char* kStray[] = {"stray_C1", "stray_C2", "stray_C3", "stray_C4", "stray_Cn"};
        const Real active = Real(c.zero[e]) - Real(c.parameters.at(kStray[e]));
        r.push_back(double(Real(c.zero[e]) + active * (Real(u) * (1 + grown) - 1)));
    }
    return r;
}

void add_solver(Cases& cases) {
    const Calibration c = calibration_of("capacitive/overlap");
    const double pair_gain =
        2 * std::sin(c.parameters.at("opening_rad") / 2) / ((1 - 0.625 * 0.625) * c.parameters.at("opening_rad") / 2);
    const struct {
        const char *id, *what;
        double u, x, y;
    } states[] = {{"C8", "Gauss-Newton from far: a shift of 0.45 disc radii under a closing gap: fx", 2.5, 0.45, -0.2},
                  {"C9", "the same with the gap twice as wide as at rest: fx", 0.5, 0.5, 0.3},
                  {"C10", "a shift of 1e-10 disc radii: fx", 1.1, 1e-10, 0}};
    for (const auto& s : states) {
        const auto r = pad_reading(c, s.u, s.x, s.y);
        const double stiff = c.parameters.at("shear_stiffness_N_per_m") * c.parameters.at("disc_radius_m");
        const Real fx = Real(stiff) * pow(Real(s.u), Real(-0.4)) * Real(s.x);
        // Two readings below 0.5 pF are rounded by 2^-55 each, and a shift of one radius changes their difference by 0.26
        // pF: a quarter of kappa * 2^-52, of which the gap's own reading and the rest that they share take their part.
        const double kappa = 0.5 / (0.13 * std::min(s.u, 1.0) * std::abs(s.x));
        const double naive = stiff * std::pow((r[4] - 0.4) / 0.1038, -0.4) *
                             ((r[0] - c.zero[0]) / 0.0562 - (r[1] - c.zero[1]) / 0.0562) / 2 / pair_gain;
        // It stops where a step is below 1e-8: the next one would be of second order, 1e-16 and a curvature of some 10.
        cases.value(s.id, s.what, {naive, estimate_of(c, r).wrench_S[0], fx, kappa, 1, 1e-15 / std::abs(s.x) + 2e-15});
    }
    const auto torn = pad_reading(c, 1.2, 0.96, 0);
    cases.marked(
        "C11", "a shift beyond what a pad survives",
        {as_good(4.78 * 0.96), published(estimate_of(c, torn), 0), TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY});
    const std::vector<double> against{0.9, 0.9, 0.05, 0.05, 0.45};  // no gap and no shift reads that
    cases.marked("C12", "electrodes that no gap and no shift explains",
                 {as_good(4.78 * (0.9 - 0.9)), published(estimate_of(c, against), 0), TACTILED_UNKNOWN_UNCERTAINTY});
}

}  // namespace

void add_capacitive_cases(Cases& cases) {
    add_roots(cases);
    add_gap(cases);
    add_areas(cases);
    add_solver(cases);
}

}  // namespace tactiled::stability
