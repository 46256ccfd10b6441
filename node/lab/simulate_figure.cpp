// The timeline as an SVG. Colours stand in the elements, so that it can be shown alone and printed; in a page the classes
// of its style sheet win.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "node/lab/chart/plot.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

// In units of the viewBox.
constexpr double kWidth = 900, kLeft = 215, kRight = 95, kTitle = 22, kMotion = 54, kLane = 30, kRow = 14, kAxis = 40;
constexpr double kLetter = 5.6;  // of a small label, about

class Drawing {
public:
    explicit Drawing(const Timeline& t) : t_(t) {
        rows_ = kTitle + kMotion + kLane * double(t.lanes.size()) + 6;
        foot_ = rows_ + kRow * double(t.rows.size()) + 4;
        const auto on = std::count_if(t.rows.begin(), t.rows.end(), [](const auto& row) { return !row.on_s.empty(); });
        bars_foot_ = rows_ + kRow * double(on);
    }

    std::string text(const std::string& title) {
        svg_ = fmt::format(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"wide\" viewBox=\"0 0 {} {:.0f}\" role=\"img\" "
            "aria-label=\"{}\" font-family=\"sans-serif\" font-size=\"11\" fill=\"#1b1f24\">\n",
            kWidth, foot_ + kAxis, html_text("effects that the scene calls for, over its time"));
        put("<text x=\"{}\" y=\"14\">{}</text>\n", kLeft, html_text(title));
        axis();
        motions();
        for (std::size_t i = 0; i < t_.lanes.size(); ++i) lane(t_.lanes[i], kTitle + kMotion + kLane * double(i));
        for (std::size_t i = 0; i < t_.rows.size(); ++i) row(t_.rows[i], rows_ + kRow * double(i));
        return svg_ + "</svg>\n";
    }

private:
    template <class... T>
    void put(fmt::format_string<T...> format, T&&... values) {
        fmt::format_to(std::back_inserter(svg_), format, std::forward<T>(values)...);
    }
    [[nodiscard]] double x(double t_s) const {
        return kLeft + (kWidth - kLeft - kRight) * std::clamp(t_s / t_.length_s, 0.0, 1.0);
    }

    void axis() {
        std::string grid;
        for (const auto& [at, text] : axis_ticks({0, t_.length_s})) {
            grid += fmt::format("M{:.1f} {:.0f}V{:.0f}", x(at), kTitle + kMotion, foot_);
            put("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>\n", x(at), foot_ + 14, text);
        }
        put("<path class=\"grid\" fill=\"none\" stroke=\"#d0d7de\" d=\"{}\"/>\n", grid);
        put("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">time, s</text>\n", x(t_.length_s / 2), foot_ + 30);
        put("<text x=\"{:.0f}\" y=\"{:.0f}\">bound at</text><text x=\"{:.0f}\" y=\"{:.0f}\">the end, N</text>\n",
            kWidth - kRight + 8, rows_ - 20, kWidth - kRight + 8, rows_ - 7);
    }

    // Where a motion begins, down through all bars; its name where there is room, upright where that is enough.
    void motions() {
        std::string borders;
        const double y = kTitle + kMotion;
        for (const auto& m : t_.motions) {
            const double left = x(m.begin_s), width = x(m.end_s) - left, middle = left + width / 2;
            if (width > 3) borders += fmt::format("M{:.1f} {:.0f}V{:.0f}", left, kTitle + 4, bars_foot_);
            if (width > kLetter * double(m.kind.size()) + 2)
                put("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>\n", middle, y - 6, html_text(m.kind));
            else if (width > 11)
                put("<text transform=\"translate({:.1f} {:.0f}) rotate(-90)\">{}</text>\n", middle + 4, y - 4,
                    html_text(m.kind));
        }
        put("<path class=\"frame\" fill=\"none\" stroke=\"#8c959f\" stroke-dasharray=\"2 2\" d=\"{}\"/>\n", borders);
    }

    void lane(const Timeline::Lane& lane, double top) {
        const auto [min, max] = std::minmax_element(lane.value.begin(), lane.value.end());
        const double low = std::min(0.0, *min), high = std::max(0.0, *max), foot = top + kLane - 4;
        std::string path, last;
        for (std::size_t i = 0; i < lane.value.size(); ++i) {
            const std::string y = fmt::format("{:.1f}", foot - (kLane - 8) * (lane.value[i] - low) / (high - low));
            const std::string next =
                i + 1 < lane.value.size()
                    ? fmt::format("{:.1f}", foot - (kLane - 8) * (lane.value[i + 1] - low) / (high - low))
                    : "";
            if (y != last || y != next)
                path += fmt::format("{}{:.1f} {}", path.empty() ? "M" : "L",
                                    x(t_.length_s * double(i) / double(lane.value.size() - 1)), y);
            last = y;
        }
        put("<path class=\"curve\" fill=\"none\" stroke=\"#b3261e\" stroke-width=\"1.3\" d=\"{}\"/>\n", path);
        put("<text x=\"{}\" y=\"{:.0f}\" text-anchor=\"end\">{}, {:.3g} .. {:.3g} {}</text>\n", kLeft - 8,
            top + kLane / 2 + 3, html_text(lane.name), *min, *max, lane.unit);
    }

    void row(const Timeline::Row& row, double top) {
        const bool ever = !row.on_s.empty();
        const char* faint = ever ? "" : " opacity=\"0.6\"";
        put("<text x=\"{}\" y=\"{:.0f}\" text-anchor=\"end\"{}>{}</text>\n", kLeft - 8, top + 11, faint,
            html_text(row.effect->name));
        if (!ever) put("<text x=\"{}\" y=\"{:.0f}\" opacity=\"0.6\">{}</text>\n", kLeft + 6, top + 11, html_text(row.why));
        for (const auto& [begin_s, end_s] : row.on_s)
            put("<path class=\"bar\" fill=\"#1f5fa8\" d=\"M{:.1f} {:.1f}H{:.1f}v{}H{:.1f}Z\"/>\n", x(begin_s), top + 2,
                std::max(x(end_s), x(begin_s) + 0.5), kRow - 4, x(begin_s));
        put("<text x=\"{}\" y=\"{:.0f}\"{}>{:.2g}</text>\n", kWidth - kRight + 8, top + 11, faint, row.bound_N);
    }

    const Timeline& t_;
    double rows_, bars_foot_, foot_;
    std::string svg_;
};

}  // namespace

std::string timeline_svg(const sim::Scene& scene, const sim::Sensor& sensor) {
    const Timeline t = timeline(scene, sensor);
    return Drawing(t).text(fmt::format("{}: sensor {} ({}), {:.3g} N wanted", scene.title, sensor.name,
                                       name_of(sensor.model), scene.wanted_N(sensor)));
}

}  // namespace tactiled::ctl
