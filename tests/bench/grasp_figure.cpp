#include "tests/bench/grasp_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "node/lab/chart/svg.hpp"
#include "node/lab/chart/text.hpp"

namespace tactiled::bench {
namespace {

constexpr double kWidth = 430, kHeight = 300, kLeft = 48, kTop = 44, kFoot = 44,
                 kGap = 30;  // size of a panel, in the viewBox
constexpr double kFont = 11;
constexpr double kMin = 0.3, kMax = 60;                // %, logarithmic
constexpr const char* kDashes[] = {"", "7 4", "2 3"};  // one, two, three jaws

struct Point {
    double ms, within_68, within_95, stable;
};

std::vector<Point> curve(const std::vector<Outcome>& outcomes, std::size_t sensed) {
    std::vector<Point> points;
    for (std::size_t i = 0; i < kMoments; ++i) {
        std::vector<double> errors;
        double stable = 0;
        for (const Outcome& o : outcomes) {
            if (o.sensed != sensed) continue;
            const double error = 100 * std::abs(o.after[i].mass_kg / o.mass_kg - 1);
            errors.push_back(std::isnan(error) ? 100 : error);  // no value counts as an error of 100 %
            stable += o.after[i].state == TACTILED_WEIGHT_STABLE;
        }
        if (errors.empty()) continue;
        std::sort(errors.begin(), errors.end());
        points.push_back({1e3 * kMomentEvery_s * double(i), errors[errors.size() * 68 / 100],
                          errors[errors.size() * 95 / 100], 100 * stable / double(errors.size())});
    }
    return points;
}

// One panel: its place on the paper, time in ms to the right, the error in % upwards.
struct Axes {
    explicit Axes(double left)
        : area{left + kLeft, left + kWidth, kTop, kTop + kHeight},
          x({0, 1e3 * kMomentEvery_s * kMoments}, area.left, area.right),
          y(Scale::logarithmic({std::log10(kMin), std::log10(kMax)}, area.foot, area.top)) {}
    PlotArea area;
    Scale x, y;
};

std::string frame(const Axes& axes, const std::string& title) {
    std::vector<Tick> percent, ms;
    for (const double at : {0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0}) percent.push_back({at, fmt::format("{:g}", at)});
    for (int at = 0; at <= 600; at += 100) ms.push_back({double(at), fmt::format("{}", at)});
    AxisMarks marks;
    marks.add_y(axes.area, axes.y, percent, 6, 4);
    marks.add_x(axes.area, axes.x, ms, 16);
    return fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" font-weight=\"bold\">{}</text>\n", axes.area.left, kTop - 8,
                       html_text(title)) +
           marks.numbers + svg_line(marks.grid, {.colour = "#c8c8c8"}) +
           fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">ms after lift-off</text>\n", axes.x.at(300),
                       axes.area.foot + 34);
}

Pen pen_of(std::size_t sensed, bool outer) {
    return {.colour = outer ? "#6e6e6e" : "#000000", .dashes = kDashes[sensed - 1], .width = outer ? 1.0 : 2.0};
}

std::string lines(const Axes& axes, const std::vector<Outcome>& outcomes) {
    std::string svg;
    for (std::size_t sensed = 1; sensed <= kMaxSensed; ++sensed)
        for (const bool outer : {false, true}) {
            SvgPath path;
            for (const Point& p : curve(outcomes, sensed))
                path.to(axes.x.at(p.ms), axes.y.at(outer ? p.within_95 : p.within_68));
            svg += svg_line(path.d(), pen_of(sensed, outer));
        }
    return svg;
}

std::string legend(double left) {
    std::string svg;
    for (std::size_t sensed = 1; sensed <= kMaxSensed; ++sensed) {
        const double middle = kTop + 12 + 17 * double(sensed - 1);
        svg += legend_line(left, middle, 34, pen_of(sensed, false)) +
               legend_text(left + 40, middle, fmt::format("{} of 3 jaws sensed", sensed), kFont);
    }
    return svg + legend_text(left, kTop + 65, "thick: 68 % of the grasps are within", kFont) +
           legend_text(left, kTop + 80, "thin: 95 %", kFont);
}

}  // namespace

std::string error_csv(const std::vector<Panel>& panels) {
    std::string csv = "panel,sensed_jaws,ms_after_lift_off,within_68_percent,within_95_percent,stable_percent\n";
    for (const Panel& panel : panels)
        for (std::size_t sensed = 1; sensed <= kMaxSensed; ++sensed)
            for (const Point& p : curve(panel.outcomes, sensed))
                csv += fmt::format("{},{},{:g},{:.3f},{:.3f},{:.1f}\n", panel.title, sensed, p.ms, p.within_68, p.within_95,
                                   p.stable);
    return csv;
}

std::string error_svg(const std::vector<Panel>& panels, const std::string& title) {
    const double width = double(panels.size()) * (kWidth + kGap) + 20, height = kTop + kHeight + kFoot;
    Svg svg({.width = width, .height = height, .about = title, .font_size = kFont, .ink = "#111", .paper = true});
    svg.put("<text x=\"{:.0f}\" y=\"16\">{}</text>\n", kLeft, html_text(title));
    for (std::size_t i = 0; i < panels.size(); ++i) {
        const Axes axes(double(i) * (kWidth + kGap));
        svg.put(frame(axes, panels[i].title) + lines(axes, panels[i].outcomes));
    }
    svg.put(legend(kWidth - 195));
    return svg.text();
}

}  // namespace tactiled::bench
