// The list of all fits.
#include <fmt/format.h>

#include <algorithm>

#include "decoupling/fit/fit.hpp"
#include "decoupling/method.hpp"

namespace tactiled {

using Fits = Registry<FitEntry>;

const FitEntry* find_fit(std::string_view model, std::string_view method) {
    const auto found = Fits::all([&](const FitEntry& e) { return e.model == model && e.method == method; });
    return found.empty() ? nullptr : found.front();
}

const FitEntry* find_array_fit(std::string_view model) {
    const auto found = Fits::all([&](const FitEntry& e) { return e.model == model && e.array != nullptr; });
    return found.empty() ? nullptr : found.front();
}

std::vector<const FitEntry*> fits_of(std::string_view model) {
    std::vector<const FitEntry*> fits;
    for (const MethodEntry* method : methods_of(model))
        if (const FitEntry* entry = find_fit(model, method->method); entry != nullptr && entry->fit != nullptr)
            fits.push_back(entry);
    return fits;
}

std::vector<const FitEntry*> all_fits() {
    std::vector<const FitEntry*> fits;
    for (const auto& model : model_names())
        for (const FitEntry* entry : fits_of(model)) fits.push_back(entry);
    return fits;
}

std::string fault_of_fits() {
    for (const FitEntry* entry : Fits::all()) {
        if (find_method(entry->model, entry->method) == nullptr)
            return fmt::format("this program fits method \"{}\" of model \"{}\", which it has not", entry->method,
                               entry->model);
        if (find_fit(entry->model, entry->method) != entry)
            return fmt::format("this program has two fits of method \"{}\" of model \"{}\"", entry->method, entry->model);
    }
    return "";
}

void put_fit_option(std::string_view name, const std::string& value, FitRequest& request) {
    for (const FitEntry* entry : fits_of(request.model))
        if (entry->option.name != nullptr && entry->option.name == name)
            entry->option.put(value, request.start[std::string(entry->method)]);
}

CalibrationData known_beforehand(const Calibration& calibration, std::span<const Parameter> parameters) {
    const CalibrationData data(calibration, parameters);
    if (const std::string fault = data.fault_of_ranges(); !fault.empty()) throw Undetermined(fault);
    return data;
}

}  // namespace tactiled
