#include <fmt/format.h>

#include <cmath>

#include "node/lab/chart/text.hpp"
#include "node/lab/report/certificate.hpp"
#include "node/lab/report/html.hpp"

namespace tactiled {
namespace {

std::string percent(double share) { return html_number(100 * share, "%"); }

std::string unit_of(const AxisFigures& axis) { return axis.name[0] == 'f' ? "N" : "Nm"; }

std::string row_of(const AxisFigures& axis, std::size_t kind) {
    const LoadFigure& figure = axis.figures[kind];
    const std::string name = fmt::format("{}, {}", html_text(kFigureKinds[kind].name), html_text(kFigureKinds[kind].symbol));
    if (!figure.absent.empty())
        return fmt::format("<tr><td>{}</td><td>{}</td><td class=\"text\" colspan=\"3\">absent: {}</td></tr>\n",
                           html_text(axis.name), name, html_text(figure.absent));
    const std::size_t worst = figure.worst();
    return html_row({html_text(axis.name), name, percent(figure.value[worst]),
                     html_number(figure.load[worst], unit_of(axis)), html_number(double(figure.value.size()), 9)});
}

}  // namespace

std::string html_certificate(const CertificateFigures& figures) {
    std::string rows = html_row({"component", "figure", "largest", "at the load", "number of loads"}, "th");
    std::string uncertain = html_row({"component", "largest load", "expanded uncertainty there (k = 2)"}, "th");
    for (const AxisFigures& axis : figures.axes) {
        for (std::size_t kind = 0; kind < kFigureKinds.size(); ++kind) rows += row_of(axis, kind);
        uncertain += html_row(
            {html_text(axis.name), html_number(axis.full_scale, unit_of(axis)), html_number(axis.expanded, unit_of(axis))});
    }
    const std::string reference =
        figures.reference.name.empty()
            ? "The reference and its uncertainty were not stated (--reference, --reference-uncertainty), so that the "
              "expanded uncertainty is unknown."
            : fmt::format("Reference: {}; the expanded uncertainty includes that of the reference.",
                          html_text(figures.reference.name));
    return fmt::format(
        "<h2>Figures as in ISO 376</h2>\n<p>From {} rows whose published force is GOOD, of {} with a label; loads that were "
        "held for three labels or more, less the rest before them. This is no accredited certificate.</p>\n{}<p>{}</p>\n{}",
        html_number(double(figures.good), 9), html_number(double(figures.labelled), 9), html_table(rows, "iso376"),
        reference, html_table(uncertain, "expanded"));
}

}  // namespace tactiled
