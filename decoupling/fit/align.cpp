#include "decoupling/fit/align.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/align_search.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kEnoughRows = 30;  // fewer do not distinguish offsets
constexpr std::size_t kCoarseRows = 500, kFineRows = 5000;
constexpr double kMinExplained = 0.5;  // part of the labels' variance: below, most of the labels are something else
// The part that the channels explain at half of the offsets stays below this, relative to the best offset. Loads that circle
// are a linear function of the channels at any offset, and each offset turns their axes otherwise.
constexpr double kTypical = 0.5;
constexpr double kFalseOffsets = 0.01;  // probability that some wrong offset seems better

[[noreturn]] void refuse(const LabelledTable& table, const LabelledTable& labels, const std::string& text) {
    throw SetupError(fmt::format("{}: its labels cannot be aligned with {}: {}", labels.name, table.name, text));
}

}  // namespace

LabelledTable read_label_file(const std::string& path) {
    LabelledTable labels = read_labelled_table(path, {.sessions = {}, .channels = {}, .only_labels = true});
    const auto has = [&](ColumnKind kind) {
        return std::any_of(labels.columns.begin(), labels.columns.end(),
                           [&](const Column& column) { return column.kind == kind; });
    };
    if (!has(ColumnKind::time))
        labels.faults.push_back(labels.name + ": no time; labels of another file are aligned by time");
    if (!has(ColumnKind::label))
        labels.faults.push_back(labels.name + ": no label; name at least one column fx_N fy_N fz_N mx_Nm my_Nm or mz_Nm");
    return labels;
}

std::string align_labels(const LabelledTable& table, const LabelledTable& labels, Labelled& labelled) {
    const auto first = std::find_if(table.t_ns.begin(), table.t_ns.end(), [](const auto& t) { return t.has_value(); });
    const auto first_label =
        std::find_if(labels.t_ns.begin(), labels.t_ns.end(), [](const auto& t) { return t.has_value(); });
    if (first == table.t_ns.end()) refuse(table, labels, "the file of the channels has no times");
    if (first_label == labels.t_ns.end()) refuse(table, labels, "the file of the labels has no times");
    const TimedReadings few(table, labelled, **first, kCoarseRows), many(table, labelled, **first, kFineRows);
    const LabelSeries series(labels, **first_label);
    if (few.t_s.size() < kEnoughRows || series.t_s.size() < kEnoughRows)
        refuse(table, labels, fmt::format("fewer than {} rows with a time", kEnoughRows));
    if (!(median_step(many.t_s) > 0 && median_step(series.t_s) > 0))
        refuse(table, labels, "the times of one file do not rise");
    const OffsetGrid coarse = coarse_search(few, series);
    if (coarse.rest.empty()) refuse(table, labels, "the times of one file do not rise");
    const std::size_t best = coarse.best();
    const auto rest_at = [&](double d) {
        const double rest = fit_at(many, series, d).rest;
        return std::isfinite(rest) ? rest : 1;
    };
    const double width_s = 2 * coarse.step_s;
    const double offset_s = minimum(rest_at, coarse.offset_s(best), width_s, 1e-4 * coarse.step_s);
    const OffsetFit fitted = fit_at(many, series, offset_s);
    if (!(fitted.rest < 1 - kMinExplained))
        refuse(table, labels,
               fmt::format("at no offset of the clocks do the channels follow the labels; at the best one they explain "
                           "{:.0f} % of them",
                           100 * (1 - std::min(1.0, std::isfinite(fitted.rest) ? fitted.rest : 1.0))));
    // The difference of two log-likelihoods against the number of offsets that could have been better by chance.
    const double length_s = many.t_s.back() - many.t_s.front();
    const OffsetPeak peak = peak_of(coarse, length_s);
    const double zero_s = double(**first_label - **first) * 1e-9;  // between the origins of both clocks
    const double evidence = peak.pieces / 2 * std::log(peak.other_rest / coarse.rest[best]);
    if (!(1 - peak.typical_rest < kTypical * (1 - coarse.rest[best])))
        refuse(
            table, labels,
            "at most other offsets the channels follow the labels nearly as well, as with loads that repeat; record loads "
            "that do not");
    if (!(evidence >= std::log(double(coarse.rest.size()) / kFalseOffsets)))
        refuse(
            table, labels,
            fmt::format("offsets of {:.4g} s and {:.4g} s fit nearly as well; record longer, with loads that do not repeat",
                        offset_s + zero_s, peak.other_s + zero_s));
    const std::vector<double> parts =
        offsets_of_parts(many, series, fitted, offset_s, std::max(width_s, 4 * median_step(many.t_s)));
    if (parts.size() < 3) refuse(table, labels, "fewer than three fifths of the rows have loads that determine the offset");
    double mean = 0, square = 0;
    for (const double d : parts) mean += d / double(parts.size());
    for (const double d : parts) square += (d - mean) * (d - mean) / double(parts.size() - 1);
    const double scatter_s = std::sqrt(square);
    if (!(scatter_s * growth_per_s(many, series, fitted, offset_s) <= 1))
        refuse(table, labels,
               fmt::format(
                   "the offset differs by {:.3g} s between parts of the recording, as if one clock was faster; record both "
                   "with one clock",
                   scatter_s));
    std::size_t found = 0;
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        if (!table.t_ns[i]) continue;
        Eigen::RowVectorXd label(series.components());
        if (!series.at(double(*table.t_ns[i] - **first) * 1e-9 + offset_s, label)) continue;
        ++found;
        for (Eigen::Index c = 0; c < label.size(); ++c)
            labelled.rows[i].wrench_S[series.component[std::size_t(c)]] = label[c];
    }
    return fmt::format(
        "labels by time: their clock is that of the channels {} {:.4f} s (sd {:.2g} s); {} of {} rows have labels\n",
        offset_s + zero_s < 0 ? "-" : "+", std::abs(offset_s + zero_s), scatter_s / std::sqrt(double(parts.size())), found,
        labelled.rows.size());
}

}  // namespace tactiled
