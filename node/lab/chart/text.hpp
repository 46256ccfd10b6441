// Texts in charts and pages.
#pragma once
#include <string>
#include <string_view>

namespace tactiled {

// Escapes text for HTML and SVG; control characters and invalid UTF-8 become U+FFFD.
std::string html_text(std::string_view text);

// Returns the width of a text in a sans-serif font of that size, rather too large than too small.
double text_width(std::string_view text, double font_size);

}  // namespace tactiled
