// Model "hair", method "matrix": weighted least squares of all hairs, with leak terms of second and third order
// (solver.hpp).
#include "decoupling/hair/setup.hpp"

namespace tactiled {
namespace {

constexpr std::array<KnownTable, 3> kTables{{kHairGains, {"leak", kPerChannel, kLeakTerms, false}, kHairNoise}};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    HairSetup setup;
    fault = read_wiring(data.calibration(), setup);
    if (fault.empty()) fault = read_gains(data, "leak", setup);
    return make_hair(data, "matrix", setup, fault);
}

const MethodEntry entry{.model = "hair",
                        .method = "matrix",
                        .place = 20,
                        .parameters = kFittedParameters,
                        .tables = kTables,
                        .make = make,
                        .errs_by_gain = true};

}  // namespace
}  // namespace tactiled
