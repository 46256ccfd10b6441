// The result of a fit as a page that can be printed, sent and shown: one self-contained HTML file.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Held-out rows of one component in numbers. The sd of a row is the calibration's for its estimate, without the factor for
// missing channels.
struct ComponentErrors {
    std::vector<double> applied, estimated, error, sd;  // rows that have both; error = estimated - applied; N or Nm
    std::vector<std::size_t> session;                   // index into Labelled::sessions
    std::size_t without_estimate = 0;                   // labelled, but BAD
    bool sd_known = false;

    // Share of the errors within `times` sd, 0 .. 1; NaN where unknown.
    [[nodiscard]] double within(double times) const;
};
// `i`: of report.components. setup
ComponentErrors component_errors(const FitReport& report, std::size_t i);

std::string unit_of(const ComponentReport& component);  // "N", "Nm"

// The page: all figures of `report`, plots of the held-out rows, and how to read them. Numbers in the tables are
// <data value="..."> with all their digits. Without network, script, fonts or images; the same report gives the same bytes.
// setup
std::string html_report(const FitReport& report, const std::string& title);

// Parts of the page, in plots.cpp.
std::string html_component_plots(const FitReport& report, std::size_t i);
std::string html_coverage(const FitReport& report);

}  // namespace tactiled
