#include "node/lab/report/html.hpp"

#include <fmt/format.h>

#include <cmath>

#include "node/lab/chart/figure.hpp"
#include "node/lab/chart/text.hpp"

namespace tactiled {
namespace {

// The style sheet of a report: light, dark and print.
constexpr const char* kReportStyle = R"(
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --paper: #ffffff; --rule: #d0d7de;
  --note: #fff4dc; --cell: 31, 95, 168; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --soft: #a3abb5; --paper: #14171b; --rule: #3a414a;
  --note: #3a2f16; --cell: 90, 150, 225; } }
* { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
body { margin: 0 auto; padding: 1.5rem; max-width: 75rem; color: var(--ink); background: var(--paper);
  font: 15px/1.45 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; }
h1 { font-size: 1.6em; overflow-wrap: anywhere; } h2 { margin-top: 2em; border-bottom: 1px solid var(--rule); }
p, li { max-width: 48em; } td, li, dd { overflow-wrap: anywhere; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: 0.8em 0; font-variant-numeric: tabular-nums; }
td { white-space: nowrap; } td.text, .facts td { white-space: normal; }
th, td { padding: 0.25em 0.7em; border-bottom: 1px solid var(--rule); text-align: right; vertical-align: top; }
th { font-weight: 600; } th:first-child, td:first-child, td.text { text-align: left; }
.facts th { text-align: left; color: var(--soft); font-weight: 400; } .facts td { text-align: left; }
.note { background: var(--note); padding: 0.6em 1em 0.6em 2em; }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(20rem, 1fr)); gap: 1em; }
figure { margin: 0; } figcaption { color: var(--soft); font-size: 0.87em; }
svg { width: 100%; height: auto; max-width: 30rem; } .wide svg { max-width: none; }
@media print { :root { color-scheme: light; --ink: #000000; --soft: #444444; --paper: #ffffff; --rule: #bbbbbb;
  --note: #fff4dc; --cell: 31, 95, 168; }
  body { font-size: 9.5pt; max-width: none; margin: 0; padding: 0; } figure, table, .note { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
  td { white-space: normal; } th, td { padding: 0.2em 0.4em; font-size: 8pt; overflow-wrap: break-word; } .scroll { overflow: visible; } .plots { grid-template-columns: repeat(3, 1fr); } }
)";

}  // namespace

std::string html_number(double value, int digits) {
    if (!std::isfinite(value)) return "unknown";
    return fmt::format("<data value=\"{}\">{:.{}g}</data>", value, value, digits);
}

std::string html_number(double value, const std::string& unit, int digits) {
    return html_number(value, digits) + (std::isfinite(value) ? " " + html_text(unit) : "");
}

std::string html_row(const std::vector<std::string>& cells_html, const char* cell) {
    std::string result = "<tr>";
    for (const auto& html : cells_html) result += fmt::format("<{0}>{1}</{0}>", cell, html);
    return result + "</tr>\n";
}

std::string html_table(const std::string& rows_html, std::string_view id) {
    return fmt::format("<div class=\"scroll\"><table id=\"{}\">\n{}</table></div>\n", html_text(id), rows_html);
}

std::string html_facts(const Facts& facts, std::string_view id) {
    std::string rows;
    for (const auto& [name, html] : facts) rows += fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", name, html);
    return fmt::format("<table class=\"facts\" id=\"{}\">\n{}</table>\n", html_text(id), rows);
}

std::string html_page(const std::string& title, const std::string& body_html) {
    return fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
        "content=\"width=device-width, initial-scale=1\">\n<title>{0}</title>\n<style>{1}{3}</style>\n</head>\n<body>\n"
        "<h1>{0}</h1>\n{2}</body>\n</html>\n",
        html_text(title), kReportStyle, body_html, kFigureStyle);
}

}  // namespace tactiled
