#include "tests/bench/grasp_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tactiled::bench {
namespace {

constexpr double kWidth = 430, kHeight = 300, kLeft = 48, kTop = 44, kFoot = 44, kGap = 30;  // of a panel, in the viewBox
constexpr double kMin = 0.3, kMax = 60;                                                      // %, logarithmic
constexpr const char* kDashes[] = {"", "7 4", "2 3"};                                        // one, two, three jaws

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
            errors.push_back(std::isnan(error) ? 100 : error);  // no value is no better than none of it
            stable += o.after[i].state == TACTILED_WEIGHT_STABLE;
        }
        if (errors.empty()) continue;
        std::sort(errors.begin(), errors.end());
        points.push_back({1e3 * kMomentEvery_s * double(i), errors[errors.size() * 68 / 100],
                          errors[errors.size() * 95 / 100], 100 * stable / double(errors.size())});
    }
    return points;
}

struct Frame {
    double left;
    [[nodiscard]] double x(double ms) const {
        return left + kLeft + (kWidth - kLeft) * ms / (1e3 * kMomentEvery_s * kMoments);
    }
    [[nodiscard]] static double y(double percent) {
        const double u = std::log(std::clamp(percent, kMin, kMax) / kMin) / std::log(kMax / kMin);
        return kTop + kHeight * (1 - u);
    }
};

std::string axes(const Frame& f, const std::string& title) {
    std::string svg =
        fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" font-weight=\"bold\">{}</text>\n", f.x(0), kTop - 8, title);
    std::string grid;
    for (const double percent : {0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0}) {
        grid += fmt::format("M{:.1f} {:.1f}H{:.1f}", f.x(0), Frame::y(percent), f.x(1e3 * kMomentEvery_s * kMoments));
        svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{:g}</text>\n", f.x(0) - 6,
                           Frame::y(percent) + 4, percent);
    }
    for (int ms = 0; ms <= 600; ms += 100) {
        grid += fmt::format("M{:.1f} {:.0f}v{:.0f}", f.x(ms), kTop, kHeight);
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>\n", f.x(ms),
                           kTop + kHeight + 16, ms);
    }
    svg += fmt::format("<path fill=\"none\" stroke=\"#c8c8c8\" d=\"{}\"/>\n", grid);
    svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">ms after lift-off</text>\n", f.x(300),
                       kTop + kHeight + 34);
    return svg;
}

std::string lines(const Frame& f, const std::vector<Outcome>& outcomes) {
    std::string svg;
    for (std::size_t sensed = 1; sensed <= kMaxSensed; ++sensed)
        for (const bool max : {false, true}) {
            std::string path;
            for (const Point& p : curve(outcomes, sensed))
                path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", f.x(p.ms),
                                    Frame::y(max ? p.within_95 : p.within_68));
            svg += fmt::format("<path fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-dasharray=\"{}\" d=\"{}\"/>\n",
                               max ? "#6e6e6e" : "#000000", max ? "1" : "2", kDashes[sensed - 1], path);
        }
    return svg;
}

std::string legend(double left) {
    std::string svg;
    for (std::size_t sensed = 1; sensed <= kMaxSensed; ++sensed) {
        const double y = kTop + 16 + 17 * double(sensed - 1);
        svg += fmt::format(
            "<path fill=\"none\" stroke=\"#000\" stroke-width=\"2\" stroke-dasharray=\"{}\" d=\"M{:.0f} {:.0f}h34\"/>"
            "<text x=\"{:.0f}\" y=\"{:.0f}\">{} of 3 jaws sensed</text>\n",
            kDashes[sensed - 1], left, y - 4, left + 40, y, sensed);
    }
    return svg + fmt::format(
                     "<text x=\"{0:.0f}\" y=\"{1:.0f}\">thick: 68 % of the grasps are within</text>"
                     "<text x=\"{0:.0f}\" y=\"{2:.0f}\">thin: 95 %</text>\n",
                     left, kTop + 69, kTop + 84);
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
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" role=\"img\" aria-label=\"{2}\" "
        "font-family=\"sans-serif\" font-size=\"11\" fill=\"#111\">\n<rect width=\"{0:.0f}\" height=\"{1:.0f}\" "
        "fill=\"#fff\"/>\n"
        "<text x=\"{3:.0f}\" y=\"16\">{2}</text>\n",
        width, height, title, kLeft);
    for (std::size_t i = 0; i < panels.size(); ++i) {
        const Frame f{double(i) * (kWidth + kGap)};
        svg += axes(f, panels[i].title) + lines(f, panels[i].outcomes);
    }
    return svg + legend(kWidth - 195) + "</svg>\n";
}

}  // namespace tactiled::bench
