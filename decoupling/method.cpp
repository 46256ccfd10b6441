#include "decoupling/method.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>

#include "decoupling/solve/checked.hpp"

namespace tactiled {

using Methods = Registry<MethodEntry>;

namespace {

// Returns the names that the other methods of the model know, if `method` runs on their fits.
OtherNames names_of_others(const MethodEntry& entry) {
    OtherNames names;
    for (const MethodEntry* other : methods_of(entry.model)) {
        if (entry.takes_fit_of != kAnyMethod && entry.takes_fit_of != other->method) continue;
        for (const Parameter& parameter : other->parameters) names.parameters.emplace_back(parameter.name);
        for (const KnownTable& table : other->tables) names.tables.emplace_back(table.name);
    }
    return names;
}

}  // namespace

const MethodEntry* find_method(std::string_view model, std::string_view method) {
    const auto found = Methods::all([&](const MethodEntry& e) { return e.model == model && e.method == method; });
    return found.empty() ? nullptr : found.front();
}

std::vector<const MethodEntry*> methods_of(std::string_view model) {
    auto methods = Methods::all([&](const MethodEntry& entry) { return entry.model == model; });
    std::sort(methods.begin(), methods.end(), [](const MethodEntry* a, const MethodEntry* b) {
        return a->place != b->place ? a->place < b->place : a->method < b->method;
    });
    return methods;
}

std::vector<std::string> method_names(std::string_view model) {
    std::vector<std::string> names;
    for (const MethodEntry* entry : methods_of(model)) names.emplace_back(entry->method);
    return names;
}

std::vector<std::string> model_names() {
    std::vector<std::string> names;
    for (const MethodEntry* entry : Methods::all()) names.emplace_back(entry->model);
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    return names;
}

std::string or_did_you_mean(std::string_view name, const std::vector<std::string>& known) {
    const auto near = nearest_name(name, known);
    return near ? fmt::format("; did you mean \"{}\"?", *near) : "";
}

std::string fault_of_methods() {
    for (const MethodEntry* entry : Methods::all()) {
        if (entry->make == nullptr)
            return fmt::format("method \"{}\" of model \"{}\" cannot be used: its entry has no make()", entry->method,
                               entry->model);
        if (find_method(entry->model, entry->method) != entry)
            return fmt::format("this program has two methods \"{}\" of model \"{}\"", entry->method, entry->model);
    }
    return "";
}

std::unique_ptr<Decoupler> make_method(const MethodEntry& method, const Calibration& calibration, std::string& fault) {
    const CalibrationData data(calibration, method.parameters, method.tables);
    fault = fault_of_checked(calibration);
    if (fault.empty()) fault = data.fault(names_of_others(method));
    if (!fault.empty()) return nullptr;
    auto decoupler = method.make(data, fault);
    assert((decoupler == nullptr) == !fault.empty());
    return decoupler;
}

}  // namespace tactiled
