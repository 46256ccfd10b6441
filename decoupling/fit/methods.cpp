// Which function fits which method. One line each.
#include "decoupling/capacitive/electrodes.hpp"
#include "decoupling/fit/capacitive_fit.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/hair_fit.hpp"
#include "decoupling/fit/piezo_fit.hpp"
#include "decoupling/fit/table_more_fit.hpp"
#include "decoupling/hair/stages.hpp"
#include "decoupling/table/sign_table.hpp"

namespace tactiled {
namespace {

bool is_gauge(std::string_view name) { return table_gauge(name).has_value(); }
bool is_hair(std::string_view name) { return hair_index(name) < 4; }
bool is_electrode(std::string_view name) { return electrode_index(name) < 5; }
bool is_film_or_centre(std::string_view name) { return name == "Vp" || name == "Cn"; }
constexpr std::string_view kFilm = "a channel of model \"piezo\" (Vp, Cn)";
constexpr std::string_view kElectrodes = "an electrode of model \"capacitive\" (C1 .. C4, Cn)";
constexpr std::string_view kGauge = "a gauge of model \"table\" (R1 .. R8)", kHair = "a hair of model \"hair\" (H1 .. H4)";

constexpr FitMethod kMethods[] = {
    {"generic", "matrix", fit_generic},
    {"generic", "quadratic", fit_quadratic},
    {"generic", "rbf", fit_rbf},
    {"generic", "mlp", fit_mlp},
    {"table", "linear", fit_table, is_gauge, kGauge},
    {"table", "matrix", fit_table_matrix, is_gauge, kGauge},
    {"table", "nonlinear", fit_table_nonlinear, is_gauge, kGauge},
    {"table", "map", fit_table_map, is_gauge, kGauge},
    {"hair", "sum_diff", fit_hair_sum_diff, is_hair, kHair},
    {"hair", "matrix", fit_hair_matrix, is_hair, kHair},
    {"hair", "physics", fit_hair_physics, is_hair, kHair},
    {"capacitive", "quadratic", fit_capacitive_quadratic, is_electrode, kElectrodes},
    {"capacitive", "ratio", fit_capacitive_ratio, is_electrode, kElectrodes},
    {"capacitive", "overlap", fit_capacitive_overlap, is_electrode, kElectrodes},
    {"piezo", "fused", fit_piezo, is_film_or_centre, kFilm, true},
};

}  // namespace

std::span<const FitMethod> fit_methods() { return kMethods; }

}  // namespace tactiled
