#include "node/lab/chart/figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "node/lab/chart/axis.hpp"
#include "node/lab/chart/labels.hpp"
#include "node/lab/chart/svg.hpp"
#include "node/lab/chart/text.hpp"

namespace tactiled {
namespace {

// In units of the viewBox.
constexpr double kWidth = 720, kLeft = 78, kRight = 18, kTitle = 30, kLegend = 22, kPlot = 330, kFoot = 54;
constexpr double kFont = 13, kLabelFont = 12, kReach = 4.5;  // distance of a symbol's edge from its middle
// Colours of different lightness, which also differ in grey and for readers with red-green colour blindness.
constexpr std::array kColours{"#1f5fa8", "#c4561e", "#1b1f24", "#6a994e", "#8d5a97", "#7f8790"};

// One axis: the mapping to the paper, and its ticks.
struct Axis {
    Scale scale;
    std::vector<Tick> ticks;
};

Axis linear_axis(const std::vector<double>& values, double from, double to) {
    const Span span = as_axis(span_of(values), 0.06);
    return {Scale(span, from, to), axis_ticks(span)};
}

Axis logarithmic_axis(const std::vector<double>& values, double from, double to) {
    std::vector<double> powers;
    for (const double v : values)
        if (std::isfinite(v) && v > 0) powers.push_back(std::log10(v));
    Span span = powers.empty() ? Span{0, 1} : as_axis(span_of(powers), 0.06);
    const bool zeros = std::any_of(values.begin(), values.end(), [](double v) { return v <= 0; });
    if (zeros) span.min -= std::max(0.4, 0.12 * (span.max - span.min));
    Axis axis{Scale::logarithmic(span, from, to), log_ticks({std::pow(10, span.min), std::pow(10, span.max)})};
    auto& ticks = axis.ticks;
    if (zeros) {
        while (!ticks.empty() && std::abs(axis.scale.at(ticks.front().at) - from) < 24) ticks.erase(ticks.begin());
        ticks.insert(ticks.begin(), {0, "0"});
    }
    return axis;
}

Axis axis_of(const Figure::Axis& axis, const std::vector<double>& values, double from, double to) {
    return axis.logarithmic ? logarithmic_axis(values, from, to) : linear_axis(values, from, to);
}

std::vector<double> all(const Figure& figure, double Figure::Point::*coordinate) {
    std::vector<double> values;
    for (const auto& series : figure.series)
        for (const auto& point : series.points) values.push_back(point.*coordinate);
    return values;
}

std::string_view colour_of(const Figure& figure, std::size_t i) {
    const std::string& own = figure.series[i].colour;
    return own.empty() ? std::string_view(kColours[i % kColours.size()]) : own;
}

class Drawing {
public:
    explicit Drawing(const Figure& figure)
        : figure_(figure),
          top_(kTitle + kLegend * double(legend(false))),
          foot_(top_ + kPlot),
          x_(axis_of(figure.x, all(figure, &Figure::Point::x), kLeft, kWidth - kRight)),
          y_(axis_of(figure.y, all(figure, &Figure::Point::y), foot_, top_)),
          svg_({.width = kWidth,
                .height = foot_ + kFoot,
                .about = figure.title,
                .font_size = kFont,
                .sized = true,
                .paper = true}) {}

    std::string text() {
        svg_.put("<text x=\"{}\" y=\"19\" font-size=\"15\" font-weight=\"bold\">{}</text>\n", kLeft,
                 html_text(figure_.title));
        legend(true);
        axes();
        lines();
        for (std::size_t i = 0; i < figure_.series.size(); ++i)
            for (const auto& point : figure_.series[i].points)
                if (drawn(point)) symbol(i, x_.scale.at(point.x), y_.scale.at(point.y));
        labels();
        return svg_.text();
    }

private:
    static bool drawn(const Figure::Point& point) { return std::isfinite(point.x) && std::isfinite(point.y); }

    // Draws the legend if `drawing`; returns its number of rows.
    int legend(bool drawing) {
        double x = kLeft;
        int row = 0;
        for (std::size_t i = 0; i < figure_.series.size(); ++i) {
            const auto& series = figure_.series[i];
            if (series.name.empty()) continue;
            const double width = 34 + text_width(series.name, kLabelFont) + 14;
            if (x > kLeft && x + width > kWidth) x = kLeft, ++row;
            const double middle = kTitle + kLegend * row + 8;
            if (drawing) {
                if (series.stroke != Stroke::none) svg_.put(legend_line(x, middle, 26, pen(i)));
                symbol(i, x + 13, middle);
                svg_.put(legend_text(x + 33, middle, series.name, kLabelFont));
            }
            x += width;
        }
        return x > kLeft || row > 0 ? row + 1 : 0;
    }

    void axes() {
        const PlotArea area{kLeft, kWidth - kRight, top_, foot_, 1};
        AxisMarks marks;
        marks.add_x(area, x_.scale, x_.ticks, 18);
        marks.add_y(area, y_.scale, y_.ticks, 7, 4.5);
        svg_.put(marks.numbers + svg_line(marks.grid, {.colour = "#d8dde3"}));
        svg_.put("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#57606a\"/>\n", kLeft, top_,
                 kWidth - kLeft - kRight, kPlot);
        svg_.put("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n", (kLeft + kWidth - kRight) / 2, foot_ + 42,
                 html_text(figure_.x.label));
        svg_.put("<text text-anchor=\"middle\" transform=\"translate(18 {:.1f}) rotate(-90)\">{}</text>\n",
                 (top_ + foot_) / 2, html_text(figure_.y.label));
    }

    [[nodiscard]] Pen pen(std::size_t i) const {
        return {.colour = colour_of(figure_, i),
                .dashes = figure_.series[i].stroke == Stroke::dashed ? "6 4" : "",
                .width = 1.5};
    }

    void lines() {
        for (std::size_t i = 0; i < figure_.series.size(); ++i) {
            if (figure_.series[i].stroke == Stroke::none) continue;
            SvgPath path;
            for (const auto& point : figure_.series[i].points)
                if (drawn(point)) path.to(x_.scale.at(point.x), y_.scale.at(point.y));
            svg_.put(svg_line(path.d(), pen(i)));
        }
    }

    void symbol(std::size_t i, double x, double y) {
        const std::string_view colour = colour_of(figure_, i);
        const std::string filled = figure_.series[i].hollow
                                       ? fmt::format("fill=\"#fff\" stroke=\"{}\" stroke-width=\"1.4\"", colour)
                                       : fmt::format("fill=\"{}\"", colour);
        const auto path = [&](const char* d) { svg_.put("<path {} d=\"M{:.1f} {:.1f}{}\"/>\n", filled, x, y, d); };
        switch (figure_.series[i].symbol) {
            case Symbol::none: return;
            case Symbol::circle: return svg_.put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" {}/>\n", x, y, filled);
            case Symbol::ring:
                return svg_.put(
                    "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.7\" fill=\"#fff\" stroke=\"{}\" stroke-width=\"1.6\"/>\n", x,
                    y, colour);
            case Symbol::square: return path("m-3.7-3.7h7.4v7.4h-7.4Z");
            case Symbol::triangle: return path("m0-4.8l4.5 8h-9Z");
            case Symbol::diamond: return path("m0-5l5 5l-5 5l-5-5Z");
            case Symbol::cross:
                return svg_.put(
                    "<path fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\" d=\"M{:.1f} {:.1f}m-4-4l8 8m0-8l-8 8\"/>\n",
                    colour, x, y);
        }
    }

    void labels() {
        std::vector<LabelRequest> requests;
        std::vector<const std::string*> texts;
        std::vector<Box> taken, crossed;
        for (const auto& series : figure_.series) {
            const double reach = series.symbol == Symbol::none ? 0.5 : kReach;
            for (std::size_t i = 0; i < series.points.size(); ++i) {
                const auto& point = series.points[i];
                if (!drawn(point)) continue;
                const double x = x_.scale.at(point.x), y = y_.scale.at(point.y);
                const Box box{x - reach, y - reach, x + reach, y + reach};
                if (!point.label.empty()) {
                    requests.push_back({box, text_width(point.label, kLabelFont), kLabelFont + 1});
                    texts.push_back(&point.label);
                } else if (series.symbol != Symbol::none) {
                    taken.push_back(box);
                }
                if (series.stroke == Stroke::none || i == 0 || !drawn(series.points[i - 1])) continue;
                const double from_x = x_.scale.at(series.points[i - 1].x), from_y = y_.scale.at(series.points[i - 1].y);
                const int steps = 1 + int(std::hypot(x - from_x, y - from_y) / 3);
                for (int k = 0; k <= steps; ++k) {
                    const double share = double(k) / steps, at_x = std::lerp(from_x, x, share),
                                 at_y = std::lerp(from_y, y, share);
                    crossed.push_back({at_x - 1, at_y - 1, at_x + 1, at_y + 1});
                }
            }
        }
        const Box frame{kLeft + 2, top_ + 2, kWidth - kRight - 2, foot_ - 2};
        const auto places = place_labels(requests, taken, std::move(crossed), frame);
        int without = 0;
        for (std::size_t i = 0; i < places.size(); ++i) {
            if (!places[i]) {
                ++without;
                continue;
            }
            const Box& box = *places[i];
            const Leader leader = leader_between(requests[i].symbol, box);
            if (leader.needed())
                svg_.put("<path stroke=\"#57606a\" stroke-width=\"0.7\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n",
                         leader.from_x, leader.from_y, leader.to_x, leader.to_y);
            // The label is anchored at the side of its symbol, so that a narrower font leaves no gap there. White
            // around it interrupts the grid's lines.
            const bool right = box.left >= requests[i].symbol.right, left = box.right <= requests[i].symbol.left;
            svg_.put(
                "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" stroke=\"#fff\" stroke-width=\"3\" "
                "paint-order=\"stroke\">{}</text>\n",
                right  ? box.left
                : left ? box.right
                       : (box.left + box.right) / 2,
                box.bottom - 3, kLabelFont,
                right  ? "start"
                : left ? "end"
                       : "middle",
                html_text(*texts[i]));
        }
        if (without > 0)
            svg_.put("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\" font-size=\"{}\">{} labels have no room</text>\n",
                     kWidth - kRight, foot_ + 42, kLabelFont, without);
    }

    const Figure& figure_;
    double top_, foot_;
    Axis x_, y_;
    Svg svg_;
};

}  // namespace

std::string figure_svg(const Figure& figure) { return Drawing(figure).text(); }

}  // namespace tactiled
