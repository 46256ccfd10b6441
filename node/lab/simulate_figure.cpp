// The timeline as a figure: a row for the motions, one for each curve of the body, and one for each effect.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "node/lab/chart/figure.hpp"
#include "node/lab/chart/text.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kRow = 14;  // height of an effect's row, in units of the viewBox
constexpr double kLane = 2;  // height of a curve, in rows
constexpr double kPlot = 590, kFont = 12;
constexpr double kGap = std::numeric_limits<double>::quiet_NaN();  // ends a line

// Rows are numbered downwards from 0, so that the y axis has -row.
struct Rows {
    Figure figure;
    double next = 0;

    // Names the next row, of that height, and returns the y of its middle.
    double add(const std::string& name, double height) {
        const double middle = -next - height / 2;
        figure.y.ticks.push_back({middle, name});
        next += height;
        return middle;
    }
};

Figure::Series curve(const Timeline& t, const Timeline::Lane& lane, double middle) {
    const auto [min, max] = std::minmax_element(lane.value.begin(), lane.value.end());
    const double low = std::min(0.0, *min), high = std::max(0.0, *max);
    Figure::Series series{"", Symbol::none, Stroke::solid, {}, kOrange};
    for (std::size_t i = 0; i < lane.value.size(); ++i)
        series.points.push_back({t.length_s * double(i) / double(lane.value.size() - 1),
                                 middle + 0.8 * kLane * ((lane.value[i] - low) / (high - low) - 0.5)});
    return series;
}

// Notes the name of each motion above its part of the time if there is room, upright if that is enough.
void note_motions(const Timeline& t, Figure& figure, Figure::Series& borders, double foot) {
    for (const auto& m : t.motions) {
        const double width = (m.end_s - m.begin_s) / t.length_s * kPlot, middle_s = (m.begin_s + m.end_s) / 2;
        if (width > 3) borders.points.insert(borders.points.end(), {{m.begin_s, 0}, {m.begin_s, foot}, {kGap, kGap}});
        if (width > text_width(m.kind, kFont) + 2)
            figure.notes.push_back({.x = middle_s, .y = 0, .text = m.kind, .up = 6, .centred = true});
        else if (width > 11)
            figure.notes.push_back({.x = middle_s, .y = 0, .text = m.kind, .right = 4, .up = 4, .upright = true});
    }
}

}  // namespace

Figure timeline_figure(const sim::Scene& scene, const std::string& effects, std::size_t number) {
    const Timeline t = timeline(scene, effects, number);
    const sim::Sensor& sensor = scene.sensors[number];
    Figure::Series borders{"", Symbol::none, Stroke::dotted, {}, kGrey, false, Shape::line, 1};
    Figure::Series active{"active", Symbol::none, Stroke::solid, {}, kGrey, false, Shape::line, 1};
    Figure::Series changed{.name = "changed a channel", .colour = kBlue, .shape = Shape::bars};
    Rows rows;
    Figure& figure = rows.figure;
    for (const auto& lane : t.lanes) {
        const auto [min, max] = std::minmax_element(lane.value.begin(), lane.value.end());
        const double middle = rows.add(fmt::format("{}, {:.3g} .. {:.3g} {}", lane.name, *min, *max, lane.unit), kLane);
        figure.series.push_back(curve(t, lane, middle));
    }
    rows.next += 0.5;
    const double first = rows.next;
    double last = first;  // foot of the rows of effects that are on
    for (const auto& row : t.rows) {
        const double y = rows.add(name_of(*row.decision), 1);
        for (const auto& [begin_s, end_s] : row.active_s)
            active.points.insert(active.points.end(), {{begin_s, y}, {end_s, y}, {kGap, kGap}});
        for (const auto& [begin_s, end_s] : row.changed_s)
            changed.points.insert(changed.points.end(),
                                  {{begin_s, y - 0.35}, {std::max(end_s, begin_s + t.length_s / 1200), y + 0.35}});
        if (row.decision->on) last = rows.next;
        if (!row.decision->on)
            figure.notes.push_back(
                {.x = 0, .y = y, .text = std::string(row.decision->why), .right = 6, .up = -4, .colour = kGrey});
        else if (row.decision->effect->stage != sim::Stage::time)
            figure.notes.push_back(
                {.x = t.length_s, .y = y, .text = fmt::format("{:.2g}", row.largest_N), .right = 8, .up = -4});
    }
    for (const auto& [text, up] : {std::pair{"largest", 16}, std::pair{"change, N", 3}})
        figure.notes.push_back({.x = t.length_s, .y = -first, .text = text, .right = 8, .up = double(up)});
    note_motions(t, figure, borders, -last);
    for (auto& series : {borders, active, changed}) figure.series.push_back(series);
    figure.title = fmt::format("{}: sensor {} ({}), {:.3g} N wanted", scene.title, sensor.name, name_of(sensor.model),
                               scene.wanted_N(sensor));
    figure.x = {.label = "time, s", .range = Span{0, t.length_s}};
    figure.y.range = Span{-rows.next, 0};
    figure.y.grid = false;
    figure.width = kPlot;
    figure.height = kRow * rows.next;
    figure.margin_right = 75;
    figure.margin_top = 50;
    return figure;
}

}  // namespace tactiled::ctl
