// The finite-element results of the table sensor, tests/data/fem, for the tests of model "table".
#pragma once
#include <fstream>
#include <sstream>

#include "made_by_hand.hpp"

namespace tactiled {

// Returns rows of a CSV file as text; the first is its header. Lines with commas in quotes do not occur.
inline std::vector<std::vector<std::string>> fem_rows(const std::string& name) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/fem/" + name);
    std::vector<std::vector<std::string>> rows;
    for (std::string line; std::getline(file, line);) {
        std::vector<std::string> cells;
        std::istringstream in(line);
        for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
        rows.push_back(cells);
    }
    return rows;
}

// table_influence.csv in SI: x_m y_m, strain per N.
inline std::vector<std::vector<double>> fem_influence() {
    std::vector<std::vector<double>> result;
    for (const auto& cells : fem_rows("table_influence.csv")) {
        if (cells[0] == "px_mm") continue;
        std::vector<double> row;
        for (std::size_t i = 0; i < cells.size(); ++i) row.push_back(std::stod(cells[i]) * (i < 2 ? 1e-3 : 1e-6));
        result.push_back(row);
    }
    return result;
}

// table_compliance.csv in SI: 8 gauges x (fx fy fz mx my), strain per N or Nm.
inline std::vector<std::vector<double>> fem_compliance() {
    std::vector<std::vector<double>> result;
    for (const auto& cells : fem_rows("table_compliance.csv")) {
        if (cells[0] == "gauge") continue;
        std::vector<double> row;
        for (std::size_t i = 1; i < 6; ++i) row.push_back(std::stod(cells[i]) * (i < 4 ? 1e-6 : 1e-3));
        result.push_back(row);
    }
    return result;
}

// Method "map" of the finite elements; the readings are strains (gauge factor 1).
inline Calibration map_calibration() {
    Calibration calibration;
    calibration.path = "map.toml";
    calibration.model = "table";
    calibration.method = "map";
    calibration.channels = all_gauges();
    calibration.zero.assign(8, 0.0);
    calibration.components = {"fx", "fy", "fz", "mx", "my"};
    calibration.parameters = {{"gauge_factor", 1}, {"noise", 1e-6}, {"contact", 1}};
    calibration.tables["influence"] = fem_influence();
    calibration.sd = {0.01, 0.01, 0.01, 1e-5, 1e-5};
    return calibration;
}

}  // namespace tactiled
