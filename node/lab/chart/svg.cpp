#include "node/lab/chart/svg.hpp"

#include "node/lab/chart/text.hpp"

namespace tactiled {

Svg::Svg(const SvgHead& head) {
    text_ = "<svg";
    if (head.font_size > 0) text_ += " xmlns=\"http://www.w3.org/2000/svg\"";
    if (!head.css_class.empty()) put(" class=\"{}\"", head.css_class);
    put(" viewBox=\"0 0 {} {}\"", head.width, head.height);
    if (head.sized) put(" width=\"{}\" height=\"{}\"", head.width, head.height);
    put(" role=\"img\" aria-label=\"{}\"", html_text(head.about));
    if (head.font_size > 0) put(" font-family=\"sans-serif\" font-size=\"{}\" fill=\"{}\"", head.font_size, head.ink);
    text_ += ">\n";
    if (head.paper) put("<rect width=\"{}\" height=\"{}\" fill=\"#fff\"/>\n", head.width, head.height);
}

std::string svg_line(std::string_view d, const Pen& pen) {
    if (d.empty()) return "";
    std::string text = "<path";
    auto out = std::back_inserter(text);
    if (!pen.css_class.empty()) fmt::format_to(out, " class=\"{}\"", pen.css_class);
    if (!pen.colour.empty()) fmt::format_to(out, " fill=\"none\" stroke=\"{}\"", pen.colour);
    if (pen.width > 0) fmt::format_to(out, " stroke-width=\"{}\"", pen.width);
    if (!pen.dashes.empty()) fmt::format_to(out, " stroke-dasharray=\"{}\"", pen.dashes);
    fmt::format_to(out, " d=\"{}\"/>\n", d);
    return text;
}

void AxisMarks::add_x(const PlotArea& area, const Scale& scale, std::span<const Tick> ticks, double below) {
    for (const auto& [value, text] : ticks) {
        const double x = scale.at(value);
        grid += fmt::format("M{:.1f} {:.{}f}V{:.{}f}", x, area.top, area.decimals, area.foot, area.decimals);
        numbers += fmt::format("<text x=\"{:.1f}\" y=\"{:.{}f}\" text-anchor=\"middle\">{}</text>\n", x, area.foot + below,
                               area.decimals, text);
    }
}

void AxisMarks::add_y(const PlotArea& area, const Scale& scale, std::span<const Tick> ticks, double left, double down) {
    for (const auto& [value, text] : ticks) {
        const double y = scale.at(value);
        grid += fmt::format("M{:.0f} {:.1f}H{:.0f}", area.left, y, area.right);
        numbers +=
            fmt::format("<text x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", area.left - left, y + down, text);
    }
}

std::string legend_text(double x, double middle, std::string_view text, double font_size) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\">{}</text>\n", x, middle + 4, font_size,
                       html_text(text));
}

std::string legend_line(double x, double middle, double length, const Pen& pen) {
    return svg_line(fmt::format("M{:.1f} {:.1f}h{}", x, middle, length), pen);
}

}  // namespace tactiled
