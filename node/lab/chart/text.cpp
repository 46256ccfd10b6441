#include "node/lab/chart/text.hpp"

#include <algorithm>
#include <cstddef>

namespace tactiled {
namespace {

// Returns the length of the valid UTF-8 sequence at the start of `text`; 0 if there is none.
std::size_t sequence(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned first = byte(0);
    const std::size_t n = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;
    if (n == 0 || n > text.size()) return 0;
    for (std::size_t i = 1; i < n; ++i)
        if ((byte(i) & 0xC0u) != 0x80) return 0;
    if (n == 3 && ((first == 0xE0 && byte(1) < 0xA0) || (first == 0xED && byte(1) > 0x9F))) return 0;  // overlong, surrogate
    if (n == 3 && first == 0xEF && byte(1) == 0xBF && byte(2) > 0xBD) return 0;  // U+FFFE, U+FFFF: not in XML
    if (n == 4 && ((first == 0xF0 && byte(1) < 0x90) || (first == 0xF4 && byte(1) > 0x8F))) return 0;
    return n;
}

}  // namespace

std::string html_text(std::string_view text) {
    std::string result;
    while (!text.empty()) {
        const std::size_t n = sequence(text);
        const char c = text[0];
        switch (c) {
            case '&': result += "&amp;"; break;
            case '<': result += "&lt;"; break;
            case '>': result += "&gt;"; break;
            case '"': result += "&quot;"; break;
            case '\'': result += "&#39;"; break;
            default: {
                const bool control = (static_cast<unsigned char>(c) < ' ' && c != '\t' && c != '\n') || c == '\x7f';
                result += n == 0 || control ? std::string_view("\uFFFD") : text.substr(0, n);
            }
        }
        text.remove_prefix(std::max<std::size_t>(n, 1));
    }
    return result;
}

double text_width(std::string_view text, double font_size) {
    double width = 0;  // relative to the font size; DejaVu Sans is the widest common font
    for (const char c : text) {
        if ((static_cast<unsigned char>(c) & 0xC0u) == 0x80) continue;  // continuation byte of a character
        if (std::string_view("iljI.,:;|'!() ").find(c) != std::string_view::npos)
            width += 0.38;
        else if (std::string_view("mwMW%").find(c) != std::string_view::npos)
            width += 0.98;
        else
            width += c >= 'A' && c <= 'Z' ? 0.74 : 0.64;
    }
    return width * font_size;
}

}  // namespace tactiled
