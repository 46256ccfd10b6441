#include "decoupling/fit/labelled.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "config/names.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/fit/align.hpp"
#include "decoupling/fit/labelled_table.hpp"

namespace tactiled {
namespace {

// The columns of the channels, in the order of the user or of the file.
std::vector<std::size_t> channel_columns(const LabelledTable& table, const Selection& selection) {
    std::vector<std::size_t> result;
    for (std::size_t k = 0; k < table.columns.size(); ++k)
        if (table.columns[k].kind == ColumnKind::channel) result.push_back(k);
    const auto place = [&](std::size_t k) {
        const auto& chosen = selection.channels;
        return std::find_if(chosen.begin(), chosen.end(), [&](const std::string& name) {
            return name == table.columns[k].name || name == channel_name(table.columns[k].name);
        });
    };
    if (!selection.channels.empty())
        std::sort(result.begin(), result.end(), [&](std::size_t a, std::size_t b) { return place(a) < place(b); });
    return result;
}

bool has_labels(const LabelledTable& table) {
    return std::any_of(table.columns.begin(), table.columns.end(),
                       [](const Column& column) { return column.kind == ColumnKind::label; });
}

void check_unknown(LabelledTable& table, const std::vector<std::size_t>& channels) {
    std::vector<std::string> unknown, names, noted;
    for (const Column& column : table.columns) {
        if (column.kind == ColumnKind::channel) names.push_back(column.name);
        if (column.kind != ColumnKind::unknown) continue;
        unknown.push_back(column.note.empty() ? column.name : fmt::format("{} ({})", column.name, column.note));
    }
    if (unknown.empty()) return;
    const bool has_families = std::any_of(table.faults.begin(), table.faults.end(), [](const auto& fault) {
        return fault.find("choose with --channels") != fault.npos;
    });
    if (has_families) return;
    table.faults.push_back(fmt::format("{}: is it a channel or not: {}? Name the channels: --channels {}", table.name,
                                       fmt::join(unknown, ", "),
                                       channels.empty() ? "A,B,C" : fmt::format("{}", fmt::join(names, ","))));
}

void check_channels(LabelledTable& table, const std::vector<std::size_t>& channels, bool has_unknown) {
    const auto add = [&](const std::string& text) { table.faults.push_back(table.name + ": " + text); };
    if (channels.empty() && !has_unknown && table.faults.empty())
        add("no channel beside times, sessions and labels: its columns are named as R1 R2 or Bx By Bz, or choose with "
            "--channels");
    if (channels.size() > kMaxChannels)
        add(fmt::format("{} channels; a sensor has at most {}: choose with --channels", channels.size(), kMaxChannels));
    std::vector<std::string> bad, seen;
    for (const std::size_t k : channels) {
        const std::string name = channel_name(table.columns[k].name);
        if (!valid_channel(name)) bad.push_back(table.columns[k].name);
        if (std::find(seen.begin(), seen.end(), name) != seen.end())
            add(fmt::format("two channels would be called {}; rename one", name));
        seen.push_back(name);
    }
    if (!bad.empty())
        add(fmt::format("a calibration cannot hold the names {}: {}; rename them, for example C1 C2", short_list(bad),
                        kValidChannel));
}

// 0 means unknown, so that negative times are all moved by the same amount.
void set_times(const LabelledTable& table, std::vector<LabelledRow>& rows) {
    std::int64_t earliest_ns = 0;
    for (const auto& t_ns : table.t_ns)
        if (t_ns) earliest_ns = std::min(earliest_ns, *t_ns);
    constexpr std::int64_t kSecond_ns = 1'000'000'000;
    const std::int64_t origin_ns = earliest_ns < 0 ? (earliest_ns / kSecond_ns - 2) * kSecond_ns : 0;
    for (std::size_t i = 0; i < rows.size(); ++i)
        if (table.t_ns[i] && *table.t_ns[i] > origin_ns) rows[i].t_ns = std::uint64_t(*table.t_ns[i] - origin_ns);
}

}  // namespace

std::string label_column(std::size_t c) { return fmt::format("{}_{}", kComponentNames[c], c < 3 ? "N" : "Nm"); }

Labelled read_labelled(const std::string& path, const Selection& selection) {
    LabelledTable table = read_labelled_table(path, selection);
    const std::vector<std::size_t> channel = channel_columns(table, selection);
    // A model that knows its channels by their names takes no other column.
    const bool are_known = selection.known != nullptr && !channel.empty();
    if (selection.channels.empty() && !are_known) check_unknown(table, channel);
    const bool has_unknown = std::any_of(table.columns.begin(), table.columns.end(),
                                         [](const Column& column) { return column.kind == ColumnKind::unknown; });
    check_channels(table, channel, has_unknown);
    Labelled labelled;
    labelled.name = table.name;
    labelled.sessions = table.sessions;
    for (const std::size_t k : channel) labelled.channels.push_back(channel_name(table.columns[k].name));
    if (selection.labels.empty() && !has_labels(table))
        table.faults.push_back(
            table.name +
            ": no label; name at least one column fx_N fy_N fz_N mx_Nm my_Nm or mz_Nm, or give their file: "
            "--labels");
    for (std::size_t i = 0; i < table.rows(); ++i) {
        LabelledRow row{.line = table.line[i], .channel = {}, .wrench_S = kUnseen};
        if (!table.session.empty()) row.session = table.session[i];
        for (const std::size_t k : channel) row.channel.push_back(table.values[k][i]);
        for (std::size_t k = 0; k < table.columns.size(); ++k) {
            const Column& column = table.columns[k];
            if (!column.is_used) continue;
            if (column.kind == ColumnKind::label) row.wrench_S[column.component] = table.values[k][i];
            if (column.kind == ColumnKind::temperature) row.temperature_C = table.values[k][i];
        }
        labelled.rows.push_back(std::move(row));
    }
    labelled.columns = table.list();
    if (selection.labels.empty()) {
        refuse_faults({&table});
    } else {
        if (has_labels(table))
            table.faults.push_back(table.name + ": has labels itself; leave --labels out, or delete them");
        LabelledTable labels = read_label_file(selection.labels);
        refuse_faults({&table, &labels});
        labelled.columns += labels.list() + align_labels(table, labels, labelled);
    }
    set_times(table, labelled.rows);
    return labelled;
}

}  // namespace tactiled
