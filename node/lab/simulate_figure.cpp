// The timeline as an SVG. Colours are in the elements, so that it can be shown alone and printed; in a page the
// classes of its style sheet override them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "node/lab/chart/axis.hpp"
#include "node/lab/chart/svg.hpp"
#include "node/lab/chart/text.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

// In units of the viewBox.
constexpr double kWidth = 900, kLeft = 215, kRight = 95, kTitle = 22, kMotion = 54, kLane = 30, kRow = 14, kAxis = 40;
constexpr double kLetter = 5.6;  // approximate width of a small letter

class Drawing {
public:
    explicit Drawing(const Timeline& t)
        : t_(t),
          rows_(kTitle + kMotion + kLane * double(t.lanes.size()) + 6),
          foot_(rows_ + kRow * double(t.rows.size()) + 4),
          time_({0, t.length_s}, kLeft, kWidth - kRight),
          svg_({.width = kWidth,
                .height = foot_ + kAxis,
                .about = "what the effects did over the time of the scene",
                .css_class = "wide",
                .font_size = 11}) {
        const auto on = std::count_if(t.rows.begin(), t.rows.end(), [](const auto& row) { return row.decision->on; });
        bars_foot_ = rows_ + kRow * double(on);
    }

    std::string text(const std::string& title) {
        svg_.put("<text x=\"{}\" y=\"14\">{}</text>\n", kLeft, html_text(title));
        axis();
        motions();
        for (std::size_t i = 0; i < t_.lanes.size(); ++i) lane(t_.lanes[i], kTitle + kMotion + kLane * double(i));
        for (std::size_t i = 0; i < t_.rows.size(); ++i) row(t_.rows[i], rows_ + kRow * double(i));
        return svg_.text();
    }

private:
    [[nodiscard]] double x(double t_s) const { return time_.at(t_s); }

    void axis() {
        AxisMarks marks;
        marks.add_x({kLeft, kWidth - kRight, kTitle + kMotion, foot_}, time_, axis_ticks({0, t_.length_s}), 14);
        svg_.put(marks.numbers + svg_line(marks.grid, {.css_class = "grid", .colour = "#d0d7de"}));
        svg_.put("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">time, s</text>\n", x(t_.length_s / 2), foot_ + 30);
        svg_.put("<text x=\"{:.0f}\" y=\"{:.0f}\">largest</text><text x=\"{:.0f}\" y=\"{:.0f}\">change, N</text>\n",
                 kWidth - kRight + 8, rows_ - 20, kWidth - kRight + 8, rows_ - 7);
    }

    // Draws the begin of each motion as a line through all bars, with its name if there is room, upright if that is
    // enough.
    void motions() {
        std::string borders;
        const double y = kTitle + kMotion;
        for (const auto& m : t_.motions) {
            const double left = x(m.begin_s), width = x(m.end_s) - left, middle = left + width / 2;
            if (width > 3) borders += fmt::format("M{:.1f} {:.0f}V{:.0f}", left, kTitle + 4, bars_foot_);
            if (width > kLetter * double(m.kind.size()) + 2)
                svg_.put("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>\n", middle, y - 6,
                         html_text(m.kind));
            else if (width > 11)
                svg_.put("<text transform=\"translate({:.1f} {:.0f}) rotate(-90)\">{}</text>\n", middle + 4, y - 4,
                         html_text(m.kind));
        }
        svg_.put(svg_line(borders, {.css_class = "frame", .colour = "#8c959f", .dashes = "2 2"}));
    }

    void lane(const Timeline::Lane& lane, double top) {
        const auto [min, max] = std::minmax_element(lane.value.begin(), lane.value.end());
        const double foot = top + kLane - 4;
        const Scale scale({std::min(0.0, *min), std::max(0.0, *max)}, foot, top + 4);
        // Equal values are reduced to the first and the last point.
        std::vector<std::string> y;
        for (const double value : lane.value) y.push_back(fmt::format("{:.1f}", scale.at(value)));
        SvgPath path;
        for (std::size_t i = 0; i < y.size(); ++i)
            if (i == 0 || i + 1 == y.size() || y[i] != y[i - 1] || y[i] != y[i + 1])
                path.to(x(t_.length_s * double(i) / double(y.size() - 1)), scale.at(lane.value[i]));
        svg_.put(svg_line(path.d(), {.css_class = "curve", .colour = "#b3261e", .width = 1.3}));
        svg_.put("<text x=\"{}\" y=\"{:.0f}\" text-anchor=\"end\">{}, {:.3g} .. {:.3g} {}</text>\n", kLeft - 8,
                 top + kLane / 2 + 3, html_text(lane.name), *min, *max, lane.unit);
    }

    void row(const Timeline::Row& row, double top) {
        const bool ever = row.decision->on;
        const char* faint = ever ? "" : " opacity=\"0.6\"";
        svg_.put("<text x=\"{}\" y=\"{:.0f}\" text-anchor=\"end\"{}>{}</text>\n", kLeft - 8, top + 11, faint,
                 html_text(name_of(*row.decision)));
        if (!ever)
            svg_.put("<text x=\"{}\" y=\"{:.0f}\" opacity=\"0.6\">{}</text>\n", kLeft + 6, top + 11,
                     html_text(row.decision->why));
        for (const auto& [begin_s, end_s] : row.active_s)
            svg_.put(svg_line(fmt::format("M{:.1f} {:.1f}H{:.1f}", x(begin_s), top + kRow / 2, x(end_s)),
                              {.css_class = "frame", .colour = "#8c959f"}));
        for (const auto& [begin_s, end_s] : row.changed_s)
            svg_.put("<path class=\"bar\" fill=\"#1f5fa8\" d=\"M{:.1f} {:.1f}H{:.1f}v{}H{:.1f}Z\"/>\n", x(begin_s), top + 2,
                     std::max(x(end_s), x(begin_s) + 0.5), kRow - 4, x(begin_s));
        if (ever && row.decision->effect->stage != sim::Stage::time)
            svg_.put("<text x=\"{}\" y=\"{:.0f}\">{:.2g}</text>\n", kWidth - kRight + 8, top + 11, row.largest_N);
    }

    const Timeline& t_;
    double rows_, foot_, bars_foot_;
    Scale time_;
    Svg svg_;
};

}  // namespace

std::string timeline_svg(const sim::Scene& scene, const std::string& effects, std::size_t number) {
    const Timeline t = timeline(scene, effects, number);
    const sim::Sensor& sensor = scene.sensors[number];
    return Drawing(t).text(fmt::format("{}: sensor {} ({}), {:.3g} N wanted", scene.title, sensor.name,
                                       name_of(sensor.model), scene.wanted_N(sensor)));
}

}  // namespace tactiled::ctl
