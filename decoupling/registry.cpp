#include "decoupling/decoupler.hpp"

#include <algorithm>
#include <utility>

namespace tactiled {
namespace {
constinit const DecouplerEntry* first = nullptr;  // filled by the entries' constructors, before main
}

DecouplerEntry::DecouplerEntry(std::string_view name_, std::vector<std::string> methods_,
                               std::unique_ptr<Decoupler> (*make_)(const Calibration&, const std::string&, Options&))
    : name(name_), methods(std::move(methods_)), make(make_), next(first) {
    first = this;
}

const DecouplerEntry* find_decoupler(std::string_view name) noexcept {
    for (const DecouplerEntry* entry = first; entry != nullptr; entry = entry->next)
        if (entry->name == name) return entry;
    return nullptr;
}

std::vector<std::string> decoupler_names() {
    std::vector<std::string> names;
    for (const DecouplerEntry* entry = first; entry != nullptr; entry = entry->next) names.emplace_back(entry->name);
    std::sort(names.begin(), names.end());
    return names;
}

}  // namespace tactiled
