#include "drivers/driver.hpp"

#include <algorithm>

namespace tactiled {
namespace {
constinit const DriverEntry* first = nullptr;  // filled by the entries' constructors, before main
}

DriverEntry::DriverEntry(std::string_view name_, std::unique_ptr<Driver> (*make_)(Options&)) noexcept
    : name(name_), make(make_), next(first) {
    first = this;
}

const DriverEntry* find_driver(std::string_view name) noexcept {
    for (const DriverEntry* entry = first; entry != nullptr; entry = entry->next)
        if (entry->name == name) return entry;
    return nullptr;
}

std::vector<std::string> driver_names() {
    std::vector<std::string> names;
    for (const DriverEntry* entry = first; entry != nullptr; entry = entry->next) names.emplace_back(entry->name);
    std::sort(names.begin(), names.end());
    return names;
}

}  // namespace tactiled
