#include "node/lab/chart/figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "node/lab/chart/labels.hpp"
#include "node/lab/chart/text.hpp"

namespace tactiled {
namespace {

// In units of the viewBox.
constexpr double kTitle = 30, kLegend = 22, kFont = 12, kReach = 4.5;  // reach of a symbol's edge from its middle
constexpr double kBetween = 8;                                         // numbers of the x axis
constexpr int kColours = 6;
constexpr const char kStart[] = "text-anchor=\"start\"", kMiddle[] = "text-anchor=\"middle\"",
                     kEnd[] = "text-anchor=\"end\"";

struct SymbolShape {
    const char* d;  // from its middle
    const char* paint;
};
constexpr const char kFilled[] = "fill=\"currentColor\"",
                     kOutlined[] = "class=\"hollow\" stroke=\"currentColor\" stroke-width=\"1.5\"";
constexpr const char kCircle[] = "m-4 0a4 4 0 1 0 8 0a4 4 0 1 0-8 0Z";
constexpr SymbolShape kSymbols[] = {
    {"", ""},
    {"h0", "stroke=\"currentColor\" stroke-width=\"2.4\" stroke-linecap=\"round\" stroke-opacity=\"0.7\""},
    {kCircle, kFilled},
    {kCircle, kOutlined},
    {"m-3.7-3.7h7.4v7.4h-7.4Z", kFilled},
    {"m0-4.8l4.5 8h-9Z", kFilled},
    {"m0-5l5 5l-5 5l-5-5Z", kFilled},
    {"m-4-4l8 8m0-8l-8 8", "stroke=\"currentColor\" stroke-width=\"1.8\""}};

struct Axis {
    Scale scale;
    std::vector<Tick> ticks;
};

Axis axis_of(const Figure& figure, Figure::Axis Figure::*of, double Figure::Point::*coordinate, double from, double to) {
    const Figure::Axis& axis = figure.*of;
    std::vector<double> values;
    for (const auto& series : figure.series)
        for (const auto& point : series.points) values.push_back(point.*coordinate);
    if (axis.range) values = {axis.range->min, axis.range->max};
    const double margin = axis.range ? 0 : 0.06;
    if (!axis.logarithmic) {
        const Span span = as_axis(span_of(values), margin);
        return {{span, from, to}, axis.ticks.empty() ? axis_ticks(span) : axis.ticks};
    }
    const bool zeros = std::any_of(values.begin(), values.end(), [](double v) { return v <= 0; });
    std::erase_if(values, [](double v) { return !std::isfinite(v) || v <= 0; });
    for (double& value : values) value = std::log10(value);
    Span span = values.empty() ? Span{0, 1} : as_axis(span_of(values), margin);
    if (zeros) span.min -= std::max(0.4, 0.12 * (span.max - span.min));
    Axis drawn{{span, from, to, true}, log_ticks({std::pow(10, span.min), std::pow(10, span.max)})};
    if (zeros) {
        std::erase_if(drawn.ticks, [&](const Tick& tick) { return std::abs(drawn.scale.at(tick.at) - from) < 24; });
        drawn.ticks.insert(drawn.ticks.begin(), {0, "0"});
    }
    return drawn;
}

bool finite(const Figure::Point& point) { return std::isfinite(point.x) && std::isfinite(point.y); }

// One figure, in the order of its parts on the paper.
class Drawing {
public:
    explicit Drawing(const Figure& figure) : f_(figure) {
        const double rows = double(legend(0));
        top_ = (f_.title.empty() ? 8 : kTitle) + kLegend * rows + f_.margin_top;
        foot_ = top_ + f_.height;
        y_ = axis_of(f_, &Figure::y, &Figure::Point::y, foot_, top_);
        for (const Tick& tick : y_.ticks)
            left_ = std::max(left_, (f_.y.label.empty() ? 15 : 37) + text_width(tick.text, kFont));
        right_ = left_ + f_.width;
        x_ = axis_of(f_, &Figure::x, &Figure::Point::x, left_, right_);
        text(left_, 19, "font-size=\"15\" font-weight=\"bold\"", f_.title);
        legend(left_);
        axes();
        for (std::size_t i = 0; i < f_.series.size(); ++i) series(i);
        labels();
        notes();
    }
    [[nodiscard]] double width() const { return right_ + f_.margin_right; }
    [[nodiscard]] double height() const { return foot_ + (f_.x.label.empty() ? 26 : 48); }
    [[nodiscard]] const std::string& elements() const { return text_; }

private:
    template <class... T>
    void put(fmt::format_string<T...> format, T&&... values) {
        fmt::format_to(std::back_inserter(text_), format, std::forward<T>(values)...);
    }
    void text(double x, double y, const std::string& attributes, const std::string& plain, bool upright = false) {
        if (!plain.empty())
            put("<text transform=\"translate({:.1f} {:.1f}){}\" {}>{}</text>\n", x, y, upright ? " rotate(-90)" : "",
                attributes, html_text(plain));
    }
    [[nodiscard]] std::string at(const Figure::Point& point) const {
        return fmt::format("{:.1f} {:.1f}", x_.scale.at(point.x), y_.scale.at(point.y));
    }
    [[nodiscard]] int colour(std::size_t i) const {
        return (f_.series[i].colour == kByIndex ? int(i) : f_.series[i].colour) % kColours;
    }

    // Draws the legend from `left` on, unless that is 0. Returns its number of rows.
    int legend(double left) {
        double x = 0;
        int row = 0;
        for (std::size_t i = 0; i < f_.series.size(); ++i) {
            const Figure::Series& s = f_.series[i];
            if (s.name.empty()) continue;
            const double width = 34 + text_width(s.name, kFont) + 14;
            if (x > 0 && x + width > f_.width) x = 0, ++row;
            const double middle = (f_.title.empty() ? 0 : kTitle) + kLegend * row + 10, from = left + x;
            x += width;
            if (left == 0) continue;
            put("<g class=\"c{}\">\n", colour(i));
            if (s.shape == Shape::line) {
                line(s, fmt::format("M{:.1f} {:.1f}h26", from, middle));
                symbols(s, fmt::format("M{:.1f} {:.1f}{}", from + 13, middle, kSymbols[int(s.symbol)].d));
            } else {
                area(s, fmt::format("M{0:.1f} {1:.1f}H{2:.1f}V{3:.1f}H{0:.1f}Z", from, middle - 5, from + 26, middle + 4));
            }
            text_ += "</g>\n";
            text(from + 33, middle + 4, kStart, s.name);
        }
        return x > 0 ? row + 1 : 0;
    }

    void axes() {
        std::string grid;
        double end = 0;  // end of the last number on the x axis
        for (const Tick& tick : x_.ticks) {
            const double x = x_.scale.at(tick.at), reach = text_width(tick.text, kFont) / 2;
            if (f_.x.grid) grid += fmt::format("M{:.1f} {:.1f}V{:.1f}", x, top_, foot_);
            if (x - reach < end) continue;
            end = x + reach + kBetween;
            text(x, foot_ + 18, kMiddle, tick.text);
        }
        for (const Tick& tick : y_.ticks) {
            const double y = y_.scale.at(tick.at);
            if (f_.y.grid) grid += fmt::format("M{:.1f} {:.1f}H{:.1f}", left_, y, right_);
            text(left_ - 7, y + 4, kEnd, tick.text);
        }
        put("<path class=\"grid\" d=\"{}\"/>\n<path class=\"frame\" d=\"M{:.1f} {:.1f}H{:.1f}V{:.1f}H{:.1f}Z\"/>\n", grid,
            left_, top_, right_, foot_, left_);
        text((left_ + right_) / 2, foot_ + 40, kMiddle, f_.x.label);
        text(18, (top_ + foot_) / 2, kMiddle, f_.y.label, true);
    }

    void line(const Figure::Series& s, const std::string& d) {
        if (s.stroke == Stroke::none || d.empty()) return;
        static constexpr const char* kDashes[] = {"", "", " stroke-dasharray=\"6 4\"", " stroke-dasharray=\"2 3\""};
        put("<path fill=\"none\" stroke=\"currentColor\" stroke-width=\"{:g}\"{} d=\"{}\"/>\n", s.width,
            kDashes[int(s.stroke)], d);
    }
    void area(const Figure::Series& s, const std::string& d) {
        put("<path fill=\"currentColor\" fill-opacity=\"{}\" d=\"{}\"/>\n", s.shape == Shape::bars ? 0.8 : 0.22, d);
    }
    void symbols(const Figure::Series& s, const std::string& d) {
        if (s.symbol == Symbol::none || d.empty()) return;
        put("<path {} d=\"{}\"/>\n", s.hollow ? kOutlined : kSymbols[int(s.symbol)].paint, d);
    }

    void series(std::size_t i) {
        const Figure::Series& s = f_.series[i];
        std::string joined, each;
        bool begins = true;
        if (s.shape == Shape::bars) {
            for (std::size_t k = 0; k + 1 < s.points.size(); k += 2)
                if (finite(s.points[k]) && finite(s.points[k + 1]))
                    joined += fmt::format("M{}V{:.1f}H{:.1f}V{:.1f}Z", at(s.points[k]), y_.scale.at(s.points[k + 1].y),
                                          x_.scale.at(s.points[k + 1].x), y_.scale.at(s.points[k].y));
        } else {
            for (const Figure::Point& point : s.points) {
                begins = begins || !finite(point);
                if (!finite(point)) continue;
                joined += (begins ? "M" : "L") + at(point);
                each += "M" + at(point) + kSymbols[int(s.symbol)].d;
                begins = false;
            }
        }
        put("<g class=\"c{}\">\n", colour(i));
        if (s.shape == Shape::line) {
            line(s, joined);
            symbols(s, each);
        } else if (!joined.empty()) {
            area(s, joined + "Z");
        }
        text_ += "</g>\n";
    }

    void labels() {
        std::vector<LabelRequest> requests;
        std::vector<std::string> texts;
        std::vector<Box> crossed;
        for (const Figure::Series& s : f_.series) {
            if (s.shape != Shape::line || s.symbol == Symbol::dot) continue;
            const double reach = s.symbol == Symbol::none ? 0.5 : kReach;
            const Figure::Point* before = nullptr;
            for (const Figure::Point& point : s.points) {
                const Figure::Point* const from = std::exchange(before, finite(point) ? &point : nullptr);
                if (before == nullptr) continue;
                const double x = x_.scale.at(point.x), y = y_.scale.at(point.y);
                if (s.symbol != Symbol::none || !point.label.empty()) {
                    const double width = point.label.empty() ? 0 : text_width(point.label, kFont) + 3;
                    requests.push_back({{x - reach, y - reach, x + reach, y + reach}, width, kFont + 1});
                    texts.push_back(point.label);
                }
                if (s.stroke != Stroke::none && from != nullptr)
                    cover({x_.scale.at(from->x), y_.scale.at(from->y), x, y}, crossed);
            }
        }
        const auto places = place_labels(requests, crossed, {left_ + 2, top_ + 2, right_ - 2, foot_ - 2});
        for (const auto& place : places)  // below the texts
            if (const auto& line = place ? place->leader : std::nullopt)
                put("<path class=\"frame\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n", line->from_x, line->from_y, line->to_x,
                    line->to_y);
        int without = 0;
        for (std::size_t i = 0; i < places.size(); ++i) {
            if (!places[i] && !texts[i].empty()) ++without;
            if (!places[i]) continue;
            // Anchored at the side of its symbol, so that a narrower font leaves no gap there.
            const Box& box = places[i]->box;
            const bool left = box.right <= requests[i].symbol.left;
            text(left ? box.right : box.left, box.bottom - 3, fmt::format("class=\"halo\" {}", left ? kEnd : kStart),
                 texts[i]);
        }
        if (without > 0) text(right_, foot_ + 40, kEnd, fmt::format("{} labels have no room", without));
    }

    void notes() {
        for (const Figure::Note& note : f_.notes)
            text(x_.scale.at(note.x) + note.right, y_.scale.at(note.y) - note.up,
                 fmt::format("class=\"c{}\" {}", note.colour, note.centred ? kMiddle : kStart), note.text, note.upright);
    }

    const Figure& f_;
    double left_ = 0, right_ = 0, top_ = 0, foot_ = 0;
    Axis x_{}, y_{};
    std::string text_;
};

}  // namespace

const char* const kFigureStyle = R"(
.figure { color: #1b1f24; font: 12px sans-serif; } .figure text { fill: currentColor; }
.figure .paper, .figure .hollow { fill: #ffffff; } .figure .halo { stroke: #ffffff; stroke-width: 3; paint-order: stroke; }
.figure .grid { fill: none; stroke: #d8dde3; } .figure .frame { fill: none; stroke: #57606a; stroke-width: 0.7; }
.c0 { color: #1f5fa8; } .c1 { color: #c4561e; } .c2 { color: #1b1f24; } .c3 { color: #6a994e; } .c4 { color: #8d5a97; }
.c5 { color: #7f8790; }
@media screen and (prefers-color-scheme: dark) { .figure, .c2 { color: #e6e8eb; }
.figure .paper, .figure .hollow { fill: #14171b; } .figure .halo { stroke: #14171b; } .figure .grid { stroke: #2b3239; }
.figure .frame { stroke: #a3abb5; } .c0 { color: #7db4f5; } .c1 { color: #ef9a62; } .c3 { color: #a3cf86; }
.c4 { color: #cf9fd9; } .c5 { color: #a3abb5; } }
)";

std::string figures_svg(std::span<const Figure> figures, const std::string& about, Place place) {
    std::string body;
    double width = 0, height = 0;
    const double top = figures.size() > 1 ? kTitle : 0;  // height of their common title
    if (top > 0) body = fmt::format("<text x=\"8\" y=\"19\" font-size=\"15\">{}</text>\n", html_text(about));
    for (const Figure& figure : figures) {
        const Drawing drawing(figure);
        body += fmt::format("<g transform=\"translate({:.0f} {:.0f})\">\n{}</g>\n", width, top, drawing.elements());
        width += drawing.width();
        height = std::max(height, top + drawing.height());
    }
    std::string attributes, background;
    if (place == Place::file) {
        attributes = " xmlns=\"http://www.w3.org/2000/svg\"";
        background = fmt::format("<style>{}</style>\n<path class=\"paper\" d=\"M0 0H{:.0f}V{:.0f}H0Z\"/>\n", kFigureStyle,
                                 width, height);
    }
    return fmt::format(
        "<svg{} class=\"figure\" viewBox=\"0 0 {:.0f} {:.0f}\" width=\"{:.0f}\" height=\"{:.0f}\" "
        "role=\"img\" aria-label=\"{}\">\n{}{}</svg>\n",
        attributes, width, height, width, height, html_text(about), background, body);
}

std::string figure_svg(const Figure& figure, Place place) { return figures_svg({&figure, 1}, figure.title, place); }

}  // namespace tactiled
