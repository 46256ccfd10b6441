// Which function fits which method. One line each.
#include "decoupling/fit/fit.hpp"
#include "decoupling/table_signs.hpp"

namespace tactiled {
namespace {

bool is_gauge(std::string_view name) { return table_gauge(name).has_value(); }

constexpr FitMethod kMethods[] = {
    {"generic", "matrix", fit_generic},
    {"generic", "quadratic", fit_quadratic},
    {"generic", "rbf", fit_rbf},
    {"generic", "mlp", fit_mlp},
    {"table", "linear", fit_table, is_gauge, "a gauge of model \"table\" (R1 .. R8)"},
};

}  // namespace

std::span<const FitMethod> fit_methods() { return kMethods; }

}  // namespace tactiled
