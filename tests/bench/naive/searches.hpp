// Straightforward code for the methods that search: a Ceres problem, built and solved again at each sample.
#pragma once
#include <ceres/ceres.h>

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include "decoupling/capacitive/electrodes.hpp"
#include "decoupling/capacitive/pad.hpp"
#include "decoupling/table/influence_map.hpp"
#include "naive/linear.hpp"

namespace naive {

inline ceres::Solver::Options quiet() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-16;  // makes both end in the same place
    options.parameter_tolerance = 1e-12;
    options.gradient_tolerance = 1e-18;
    return options;
}

// capacitive/overlap: closeness and shift that explain five electrodes, derivatives by differences.
class OverlapSearch {
public:
    explicit OverlapSearch(const tactiled::Calibration& c) : zero_(c.zero) {
        const auto p = [&](const std::string& name) { return c.parameters.count(name) != 0 ? c.parameters.at(name) : 0.0; };
        const tactiled::ElectrodeGeometry geometry{p("disc_radius_m"), p("inner_radius_m"),  p("outer_radius_m"),
                                                   p("opening_rad"),   p("centre_radius_m"), p("gap_m")};
        radius_m_ = geometry.disc_radius_m;
        for (std::size_t k = 0; k < c.channels.size(); ++k) {
            sector_.push_back(geometry.sector(tactiled::electrode_index(c.channels[k])));
            active_.push_back(c.zero[k] - p("stray_" + c.channels[k]));
        }
        pad_ = {p("normal_stiffness_N"), p("stiffening"), p("shear_stiffness_N_per_m"), p("shear_gap_exponent"), p("gap_m")};
    }
    tactiled::Wrench operator()(const std::vector<double>& channel) {
        std::array<double, 3> state{};  // closeness - 1; shift in disc radii
        ceres::Problem problem;
        problem.AddResidualBlock(
            new ceres::NumericDiffCostFunction<Residual, ceres::CENTRAL, 5, 3>(new Residual{*this, channel}), nullptr,
            state.data());
        ceres::Solver::Summary summary;
        ceres::Solve(quiet(), &problem, &summary);
        const double x_m = state[1] * radius_m_, y_m = state[2] * radius_m_;
        tactiled::Wrench wrench = tactiled::kUnseen;
        wrench[0] = pad_.shear_stiffness_at(state[0]) * x_m;
        wrench[1] = pad_.shear_stiffness_at(state[0]) * y_m;
        wrench[2] = -pad_.press_N(state[0]) - pad_.press_by_shift_N(state[0], x_m * x_m + y_m * y_m);
        return wrench;
    }

private:
    struct Residual {
        const OverlapSearch& of;
        const std::vector<double>& channel;
        bool operator()(const double* state, double* residual) const {
            for (std::size_t k = 0; k < channel.size(); ++k) {
                const auto shared =
                    tactiled::overlap(of.sector_[k], of.radius_m_, state[1] * of.radius_m_, state[2] * of.radius_m_);
                const double of_rest = shared.change / tactiled::area_at_rest(of.sector_[k], of.radius_m_);
                const double reading = of.active_[k] * (state[0] + (1 + state[0]) * of_rest);
                residual[k] = (reading - (channel[k] - of.zero_[k])) / of.active_[4];
            }
            return true;
        }
    };
    std::vector<double> zero_, active_;
    std::vector<tactiled::Sector> sector_;
    double radius_m_ = 0;
    tactiled::PadLaw pad_{};
};

// table/map: point and force that explain eight gauges, all five unknowns at once, on from the last sample.
class PointSearch {
public:
    explicit PointSearch(const tactiled::Calibration& c) : zero_(c.zero) {
        std::string fault;
        map_ = tactiled::influence_of(c, fault);
        if (!map_) throw std::runtime_error(fault);
        noise_ = c.parameters.at("noise");
    }
    tactiled::Wrench operator()(const std::vector<double>& channel) {
        Eigen::Matrix<double, 8, 1> reading;
        for (Eigen::Index k = 0; k < 8; ++k) reading[k] = channel[std::size_t(k)] - zero_[std::size_t(k)];
        ceres::Problem problem;
        problem.AddResidualBlock(new Cost(*map_, reading, noise_), nullptr, unknown_.data());
        ceres::Solver::Summary summary;
        ceres::Solve(quiet(), &problem, &summary);
        const double x_m = unknown_[0] * 1e-3, y_m = unknown_[1] * 1e-3;
        return {unknown_[2], unknown_[3], unknown_[4], y_m * unknown_[4], -x_m * unknown_[4], tactiled::kNaN};
    }

private:
    // Point in mm and force in N, so that the unknowns are of one size.
    class Cost final : public ceres::SizedCostFunction<8, 5> {
    public:
        Cost(const tactiled::InfluenceMap& map, const Eigen::Matrix<double, 8, 1>& reading, double noise)
            : map_(map), reading_(reading), noise_(noise) {}
        bool Evaluate(double const* const* parameters, double* residual, double** jacobian) const override {
            const double* u = parameters[0];
            tactiled::InfluenceMap::At at;
            map_.at(u[0] * 1e-3, u[1] * 1e-3, at);
            const Eigen::Vector3d force(u[2], u[3], u[4]);
            Eigen::Map<Eigen::Matrix<double, 8, 1>>{residual} = (at.value * force - reading_) / noise_;
            if (jacobian == nullptr || jacobian[0] == nullptr) return true;
            Eigen::Map<Eigen::Matrix<double, 8, 5, Eigen::RowMajor>> j(jacobian[0]);
            j.col(0) = at.dx * force * 1e-3 / noise_;
            j.col(1) = at.dy * force * 1e-3 / noise_;
            j.rightCols<3>() = at.value / noise_;
            return true;
        }

    private:
        const tactiled::InfluenceMap& map_;
        Eigen::Matrix<double, 8, 1> reading_;
        double noise_;
    };
    std::vector<double> zero_;
    std::optional<tactiled::InfluenceMap> map_;
    double noise_ = 1;
    std::array<double, 5> unknown_{0, 0, 0, 0, -0.1};
};

}  // namespace naive
