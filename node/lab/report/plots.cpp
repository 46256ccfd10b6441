// The plots of a report, each a <figure> with a caption.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "decoupling/solve/load_scale.hpp"
#include "node/lab/report/report.hpp"

namespace tactiled {
namespace {

constexpr double kHistogramEnd = 4;  // standard deviations
constexpr int kBins = 32;

using Points = std::vector<Figure::Point>;

Figure::Series line(const std::string& name, Points points, Stroke stroke = Stroke::solid) {
    return {name, Symbol::none, stroke, std::move(points), kOrange};
}

std::string applied_estimated(const ComponentErrors& errors, const std::string& name, const std::string& unit) {
    const Span a = span_of(errors.applied), e = span_of(errors.estimated);
    const Span both = as_axis({std::min(a.min, e.min), std::max(a.max, e.max)});
    const Figure figure{.x = {.label = fmt::format("applied {}, {}", name, unit), .range = both},
                        .y = {.label = fmt::format("estimated {}, {}", name, unit), .range = both},
                        .series = {line("equal", {{both.min, both.min}, {both.max, both.max}}, Stroke::dashed),
                                   held_out_rows(errors.applied, errors.estimated)}};
    return html_figure(figure, name + ": estimated against applied, held-out rows",
                       fmt::format("Estimated against applied {}, held-out rows. On the line they are equal.{}", name,
                                   html_thinned(errors.applied.size())));
}

std::string residuals(const FitReport& report, std::size_t i, const ComponentErrors& errors, const std::string& unit) {
    const std::string& name = report.components[i].name;
    const Span x = as_axis(span_of(errors.applied));
    Figure figure{.x = {.label = fmt::format("applied {}, {}", name, unit), .range = x},
                  .y = {.label = fmt::format("estimated − applied, {}", unit)}};
    if (errors.sd_known) {
        Points band;
        for (int k = -40; k <= 40; ++k) {  // along the lower side, and back along the upper one
            Wrench alone{};                // the others are 0
            const double load = alone[component_index(name)] = x.max - (x.max - x.min) * std::abs(k) / 40;
            band.push_back({load, std::copysign(stated_sd(report.calibration, i, alone), k + 0.5)});
        }
        figure.series.push_back({.name = "one stated sd", .points = band, .colour = kOrange, .shape = Shape::area});
    }
    figure.series.push_back(line("no error", {{x.min, 0}, {x.max, 0}}, Stroke::dashed));
    figure.series.push_back(held_out_rows(errors.applied, errors.error));
    return html_figure(
        figure, name + ": error against applied, held-out rows",
        fmt::format("Error against applied {}, held-out rows. {}{}", name,
                    errors.sd_known ? "Shaded: one stated sd each way, at an estimate equal to the load and no other load."
                                    : "No band: the sd is unknown.",
                    html_thinned(errors.applied.size())));
}

// Returns the bars of a histogram between x.min and x.max; values beyond are in the outermost bars.
Figure::Series histogram(const std::string& name, const std::vector<double>& values, Span x, double per_value) {
    const double width = x.max / kBins - x.min / kBins;
    std::vector<double> height(kBins);
    for (const double value : values)
        height[std::size_t(std::clamp((value - x.min) / width, 0.0, kBins - 1.0))] += per_value;
    Figure::Series bars{.name = name, .colour = kBlue, .shape = Shape::bars};
    for (int k = 0; k < kBins; ++k) {
        bars.points.push_back({x.min + k * width, 0});
        bars.points.push_back({x.min + (k + 1) * width, height[std::size_t(k)]});
    }
    return bars;
}

double highest(const Figure::Series& bars) {
    double y = 0;
    for (const auto& point : bars.points) y = std::max(y, point.y);
    return y;
}

// Shows errors in sd beside a normal distribution; in rms if the sd is unknown.
std::string distribution(const ComponentReport& component, const ComponentErrors& errors) {
    const char* const scale = errors.sd_known ? "sd" : "rms";
    std::vector<double> ratios;
    for (std::size_t k = 0; k < errors.error.size(); ++k)
        ratios.push_back(errors.error[k] / (errors.sd_known ? errors.sd[k] : component.held_out_rms));
    std::erase_if(ratios, [](double ratio) { return std::isnan(ratio); });
    if (ratios.empty()) return "";
    const Span x{-kHistogramEnd, kHistogramEnd};
    const auto bars = histogram("errors", ratios, x, kBins / (2 * kHistogramEnd * double(ratios.size())));
    Points normal;
    for (int k = -40; k <= 40; ++k) {
        const double z = kHistogramEnd * k / 40.0;
        normal.push_back({z, std::exp(-z * z / 2) / std::sqrt(2 * M_PI)});
    }
    const Figure figure{
        .x = {.label = fmt::format("error of {} / {}", component.name, scale), .range = x},
        .y = {.label = fmt::format("share of errors per {}", scale), .range = Span{0, 1.06 * std::max(0.4, highest(bars))}},
        .series = {bars, line("normal distribution", normal)}};
    std::string caption = fmt::format(
        "Error of {} in {}; the line is the normal distribution. Errors beyond {:g} {} are "
        "in the outermost bars.",
        component.name, scale, kHistogramEnd, scale);
    if (errors.sd_known)
        caption += fmt::format(" Beyond 2 sd: {:.2f} % (normal: 4.55 %); beyond 3 sd: {:.2f} % (normal: 0.27 %).",
                               100 * (1 - errors.within(2)), 100 * (1 - errors.within(3)));
    return html_figure(figure, fmt::format("{}: histogram of held-out error over {}", component.name, scale), caption);
}

// Returns the labels of rows that have all channels.
std::vector<Wrench> loads(const FitReport& report) {
    std::vector<Wrench> result;
    if (report.labelled == nullptr) {
        for (const auto& [row, estimated] : report.held_out) result.push_back(row->wrench_S);
        return result;
    }
    for (const auto& row : report.labelled->rows)
        if (std::none_of(row.channel.begin(), row.channel.end(), [](double value) { return std::isnan(value); }))
            result.push_back(row.wrench_S);
    return result;
}

std::string load_histogram(const ComponentReport& component, const std::vector<Wrench>& all) {
    const std::size_t c = component_index(component.name);
    std::vector<double> values;
    for (const auto& wrench : all)
        if (std::isfinite(wrench[c])) values.push_back(wrench[c]);
    if (values.empty()) return "";
    const Span x = as_axis(span_of(values), 0);
    const auto bars = histogram("", values, x, 1);
    const Figure figure{.x = {.label = fmt::format("applied {}, {}", component.name, unit_of(component)), .range = x},
                        .y = {.label = "rows", .range = Span{0, 1.06 * highest(bars)}},
                        .series = {bars}};
    return html_figure(figure, component.name + ": histogram of the loads",
                       fmt::format("Loads {} of {} rows.", component.name, values.size()));
}

std::string load_pair(const ComponentReport& a, const ComponentReport& b, const std::vector<Wrench>& all) {
    std::vector<double> x, y;
    for (const auto& wrench : all)
        if (const double va = wrench[component_index(a.name)], vb = wrench[component_index(b.name)];
            std::isfinite(va) && std::isfinite(vb)) {
            x.push_back(va);
            y.push_back(vb);
        }
    if (x.empty()) return "";
    const Figure figure{.x = {.label = fmt::format("applied {}, {}", a.name, unit_of(a))},
                        .y = {.label = fmt::format("applied {}, {}", b.name, unit_of(b))},
                        .series = {held_out_rows(x, y)}};
    return html_figure(figure, fmt::format("loads: {} against {}", b.name, a.name),
                       fmt::format("Loads {} and {}, {} rows.{}", a.name, b.name, x.size(), html_thinned(x.size())));
}

}  // namespace

Figure::Series held_out_rows(std::span<const double> x, std::span<const double> y) {
    Figure::Series rows{.name = "", .symbol = Symbol::dot, .colour = kBlue};
    const std::size_t n = std::min(x.size(), kMaxDots);
    for (std::size_t i = 0; i < n; ++i) rows.points.push_back({x[i * x.size() / n], y[i * x.size() / n]});
    return rows;
}

std::string html_figure(Figure figure, const std::string& about, const std::string& caption_html) {
    figure.width = 280;
    figure.height = 230;
    return fmt::format("<figure>\n{}<figcaption>{}</figcaption>\n</figure>\n", figures_svg({&figure, 1}, about, Place::page),
                       caption_html);
}

std::string html_thinned(std::size_t rows) {
    return rows > kMaxDots ? fmt::format(" {} of {} rows are drawn, evenly thinned.", kMaxDots, rows) : "";
}

double ComponentErrors::within(double times) const {
    if (!sd_known || error.empty()) return kNaN;
    std::size_t n = 0;
    for (std::size_t k = 0; k < error.size(); ++k) n += std::abs(error[k]) <= times * sd[k] ? 1 : 0;
    return double(n) / double(error.size());
}

double ComponentErrors::median_sd() const { return sd_known ? median(sd) : kNaN; }

ComponentErrors::Worst ComponentErrors::worst_session() const {
    std::map<std::size_t, std::pair<double, double>> squares;  // sum, rows
    for (std::size_t k = 0; k < error.size(); ++k) {
        squares[session[k]].first += error[k] * error[k];
        squares[session[k]].second += 1;
    }
    Worst worst{0, kNaN};
    for (const auto& [of, sum] : squares)
        if (const double rms = std::sqrt(sum.first / sum.second); !(rms <= worst.rms)) worst = {of, rms};
    return worst;
}

ComponentErrors component_errors(const FitReport& report, std::size_t i) {
    const Calibration& calibration = report.calibration;
    const std::size_t c = component_index(report.components[i].name);
    ComponentErrors result;
    if (c >= kComponentNames.size()) return result;
    result.sd_known = i < calibration.sd.size();
    for (const auto& [row, estimated_S] : report.held_out) {
        const double applied = row->wrench_S[c], estimated = estimated_S[c];
        if (!std::isfinite(applied)) continue;
        if (!std::isfinite(estimated)) {
            ++result.without_estimate;
            continue;
        }
        result.applied.push_back(applied);
        result.estimated.push_back(estimated);
        result.error.push_back(estimated - applied);
        result.session.push_back(row->session);
        if (result.sd_known) result.sd.push_back(stated_sd(calibration, i, estimated_S));
    }
    return result;
}

std::string unit_of(const ComponentReport& component) { return component.name.starts_with('f') ? "N" : "Nm"; }

std::string html_component_plots(const FitReport& report, std::size_t i) {
    const ComponentReport& component = report.components[i];
    const ComponentErrors errors = component_errors(report, i);
    if (errors.error.empty()) return "<p>No held-out rows: nothing to draw.</p>\n";
    const std::string unit = unit_of(component);
    return "<div class=\"plots\">\n" + applied_estimated(errors, component.name, unit) + residuals(report, i, errors, unit) +
           distribution(component, errors) + html_history_plots(report, i) + "</div>\n";
}

std::string html_coverage(const FitReport& report) {
    const std::vector<Wrench> all = loads(report);
    std::vector<ComponentReport> known;
    for (const auto& component : report.components)
        if (component_index(component.name) < kComponentNames.size()) known.push_back(component);
    std::string plots;
    if (known.size() == 1) plots = load_histogram(known[0], all);
    for (std::size_t i = 0; i < known.size(); ++i)
        for (std::size_t j = i + 1; j < known.size(); ++j) plots += load_pair(known[i], known[j], all);
    return plots.empty() ? "<p>No labelled rows.</p>\n" : "<div class=\"plots\">\n" + plots + "</div>\n";
}

}  // namespace tactiled
