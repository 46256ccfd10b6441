// Model "hair", method "physics": like "matrix" without leak terms, with gains from the hair's geometry
// (physics.hpp).
#include "decoupling/hair/physics.hpp"

#include "decoupling/hair/setup.hpp"

namespace tactiled {
namespace {

constexpr auto kParameters =
    joined(std::array<Parameter, 3>{{kArea,
                                     {"correction_normal", "measured over computed sensitivity", 0, kLargest, 1},
                                     {"correction_shear", "measured over computed sensitivity", 0, kLargest, 1}}},
           hair_geometry_parameters(false));
// hair_gain: one row per hair, its normal and its shear sensitivity relative to those of the geometry.
constexpr std::array<KnownTable, 2> kTables{{{"hair_gain", kPerChannel, 2, false}, kHairNoise}};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    HairSetup setup;
    fault = read_wiring(data.calibration(), setup);
    if (!fault.empty()) return nullptr;
    setup.area_m2 = data["area_m2"];
    const HairPhysics physics = hair_physics(data);
    const double normal = data["correction_normal"] * normal_sensitivity_per_Pa(physics);
    const double shear = data["correction_shear"] * shear_sensitivity_per_Pa(physics);
    const NumberRows* own = data.table("hair_gain");
    for (std::size_t k = 0; k < data.calibration().channels.size(); ++k) {
        const std::size_t i = setup.hair[k];
        const double own_normal = own != nullptr ? (*own)[k][0] : 1, own_shear = own != nullptr ? (*own)[k][1] : 1;
        setup.response.gain[i] = {normal * own_normal, -shear * own_shear * kHairCos[i], -shear * own_shear * kHairSin[i]};
    }
    fault = read_noise(data, setup);
    return make_hair(data, "physics", setup, fault);
}

const MethodEntry entry{
    .model = "hair", .method = "physics", .place = 30, .parameters = kParameters, .tables = kTables, .make = make};

}  // namespace
}  // namespace tactiled
