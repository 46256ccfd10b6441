// Axes: the span of the values, the ticks, and the coordinate of a value on the paper. May allocate; never in the
// loop.
#pragma once
#include <span>
#include <string>
#include <vector>

namespace tactiled {

struct Span {  // a range of numbers
    double min, max;
};

// Returns the span of all finite numbers of `values`; {0, 0} if there are none.
Span span_of(std::span<const double> values);
// Makes a span usable as an axis: finite, min < max, wider by `margin` times its width on both sides.
Span as_axis(Span span, double margin = 0.04);

struct Tick {
    double at;
    std::string text;
};
// Returns about five ticks for an axis: multiples of 1, 2 or 5 times a power of ten.
std::vector<Tick> axis_ticks(Span axis);
// Returns ticks for a logarithmic axis, 0 < min < max: powers of ten, with 2 and 5 times them if there are fewer than
// three, and only every n-th if there are more than eight. Numbers far from 1 are written as 10⁻⁵.
std::vector<Tick> log_ticks(Span axis);

// Maps the values of an axis to coordinates on the paper; values beyond the axis are placed at its ends.
struct Scale {
    Span axis;  // its decimal logarithms, if it is logarithmic
    double from, to;
    bool logarithmic = false;  // values of 0 and less are placed at axis.min

    [[nodiscard]] double at(double value) const;
};

}  // namespace tactiled
