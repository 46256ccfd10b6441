#include "node/lab/chart/plot.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "node/lab/chart/text.hpp"

namespace tactiled {
namespace {

// In units of the viewBox.
constexpr double kWidth = 360, kHeight = 290;
constexpr PlotArea kArea{.left = 62, .right = 350, .top = 10, .foot = 246};

bool finite(Dot dot) { return std::isfinite(dot.x) && std::isfinite(dot.y); }

}  // namespace

SvgPlot::SvgPlot(std::string_view about, std::string_view x_label, Span x, std::string_view y_label, Span y)
    : x_(as_axis(x, 0), kArea.left, kArea.right),
      y_(as_axis(y, 0), kArea.foot, kArea.top),
      svg_({.width = kWidth, .height = kHeight, .about = about}) {
    svg_.put("<rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>\n", kArea.left, kArea.top,
             kArea.right - kArea.left, kArea.foot - kArea.top);
    AxisMarks marks;
    marks.add_x(kArea, x_, axis_ticks(x_.axis()), 15);
    marks.add_y(kArea, y_, axis_ticks(y_.axis()), 5, 4);
    svg_.put(svg_line(marks.grid, {.css_class = "grid"}) + marks.numbers);
    svg_.put("<text class=\"label\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", (kArea.left + kArea.right) / 2,
             kHeight - 8, html_text(x_label));
    svg_.put("<text class=\"label\" x=\"13\" y=\"{0}\" text-anchor=\"middle\" transform=\"rotate(-90 13 {0})\">{1}</text>\n",
             (kArea.top + kArea.foot) / 2, html_text(y_label));
}

void SvgPlot::dots(std::span<const Dot> dots) {
    const std::size_t n = std::min(dots.size(), kMaxDots);
    std::string d;
    for (std::size_t i = 0; i < n; ++i)
        if (const Dot dot = dots[i * dots.size() / n]; finite(dot)) d += path({&dot, 1}) + "h0";
    svg_.put(svg_line(d, {.css_class = "dots"}));
}

std::string SvgPlot::path(std::span<const Dot> dots) const {
    SvgPath path;
    for (const Dot dot : dots)
        if (finite(dot)) path.to(x_.at(dot.x), y_.at(dot.y));
    return path.d();
}

void SvgPlot::line(std::span<const Dot> dots, std::string_view css_class) {
    svg_.put(svg_line(path(dots), {.css_class = css_class}));
}

void SvgPlot::band(std::span<const Dot> lower, std::span<const Dot> upper) {
    std::vector<Dot> around(lower.begin(), lower.end());
    around.insert(around.end(), upper.rbegin(), upper.rend());
    if (const std::string d = path(around); !d.empty()) svg_.put(svg_line(d + "Z", {.css_class = "band"}));
}

void SvgPlot::bar(double left, double right, double height) {
    const double foot = y_.axis().min;
    const Dot corners[] = {{left, foot}, {left, height}, {right, height}, {right, foot}};
    if (height > foot && std::all_of(std::begin(corners), std::end(corners), finite))
        svg_.put(svg_line(path(corners) + "Z", {.css_class = "bar"}));
}

}  // namespace tactiled
