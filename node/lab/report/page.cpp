// The page of a report: header, tables, and explanations. Its plots are in plots.cpp.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "decoupling/solve/domain.hpp"
#include "node/lab/chart/text.hpp"
#include "node/lab/report/html.hpp"
#include "node/lab/report/report.hpp"

namespace tactiled {
namespace {

std::string percent(double share) { return html_number(100 * share, "%"); }

std::string or_unknown(const std::string& text) { return text.empty() ? "unknown" : html_text(text); }

std::string header(const FitReport& report) {
    const Calibration& c = report.calibration;
    const int disagree = report.rows_read - report.rows_without_label - report.rows_missing_channel - c.rows;
    Facts facts{{"model, method", html_text(c.model) + ", " + html_text(c.method)},
                {"serial", or_unknown(c.serial)},
                {"date", or_unknown(c.date)}};
    if (report.labelled != nullptr) facts.emplace_back("recording", or_unknown(report.labelled->name));
    if (report.labelled != nullptr && !report.labelled->sessions.empty())
        facts.emplace_back("sessions", html_text(fmt::format("{}", fmt::join(report.labelled->sessions, ", "))));
    facts.emplace_back("contact model", or_unknown(c.contact_model));
    facts.emplace_back("channels", fmt::format("{}, unit: {}", c.channels.size(), or_unknown(c.channel_unit)));
    facts.emplace_back("rows used", fmt::format("{} of {}", html_number(c.rows, 9), html_number(report.rows_read, 9)));
    facts.emplace_back("rows left out",
                       fmt::format("{} without a label, {} with a missing channel, {} whose label disagrees with the rest",
                                   html_number(report.rows_without_label, 9), html_number(report.rows_missing_channel, 9),
                                   html_number(disagree, 9)));
    facts.emplace_back("validated by", c.validation.empty() ? "not validated" : html_text(c.validation));
    return html_facts(facts);
}

std::string warnings(const FitReport& report) {
    if (report.warnings.empty()) return "";
    std::string items;
    std::set<std::string> said;  // removes repetitions between methods
    for (const auto& warning : report.warnings)
        if (said.insert(warning).second) items += "<li>" + html_text(warning) + "</li>\n";
    return "<h2>Warnings</h2>\n<ul class=\"note\" id=\"warnings\">\n" + items + "</ul>\n";
}

std::string components(const FitReport& report) {
    std::string rows =
        html_row({"component", "rows", "full scale", "fitted rms", "held-out rms", "held-out rms, % of full scale", "sd",
                  "held-out errors within one sd", "held-out rows without estimate"},
                 "th");
    for (std::size_t i = 0; i < report.components.size(); ++i) {
        const ComponentReport& c = report.components[i];
        const ComponentErrors errors = component_errors(report, i);
        const std::string unit = unit_of(c);
        std::string sd = "unknown";
        if (errors.sd_known) {
            sd = html_number(report.calibration.sd[i], unit);
            std::string more;
            if (i < report.calibration.sd_slope.size() && report.calibration.sd_slope[i] != 0)
                more += fmt::format(", {} × |{}|", html_number(report.calibration.sd_slope[i]), html_text(c.name));
            if (i < report.calibration.sd_load.size() && report.calibration.sd_load[i] != 0)
                more += fmt::format(", {} × load", html_number(report.calibration.sd_load[i]));
            if (!more.empty()) sd = fmt::format("hypot({}{})", sd, more);
        }
        rows += html_row({html_text(c.name), html_number(c.rows, 9), html_number(c.full_scale, unit),
                          html_number(c.fitted_rms, unit), html_number(c.held_out_rms, unit),
                          percent(c.held_out_rms / c.full_scale), sd, percent(errors.within(1)),
                          html_number(double(errors.without_estimate), 9)});
    }
    return html_table(rows, "components");
}

std::string methods(const FitReport& report) {
    std::vector<std::string> head{"method"};
    for (const auto& c : report.components)
        head.push_back(fmt::format("held-out rms {}, % of full scale", html_text(c.name)));
    std::string rows = html_row(head, "th");
    for (const auto& method : report.methods) {
        std::vector<std::string> cells{html_text(method.method)};
        for (std::size_t i = 0; method.refused.empty() && i < report.components.size(); ++i)
            cells.push_back(i < method.held_out_rms.size()
                                ? percent(method.held_out_rms[i] / report.components[i].full_scale)
                                : "unknown");
        if (method.refused.empty())
            rows += html_row(cells);
        else
            rows += fmt::format("<tr><td>{}</td><td class=\"text\" colspan=\"{}\">refused: {}</td></tr>\n", cells[0],
                                std::max<std::size_t>(1, report.components.size()), html_text(method.refused));
    }
    std::string text = "<h2>Methods tried</h2>\n" + html_table(rows, "methods");
    if (report.methods.size() > 1)
        text +=
            "<p>The calibration is the one with the least sum of these errors. It was chosen with the rows that are used "
            "here, so its error on new data is a little larger.</p>\n";
    return text;
}

// The mean error of a session is mostly caused by mounting, temperature and drift.
std::string sessions(const FitReport& report) {
    if (report.labelled == nullptr || report.labelled->sessions.size() < 2 || report.held_out.empty()) return "";
    std::string rows = html_row({"session", "component", "rows", "mean error", "rms error"}, "th");
    for (std::size_t s = 0; s < report.labelled->sessions.size(); ++s)
        for (std::size_t i = 0; i < report.components.size(); ++i) {
            const ComponentErrors errors = component_errors(report, i);
            double sum = 0, squares = 0, n = 0;
            for (std::size_t k = 0; k < errors.error.size(); ++k) {
                if (errors.session[k] != s) continue;
                sum += errors.error[k];
                squares += errors.error[k] * errors.error[k];
                ++n;
            }
            if (n == 0) continue;
            const std::string unit = unit_of(report.components[i]);
            rows += html_row({html_text(report.labelled->sessions[s]), html_text(report.components[i].name),
                              html_number(n, 9), html_number(sum / n, unit), html_number(std::sqrt(squares / n), unit)});
        }
    return "<h2>Errors by session</h2>\n<p>Held-out rows. A mean error that differs from session to session is an offset, "
           "for "
           "instance of mounting or temperature; a tare removes the part that is there at no load.</p>\n" +
           html_table(rows, "sessions");
}

std::string crosstalk(const FitReport& report) {
    std::vector<std::string> head{"estimated \\ applied"};
    for (const auto& c : report.components) head.push_back(html_text(c.name));
    std::string rows = html_row(head, "th");
    for (const auto& estimated : report.components) {
        const std::size_t i = component_index(estimated.name);
        rows += "<tr><th>" + html_text(estimated.name) + "</th>";
        for (const auto& applied : report.components) {
            const std::size_t j = component_index(applied.name);
            const double slope = i < 6 && j < 6 ? report.crosstalk[i][j] : kNaN;
            // Full colour at an error of 20 %.
            const double off = std::min(1.0, std::abs(slope - (i == j ? 1 : 0)) / 0.2);
            rows += fmt::format(
                "<td{}>{}</td>",
                std::isfinite(off) ? fmt::format(" style=\"background: rgba(var(--cell), {:.2f})\"", 0.6 * off) : "",
                percent(slope));
        }
        rows += "</tr>\n";
    }
    return "<h2>Crosstalk</h2>\n<p>Slope of each estimated component over each applied one, both in full scales, by least "
           "squares over all applied components of the held-out rows. Perfect: 100 % on the diagonal, 0 % elsewhere. Below "
           "100 % on the diagonal: the load is underestimated. The colour is the distance from perfect, full at 20 "
           "%.</p>\n" +
           html_table(rows, "crosstalk");
}

std::string conditioning(const FitReport& report) {
    const Calibration& c = report.calibration;
    std::string text = fmt::format(
        "<h2>Conditioning and noise</h2>\n<p>Condition number: <span id=\"condition\">{}</span>. It "
        "says how much the solved problem can amplify an error of a channel in the worst case: "
        "1 is best, above 1000 the channels nearly repeat each other.</p>\n",
        c.condition > 0 ? html_number(c.condition) : "unknown");
    bool fits = !c.matrix.empty() && c.matrix.size() == report.components.size();
    for (const auto& m : c.matrix) fits = fits && m.size() == c.channels.size();
    if (!fits) return text + "<p>This method has no matrix from channels to forces, so no noise is computed from it.</p>\n";
    const std::string unit = c.channel_unit.empty() || c.channel_unit == "unknown" ? "channel unit" : c.channel_unit;
    std::string rows = html_row({"component", fmt::format("its noise at 1 {} of noise in each channel", html_text(unit)),
                                 "noise for 1 % of full scale"},
                                "th");
    for (std::size_t i = 0; i < c.matrix.size(); ++i) {
        double norm = 0;
        for (const double m : c.matrix[i]) norm = std::hypot(norm, m);
        const ComponentReport& component = report.components[i];
        rows += html_row({html_text(component.name), html_number(norm, unit_of(component)),
                          html_number(0.01 * component.full_scale / norm, unit)});
    }
    text +=
        "<p>If every channel has independent noise of the same sd, a component has that sd times the norm of its row of "
        "the matrix: the middle column is its sd at one unit, the right one the channels' sd that costs 1 % of full "
        "scale.";
    if (!c.tables.empty()) text += " This is the linear part only; the method's correction adds to it.";
    return text + "</p>\n" + html_table(rows, "noise");
}

std::string domain(const FitReport& report) {
    const Calibration& c = report.calibration;
    std::string rows = html_row({"channel", "zero", "least", "greatest"}, "th");
    for (std::size_t k = 0; k < c.channels.size(); ++k)
        rows += html_row({html_text(c.channels[k]), k < c.zero.size() ? html_number(c.zero[k], 6) : "unknown",
                          k < c.channel_least.size() ? html_number(c.channel_least[k], 6) : "unknown",
                          k < c.channel_most.size() ? html_number(c.channel_most[k], 6) : "unknown"});
    std::string text = fmt::format(
                           "<h2>Channels</h2>\n<p>In {}. Zero: what the calibration takes as no load. A reading more "
                           "than {:g} % of the width beyond least or greatest is marked as outside of the "
                           "domain.</p>\n",
                           or_unknown(c.channel_unit) == "unknown" ? "the unit of the recording" : html_text(c.channel_unit),
                           100 * kDomainMargin) +
                       html_table(rows, "channels");
    if (c.parameters.empty()) return text;
    rows = html_row({"parameter", "value"}, "th");
    for (const auto& [name, value] : c.parameters) rows += html_row({html_text(name), html_number(value, 6)});
    return text + "<h2>Parameters</h2>\n" + html_table(rows, "parameters");
}

std::string damage(const Calibration& calibration) {
    const UndetectedDamage& damage = calibration.undetected_damage;
    if (!damage.is_known()) return "";
    std::vector<std::string> head{"channel"};
    for (const DamageKind& kind : kDamageKinds) head.emplace_back(kind.text);
    std::string rows = html_row(head, "th");
    const auto add = [&](const std::string& name, const auto& share_of) {
        std::vector<std::string> cells{html_text(name)};
        for (std::size_t kind = 0; kind < kDamageKinds.size(); ++kind) cells.push_back(percent(share_of(kind)));
        rows += html_row(cells);
    };
    for (std::size_t k = 0; k < calibration.channels.size(); ++k)
        add(calibration.channels[k], [&](std::size_t kind) { return damage.share[kind][k]; });
    add("mean", [&](std::size_t kind) { return damage.mean(kind); });
    return "<h2>Undetected damage of a channel</h2>\n<p>Share of the readings that stay GOOD although the damage moves a "
           "component by more than 10 % of full scale: the other channels do not contradict them. A channel is exchanged "
           "with each of the others in turn, drawn for each reading.</p>\n" +
           html_table(rows, "damage");
}

constexpr const char* kHowToRead = R"(<h2>How to read the numbers</h2>
<ul>
<li>Forces are in N and torques in Nm, in the sensor's frame; a press has negative fz.</li>
<li>Full scale is the greatest load of the component in the recording, not what the sensor survives.</li>
<li>Fitted rms is the error on the rows that made the calibration. It flatters; do not quote it as accuracy.</li>
<li>Held-out rms is the error on rows that a fit without their group (see "validated by") had not seen. Quote this one, with
the way of validation. With one session it does not contain mounting the sensor again, another day or another temperature.</li>
<li>The reference's own error is part of every error here.</li>
<li>sd is the standard deviation that the calibration states for an estimate: the root mean square of the held-out errors, and
at least that of the worst session. Of normal errors 68 % are within one sd. The shares are counted on the same
rows, so they check that the statement holds, not that it would hold on other data.</li>
<li>Held-out rows without estimate are labelled rows where the model gave no number (BAD). They are in no rms.</li>
<li>Where the loads have gaps, the calibration has not been tested there.</li>
</ul>
)";

}  // namespace

std::string html_report(const FitReport& report, const std::string& title, const CertificateFigures* certificate) {
    std::string page = header(report) + warnings(report);
    page += "<h2>Components</h2>\n" + components(report) + methods(report);
    for (std::size_t i = 0; i < report.components.size(); ++i)
        page += "<h2>" + html_text(report.components[i].name) + "</h2>\n" + html_component_plots(report, i);
    page += html_within(report) + sessions(report) + html_zeros(report) + html_loading(report) + crosstalk(report);
    if (certificate != nullptr) page += html_certificate(*certificate);
    page += "<h2>Coverage of the loads</h2>\n<p>The loads of the labelled rows that have all channels.</p>\n" +
            html_coverage(report);
    return html_page(title, page + conditioning(report) + domain(report) + damage(report.calibration) + kHowToRead);
}

}  // namespace tactiled
