// Small plots as inline SVG, for reports: axes with ticks, dots, lines, bands and bars. Colours and strokes are classes of
// the page's style sheet. May allocate; never in the loop.
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tactiled {

// Text for HTML: markup escaped; control characters and bytes that are no UTF-8 become U+FFFD.
std::string html_text(std::string_view text);

struct Span {  // of numbers
    double min, max;
};

// All finite numbers of `values`; {0, 0} where there are none.
Span span_of(std::span<const double> values);
// Made usable as an axis: finite, least < most, `margin` x its width wider on both sides.
Span as_axis(Span span, double margin = 0.04);

struct Tick {
    double at;
    std::string text;
};
// About five for an axis: multiples of 1, 2 or 5 times a power of ten.
std::vector<Tick> axis_ticks(Span axis);
// For a logarithmic axis, 0 < least < most: powers of ten, where those are fewer than three also 2 and 5 times them; every
// so many where they are more than eight. What is far from 1 reads 10⁻⁵.
std::vector<Tick> log_ticks(Span axis);

struct Dot {
    double x, y;
};

inline constexpr std::size_t kMaxDots = 2000;  // of one plot; more look the same and make the file slow

class SvgPlot {
public:
    // Labels are text, not HTML. `about` is read out to those who do not see the plot.
    SvgPlot(std::string_view about, std::string_view x_label, Span x, std::string_view y_label, Span y);

    // At most kMaxDots of them, evenly thinned. What is not finite is not drawn; what is off the axes, at their edge.
    void dots(std::span<const Dot> dots);
    void line(std::span<const Dot> dots, std::string_view css_class);
    // Between two lines that have the same x.
    void band(std::span<const Dot> lower, std::span<const Dot> upper);
    // From the foot of the plot to `height`.
    void bar(double left, double right, double height);

    [[nodiscard]] std::string text() const;

private:
    [[nodiscard]] std::string at(Dot dot) const;  // "12.3 45.6"
    std::string path(std::span<const Dot> dots) const;

    Span x_, y_;
    std::string frame_, inside_;
};

}  // namespace tactiled
