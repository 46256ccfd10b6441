// Plots of a report: errors against time, direction of the load, and distance of the channels from their mean;
// coverage of the stated sd; zeros of the sessions.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "decoupling/solve/domain.hpp"
#include "node/lab/chart/text.hpp"
#include "node/lab/report/html.hpp"
#include "node/lab/report/report.hpp"

namespace tactiled {
namespace {

constexpr double kChanges = 1e-3;  // change from row to row relative to full scale: less is neither loading nor unloading

// Held-out rows of a component that have an error, in the order of time.
struct Row {
    const LabelledRow* row;
    double error;
};
std::vector<Row> rows_of(const FitReport& report, std::size_t c) {
    std::vector<Row> rows;
    if (c >= kComponentNames.size()) return rows;
    for (const auto& [row, estimated_S] : report.held_out)
        if (const double error = estimated_S[c] - row->wrench_S[c]; std::isfinite(error)) rows.push_back({row, error});
    std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
        if (a.row->session != b.row->session) return a.row->session < b.row->session;
        return a.row->t_ns != b.row->t_ns ? a.row->t_ns < b.row->t_ns : a.row->line < b.row->line;
    });
    return rows;
}

// Returns the distance of each row's channels from their mean over all rows, in widths (sd) of the channels: root of
// the mean square.
std::vector<double> distances(const std::vector<Row>& rows) {
    const std::size_t n = rows.empty() ? 0 : rows.front().row->channel.size();
    std::vector<double> mean(n), squares(n), result;
    for (const Row& row : rows)
        for (std::size_t k = 0; k < n; ++k) mean[k] += row.row->channel[k] / double(rows.size());
    for (const Row& row : rows)
        for (std::size_t k = 0; k < n; ++k) squares[k] += std::pow(row.row->channel[k] - mean[k], 2) / double(rows.size());
    for (const Row& row : rows) {
        double sum = 0;
        for (std::size_t k = 0; k < n; ++k)
            if (squares[k] > 0) sum += std::pow(row.row->channel[k] - mean[k], 2) / squares[k];
        result.push_back(std::sqrt(sum / double(std::max<std::size_t>(1, n))));
    }
    return result;
}

std::string scatter(const std::string& about, const std::string& x_label, const std::vector<double>& x,
                    const std::string& y_label, const std::vector<Row>& rows) {
    std::vector<double> y;
    for (const Row& row : rows) y.push_back(row.error);
    const Span across = as_axis(span_of(x));
    const Figure figure{.x = {.label = x_label, .range = across},
                        .y = {.label = y_label},
                        .series = {{"no error", Symbol::none, Stroke::dashed, {{across.min, 0}, {across.max, 0}}, kOrange},
                                   held_out_rows(x, y)}};
    return html_figure(figure, about, html_text(about) + "." + html_thinned(rows.size()));
}

}  // namespace

std::string html_history_plots(const FitReport& report, std::size_t i) {
    const ComponentReport& component = report.components[i];
    const std::vector<Row> rows = rows_of(report, component_index(component.name));
    if (rows.empty()) return "";
    std::map<std::size_t, std::uint64_t> begun;  // time of a session's first row
    bool timed = true;
    for (const Row& row : rows) {
        begun.emplace(row.row->session, row.row->t_ns);
        timed = timed && row.row->t_ns != 0;
    }
    std::vector<double> time(rows.size());
    if (timed)
        for (std::size_t k = 0; k < rows.size(); ++k)
            time[k] = 1e-9 * double(rows[k].row->t_ns - begun[rows[k].row->session]);
    else
        std::iota(time.begin(), time.end(), 0.0);
    const std::string unit = fmt::format("estimated − applied, {}", unit_of(component));
    return scatter(component.name + ": error against time, held-out rows",
                   timed ? "s since the session's first row" : "number of the row", time, unit, rows) +
           scatter(component.name + ": error against the channels' distance from their mean",
                   "root mean square distance, sd of a channel", distances(rows), unit, rows);
}

std::string html_loading(const FitReport& report) {
    std::string text = html_row(
        {"component", "rows loading", "mean error", "rms error", "rows unloading", "mean error", "rms error"}, "th");
    bool any = false;
    for (const ComponentReport& component : report.components) {
        const std::size_t c = component_index(component.name);
        double n[2]{}, sum[2]{}, squares[2]{};
        const LabelledRow* before = nullptr;
        for (const auto& [row, error] : rows_of(report, c)) {
            const double change = before == nullptr || before->session != row->session
                                      ? 0
                                      : std::abs(row->wrench_S[c]) - std::abs(before->wrench_S[c]);
            before = row;
            if (!(std::abs(change) > kChanges * component.full_scale)) continue;
            const int direction = change > 0 ? 0 : 1;
            n[direction] += 1;
            sum[direction] += error;
            squares[direction] += error * error;
        }
        if (n[0] + n[1] == 0) continue;
        any = true;
        std::vector<std::string> cells{html_text(component.name)};
        for (int direction = 0; direction < 2; ++direction) {
            cells.push_back(html_number(n[direction], 9));
            for (const double value : {sum[direction] / n[direction], std::sqrt(squares[direction] / n[direction])})
                cells.push_back(html_number(value, unit_of(component)));
        }
        text += html_row(cells);
    }
    if (!any) return "";
    return "<h2>Loading and unloading</h2>\n<p>Held-out rows whose load is greater, or smaller, than that of the row before "
           "by more than 0.1 % of full scale. Mean errors that differ are hysteresis.</p>\n" +
           html_table(text, "loading");
}

std::string html_within(const FitReport& report) {
    std::string text = html_row(
        {"component", "median sd", "median sd over rms error", "within 1 sd", "within 2 sd", "within 3 sd", "beyond 5 sd"},
        "th");
    bool any = false;
    for (std::size_t i = 0; i < report.components.size(); ++i) {
        const ComponentErrors errors = component_errors(report, i);
        const double sd = errors.median_sd();
        if (!std::isfinite(sd)) continue;
        any = true;
        const auto share = [](double value) { return html_number(100 * value, "%"); };
        const double sharpness = sd / report.components[i].held_out_rms;
        text += html_row({html_text(report.components[i].name), html_number(sd, unit_of(report.components[i])),
                          html_number(sharpness), share(errors.within(1)), share(errors.within(2)), share(errors.within(3)),
                          share(1 - errors.within(5))});
    }
    if (!any) return "";
    return "<h2>Coverage of the stated sd</h2>\n<p>Shares of the held-out errors; of normal errors they would be 68.3, "
           "95.4, "
           "99.7 and 0 %.</p>\n" +
           html_table(text, "within");
}

std::string html_zeros(const FitReport& report) {
    if (report.labelled == nullptr || report.zeros.offset.empty()) return "";
    std::vector<std::string> head{"session"};
    for (const auto& channel : report.calibration.channels) head.push_back(html_text(channel));
    std::string text = html_row(head, "th");
    for (std::size_t s = 0; s < report.zeros.offset.size(); ++s) {
        if (report.zeros.offset[s].empty() || s >= report.labelled->sessions.size()) continue;
        std::vector<std::string> cells{html_text(report.labelled->sessions[s])};
        for (const double offset : report.zeros.offset[s]) cells.push_back(html_number(offset));
        text += html_row(cells);
    }
    return fmt::format("<h2>Zeros of the sessions</h2>\n<p>Of each channel, less the mean over the sessions. {}</p>\n",
                       report.zeros.own
                           ? "Each session was read from its own zero, as after a tare: the errors on this page "
                             "are those after a tare."
                           : "All sessions were read from one zero.") +
           html_table(text, "zeros");
}

}  // namespace tactiled
