#include "decoupling/hair/setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "decoupling/generic/methods.hpp"
#include "decoupling/hair/physics.hpp"
#include "decoupling/solve/checked.hpp"

namespace tactiled {
namespace {

constexpr double kMinSum = 0.1;  // of the sum of sizes; 1 where both hairs of a pair answer alike
constexpr std::array<std::string_view, 3> kNameOf{"fz", "fx", "fy"};

// The names that a method reads, with what each is.
struct Name {
    const char *name, *what;
    bool needed, positive;
};
std::vector<Name> parameters_of(const std::string& method) {
    std::vector<Name> names{{"area_m2", "of the cap; 2.827e-5 of one of 6 mm diameter", true, true}};
    const auto add = [&](std::initializer_list<Name> more) { names.insert(names.end(), more); };
    if (method == "physics") {
        add({{"radius_m", "of the hair's arc", true, true},
             {"width_m", "of the hair", true, true},
             {"thickness_m", "of the hair", true, true},
             {"root_distance_m", "L of Cao et al.", true, false},
             {"k_x_Pa", "foundation modulus, N/m^2", true, true},
             {"k_y_Pa", "foundation modulus, N/m^2", true, true},
             {"friction", "mu", true, false},
             {"pi_l_per_Pa", "piezoresistive coefficient", true, true},
             {"elastomer_kPa", "Young's modulus; PDMS 750, Ecoflex 250, hydrogel 150", true, true},
             {"poisson", "of the elastomer", false, false},
             {"correction_normal", "measured over computed sensitivity", false, false},
             {"correction_shear", "measured over computed sensitivity", false, false}});
    } else {
        add({{"normal_scale_Pa", "greatest normal stress of the calibration", true, true},
             {"shear_scale_Pa", "greatest shear stress of the calibration", true, true},
             {"pull_scale_Pa", "greatest pull of the calibration", false, false}});
    }
    return names;
}

std::string fault_of_names(const Calibration& calibration, const std::string& method, const std::vector<Name>& names) {
    std::vector<std::string> known;
    for (const Name& name : names) known.emplace_back(name.name);
    if (method == "sum_diff") known.insert(known.end(), {"diff_x_per_Pa", "diff_y_per_Pa"});
    for (const auto& [name, value] : calibration.parameters)
        if (std::find(known.begin(), known.end(), name) == known.end()) {
            const auto near = nearest_name(name, known);
            return fmt::format("parameter {} is unknown; {}", name,
                               near ? "did you mean " + *near + "?" : fmt::format("known are {}", fmt::join(known, " ")));
        }
    const std::vector<std::string> tables = method == "physics"    ? std::vector<std::string>{"hair_gain", "noise"}
                                            : method == "sum_diff" ? std::vector<std::string>{"gains", "intercept", "noise"}
                                                                   : std::vector<std::string>{"gains", "leak", "noise"};
    for (const auto& [name, table] : calibration.tables)
        if (std::find(tables.begin(), tables.end(), name) == tables.end())
            return fmt::format("table {} is unknown; method {} has {}", name, method, fmt::join(tables, " "));
    for (const Name& name : names) {
        const auto at = calibration.parameters.find(name.name);
        if (at == calibration.parameters.end()) {
            if (name.needed) return fmt::format("parameter {} ({}) is missing", name.name, name.what);
        } else if (at->second < 0 || (name.positive && at->second == 0)) {
            return fmt::format("parameter {} ({}) = {} is not {}", name.name, name.what, at->second,
                               name.positive ? "above 0" : "0 or more");
        }
    }
    return "";
}

// Which hairs are wired to which channel, and which loads the components ask for.
std::string read_wiring(const Calibration& calibration, const std::string& method, HairSetup& setup) {
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const std::size_t hair = hair_index(calibration.channels[k]);
        if (hair == 4) return fmt::format("channel \"{}\"; a hair sensor has H1 .. H4", calibration.channels[k]);
        if ((setup.wired >> hair & 1u) != 0) return fmt::format("channel \"{}\" twice", calibration.channels[k]);
        setup.wired |= 1u << hair;
        setup.hair[k] = hair;
    }
    for (const auto& name : calibration.components) {
        const auto at = std::find(kNameOf.begin(), kNameOf.end(), name);
        if (at == kNameOf.end()) return fmt::format("component \"{}\"; a hair sensor sees fx fy fz", name);
        setup.unknowns |= 1u << (at - kNameOf.begin());
    }
    const bool x = (setup.unknowns & 2u) != 0, y = (setup.unknowns & 4u) != 0;
    if ((setup.unknowns & 1u) == 0 || !(x || y)) return "components needs fz and at least one of fx fy";
    if ((x && (setup.wired & kPairX) == 0) || (y && (setup.wired & kPairY) == 0))
        return fmt::format("component {} needs {}", x && (setup.wired & kPairX) == 0 ? "fx" : "fy",
                           x && (setup.wired & kPairX) == 0 ? "H1 or H3" : "H2 or H4");
    if (method == "sum_diff" && ((x && (setup.wired & kPairX) != kPairX) || (y && (setup.wired & kPairY) != kPairY)))
        return "method sum_diff needs H1 H3 for fx and H2 H4 for fy; with other hairs use matrix";
    return "";
}

double parameter(const Calibration& calibration, const char* name, double otherwise) {
    const auto found = calibration.parameters.find(name);
    return found == calibration.parameters.end() ? otherwise : found->second;
}

// Gains and leak of each hair at full scale.
std::string read_response(const Calibration& calibration, const std::string& method, HairSetup& setup) {
    const std::size_t n = calibration.channels.size();
    std::string fault;
    const auto optional = [&](const char* name, std::size_t rows,
                              std::size_t columns) -> const std::vector<std::vector<double>>* {
        return calibration.tables.count(name) == 0 ? nullptr : table_of(calibration, name, rows, columns, fault);
    };
    const auto& scale = setup.scale_Pa;
    if (method == "physics") {
        const HairPhysics p = {.radius_m = calibration.parameters.at("radius_m"),
                               .width_m = calibration.parameters.at("width_m"),
                               .thickness_m = calibration.parameters.at("thickness_m"),
                               .root_distance_m = calibration.parameters.at("root_distance_m"),
                               .k_x_Pa = calibration.parameters.at("k_x_Pa"),
                               .k_y_Pa = calibration.parameters.at("k_y_Pa"),
                               .friction = calibration.parameters.at("friction"),
                               .pi_l_per_Pa = calibration.parameters.at("pi_l_per_Pa"),
                               .elastomer_kPa = calibration.parameters.at("elastomer_kPa"),
                               .poisson = parameter(calibration, "poisson", HairPhysics{}.poisson)};
        if (p.poisson > 0.5) return fmt::format("parameter poisson = {} is above 0.5", p.poisson);
        const auto* own = optional("hair_gain", n, 2);
        const double normal = parameter(calibration, "correction_normal", 1) * normal_sensitivity_per_Pa(p);
        const double shear = parameter(calibration, "correction_shear", 1) * shear_sensitivity_per_Pa(p);
        for (std::size_t k = 0; k < n; ++k) {
            const std::size_t i = setup.hair[k];
            const double own_normal = own != nullptr ? (*own)[k][0] : 1, own_shear = own != nullptr ? (*own)[k][1] : 1;
            setup.response.gain[i] = {normal * own_normal, -shear * own_shear * kHairCos[i],
                                      -shear * own_shear * kHairSin[i]};
        }
    } else {
        const auto* gains = table_of(calibration, "gains", n, 3, fault);
        const bool intercept = method == "sum_diff";
        const auto* leaks = optional(intercept ? "intercept" : "leak", n, intercept ? kInterceptTerms : kLeakTerms);
        for (std::size_t k = 0; k < n && fault.empty(); ++k) {
            const std::size_t i = setup.hair[k];
            for (std::size_t j = 0; j < 3; ++j) setup.response.gain[i][j] = (*gains)[k][j] * scale[j];
            if (leaks != nullptr)
                std::copy((*leaks)[k].begin(), (*leaks)[k].end(),
                          setup.response.leak[i].end() - std::ptrdiff_t((*leaks)[k].size()));
        }
    }
    if (const auto* noise = optional("noise", 1, n); noise != nullptr) {
        setup.noise_known = true;
        for (std::size_t k = 0; k < n; ++k) {
            setup.response.noise[setup.hair[k]] = noise->front()[k];
            if (!(noise->front()[k] > 0)) fault = "table noise has a number that is not above 0";
        }
    }
    return fault;
}

}  // namespace

std::string read_hair_setup(const Calibration& calibration, const std::string& method, HairSetup& setup) {
    std::string fault = fault_of_checked(calibration);
    if (fault.empty()) fault = fault_of_names(calibration, method, parameters_of(method));
    if (fault.empty()) fault = read_wiring(calibration, method, setup);
    if (!fault.empty()) return fault;
    setup.area_m2 = calibration.parameters.at("area_m2");
    const double normal = parameter(calibration, "normal_scale_Pa", 1), shear = parameter(calibration, "shear_scale_Pa", 1);
    setup.scale_Pa = {normal, shear, shear};
    setup.response.min[0] = -parameter(calibration, "pull_scale_Pa", 0) / normal;
    for (std::size_t axis = 0; axis < 2 && method == "sum_diff"; ++axis) {
        const char* name = axis == 0 ? "diff_x_per_Pa" : "diff_y_per_Pa";
        setup.diff_per_Pa[axis] = parameter(calibration, name, 0);
        if ((setup.unknowns >> (axis + 1) & 1u) != 0 && setup.diff_per_Pa[axis] == 0)
            return fmt::format("parameter {} (DIFF of the pair at 1 Pa of shear, {}) is missing or 0", name,
                               axis == 0 ? "r3 - r1" : "r4 - r2");
    }
    if (fault = read_response(calibration, method, setup); !fault.empty()) return fault;
    for (const std::uint32_t pair : {kPairX, kPairY}) {
        double sum = 0, size = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            sum += (pair >> i & 1u) != 0 ? setup.response.gain[i][0] : 0;
            size += (pair >> i & 1u) != 0 ? std::abs(setup.response.gain[i][0]) : 0;
        }
        if (method == "sum_diff" && (setup.wired & pair) == pair && !(std::abs(sum) > kMinSum * size))
            return fmt::format("table gains: the hairs {} answer a press with opposite signs, so their SUM says nothing",
                               pair == kPairX ? "H1 H3" : "H2 H4");
    }
    return "";
}

}  // namespace tactiled
