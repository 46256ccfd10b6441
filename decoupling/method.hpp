// The list of all methods (config/registry.hpp). A method is one entry object at the end of its own file, so that a new
// method is one new file and one line in a CMakeLists.txt. The models are those of the methods. The linker's order of the
// entries has no effect.
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
    std::string_view model = {}, method = {};  // names in `model = "table"` and `method = "linear"`
    int place = 0;  // order among the methods of the model, in every list; the first is the model's default
    // The parameters and tables of the calibration that the method reads. They have been checked when make() is called.
    std::span<const Parameter> parameters = {};
    std::span<const KnownTable> tables = {};
    // Prepares everything that decouple() needs. Returns nullptr with `fault` set if the calibration is not suitable.
    // setup
    std::unique_ptr<Decoupler> (*make)(const CalibrationData& data, std::string& fault) = nullptr;
    // The method whose fit and standard deviation are valid for this method, too. "" = none
    std::string_view sd_of = {};
    // The method whose fit this method can use as well: names that only the other method knows are then not an error.
    // kAnyMethod = every method of the model, "" = none
    std::string_view takes_fit_of = {};
    // The error of a calibration is a smooth curve through 0, as measured for hairs: one known weight corrects most
    // of it.
    bool errs_by_gain = false;
    Registry<MethodEntry> in_list{this};
};
inline constexpr std::string_view kAnyMethod = "*";

// Returns the entry of that name, nullptr if there is none. setup
const MethodEntry* find_method(std::string_view model, std::string_view method);
// Returns the methods of one model in the order of their places; empty if the model is unknown. setup
std::vector<const MethodEntry*> methods_of(std::string_view model);
std::vector<std::string> method_names(std::string_view model);
// Returns the models in alphabetical order. setup
std::vector<std::string> model_names();
// Returns "; did you mean "linear"?" if one of the known names is similar, else "". setup
std::string or_did_you_mean(std::string_view name, const std::vector<std::string>& known);
// Returns the fault of the list: two entries of one name, or an entry without a make(); "" if there is none. Checked
// at each start. setup
std::string fault_of_methods();

// Returns the decoupler of one method, from a calibration whose own fit is the one to use. Returns nullptr with
// `fault` set if that is not possible. setup
std::unique_ptr<Decoupler> make_method(const MethodEntry& method, const Calibration& calibration, std::string& fault);

}  // namespace tactiled
