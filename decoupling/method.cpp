#include "decoupling/method.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>

#include "decoupling/solve/checked.hpp"

namespace tactiled {
namespace {

constinit const MethodEntry* first = nullptr;  // filled by the entries' constructors, before main

// The names that the other methods of the model know, where `method` runs on their fits.
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

MethodEntry::MethodEntry(const Method& about) noexcept : Method(about), next(first) { first = this; }

MethodEntry::~MethodEntry() {
    assert(first == this);
    first = next;
}

const MethodEntry* find_method(std::string_view model, std::string_view method) noexcept {
    for (const MethodEntry* entry = first; entry != nullptr; entry = entry->next)
        if (entry->model == model && entry->method == method) return entry;
    return nullptr;
}

std::vector<const MethodEntry*> methods_of(std::string_view model) {
    std::vector<const MethodEntry*> methods;
    for (const MethodEntry* entry = first; entry != nullptr; entry = entry->next)
        if (entry->model == model) methods.push_back(entry);
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
    for (const MethodEntry* entry = first; entry != nullptr; entry = entry->next) names.emplace_back(entry->model);
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    return names;
}

std::string or_did_you_mean(std::string_view name, const std::vector<std::string>& known) {
    const auto near = nearest_name(name, known);
    return near ? fmt::format("; did you mean \"{}\"?", *near) : "";
}

std::string fault_of_methods() {
    for (const MethodEntry* entry = first; entry != nullptr; entry = entry->next) {
        if (entry->make == nullptr)
            return fmt::format("method \"{}\" of model \"{}\" cannot be made: its entry has no make()", entry->method,
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
