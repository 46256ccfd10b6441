// The list of all methods (config/registry.hpp). A method is one entry object at the end of its own file, so that a new
// method is one new file and one line in a CMakeLists.txt. A model exists because methods name it. The order in which the
// linker meets the entries decides nothing.
#pragma once
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/registry.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/solve/parameters.hpp"

namespace tactiled {

struct MethodEntry {
    std::string_view model = {}, method = {};  // as in `model = "table"` and `method = "linear"`
    int place = 0;  // among the methods of the model, in every list; the first is the model's default
    // The parameters and tables of the calibration that the method reads. They have been checked when make() is called.
    std::span<const Parameter> parameters = {};
    std::span<const KnownTable> tables = {};
    // Prepares everything that decouple() needs; nullptr where the calibration does not serve, and `fault` says why. setup
    std::unique_ptr<Decoupler> (*make)(const CalibrationData& data, std::string& fault) = nullptr;
    // The method whose fit and standard deviation serve this method, too. "" = none
    std::string_view sd_of = {};
    // The method whose fit this method can run on as well: the names that only the other one knows are no error then.
    // kAnyMethod = every method of the model, "" = none
    std::string_view takes_fit_of = {};
    // What a calibration leaves is a smooth curve through 0, as measured for hairs: one known weight corrects most of it.
    bool errs_by_gain = false;
    Registry<MethodEntry> in_list{this};
};
inline constexpr std::string_view kAnyMethod = "*";

// nullptr where there is none of that name. setup
const MethodEntry* find_method(std::string_view model, std::string_view method);
// The methods of one model in the order of their places; empty where the model is unknown. setup
std::vector<const MethodEntry*> methods_of(std::string_view model);
std::vector<std::string> method_names(std::string_view model);
// The models in alphabetical order. setup
std::vector<std::string> model_names();
// "; did you mean "linear"?" where one of the known names is near, else "". setup
std::string or_did_you_mean(std::string_view name, const std::vector<std::string>& known);
// The fault of the list: two entries of one name, or an entry without a make(); "" where there is none. Each start asks.
// setup
std::string fault_of_methods();

// The decoupler of one method, from a calibration whose own fit is the one to use. nullptr where that cannot be, and
// `fault` says why. setup
std::unique_ptr<Decoupler> make_method(const MethodEntry& method, const Calibration& calibration, std::string& fault);

}  // namespace tactiled
