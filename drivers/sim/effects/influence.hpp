// Strain of the table's gauges under a force anywhere on its plate, and under a force that is spread over a patch.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "drivers/sim/motion.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

// True if the body covers a part of the plate (a sphere or an edge); a flat body covers the whole plate.
inline bool makes_patch(const Body& body) { return body.shape == Body::Shape::sphere || body.shape == Body::Shape::edge; }

class InfluenceMap {
public:
    static constexpr std::size_t kRings = 20, kAngles = 48, kPoints = 1 + kRings * kAngles;
    using Strains = std::array<double, 24>;                                // per N of Fx, Fy, +Fz, of R1 .. R8
    using Matrix = std::array<std::array<double, 3>, kMaxSensorChannels>;  // channel's unit per N of fx fy fz

    // setup. `sample` must outlive the map. Points: the centre, then 20 rings of 48 points, ring after ring.
    explicit InfluenceMap(const TableSample& sample)
        : factor_{sample.gauge_factor_tangential, sample.gauge_factor_tangential, sample.gauge_factor_normal},
          plate_m_(sample.plate_radius_m),
          points_(&sample.influence),
          per_ring_(1 / std::hypot(sample.influence[1][0], sample.influence[1][1])) {
        for (std::size_t i = 0; i < kQuadratureRings; ++i)
            for (std::size_t j = 0; j < kQuadratureAngles; ++j) {
                const double rho = std::sqrt((double(i) + 0.5) / double(kQuadratureRings));
                const double angle = 2 * std::numbers::pi * (double(j) + 0.5 * double(i % 2)) / double(kQuadratureAngles);
                places_[i * kQuadratureAngles + j] = {rho * std::cos(angle), rho * std::sin(angle)};
            }
        uniform_ = mean(0, 0, plate_m_);
    }

    // Returns the additional response to a load on this patch compared with a load on the whole plate. rt: wait-free
    [[nodiscard]] Matrix excess(double x_m, double y_m, double radius_m) const noexcept {
        return matrix(mean(x_m, y_m, radius_m));
    }

    // Returns the upper limit of |excess| for a centre within |x|, |y| and a radius within 0 .. radius_m: a mean over
    // a patch is between the values at the corners of the cells that it touches. setup
    [[nodiscard]] Matrix largest_excess(double x_m, double y_m, double radius_m) const {
        const double cell = 3.5 / per_ring_;  // one ring; 1/48 of the outermost ring's length is 2.6 rings
        const bool all = x_m + radius_m >= plate_m_ || y_m + radius_m >= plate_m_ || std::hypot(x_m, y_m) >= plate_m_;
        Matrix max{};
        for (const auto& point : *points_) {
            const double beyond = radius_m + cell;
            if (!all && (std::abs(point[0]) > x_m + beyond || std::abs(point[1]) > y_m + beyond)) continue;
            Strains strains;
            std::copy(point.begin() + 2, point.end(), strains.begin());
            const Matrix here = matrix(strains);
            for (std::size_t k = 0; k < kMaxSensorChannels; ++k)
                for (std::size_t axis = 0; axis < 3; ++axis) max[k][axis] = std::max(max[k][axis], std::abs(here[k][axis]));
        }
        return max;
    }

    // Mean strains over the part of the patch that is on the plate, or at the plate's nearest point if no part is.
    [[nodiscard]] Strains mean(double x_m, double y_m, double radius_m) const noexcept {
        Strains sum{};
        std::size_t inside = 0;
        for (const auto& place : places_) {
            const double x = x_m + radius_m * place[0], y = y_m + radius_m * place[1];
            if (x * x + y * y > plate_m_ * plate_m_) continue;
            add(sum, x, y);
            ++inside;
        }
        if (inside == 0) {
            const double away = std::max(std::hypot(x_m, y_m), plate_m_);
            add(sum, x_m * plate_m_ / away, y_m * plate_m_ / away);
            inside = 1;
        }
        for (double& strain : sum) strain /= double(inside);
        return sum;
    }

private:
    [[nodiscard]] Matrix matrix(const Strains& strains) const noexcept {
        Matrix matrix{};
        for (std::size_t k = 0; k < kMaxSensorChannels; ++k)
            for (std::size_t axis = 0; axis < 3; ++axis)
                matrix[k][axis] = factor_[axis] * (strains[3 * k + axis] - uniform_[3 * k + axis]);
        return matrix;
    }

    // Adds the bilinear interpolation in ring and angle.
    void add(Strains& sum, double x, double y) const noexcept {
        const double ring = std::min(std::hypot(x, y) * per_ring_, double(kRings));
        double angle = std::atan2(y, x) * (double(kAngles) / (2 * std::numbers::pi));
        if (angle < 0) angle += double(kAngles);
        const std::size_t i = std::min(std::size_t(ring), kRings - 1), j = std::min(std::size_t(angle), kAngles - 1);
        const double u = ring - double(i), v = std::min(angle - double(j), 1.0);
        add(sum, i, j, (1 - u) * (1 - v));
        add(sum, i, j + 1, (1 - u) * v);
        add(sum, i + 1, j, u * (1 - v));
        add(sum, i + 1, j + 1, u * v);
    }
    void add(Strains& sum, std::size_t ring, std::size_t angle, double weight) const noexcept {
        const auto& point = (*points_)[ring == 0 ? 0 : 1 + (ring - 1) * kAngles + angle % kAngles];
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += weight * point[2 + i];
    }

    static constexpr std::size_t kQuadratureRings = 6, kQuadratureAngles = 12;
    std::array<double, 3> factor_;
    double plate_m_;
    const std::vector<std::array<double, 26>>* points_;
    double per_ring_;  // rings per metre
    std::array<std::array<double, 2>, kQuadratureRings * kQuadratureAngles> places_{};
    Strains uniform_{};
};

inline bool has_map(const TableSample& sample) { return sample.influence.size() == InfluenceMap::kPoints; }

}  // namespace tactiled::sim
