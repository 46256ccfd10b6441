#include "node/lab/chart/axis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tactiled {
namespace {

constexpr double kGreatest = 1e300;  // limit of a value, so that differences stay finite
constexpr int kTicks = 5;            // approximate number

}  // namespace

Span span_of(std::span<const double> values) {
    Span span{HUGE_VAL, -HUGE_VAL};
    for (const double value : values)
        if (std::isfinite(value)) span = {std::min(span.min, value), std::max(span.max, value)};
    return span.min <= span.max ? span : Span{0, 0};
}

Span as_axis(Span span, double margin) {
    for (double* const end : {&span.min, &span.max})
        *end = std::isfinite(*end) ? std::clamp(*end, -kGreatest, kGreatest) : 0;
    if (span.min > span.max) std::swap(span.min, span.max);
    const double greatest = std::max(std::abs(span.min), std::abs(span.max));
    if (greatest < 1e-290) return {-1, 1};
    // Below this width, neighbouring ticks would be the same number.
    const double min_width = 1e-9 * greatest;
    const double more = span.max - span.min > min_width ? margin * (span.max - span.min) : 0.1 * greatest;
    return {span.min - more, span.max + more};
}

std::vector<Tick> axis_ticks(Span axis) {
    const double width = axis.max - axis.min;
    const double power = std::pow(10, std::floor(std::log10(width / kTicks)));
    double step = 10 * power;
    for (const double factor : {5.0, 2.0, 1.0})
        if (width / (factor * power) <= 1.5 * kTicks) step = factor * power;
    std::vector<Tick> result;
    if (!(step > 0) || !std::isfinite(step)) return result;
    const double greatest = std::max(std::abs(axis.min), std::abs(axis.max));
    const int digits = std::clamp(int(std::ceil(std::log10(greatest / step))) + 2, 3, 15);  // neighbours must differ
    const double first = std::ceil(axis.min / step);
    for (int i = 0; i < 3 * kTicks; ++i) {
        const double multiple = first + i, at = multiple * step;
        if (at > axis.max) break;
        result.push_back({at, multiple == 0 ? "0" : fmt::format("{:.{}g}", at, digits)});
    }
    return result;
}

std::vector<Tick> log_ticks(Span axis) {
    std::vector<Tick> result;
    if (!(axis.min > 0) || !(axis.max > axis.min) || !std::isfinite(axis.max)) return result;
    const int first = int(std::floor(std::log10(axis.min))), last = int(std::ceil(std::log10(axis.max)));
    const bool between = std::log10(axis.max / axis.min) < 2.5;
    const int every = std::max(1, (last - first + 7) / 8);
    for (int power = first; power <= last; power += every)
        for (const int factor : {1, 2, 5}) {
            const double at = factor * std::pow(10, power);
            if (factor > 1 && !between) break;
            if (at < axis.min * (1 - 1e-12) || at > axis.max * (1 + 1e-12)) continue;
            std::string text = fmt::format("{:g}", at);
            if (power < -3 || power > 4) {
                text = factor == 1 ? "10" : fmt::format("{}·10", factor);
                if (power < 0) text += "⁻";
                for (const char digit : std::to_string(std::abs(power)))
                    text += std::array{"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"}[std::size_t(digit - '0')];
            }
            result.push_back({at, text});
        }
    return result;
}

double Scale::at(double value) const {
    if (logarithmic) value = value > 0 ? std::log10(value) : axis.min;
    return from + (to - from) * std::clamp((value - axis.min) / (axis.max - axis.min), 0.0, 1.0);
}

}  // namespace tactiled
