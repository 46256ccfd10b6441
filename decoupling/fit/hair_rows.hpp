// Labelled rows of a hair sensor as stresses, and the response of one hair to them.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/hair/stages.hpp"

namespace tactiled {

// Least squares in which rows far from the rest lose their weight. `sd`: robust standard deviation of a reading.
struct RobustFit {
    LeastSquares solved;
    double sd = 0;
};
RobustFit robust_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& y);

struct HairSession {
    Rows rows;
    std::vector<std::size_t> hair;  // hair of each channel
    std::vector<HairLoad> load;     // load of each row, relative to full scale
    std::array<bool, 3> asked{};    // sigma, tau_x, tau_y
    HairLoad scale_Pa{};
    double pull_Pa = 0;
};
// setup: throws Undetermined where channels or labels are not those of a hair sensor
HairSession hair_session_of(const Rows& rows, const Calibration& calibration, double area_m2);
bool has_hair(const HairSession& session, std::size_t hair);

// One hair: zero, gains (dR/R0 at full scale), leak terms. Terms that the rows do not determine are 0.
struct HairFit {
    double zero = 0, noise = 0, condition = 0;
    HairLoad gain{};
    LeakTerms leak{};
    bool whole = true;  // all requested terms are determined
};
// Fits one hair. `first`: the first leak term that may be used; kLeakTerms = none. setup: throws Undetermined
HairFit fit_hair(const HairSession& session, std::size_t channel, std::size_t first);

}  // namespace tactiled
