// The result of a fit as a self-contained HTML file for printing and sending.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "node/lab/chart/figure.hpp"
#include "node/lab/report/certificate.hpp"

namespace tactiled {

// Held-out rows of one component in numbers. The sd of a row is the calibration's for its estimate, without the
// factor for missing channels.
struct ComponentErrors {
    std::vector<double> applied, estimated, error, sd;  // rows that have both; error = estimated - applied; N or Nm
    std::vector<std::size_t> session;                   // index into Labelled::sessions
    std::size_t without_estimate = 0;                   // labelled, but BAD
    bool sd_known = false;

    // Returns the share of the errors within `times` sd, 0 .. 1; NaN if unknown.
    [[nodiscard]] double within(double times) const;
    // Returns the median of the stated sd; NaN if unknown.
    [[nodiscard]] double median_sd() const;
    // Session with the largest root mean square error, and that error; NaN if there are no errors.
    struct Worst {
        std::size_t session;
        double rms;
    };
    [[nodiscard]] Worst worst_session() const;
};
// `i`: index in report.components. setup
ComponentErrors component_errors(const FitReport& report, std::size_t i);

std::string unit_of(const ComponentReport& component);  // "N", "Nm"

// Returns the page: all figures of `report`, plots of the held-out rows, and explanations. Numbers in the tables are
// <data value="..."> with all their digits. The page has no network access, script, fonts or images; the same report
// gives the same bytes. `certificate`: figures of its own section; nullptr = without it. setup
std::string html_report(const FitReport& report, const std::string& title, const CertificateFigures* certificate = nullptr);

// Parts of the page, in plots.cpp.
inline constexpr std::size_t kMaxDots = 2000;  // in one plot; more look the same and make the file slow
// Returns a dot for each row, evenly thinned to kMaxDots.
Figure::Series held_out_rows(std::span<const double> x, std::span<const double> y);
std::string html_figure(Figure figure, const std::string& about, const std::string& caption_html);
std::string html_thinned(std::size_t rows);  // the note that a plot shows a part of the rows, or ""
std::string html_component_plots(const FitReport& report, std::size_t i);
std::string html_coverage(const FitReport& report);

// Parts of the page, in history.cpp; "" if there is nothing to show.
std::string html_history_plots(const FitReport& report, std::size_t i);
std::string html_loading(const FitReport& report);
std::string html_within(const FitReport& report);
std::string html_zeros(const FitReport& report);

}  // namespace tactiled
