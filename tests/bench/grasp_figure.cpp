#include "tests/bench/grasp_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "node/lab/chart/figure.hpp"

namespace tactiled::bench {
namespace {

constexpr Stroke kStrokes[] = {Stroke::solid, Stroke::dashed, Stroke::dotted};  // one, two, three jaws

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

// Thick lines: 68 % of the grasps are within; thin ones: 95 %.
Figure figure_of(const Panel& panel) {
    Figure figure{.title = panel.title,
                  .x = {.label = "ms after lift-off", .range = Span{0, 1e3 * kMomentEvery_s * kMoments}},
                  .y = {.label = "error of the weight, %", .logarithmic = true, .range = Span{0.2, 60}},
                  .width = 430,
                  .height = 300};
    for (const bool outer : {false, true})
        for (std::size_t sensed = 1; sensed <= kMaxSensed; ++sensed) {
            Figure::Series line{fmt::format("{} of 3 jaws, {} %", sensed, outer ? 95 : 68),
                                Symbol::none,
                                kStrokes[sensed - 1],
                                {},
                                outer ? kGrey : kInk};
            line.width = outer ? 1 : 2;
            for (const Point& p : curve(panel.outcomes, sensed))
                line.points.push_back({p.ms, outer ? p.within_95 : p.within_68});
            figure.series.push_back(std::move(line));
        }
    return figure;
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
    std::vector<Figure> figures;
    for (const Panel& panel : panels) figures.push_back(figure_of(panel));
    return figures_svg(figures, title, Place::file);
}

}  // namespace tactiled::bench
