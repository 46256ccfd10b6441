#include "decoupling/fit/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "decoupling/domain.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/table_signs.hpp"

namespace tactiled {
namespace {

constexpr std::pair<std::string_view, FitModel> kFits[] = {{"generic", fit_generic}, {"table", fit_table}};

constexpr std::size_t kRowsPerCoefficient = 3;  // fewer describe the noise
constexpr double kIllConditioned = 1000;        // 0.1 % of noise in a channel becomes 100 % of a coefficient
constexpr double kHardlyIndependent = 0.05;     // of the labels: correlated to more than 0.995
constexpr double kNotIndependent = 1e-3;        // ... to more than 0.999998: computed from each other

// Keeps the columns `kept` of every row.
Labelled with_channels(const Labelled& labelled, const std::vector<std::size_t>& kept) {
    Labelled result = labelled;
    result.channels.clear();
    for (const std::size_t k : kept) result.channels.push_back(labelled.channels[k]);
    for (auto& row : result.rows) {
        std::vector<double> channel;
        for (const std::size_t k : kept) channel.push_back(row.channel[k]);
        row.channel = std::move(channel);
    }
    return result;
}

bool has_label(const LabelledRow& row) {
    return std::any_of(row.wrench_S.begin(), row.wrench_S.end(), [](double value) { return std::isfinite(value); });
}

// Without the channels that say nothing: those that the model does not know, and those that never change.
Labelled with_useful_channels(const Labelled& labelled, const std::string& model, std::vector<std::string>& warnings) {
    std::vector<std::size_t> kept;
    for (std::size_t k = 0; k < labelled.channels.size(); ++k) {
        const std::string& name = labelled.channels[k];
        if (model == "table" && !table_gauge(name)) {
            warnings.push_back(fmt::format("channel {} is no gauge of model \"table\" (R1 .. R8): left out", name));
            continue;
        }
        double least = std::numeric_limits<double>::infinity(), most = -least;
        for (const auto& row : labelled.rows) {
            if (!has_label(row) || std::isnan(row.channel[k])) continue;
            least = std::min(least, row.channel[k]);
            most = std::max(most, row.channel[k]);
        }
        if (least < most) {
            kept.push_back(k);
        } else {
            const std::string what = least > most ? "has no value" : fmt::format("is always {}", least);
            if (model == "table") throw Undetermined(fmt::format("gauge {} {} in the labelled rows", name, what));
            warnings.push_back(fmt::format("channel {} {} in the labelled rows: left out", name, what));
        }
    }
    if (kept.empty())
        throw Undetermined(model == "table" ? "no column is a gauge of model \"table\" (R1 .. R8)"
                                            : "no channel changes in the labelled rows");
    return with_channels(labelled, kept);
}

// The labels of the components must vary, and not only together. Fills the report's part about labels.
void check_labels(const Rows& rows, FitReport& report) {
    for (auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        double sum = 0, squares = 0, least = std::numeric_limits<double>::infinity(), most = -least;
        for (const auto* row : rows) {
            const double label = row->wrench_S[c];
            if (std::isnan(label)) continue;
            ++component.rows;
            sum += label;
            least = std::min(least, label);
            most = std::max(most, label);
            component.full_scale = std::max(component.full_scale, std::abs(label));
        }
        if (component.rows == 0) throw Undetermined(fmt::format("no row with {} has all channels", label_column(c)));
        if (!(least < most))
            throw Undetermined(fmt::format("{} is always {}: load the sensor along this axis too, or leave the column out",
                                           label_column(c), least));
        for (const auto* row : rows)
            if (!std::isnan(row->wrench_S[c])) squares += std::pow(row->wrench_S[c] - sum / component.rows, 2);
        component.spread = std::sqrt(squares / component.rows);
    }
    std::vector<Eigen::RowVectorXd> whole;
    const auto n = Eigen::Index(report.components.size());
    for (const auto* row : rows) {
        Eigen::RowVectorXd labels(n);
        for (Eigen::Index i = 0; i < n; ++i)
            labels[i] = row->wrench_S[component_index(report.components[std::size_t(i)].name)];
        if (labels.allFinite()) whole.push_back(labels);
    }
    if (n < 2 || whole.size() < 2) return;
    Eigen::MatrixXd labels(Eigen::Index(whole.size()), n);
    for (std::size_t i = 0; i < whole.size(); ++i) labels.row(Eigen::Index(i)) = whole[i];
    const Eigen::RowVectorXd centre = labels.colwise().mean();
    labels.rowwise() -= centre;
    for (Eigen::Index i = 0; i < n; ++i) {
        const double length = labels.col(i).norm();
        if (length > 0) labels.col(i) /= length;  // 0: constant where all are known; the singular value below says so
    }
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(labels.transpose() * labels, Eigen::ComputeFullV);  // squares: of length 1
    const double ratio = std::sqrt(std::max(0.0, svd.singularValues()[n - 1]) / svd.singularValues()[0]);
    if (ratio > kHardlyIndependent) return;
    std::string together;
    for (Eigen::Index i = 0; i < n; ++i)
        if (std::abs(svd.matrixV()(i, n - 1)) > 0.1)
            together += (together.empty() ? "" : " ") + report.components[std::size_t(i)].name;
    if (ratio < kNotIndependent)
        throw Undetermined(
            fmt::format("the labels of {} follow from each other: load the axes independently, or leave one out", together));
    report.warnings.push_back(
        fmt::format("the labels of {} hardly vary independently of each other: they are told apart badly", together));
}

}  // namespace

FitReport fit(const Labelled& all, const FitRequest& request) {
    const auto* entry = find_decoupler(request.model);
    const auto* const at =
        std::find_if(std::begin(kFits), std::end(kFits), [&](const auto& known) { return known.first == request.model; });
    if (entry == nullptr || at == std::end(kFits)) {
        const auto near = nearest_name(request.model, decoupler_names());
        throw SetupError(fmt::format("model \"{}\" is unknown; {}", request.model,
                                     near ? fmt::format("did you mean \"{}\"?", *near)
                                          : fmt::format("known are {}", fmt::join(decoupler_names(), " "))));
    }
    const FitModel fit_model = at->second;
    FitReport report;
    Calibration& calibration = report.calibration;
    calibration.model = request.model;
    calibration.method = request.method.empty() ? entry->methods.front() : request.method;
    if (std::find(entry->methods.begin(), entry->methods.end(), calibration.method) == entry->methods.end())
        throw SetupError(fmt::format("model \"{}\" has no method \"{}\"; it has {}", request.model, calibration.method,
                                     fmt::join(entry->methods, " ")));
    calibration.serial = request.serial;
    calibration.contact_model = request.contact_model;
    calibration.channel_unit = request.channel_unit;
    calibration.date = request.date;

    const Labelled labelled = with_useful_channels(all, request.model, report.warnings);
    calibration.channels = labelled.channels;
    Rows rows;
    std::array<bool, 6> labelled_at_all{};
    for (const auto& row : labelled.rows) {
        ++report.rows_read;
        if (!has_label(row)) {
            ++report.rows_without_label;
            continue;
        }
        for (std::size_t c = 0; c < labelled_at_all.size(); ++c)
            labelled_at_all[c] = labelled_at_all[c] || std::isfinite(row.wrench_S[c]);
        if (std::any_of(row.channel.begin(), row.channel.end(), [](double value) { return std::isnan(value); }))
            ++report.rows_missing_channel;
        else
            rows.push_back(&row);
    }
    for (std::size_t c = 0; c < labelled_at_all.size(); ++c) {
        if (!labelled_at_all[c]) continue;
        calibration.components.emplace_back(kComponentNames[c]);
        report.components.push_back({.name = kComponentNames[c]});
    }
    if (rows.empty()) throw Undetermined("no row has a label and all channels");
    if (report.rows_missing_channel > 0)
        report.warnings.push_back(fmt::format("{} labelled rows lack a channel: left out", report.rows_missing_channel));
    check_labels(rows, report);
    const std::size_t coefficients = calibration.channels.size() + 1;
    for (const auto& component : report.components)
        if (std::size_t(component.rows) < kRowsPerCoefficient * coefficients)
            throw Undetermined(fmt::format("{} rows with {} for {} coefficients; at least {} are needed", component.rows,
                                           component.name, coefficients, kRowsPerCoefficient * coefficients));

    fit_model(rows, calibration, report.warnings);
    if (calibration.condition > kIllConditioned)
        report.warnings.push_back(fmt::format(
            "condition number {:.2g}: the channels nearly repeat each other, noise is amplified", calibration.condition));
    calibration.rows = int(rows.size());
    const std::size_t n = calibration.channels.size();
    calibration.channel_least.assign(n, std::numeric_limits<double>::infinity());
    calibration.channel_most.assign(n, -std::numeric_limits<double>::infinity());
    for (const auto* row : rows)
        for (std::size_t k = 0; k < n; ++k) {
            calibration.channel_least[k] = std::min(calibration.channel_least[k], row->channel[k]);
            calibration.channel_most[k] = std::max(calibration.channel_most[k], row->channel[k]);
        }
    for (const auto& component : report.components) calibration.full_scale.push_back(component.full_scale);

    const Wrench fitted = rms_error(calibration, rows);
    const Wrench held_out = held_out_rms(labelled, rows, fit_model, report);
    for (auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        component.fitted_rms = fitted[c];
        component.held_out_rms = held_out[c];
        if (held_out[c] >= component.spread)
            report.warnings.push_back(
                fmt::format("{}: held-out error {:.3g} is no smaller than the spread {:.3g} of its labels: these "
                            "channels do not tell {}, or a part that was left out alone loads this axis",
                            component.name, held_out[c], component.spread, component.name));
        if (std::isfinite(held_out[c])) calibration.sd.push_back(held_out[c]);
    }
    if (calibration.sd.size() != report.components.size()) calibration.sd.clear();
    report_outliers(labelled, rows, report);
    return report;
}

}  // namespace tactiled
