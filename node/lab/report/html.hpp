// The common part of the programs' pages: one HTML file without network, script, fonts or images.
#pragma once
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tactiled {

// Writes a number with few visible digits and all digits for copying; "unknown" if it is not finite.
std::string html_number(double value, int digits = 4);
// The same with its unit; "unknown" alone if it is not finite.
std::string html_number(double value, const std::string& unit, int digits = 4);
// Returns a row of cells that contain HTML, <td> or <th>.
std::string html_row(const std::vector<std::string>& cells_html, const char* cell = "td");
// Returns a table that scrolls sideways if it is too wide.
std::string html_table(const std::string& rows_html, std::string_view id);
// Returns a table of facts: name, HTML.
using Facts = std::vector<std::pair<const char*, std::string>>;
std::string html_facts(const Facts& facts, std::string_view id = "facts");
// Returns the whole page. `title` is plain text.
std::string html_page(const std::string& title, const std::string& body_html);

}  // namespace tactiled
