#include "decoupling/fit/labels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kHardlyIndependent = 0.05;  // independent part of a label: correlated to more than 0.995
constexpr double kNotIndependent = 1e-3;     // the same: correlated to more than 0.999998, so computed from each other
constexpr double kLargestChannel = 1e100;    // the squares of their sums must be finite; its inverse is the minimum width
constexpr double kLargestLoad = 1e12;        // N or Nm; its inverse is the minimum full scale
constexpr double kNoPress = 0.02;            // relative to the largest pull
// Distance of a mark for a missing value over the range of all other labels; the second if it consists of nines.
constexpr double kMarkBeyond = 15, kNinesBeyond = 2;
constexpr double kRelated = 0.5;          // correlation of a channel with a label
constexpr double kAsFar = 2.5;            // ratio of a label to the load that such a channel shows
constexpr double kUsual[] = {1000, 100};  // N, Nm: more is rare in a gripper, and usual for grams or mN
constexpr double kLongArm_m = 1;          // a moment over a force

// 99, 999, -9999 ...
bool is_nines(double label) {
    const double next = std::abs(label) + 1, power = std::round(std::log10(next));
    return power >= 2 && next == std::pow(10, power);
}

// Returns true if in each row with the label `mark` a channel is as far from its values in the other rows as under such a
// load. Counts only channels that change with the label in the other rows and that do not have the mark themselves.
bool channels_follow(const Rows& rows, std::size_t c, double mark) {
    Rows others, marked;
    for (const auto* row : rows)
        if (std::isfinite(row->wrench_S[c])) (row->wrench_S[c] == mark ? marked : others).push_back(row);
    std::vector<bool> follows(marked.size());
    for (std::size_t k = 0; k < rows.front()->channel.size(); ++k) {
        const double n = double(others.size());
        double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
        for (const auto* row : others) x += row->channel[k] / n, y += row->wrench_S[c] / n;
        for (const auto* row : others) {
            const double dx = row->channel[k] - x, dy = row->wrench_S[c] - y;
            xx += dx * dx, yy += dy * dy, xy += dx * dy;
        }
        if (!(std::abs(xy) > kRelated * std::sqrt(xx * yy))) continue;
        const double slope = std::copysign(std::sqrt(yy / xx), xy);
        for (std::size_t i = 0; i < marked.size(); ++i) {
            const double reading = marked[i]->channel[k], expected = y + slope * (reading - x);
            if (reading != mark && expected / mark > 1 / kAsFar && expected / mark < kAsFar) follows[i] = true;
        }
    }
    return std::find(follows.begin(), follows.end(), false) == follows.end();
}

// Refuses a label that several rows have exactly, or that consists of nines, far from all other labels, although no channel
// is far from the others: a mark for a missing value.
void refuse_mark(const Labelled& labelled, const Rows& rows, std::size_t c) {
    const LabelledRow *least = nullptr, *greatest = nullptr;
    for (const auto* row : rows) {
        if (std::isnan(row->wrench_S[c])) continue;
        if (least == nullptr || row->wrench_S[c] < least->wrench_S[c]) least = row;
        if (greatest == nullptr || row->wrench_S[c] > greatest->wrench_S[c]) greatest = row;
    }
    for (const LabelledRow* first : {least, greatest}) {
        if (first == nullptr) continue;
        const double mark = first->wrench_S[c];
        double min = 0, max = 0;
        std::size_t n = 0, others = 0;
        for (const auto* row : rows) {
            const double label = row->wrench_S[c];
            if (std::isnan(label)) continue;
            label == mark ? ++n : ++others;
            if (label != mark) min = std::min(min, label), max = std::max(max, label);
        }
        const double beyond = is_nines(mark) ? kNinesBeyond : kMarkBeyond;
        if ((n < 2 && !is_nines(mark)) || others < 3 || !(max > min) ||
            std::max(mark - max, min - mark) <= beyond * (max - min) || channels_follow(rows, c, mark))
            continue;
        throw Undetermined(
            fmt::format("{}:{}: {} is {:.5g} there and in {} other rows, elsewhere {:.4g} to {:.4g}: a mark "
                        "for a missing value? Leave such cells empty",
                        labelled.name, first->line, label_column(c), mark, n - 1, min, max));
    }
}

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

}  // namespace

Wrench full_scales(const Rows& rows) {
    Wrench full_scale{};
    for (const auto* row : rows)
        for (std::size_t c = 0; c < full_scale.size(); ++c)
            if (std::abs(row->wrench_S[c]) > full_scale[c]) full_scale[c] = std::abs(row->wrench_S[c]);
    return full_scale;
}

bool has_label(const LabelledRow& row) {
    return std::any_of(row.wrench_S.begin(), row.wrench_S.end(), [](double value) { return std::isfinite(value); });
}

bool is_same_label(const Wrench& a, const Wrench& b) {
    for (std::size_t c = 0; c < a.size(); ++c)
        if (a[c] != b[c] && !(std::isnan(a[c]) && std::isnan(b[c]))) return false;
    return true;
}

Rows rows_with(const Rows& rows, const std::vector<std::size_t>& components) {
    Rows whole;
    for (const auto* row : rows)
        if (std::all_of(components.begin(), components.end(),
                        [&](std::size_t c) { return std::isfinite(row->wrench_S[c]); }))
            whole.push_back(row);
    return whole;
}

std::vector<std::size_t> component_indices(const std::vector<std::string>& names) {
    std::vector<std::size_t> indices;
    for (const auto& name : names) indices.push_back(component_index(name));
    return indices;
}

Eigen::MatrixXd channels_of(const Rows& rows) {
    const auto n = Eigen::Index(rows.front()->channel.size());
    Eigen::MatrixXd channels(Eigen::Index(rows.size()), n);
    for (std::size_t i = 0; i < rows.size(); ++i)
        channels.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVectorXd>(rows[i]->channel.data(), n);
    return channels;
}

Eigen::MatrixXd labels_of(const Rows& rows, const std::vector<std::size_t>& components) {
    Eigen::MatrixXd labels(Eigen::Index(rows.size()), Eigen::Index(components.size()));
    for (std::size_t i = 0; i < rows.size(); ++i)
        for (std::size_t c = 0; c < components.size(); ++c)
            labels(Eigen::Index(i), Eigen::Index(c)) = rows[i]->wrench_S[components[c]];
    return labels;
}

Labelled with_useful_channels(const Labelled& labelled, const FitEntry& method, std::vector<std::string>& warnings) {
    std::vector<std::size_t> kept;
    for (std::size_t k = 0; k < labelled.channels.size(); ++k) {
        const std::string& name = labelled.channels[k];
        if (method.channels.includes != nullptr && !method.channels.includes(name)) {
            const std::string_view what = method.channels.description;
            const std::size_t article = what.find(' ') + 1;  // length of "a " or "an "
            warnings.push_back(fmt::format("channel {} is no {}: left out", name, what.substr(article)));
            continue;
        }
        double min = std::numeric_limits<double>::infinity(), max = -min;
        for (const auto& row : labelled.rows) {
            if (!has_label(row) || std::isnan(row.channel[k])) continue;
            min = std::min(min, row.channel[k]);
            max = std::max(max, row.channel[k]);
        }
        if (min < max) {
            kept.push_back(k);
        } else {
            const std::string what = min > max ? "has no value" : fmt::format("is always {}", min);
            if (method.channels.includes != nullptr)
                throw Undetermined(fmt::format("channel {} {} in the labelled rows", name, what));
            warnings.push_back(fmt::format("channel {} {} in the labelled rows: left out", name, what));
        }
    }
    if (kept.empty())
        throw Undetermined(method.channels.includes != nullptr
                               ? fmt::format("no column is {}", method.channels.description)
                               : "no channel changes in the labelled rows: is it connected, and was it loaded?");
    return with_channels(labelled, kept);
}

void check_numbers(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings) {
    for (std::size_t k = 0; k < labelled.channels.size(); ++k) {
        double min = std::numeric_limits<double>::infinity(), max = -min;
        for (const auto* row : rows) {
            min = std::min(min, row->channel[k]);
            max = std::max(max, row->channel[k]);
            if (std::abs(row->channel[k]) > kLargestChannel)
                throw Undetermined(
                    fmt::format("{}:{}: channel {} is {:.3g}; no reading is beyond {:.0g}: is the column damaged?",
                                labelled.name, row->line, labelled.channels[k], row->channel[k], kLargestChannel));
        }
        if (max - min < 1 / kLargestChannel && max > min)
            throw Undetermined(
                fmt::format("channel {} changes by {:.2g} only: give it in a larger unit", labelled.channels[k], max - min));
    }
    for (std::size_t c = 0; c < 6; ++c) {
        double full_scale = 0;
        for (const auto* row : rows) {
            const double label = std::abs(row->wrench_S[c]);
            if (label > kLargestLoad)
                throw Undetermined(fmt::format("{}:{}: {} is {:.3g}; labels are in {}", labelled.name, row->line,
                                               label_column(c), row->wrench_S[c], c < 3 ? "N" : "Nm"));
            if (label > full_scale) full_scale = label;
        }
        if (full_scale > 0 && full_scale < 1 / kLargestLoad)
            throw Undetermined(fmt::format("{} is {:.2g} at most, which no reference measures; labels are in {}",
                                           label_column(c), full_scale, c < 3 ? "N" : "Nm"));
        refuse_mark(labelled, rows, c);
        if (full_scale > kUsual[c / 3])
            warnings.push_back(fmt::format("{} reaches {:.4g}: labels are in {}; are these {}?", label_column(c), full_scale,
                                           c < 3 ? "N" : "Nm", c < 3 ? "grams or mN" : "Nmm"));
    }
    const Wrench full_scale = full_scales(rows);
    const double force = std::max({full_scale[0], full_scale[1], full_scale[2]});
    const double moment = std::max({full_scale[3], full_scale[4], full_scale[5]});
    if (force > 0 && moment > kLongArm_m * force)
        warnings.push_back(
            fmt::format("the greatest moment is the greatest force with an arm of {:.3g} m: are the moments in Nmm, or the "
                        "forces in kN?",
                        moment / force));
}

std::string press_without_sign(const Rows& rows) {
    double max = 0, presses = 0;
    std::vector<double> labels;
    for (const auto* row : rows)
        if (!std::isnan(row->wrench_S[2])) labels.push_back(row->wrench_S[2]);
    if (labels.empty()) return "";
    std::sort(labels.begin(), labels.end());
    const double min = labels.front();
    max = labels.back();
    // A few mistyped labels do not determine the direction: up to 1 % of the labels are skipped.
    const std::size_t some = std::max<std::size_t>(1, labels.size() / 100);
    presses = labels[some - 1];
    if (!(max > 0) || presses < -kNoPress * labels[labels.size() - some]) return "";
    return fmt::format(
        "fz_N is never negative ({:.3g} to {:.3g} N), as if the sensor was only pulled: a press on it has fz < 0. "
        "If these are presses, change their sign",
        min, max);
}

void check_labels(const Rows& rows, FitReport& report) {
    for (auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        component = {.name = component.name};
        double sum = 0, squares = 0, min = std::numeric_limits<double>::infinity(), max = -min;
        for (const auto* row : rows) {
            const double label = row->wrench_S[c];
            if (std::isnan(label)) continue;
            ++component.rows;
            sum += label;
            min = std::min(min, label);
            max = std::max(max, label);
            component.full_scale = std::max(component.full_scale, std::abs(label));
        }
        if (component.rows == 0) throw Undetermined(fmt::format("no row with {} has all channels", label_column(c)));
        if (!(min < max))
            throw Undetermined(fmt::format("{} is always {}: load the sensor along this axis too, or leave the column out",
                                           label_column(c), min));
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
        // 0: constant where all labels are present; the singular value below detects that
        if (length > 0) labels.col(i) /= length;
    }
    // squares of them, for columns of length 1
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(labels.transpose() * labels, Eigen::ComputeFullV);
    const double ratio = std::sqrt(std::max(0.0, svd.singularValues()[n - 1]) / svd.singularValues()[0]);
    if (ratio > kHardlyIndependent) return;
    std::string together;
    for (Eigen::Index i = 0; i < n; ++i)
        if (std::abs(svd.matrixV()(i, n - 1)) > 0.1)
            together += (together.empty() ? "" : " ") + report.components[std::size_t(i)].name;
    if (ratio < kNotIndependent)
        throw Undetermined(
            fmt::format("the labels of {} follow from each other: load the axes independently, or leave one out", together));
    const std::string warning =
        fmt::format("the labels of {} hardly vary independently of each other: their parts are determined badly", together);
    if (std::find(report.warnings.begin(), report.warnings.end(), warning) == report.warnings.end())
        report.warnings.push_back(warning);
}

std::size_t independent_rows(const Rows& rows, std::size_t c) {
    std::size_t n = 0;
    const Wrench* last = nullptr;
    for (const auto* row : rows) {
        if (std::isnan(row->wrench_S[c])) continue;
        n += last == nullptr || !is_same_label(*last, row->wrench_S) ? 1 : 0;
        last = &row->wrench_S;
    }
    return n;
}

}  // namespace tactiled
