// The common parts of all charts as SVG: head, lines, the grid with the numbers of an axis, the legend.
#pragma once
#include <fmt/format.h>

#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "node/lab/chart/axis.hpp"

namespace tactiled {

struct SvgHead {
    double width, height;          // size of the viewBox
    std::string_view about;        // plain text, for screen readers
    std::string_view css_class{};  // "" = none
    double font_size = 0;          // 0: the style sheet of a page sets fonts and colours
    std::string_view ink = "#1b1f24";
    bool sized = false;  // one unit of the viewBox is a pixel
    bool paper = false;  // draws a white background
};

// An SVG that is written element after element.
class Svg {
public:
    explicit Svg(const SvgHead& head);
    template <class... T>
    void put(fmt::format_string<T...> format, T&&... values) {
        fmt::format_to(std::back_inserter(text_), format, std::forward<T>(values)...);
    }
    void put(const std::string& elements) { text_ += elements; }
    [[nodiscard]] std::string text() const { return text_ + "</svg>\n"; }

private:
    std::string text_;
};

// A line through points, as a path's d: "M1.0 2.0L3.0 4.0".
class SvgPath {
public:
    void to(double x, double y) { fmt::format_to(std::back_inserter(d_), "{}{:.1f} {:.1f}", d_.empty() ? "M" : "L", x, y); }
    [[nodiscard]] const std::string& d() const { return d_; }

private:
    std::string d_;
};

struct Pen {
    std::string_view css_class{}, colour{},
        dashes{};      // "" = omitted; without a colour the class defines the style of the line
    double width = 0;  // 0 = omitted
};
// Returns the element that draws a path; "" if there is nothing to draw.
std::string svg_line(std::string_view d, const Pen& pen);

// The area in which values are drawn. `decimals`: of the coordinates of its top and foot.
struct PlotArea {
    double left, right, top, foot;
    int decimals = 0;
};
// The ticks of a chart's axes: lines of the grid across the plot, as a path's d, and the numbers beside it, as
// elements.
struct AxisMarks {
    std::string grid, numbers;
    // Adds ticks of the x axis, with the numbers `below` the foot.
    void add_x(const PlotArea& area, const Scale& scale, std::span<const Tick> ticks, double below);
    // Adds ticks of the y axis, with the numbers ending `left` of the plot and `down` below the line, so that their
    // middle is at the line.
    void add_y(const PlotArea& area, const Scale& scale, std::span<const Tick> ticks, double left, double down);
};

// Returns the text of an entry of the legend, whose line is at the height `middle`.
std::string legend_text(double x, double middle, std::string_view text, double font_size);
std::string legend_line(double x, double middle, double length, const Pen& pen);

}  // namespace tactiled
