// The costs of accuracy that `accuracy_costs NAME` measures, one file each, with the product's own code. An entry is
// at the end of its file and in the list in accuracy_costs.cpp.
#pragma once
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/decoupler.hpp"
#include "node/lab/chart/figure.hpp"

namespace tactiled::ctl {

struct CostSetup {
    std::size_t samples = 0;   // to take of each thing that is compared; 0 = as for the figures
    std::string folder = ".";  // folder of the project, which has config/
    std::string influence;     // a calibration with a plate's influence map; "" = the one in config/
    [[nodiscard]] std::size_t samples_or(std::size_t usual) const { return samples > 0 ? samples : usual; }
    [[nodiscard]] std::string influence_path() const {
        return influence.empty() ? folder + "/config/calibration/table_influence.toml" : influence;
    }
};

struct Cost {
    struct Row {
        std::string name;
        std::vector<double> values;  // NaN: there is none
    };
    std::vector<std::string> columns;  // names with units; the first is that of the rows' names
    std::vector<Row> rows;
    Figure figure;
    std::string advice;  // recommendation, one sentence made from the numbers
};

struct CostEntry {
    std::string_view name;              // name on the command line
    std::string_view title;             // for the list
    std::string_view path;              // path of the figure in the project's folder, beside its page
    Cost (*measure)(const CostSetup&);  // setup: throws SetupError where a file is missing or wrong
};

// A calibration file of the sources. setup: throws SetupError with what is wrong
Calibration shipped_calibration(const CostSetup& setup, const std::string& name);

}  // namespace tactiled::ctl
