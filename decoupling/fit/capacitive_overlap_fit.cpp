// Model "capacitive", method "overlap": the pad with the exact overlap. The geometry comes from
// `calibration.parameters`, all six numbers or none; without them a geometry is assumed, with a warning.
#include <fmt/format.h>

#include <cmath>

#include "decoupling/capacitive/electrodes.hpp"
#include "decoupling/fit/capacitive_fit.hpp"

namespace tactiled {
namespace {

// The thesis gives 12 mm for the whole and about 80 degrees; the radii are assumed. Forces depend on them only at the
// second order of the shift: at first order, the fitted shear stiffness compensates for them.
constexpr ElectrodeGeometry kAssumed{5e-3, 3e-3, 6e-3, 1.3962634015954636, 3e-3, 3e-3};

// Returns the stated geometry, or the assumed one if no parameter is stated.
ElectrodeGeometry stated_geometry(const Calibration& calibration, std::vector<std::string>& warnings) {
    const CalibrationData known = known_beforehand(calibration, kGeometryParameters);
    std::string missing;
    std::size_t n = 0;
    for (const Parameter& parameter : kGeometryParameters)
        if (known.has(parameter.name))
            ++n;
        else
            missing += std::string(missing.empty() ? "" : ", ") + parameter.name + " (" + parameter.what + ")";
    if (n == 0) {
        warnings.push_back(
            fmt::format("the electrodes' geometry is not stated: disc_radius_m {} inner_radius_m {} outer_radius_m {} "
                        "opening_rad {:.4f} "
                        "centre_radius_m {} gap_m {} are assumed; forces far off the axis are worse for it",
                        kAssumed.disc_radius_m, kAssumed.inner_radius_m, kAssumed.outer_radius_m, kAssumed.opening_rad,
                        kAssumed.centre_radius_m, kAssumed.gap_m));
        return kAssumed;
    }
    if (!missing.empty()) throw Undetermined("the electrodes' geometry is stated in part; missing: " + missing);
    const ElectrodeGeometry geometry = electrode_geometry(known);
    if (const std::string fault = geometry.fault(); !fault.empty()) throw Undetermined("the electrodes' geometry: " + fault);
    return geometry;
}

void fit_overlap(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const ElectrodeGeometry geometry = stated_geometry(calibration, warnings);
    Sector sector = geometry.sector(0);
    sector.inner /= geometry.disc_radius_m;
    sector.outer /= geometry.disc_radius_m;
    const double pair_gain = 2 * std::sin(geometry.opening_rad / 2) / area_at_rest(sector, 1);
    const FittedPad fitted = fit_pad(rows, &geometry, pair_gain, calibration, warnings);
    auto& out = calibration.parameters;
    out["shear_stiffness_N_per_m"] = std::exp(fitted.p[kLogShear]) / geometry.disc_radius_m;
    out["noise"] = fitted.noise;
    const double value[] = {geometry.disc_radius_m, geometry.inner_radius_m,  geometry.outer_radius_m,
                            geometry.opening_rad,   geometry.centre_radius_m, geometry.gap_m};
    for (std::size_t i = 0; i < kGeometryParameters.size(); ++i) out[kGeometryParameters[i].name] = value[i];
}

const FitEntry entry{.model = "capacitive", .method = "overlap", .fit = fit_overlap, .channels = kElectrodeOfPad};

}  // namespace
}  // namespace tactiled
