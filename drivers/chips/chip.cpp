#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "drivers/chips/chip.hpp"

namespace tactiled {
unsigned choice(Options& options, std::string_view key, std::initializer_list<double> allowed, double fallback) {
    const double value = options.number(key, {-1e9, 1e9}, fallback);
    const double* const found = std::find(allowed.begin(), allowed.end(), value);
    if (found != allowed.end()) return unsigned(found - allowed.begin());
    options.problem(key, fmt::format("{} = {} is not possible; one of {}", key, value, fmt::join(allowed, ", ")));
    return unsigned(std::find(allowed.begin(), allowed.end(), fallback) - allowed.begin());
}

}  // namespace tactiled
