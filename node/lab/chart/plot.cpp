#include "node/lab/chart/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

namespace tactiled {
namespace {

// In units of the viewBox.
constexpr double kWidth = 360, kHeight = 290, kLeft = 62, kRight = 10, kTop = 10, kFoot = 44;
constexpr double kGreatest = 1e300;  // of an axis: differences stay finite
constexpr int kTicks = 5;            // about

bool finite(Dot dot) { return std::isfinite(dot.x) && std::isfinite(dot.y); }

// Share of the axis, 0 .. 1.
double share(double value, Span axis) {
    value = std::clamp(value, axis.min, axis.max);
    return (value - axis.min) / (axis.max - axis.min);
}

// Length of the UTF-8 sequence that `text` starts with; 0 where it starts with none.
std::size_t sequence(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned first = byte(0);
    const std::size_t n = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;
    if (n == 0 || n > text.size()) return 0;
    for (std::size_t i = 1; i < n; ++i)
        if ((byte(i) & 0xC0u) != 0x80) return 0;
    if (n == 3 && ((first == 0xE0 && byte(1) < 0xA0) || (first == 0xED && byte(1) > 0x9F))) return 0;  // long, surrogate
    if (n == 4 && ((first == 0xF0 && byte(1) < 0x90) || (first == 0xF4 && byte(1) > 0x8F))) return 0;
    return n;
}

}  // namespace

std::string html_text(std::string_view text) {
    std::string result;
    while (!text.empty()) {
        const std::size_t n = sequence(text);
        const char c = text[0];
        if (n == 0 || (n == 1 && ((c >= 0 && c < ' ' && c != '\t' && c != '\n') || c == '\x7f')))
            result += "\xEF\xBF\xBD";
        else if (c == '&')
            result += "&amp;";
        else if (c == '<')
            result += "&lt;";
        else if (c == '>')
            result += "&gt;";
        else if (c == '"')
            result += "&quot;";
        else if (c == '\'')
            result += "&#39;";
        else
            result += text.substr(0, n);
        text.remove_prefix(std::max<std::size_t>(n, 1));
    }
    return result;
}

Span span_of(std::span<const double> values) {
    Span span{0, 0};
    bool any = false;
    for (const double value : values) {
        if (!std::isfinite(value)) continue;
        span = any ? Span{std::min(span.min, value), std::max(span.max, value)} : Span{value, value};
        any = true;
    }
    return span;
}

Span as_axis(Span span, double margin) {
    if (!std::isfinite(span.min)) span.min = 0;
    if (!std::isfinite(span.max)) span.max = span.min;
    span.min = std::clamp(span.min, -kGreatest, kGreatest);
    span.max = std::clamp(span.max, -kGreatest, kGreatest);
    if (span.min > span.max) std::swap(span.min, span.max);
    const double greatest = std::max(std::abs(span.min), std::abs(span.max));
    if (greatest < 1e-290) return {-1, 1};
    // Narrower than this, neighbouring ticks would be the same number.
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
    const int digits = std::clamp(int(std::ceil(std::log10(greatest / step))) + 2, 3, 15);  // so that neighbours differ
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

SvgPlot::SvgPlot(std::string_view about, std::string_view x_label, Span x, std::string_view y_label, Span y)
    : x_(as_axis(x, 0)), y_(as_axis(y, 0)) {
    auto out = std::back_inserter(frame_);
    fmt::format_to(out, "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n", kWidth, kHeight, html_text(about));
    fmt::format_to(out, "<rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>\n", kLeft, kTop,
                   kWidth - kLeft - kRight, kHeight - kTop - kFoot);
    std::string grid, numbers;
    for (const auto& [value, text] : axis_ticks(x_)) {
        const double px = kLeft + share(value, x_) * (kWidth - kLeft - kRight);
        grid += fmt::format("M{:.1f} {}V{}", px, kTop, kHeight - kFoot);
        numbers +=
            fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", px, kHeight - kFoot + 15, text);
    }
    for (const auto& [value, text] : axis_ticks(y_)) {
        const double py = kHeight - kFoot - share(value, y_) * (kHeight - kTop - kFoot);
        grid += fmt::format("M{} {:.1f}H{}", kLeft, py, kWidth - kRight);
        numbers += fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", kLeft - 5, py + 4, text);
    }
    if (!grid.empty()) fmt::format_to(out, "<path class=\"grid\" d=\"{}\"/>\n", grid);
    frame_ += numbers;
    fmt::format_to(out, "<text class=\"label\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n",
                   (kLeft + kWidth - kRight) / 2, kHeight - 8, html_text(x_label));
    const double middle = (kTop + kHeight - kFoot) / 2;
    fmt::format_to(out,
                   "<text class=\"label\" x=\"13\" y=\"{0}\" text-anchor=\"middle\" transform=\"rotate(-90 13 {0})\">{1}"
                   "</text>\n",
                   middle, html_text(y_label));
}

std::string SvgPlot::at(Dot dot) const {
    return fmt::format("{:.1f} {:.1f}", kLeft + share(dot.x, x_) * (kWidth - kLeft - kRight),
                       kHeight - kFoot - share(dot.y, y_) * (kHeight - kTop - kFoot));
}

void SvgPlot::dots(std::span<const Dot> dots) {
    const std::size_t n = std::min(dots.size(), kMaxDots);
    std::string path;
    for (std::size_t i = 0; i < n; ++i)
        if (const Dot dot = dots[i * dots.size() / n]; finite(dot)) path += "M" + at(dot) + "h0";
    if (!path.empty()) inside_ += fmt::format("<path class=\"dots\" d=\"{}\"/>\n", path);
}

std::string SvgPlot::path(std::span<const Dot> dots) const {
    std::string path;
    for (const Dot dot : dots)
        if (finite(dot)) path += (path.empty() ? "M" : "L") + at(dot);
    return path;
}

void SvgPlot::line(std::span<const Dot> dots, std::string_view css_class) {
    if (const std::string d = path(dots); !d.empty())
        inside_ += fmt::format("<path class=\"{}\" d=\"{}\"/>\n", css_class, d);
}

void SvgPlot::band(std::span<const Dot> lower, std::span<const Dot> upper) {
    std::vector<Dot> around(lower.begin(), lower.end());
    around.insert(around.end(), upper.rbegin(), upper.rend());
    if (const std::string d = path(around); !d.empty()) inside_ += fmt::format("<path class=\"band\" d=\"{}Z\"/>\n", d);
}

void SvgPlot::bar(double left, double right, double height) {
    const Dot corners[] = {{left, y_.min}, {left, height}, {right, height}, {right, y_.min}};
    if (height > y_.min && std::all_of(std::begin(corners), std::end(corners), finite))
        inside_ += fmt::format("<path class=\"bar\" d=\"{}Z\"/>\n", path(corners));
}

std::string SvgPlot::text() const { return frame_ + inside_ + "</svg>\n"; }

}  // namespace tactiled
