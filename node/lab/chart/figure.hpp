// A figure of measured points as a standalone SVG. It is readable in print and without colours, because every series
// has its own symbol. Equal data give equal bytes. May allocate; never in the loop.
#pragma once
#include <string>
#include <vector>

namespace tactiled {

enum class Symbol { none, circle, ring, square, triangle, diamond, cross };
enum class Stroke { none, solid, dashed };

struct Figure {
    struct Axis {
        std::string label;  // with its unit
        bool logarithmic = false;
    };
    struct Point {
        double x, y;        // drawn if finite; on a logarithmic axis 0 and less are placed at its begin, as 0
        std::string label;  // beside it, "" = none
    };
    struct Series {
        std::string name;  // name in the legend, "" = not listed
        Symbol symbol = Symbol::circle;
        Stroke stroke = Stroke::none;  // joins the points in their order
        std::vector<Point> points;
        std::string colour;   // for example "#1f5fa8"; "" = by its index among the series
        bool hollow = false;  // draws the symbols as outlines
    };
    std::string title;
    Axis x, y;
    std::vector<Series> series;
};

// Returns the figure. Its texts are plain text, not HTML. setup
std::string figure_svg(const Figure& figure);

}  // namespace tactiled
