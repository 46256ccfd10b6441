// Texts in charts and pages.
#pragma once
#include <string>
#include <string_view>

namespace tactiled {

// Text for HTML and SVG: markup escaped; control characters and bytes that are no UTF-8 become U+FFFD.
std::string html_text(std::string_view text);

// The width of a text in a sans-serif font of that size, rather too wide than too narrow.
double text_width(std::string_view text, double font_size);

}  // namespace tactiled
