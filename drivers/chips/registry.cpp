#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {
constinit const ChipEntry* first = nullptr;  // filled by the entries' constructors, before main
}

ChipEntry::ChipEntry(std::string_view name_, std::uint8_t min, std::uint8_t max,
                     std::unique_ptr<Chip> (*make_)(Options&)) noexcept
    : name(name_), min_address(min), max_address(max), make(make_), next(first) {
    first = this;
}

const ChipEntry* find_chip(std::string_view name) noexcept {
    for (const ChipEntry* entry = first; entry != nullptr; entry = entry->next)
        if (entry->name == name) return entry;
    return nullptr;
}

std::vector<std::string> chip_names() {
    std::vector<std::string> names;
    for (const ChipEntry* entry = first; entry != nullptr; entry = entry->next) names.emplace_back(entry->name);
    std::sort(names.begin(), names.end());
    return names;
}

unsigned choice(Options& options, std::string_view key, std::initializer_list<double> allowed, double fallback) {
    const double value = options.number(key, {-1e9, 1e9}, fallback);
    const double* const found = std::find(allowed.begin(), allowed.end(), value);
    if (found != allowed.end()) return unsigned(found - allowed.begin());
    options.problem(key, fmt::format("{} = {} is not possible; one of {}", key, value, fmt::join(allowed, ", ")));
    return unsigned(std::find(allowed.begin(), allowed.end(), fallback) - allowed.begin());
}

}  // namespace tactiled
