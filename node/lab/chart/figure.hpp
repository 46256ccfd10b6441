// A figure of measured points as an SVG that stands alone: readable in print and without colours, for every series has a
// symbol of its own. Equal data give equal bytes. May allocate; never in the loop.
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
        double x, y;        // drawn if finite; on a logarithmic axis 0 and less stand at its begin, as 0
        std::string label;  // beside it, "" = none
    };
    struct Series {
        std::string name;  // in the legend, "" = not there
        Symbol symbol = Symbol::circle;
        Stroke stroke = Stroke::none;  // joins the points in their order
        std::vector<Point> points;
        std::string colour;   // for example "#1f5fa8"; "" = by its place among the series
        bool hollow = false;  // its symbols are outlines
    };
    std::string title;
    Axis x, y;
    std::vector<Series> series;
};

// Texts are text, not HTML. setup
std::string figure_svg(const Figure& figure);

}  // namespace tactiled
