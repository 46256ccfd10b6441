// Small plots as inline SVG, for reports: axes with ticks, dots, lines, bands and bars. Colours and strokes are classes of
// the page's style sheet. May allocate; never in the loop.
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "node/lab/chart/axis.hpp"
#include "node/lab/chart/svg.hpp"

namespace tactiled {

struct Dot {
    double x, y;
};

inline constexpr std::size_t kMaxDots = 2000;  // in one plot; more look the same and make the file slow

class SvgPlot {
public:
    // Labels are text, not HTML. `about` is read out to those who do not see the plot.
    SvgPlot(std::string_view about, std::string_view x_label, Span x, std::string_view y_label, Span y);

    // At most kMaxDots of them, evenly thinned. Only finite ones are drawn; those off the axes stand at their edge.
    void dots(std::span<const Dot> dots);
    void line(std::span<const Dot> dots, std::string_view css_class);
    // Between two lines that have the same x.
    void band(std::span<const Dot> lower, std::span<const Dot> upper);
    // From the foot of the plot to `height`.
    void bar(double left, double right, double height);

    [[nodiscard]] std::string text() const { return svg_.text(); }

private:
    [[nodiscard]] std::string path(std::span<const Dot> dots) const;

    Scale x_, y_;
    Svg svg_;
};

}  // namespace tactiled
