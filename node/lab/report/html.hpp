// Common part of the pages of the programs: one HTML file that needs nothing else; no network, script, fonts, images.
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace tactiled {

// All digits for whoever copies it, few to read; "unknown" where it is not finite.
std::string html_number(double value, int digits = 4);
// A row of cells that are HTML already, <td> or <th>.
std::string html_row(const std::vector<std::string>& cells_html, const char* cell = "td");
// Rows in a table that scrolls sideways where it is too wide.
std::string html_table(const std::string& rows_html, std::string_view id);
// A line of a table of facts: name, HTML.
std::string html_fact(const char* name, const std::string& html);
std::string html_facts(const std::string& facts_html, std::string_view id = "facts");
// The whole page. `title` is text.
std::string html_page(const std::string& title, const std::string& body_html);

}  // namespace tactiled
