// Small plots as inline SVG, for reports: axes with ticks, dots, lines, bands and bars. Colours and strokes are
// classes of the page's style sheet. May allocate; never in the loop.
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
    // Labels are plain text, not HTML. `about` is the description for screen readers.
    SvgPlot(std::string_view about, std::string_view x_label, Span x, std::string_view y_label, Span y);

    // Draws at most kMaxDots dots, evenly thinned. Only finite ones are drawn; dots beyond the axes are placed at
    // their edge.
    void dots(std::span<const Dot> dots);
    void line(std::span<const Dot> dots, std::string_view css_class);
    // Fills the area between two lines with the same x.
    void band(std::span<const Dot> lower, std::span<const Dot> upper);
    // Draws a bar from the foot of the plot to `height`.
    void bar(double left, double right, double height);

    [[nodiscard]] std::string text() const { return svg_.text(); }

private:
    [[nodiscard]] std::string path(std::span<const Dot> dots) const;

    Scale x_, y_;
    Svg svg_;
};

}  // namespace tactiled
