// The spline runs along whole diameters, with ring -i at an angle being ring +i across the centre, and around each
// ring with the period of the circle. The centre is therefore a point like any other.
#include "decoupling/table/influence_map.hpp"
#include "decoupling/solve/dense.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace tactiled {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

struct Grid {
    double spacing_m = 0;
    int rings = 0, angles = 0;
    std::vector<std::size_t> row;  // index of the row for (ring - 1) * angles + angle
    std::size_t centre = 0;
    std::string fault;
};

Grid grid_of(const std::vector<std::vector<double>>& rows) {
    Grid grid;
    const auto refuse = [&](const std::string& text) {
        grid.fault = "table influence: " + text;
        return grid;
    };
    if (rows.size() < 40 || rows.front().size() != 26)
        return refuse("needed are 40 rows and more of 26: x_m y_m and the strain per N of Fx Fy Fz for R1 .. R8");
    double min = std::numeric_limits<double>::infinity(), max = 0;
    std::size_t centres = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) max = std::max(max, std::hypot(rows[i][0], rows[i][1]));
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const double r = std::hypot(rows[i][0], rows[i][1]);
        if (r > 1e-3 * max) {
            min = std::min(min, r);
        } else {
            grid.centre = i;
            ++centres;
        }
    }
    if (centres != 1 || !(max > 0)) return refuse(fmt::format("{} points at the centre; one is needed", centres));
    grid.rings = int(std::lround(std::min(max / min, 1e6)));
    grid.spacing_m = max / grid.rings;
    const std::size_t around = rows.size() - 1;
    if (grid.rings < 4 || around % std::size_t(grid.rings) != 0 || around / std::size_t(grid.rings) % 2 != 0 ||
        around / std::size_t(grid.rings) < 8)
        return refuse(fmt::format("{} points are no {} rings of equally many (an even number, 8 or more) and a centre",
                                  rows.size(), grid.rings));
    grid.angles = int(around / std::size_t(grid.rings));
    grid.row.assign(around, rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (i == grid.centre) continue;
        const double ring = std::hypot(rows[i][0], rows[i][1]) / grid.spacing_m;
        const double angle = std::atan2(rows[i][1], rows[i][0]) / kTwoPi * grid.angles;
        if (std::abs(ring - std::round(ring)) > 0.01 || std::abs(angle - std::round(angle)) > 0.01)
            return refuse(fmt::format("the point ({}, {}) is not on the grid of {} rings and {} angles", rows[i][0],
                                      rows[i][1], grid.rings, grid.angles));
        const int at = (int(std::lround(angle)) + grid.angles) % grid.angles;
        auto& slot = grid.row[std::size_t((int(std::lround(ring)) - 1) * grid.angles + at)];
        if (slot != rows.size()) return refuse(fmt::format("the point ({}, {}) twice", rows[i][0], rows[i][1]));
        slot = i;
    }
    return grid;
}

// Weights of the four coefficients around t in 0 .. 1 of a cell, and their derivatives.
struct Weights {
    std::array<double, 4> value, slope;
};
Weights weights_at(double t) noexcept {
    const double s = 1 - t;
    return {{s * s * s / 6, (3 * t * t * (t - 2) + 4) / 6, (3 * s * s * (s - 2) + 4) / 6, t * t * t / 6},
            {-s * s / 2, t * (3 * t - 4) / 2, s * (4 - 3 * s) / 2, t * t / 2}};
}

}  // namespace

std::string InfluenceMap::fault_of(const std::vector<std::vector<double>>& rows) { return grid_of(rows).fault; }

InfluenceMap::InfluenceMap(const std::vector<std::vector<double>>& rows, const std::array<int, 8>& gauge,
                           const std::array<double, 8>& gain) {
    const Grid grid = grid_of(rows);
    spacing_m_ = grid.spacing_m;
    n_rings_ = grid.rings;
    n_angles_ = grid.angles;
    const int n = n_angles_, half = n / 2, along = 2 * n_rings_ + 1;
    // Converts coefficients to values at the nodes: (1, 4, 1) / 6. Around the circle it is periodic; along a diameter
    // the third derivative is continuous over the last but one node.
    Eigen::MatrixXd around = Eigen::MatrixXd::Zero(n, n);
    for (int j = 0; j < n; ++j) {
        around(j, j) += 4.0 / 6;
        around(j, (j + 1) % n) += 1.0 / 6;
        around(j, (j + n - 1) % n) += 1.0 / 6;
    }
    Eigen::MatrixXd across = Eigen::MatrixXd::Zero(along + 2, along + 2);
    for (int i = 0; i < along; ++i) across.row(i + 1).segment<3>(i) << 1.0 / 6, 4.0 / 6, 1.0 / 6;
    across.row(0).head<5>() << 1, -4, 6, -4, 1;
    across.row(along + 1).tail<5>() << 1, -4, 6, -4, 1;
    const Eigen::PartialPivLU<Eigen::MatrixXd> around_lu(around), across_lu(across);

    coefficients_.assign(std::size_t((n_rings_ + 3) * n * kValues), 0.0);
    for (int v = 0; v < kValues; ++v) {
        const int i = v % 8, component = v / 8;
        if (gauge[std::size_t(i)] < 0) continue;
        const auto column = std::size_t(2 + 3 * gauge[std::size_t(i)] + component);
        Eigen::MatrixXd rings(n_rings_ + 1, n);  // coefficients around each ring
        rings.row(0).setConstant(gain[std::size_t(i)] * rows[grid.centre][column]);
        for (int ring = 1; ring <= n_rings_; ++ring) {
            Eigen::VectorXd values(n);
            for (int j = 0; j < n; ++j)
                values[j] = gain[std::size_t(i)] * rows[grid.row[std::size_t((ring - 1) * n + j)]][column];
            rings.row(ring) = around_lu.solve(values).transpose();
        }
        for (int j = 0; j < n; ++j) {
            Eigen::VectorXd values = Eigen::VectorXd::Zero(along + 2);
            for (int ring = -n_rings_; ring <= n_rings_; ++ring)
                values[ring + n_rings_ + 1] = rings(std::abs(ring), ring < 0 ? (j + half) % n : j);
            const Eigen::VectorXd c = across_lu.solve(values);
            for (int ring = -1; ring <= n_rings_ + 1; ++ring)
                coefficients_[std::size_t(((ring + 1) * n + j) * kValues + v)] = c[ring + n_rings_ + 1];
        }
    }
}

void InfluenceMap::at(double x_m, double y_m, At& out) const noexcept {
    using Values = Eigen::Array<double, kValues, 1>;
    // At the centre the direction is undefined; at 1e-4 of a ring from there the value is the same.
    double r = std::hypot(x_m, y_m) / spacing_m_;
    const double angle = std::atan2(y_m, x_m);
    r = std::clamp(r, 1e-4, n_rings_ + 1.0);
    const int ring = std::min(int(r), n_rings_ - 1);
    double turn = angle / kTwoPi * n_angles_;
    if (turn < 0) turn += n_angles_;
    const int sector = std::min(int(turn), n_angles_ - 1);
    const Weights wr = weights_at(r - ring), wa = weights_at(turn - sector);
    Values value = Values::Zero(), by_r = Values::Zero(), by_angle = Values::Zero();
    for (int j = 0; j < 4; ++j) {
        const int column = (sector + j - 1 + n_angles_) % n_angles_;
        Values line = Values::Zero(), slope = Values::Zero();
        for (int i = 0; i < 4; ++i) {
            const Eigen::Map<const Values> c(coefficient(ring + i - 1, column));
            line += wr.value[std::size_t(i)] * c;
            slope += wr.slope[std::size_t(i)] * c;
        }
        value += wa.value[std::size_t(j)] * line;
        by_r += wa.value[std::size_t(j)] * slope;
        by_angle += wa.slope[std::size_t(j)] * line;
    }
    const double cosine = std::cos(angle), sine = std::sin(angle);
    const double radial = 1 / spacing_m_, tangential = n_angles_ / (kTwoPi * r * spacing_m_);
    Eigen::Map<Values>(out.value.data()) = value;
    Eigen::Map<Values>(out.dx.data()) = (radial * cosine) * by_r - (tangential * sine) * by_angle;
    Eigen::Map<Values>(out.dy.data()) = (radial * sine) * by_r + (tangential * cosine) * by_angle;
}

Influence InfluenceMap::mean() const {
    const int rings = 8 * n_rings_, angles = 2 * n_angles_;
    Influence sum = Influence::Zero();
    At here;
    double area = 0;
    for (int i = 0; i < rings; ++i) {
        const double r = (i + 0.5) / rings * radius_m();
        for (int j = 0; j < angles; ++j) {
            const double angle = kTwoPi * (j + 0.5) / angles;
            at(r * std::cos(angle), r * std::sin(angle), here);
            sum += r * here.value;
            area += r;
        }
    }
    return sum / area;
}

}  // namespace tactiled
