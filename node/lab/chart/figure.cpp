#include "node/lab/chart/figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "node/lab/chart/labels.hpp"
#include "node/lab/chart/plot.hpp"

namespace tactiled::ctl {
namespace {

// In units of the viewBox.
constexpr double kWidth = 720, kLeft = 78, kRight = 18, kTitle = 30, kLegend = 22, kPlot = 330, kFoot = 54;
constexpr double kFont = 13, kLabelFont = 12, kReach = 4.5;  // of a symbol from its middle
// Of different lightness, so that they differ in grey; also to those who tell red and green badly.
constexpr std::array kColours{"#1f5fa8", "#c4561e", "#1b1f24", "#6a994e", "#8d5a97", "#7f8790"};

// One axis: where on the paper a value stands.
class Scale {
public:
    Scale(const Figure::Axis& axis, const std::vector<double>& values, double from, double to)
        : logarithmic_(axis.logarithmic), from_(from), to_(to) {
        std::vector<double> used;
        for (const double v : values)
            if (std::isfinite(v) && (!logarithmic_ || v > 0)) used.push_back(logarithmic_ ? std::log10(v) : v);
        const bool zeros = logarithmic_ && std::any_of(values.begin(), values.end(), [](double v) { return v <= 0; });
        span_ = as_axis(span_of(used), 0.06);
        if (logarithmic_ && used.empty()) span_ = {0, 1};
        if (zeros) span_.min -= std::max(0.4, 0.12 * (span_.max - span_.min));
        ticks_ = logarithmic_ ? log_ticks({std::pow(10, span_.min), std::pow(10, span_.max)}) : axis_ticks(span_);
        if (zeros) {
            while (!ticks_.empty() && std::abs(at(ticks_.front().at) - from_) < 24) ticks_.erase(ticks_.begin());
            ticks_.insert(ticks_.begin(), {0, "0"});
        }
    }
    [[nodiscard]] double at(double value) const {
        if (logarithmic_) value = value > 0 ? std::log10(value) : span_.min;
        return from_ + (to_ - from_) * std::clamp((value - span_.min) / (span_.max - span_.min), 0.0, 1.0);
    }
    [[nodiscard]] const std::vector<Tick>& ticks() const { return ticks_; }

private:
    bool logarithmic_;
    double from_, to_;
    Span span_{};
    std::vector<Tick> ticks_;
};

std::vector<double> all(const Figure& figure, double Figure::Point::*coordinate) {
    std::vector<double> values;
    for (const auto& series : figure.series)
        for (const auto& point : series.points) values.push_back(point.*coordinate);
    return values;
}

std::string colour_of(const Figure& figure, std::size_t i) {
    return figure.series[i].colour.empty() ? kColours[i % kColours.size()] : figure.series[i].colour;
}

class Drawing {
public:
    explicit Drawing(const Figure& figure)
        : figure_(figure),
          top_(kTitle + kLegend * double(legend(false))),
          foot_(top_ + kPlot),
          x_(figure.x, all(figure, &Figure::Point::x), kLeft, kWidth - kRight),
          y_(figure.y, all(figure, &Figure::Point::y), foot_, top_) {}

    std::string text() {
        const double height = foot_ + kFoot;
        svg_ = fmt::format(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" width=\"{}\" height=\"{}\" role=\"img\" "
            "aria-label=\"{}\" font-family=\"sans-serif\" font-size=\"{}\" fill=\"#1b1f24\">\n"
            "<rect width=\"{}\" height=\"{}\" fill=\"#fff\"/>\n",
            kWidth, height, kWidth, height, html_text(figure_.title), kFont, kWidth, height);
        put("<text x=\"{}\" y=\"19\" font-size=\"15\" font-weight=\"bold\">{}</text>\n", kLeft, html_text(figure_.title));
        legend(true);
        axes();
        lines();
        for (std::size_t i = 0; i < figure_.series.size(); ++i)
            for (const auto& point : figure_.series[i].points)
                if (drawn(point)) symbol(i, x_.at(point.x), y_.at(point.y));
        labels();
        return svg_ + "</svg>\n";
    }

private:
    template <class... T>
    void put(fmt::format_string<T...> format, T&&... values) {
        fmt::format_to(std::back_inserter(svg_), format, std::forward<T>(values)...);
    }
    static bool drawn(const Figure::Point& point) { return std::isfinite(point.x) && std::isfinite(point.y); }

    // Draws it where `drawing`; returns its rows.
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
                if (series.stroke != Stroke::none) stroke(i, fmt::format("M{:.1f} {:.1f}h26", x, middle));
                symbol(i, x + 13, middle);
                put("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\">{}</text>\n", x + 33, middle + 4, kLabelFont,
                    html_text(series.name));
            }
            x += width;
        }
        return x > kLeft || row > 0 ? row + 1 : 0;
    }

    void axes() {
        std::string grid;
        for (const auto& [value, text] : x_.ticks()) {
            grid += fmt::format("M{:.1f} {:.1f}V{:.1f}", x_.at(value), top_, foot_);
            put("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n", x_.at(value), foot_ + 18, text);
        }
        for (const auto& [value, text] : y_.ticks()) {
            grid += fmt::format("M{} {:.1f}H{}", kLeft, y_.at(value), kWidth - kRight);
            put("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", kLeft - 7, y_.at(value) + 4.5, text);
        }
        put("<path fill=\"none\" stroke=\"#d8dde3\" d=\"{}\"/>\n", grid);
        put("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#57606a\"/>\n", kLeft, top_,
            kWidth - kLeft - kRight, kPlot);
        put("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n", (kLeft + kWidth - kRight) / 2, foot_ + 42,
            html_text(figure_.x.label));
        put("<text text-anchor=\"middle\" transform=\"translate(18 {:.1f}) rotate(-90)\">{}</text>\n", (top_ + foot_) / 2,
            html_text(figure_.y.label));
    }

    void stroke(std::size_t i, const std::string& path) {
        put("<path fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"{} d=\"{}\"/>\n", colour_of(figure_, i),
            figure_.series[i].stroke == Stroke::dashed ? " stroke-dasharray=\"6 4\"" : "", path);
    }

    void lines() {
        for (std::size_t i = 0; i < figure_.series.size(); ++i) {
            if (figure_.series[i].stroke == Stroke::none) continue;
            std::string path;
            for (const auto& point : figure_.series[i].points)
                if (drawn(point))
                    path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x_.at(point.x), y_.at(point.y));
            if (!path.empty()) stroke(i, path);
        }
    }

    void symbol(std::size_t i, double x, double y) {
        const std::string colour = colour_of(figure_, i);
        const std::string filled = figure_.series[i].hollow
                                       ? fmt::format("fill=\"#fff\" stroke=\"{}\" stroke-width=\"1.4\"", colour)
                                       : fmt::format("fill=\"{}\"", colour);
        const auto path = [&](const char* d) { put("<path {} d=\"M{:.1f} {:.1f}{}\"/>\n", filled, x, y, d); };
        switch (figure_.series[i].symbol) {
            case Symbol::none: return;
            case Symbol::circle: return put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" {}/>\n", x, y, filled);
            case Symbol::ring:
                return put(
                    "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.7\" fill=\"#fff\" stroke=\"{}\" stroke-width=\"1.6\"/>\n", x,
                    y, colour);
            case Symbol::square: return path("m-3.7-3.7h7.4v7.4h-7.4Z");
            case Symbol::triangle: return path("m0-4.8l4.5 8h-9Z");
            case Symbol::diamond: return path("m0-5l5 5l-5 5l-5-5Z");
            case Symbol::cross:
                return put(
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
                const double x = x_.at(point.x), y = y_.at(point.y);
                const Box box{x - reach, y - reach, x + reach, y + reach};
                if (!point.label.empty()) {
                    requests.push_back({box, text_width(point.label, kLabelFont), kLabelFont + 1});
                    texts.push_back(&point.label);
                } else if (series.symbol != Symbol::none) {
                    taken.push_back(box);
                }
                if (series.stroke == Stroke::none || i == 0 || !drawn(series.points[i - 1])) continue;
                const double from_x = x_.at(series.points[i - 1].x), from_y = y_.at(series.points[i - 1].y);
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
                put("<path stroke=\"#57606a\" stroke-width=\"0.7\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n", leader.from_x,
                    leader.from_y, leader.to_x, leader.to_y);
            // Held at the side of its symbol: a narrower font leaves no gap there. White around it breaks the grid's lines.
            const bool right = box.left >= requests[i].symbol.right, left = box.right <= requests[i].symbol.left;
            put("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" stroke=\"#fff\" stroke-width=\"3\" "
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
            put("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\" font-size=\"{}\">{} labels have no room</text>\n",
                kWidth - kRight, foot_ + 42, kLabelFont, without);
    }

    const Figure& figure_;
    double top_, foot_;
    Scale x_, y_;
    std::string svg_;
};

}  // namespace

std::string figure_svg(const Figure& figure) { return Drawing(figure).text(); }

}  // namespace tactiled::ctl
