// The figures of pages, reports and manuals as SVG: axes, series, legend, labels. A figure is readable in print and
// without colours if each of its series has its own symbol or stroke. Equal data give equal bytes. May allocate; never
// in the loop.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "node/lab/chart/axis.hpp"

namespace tactiled {

enum class Symbol { none, dot, circle, ring, square, triangle, diamond, cross };
enum class Stroke { none, solid, dashed, dotted };
// line: a stroke joins the points up to one that is not finite. area: the inside of the points. bars: rectangles, two
// opposite corners each.
enum class Shape { line, area, bars };

// Indices of the palette, which differ in grey and for readers with red-green colour blindness.
inline constexpr int kBlue = 0, kOrange = 1, kInk = 2, kGreen = 3, kViolet = 4, kGrey = 5;
inline constexpr int kByIndex = -1;  // the index of the series

struct Figure {
    struct Axis {
        std::string label;  // with its unit; "" = none
        bool logarithmic = false;
        std::optional<Span> range = {};  // default: that of the points, and some more
        std::vector<Tick> ticks = {};    // default: numbers
        bool grid = true;
    };
    struct Point {
        double x, y;             // drawn if finite; on a logarithmic axis 0 and less are placed at its begin, as 0
        std::string label = "";  // beside it, "" = none
    };
    struct Series {
        std::string name;  // name in the legend, "" = not listed
        Symbol symbol = Symbol::circle;
        Stroke stroke = Stroke::none;
        std::vector<Point> points = {};
        int colour = kByIndex;
        bool hollow = false;  // draws the symbols as outlines
        Shape shape = Shape::line;
        double width = 1.5;  // width of the stroke
    };
    struct Note {  // a text at a fixed place: its begin, its middle if `centred`
        double x, y;
        std::string text;
        double right = 0, up = 0;  // offsets on the paper
        bool centred = false, upright = false;
        int colour = kInk;
    };
    std::string title = "";  // "" = none
    Axis x, y;
    std::vector<Series> series = {};
    std::vector<Note> notes = {};
    double width = 624, height = 330;          // size of the area in which values are drawn
    double margin_right = 18, margin_top = 0;  // beside it and above it; notes may use them
};

// file: complete with style and background. page: for a page whose style sheet contains kFigureStyle.
enum class Place { file, page };

// Style sheet of figures, light and dark.
extern const char* const kFigureStyle;

// Returns the figures side by side. Texts are plain text, not HTML. `about` is the description for screen readers. setup
std::string figures_svg(std::span<const Figure> figures, const std::string& about, Place place);
// Returns one figure with its title as the description. setup
std::string figure_svg(const Figure& figure, Place place = Place::file);

}  // namespace tactiled
