#include "node/lab/report/html.hpp"

#include <fmt/format.h>

#include <cmath>

#include "node/lab/chart/figure.hpp"
#include "node/lab/chart/text.hpp"
#include "node/lab/report/style.hpp"

namespace tactiled {

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
