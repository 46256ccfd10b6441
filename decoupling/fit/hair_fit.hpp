// The common parts of the fits of model "hair": labelled rows as stresses, and the response of each hair to them. Each hair
// is fitted as reading from loads, because the noise is in the readings. Rows that contradict the rest (swapped labels)
// lose their weight (Cauchy).
#pragma once
#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/hair/physics.hpp"
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

inline constexpr double kHairCapArea_m2 = 2.827433388230814e-5;  // pi (3 mm)^2

bool is_hair(std::string_view name);
inline constexpr KnownChannels kHair{is_hair, "a hair of model \"hair\" (H1 .. H4; H0 is a dummy)", "dR/R0"};

// Returns the parameter area_m2 if it is stated, else kHairCapArea_m2. setup: throws Undetermined
double cap_area_m2(const Calibration& calibration);

// Fits each hair of the session and stores zero, noise and condition in the calibration. `first`: the first leak term
// that may be used; kLeakTerms = none. setup: throws Undetermined
std::vector<HairFit> fit_hairs(const HairSession& session, Calibration& calibration, std::size_t first,
                               std::vector<std::string>& warnings);
// Stores area and ranges as parameters, and gains and leak terms from `first` on in the tables of these names.
void store_scales(const HairSession& session, double area_m2, Calibration& calibration);
void store_response(const HairSession& session, const std::vector<HairFit>& hairs, std::size_t first, const char* name,
                    Calibration& calibration);

// Returns the parameters of method physics for a named elastomer of kElastomers, the rest as in `start`; for the
// `calibration.parameters` before the fit. setup: throws SetupError for an unknown name
std::map<std::string, double> hair_parameters(std::string_view elastomer, const HairPhysics& start = {});

}  // namespace tactiled
