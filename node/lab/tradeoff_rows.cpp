// Scenes as rows, in process: the two files of `tactilectl simulate`, and the recording of a calibration bench.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "drivers/sim/simulation.hpp"
#include "node/lab/tradeoff.hpp"

namespace tactiled::ctl {
namespace {

// Effects on the load itself: friction, ridges, adhesion. They are part of the truth; all others belong to the
// sensor. The effects of time are included because they define the time of the samples.
constexpr const char* kWorld = "clock_drift,sampling_jitter,friction_limit,partial_slip,stick_slip,texture,adhesion";

}  // namespace

Labelled rows_of(const sim::Scene& scene, std::size_t max) {
    const sim::Sensor& sensor = scene.sensors.front();
    sim::Simulation read(scene, "all"), applied(scene, kWorld);
    Labelled labelled{.name = scene.file, .channels = sensor.channels, .sessions = {}, .rows = {}};
    for (std::uint64_t done = 0; done < scene.samples && labelled.rows.size() < max;) {
        const sim::Block &block = read.advance(0), &world = applied.advance(0);
        if (block.n != world.n) throw std::logic_error("two runs of one scene have blocks of different size");
        for (std::size_t n = 0; n < block.n; ++n) {
            if ((block.first + n) % sensor.every != 0 || block.dropped[n]) continue;
            LabelledRow row{.line = std::int64_t(block.first + n) + 2,
                            .channel = {},
                            .wrench_S = kUnseen,
                            .session = 0,
                            .t_ns = std::uint64_t(std::llround((1 + block.t_s[n]) * 1e9))};
            for (std::size_t k = 0; k < sensor.n(); ++k)
                row.channel.push_back((block.missing[n] >> k & 1u) == 0 ? block.channel[k][n] : kNaN);
            for (std::size_t axis = 0; axis < sim::kAxes; ++axis) row.wrench_S[axis] = world.load[axis][n] + 0.0;
            labelled.rows.push_back(std::move(row));
        }
        done += block.n;
    }
    return labelled;
}

CalibrationScene read_calibration_scene(const std::string& path) {
    Problems problems;
    Options options = Options::parse_file(path, problems);
    Options reported = options.table("calibrate");
    CalibrationScene result;
    result.components = reported.texts("components", {1, 6});
    if (result.components.empty()) result.components = {"fx", "fy", "fz"};
    result.channels = reported.texts("channels", {1, 32});
    result.settle_s = reported.number("settle_s", {0, 1e3}, 0.05);
    result.from_s = reported.number("from_s", {0, 1e7}, 0);
    result.influence = reported.text("influence", "");
    if (!result.influence.empty())
        result.influence = (std::filesystem::path(path).parent_path() / result.influence).string();
    result.model = reported.text("model", "");
    for (const auto& text : reported.texts("set", {1, 64}))
        result.known[text.substr(0, text.find('='))] = std::stod(text.substr(text.find('=') + 1));
    result.scene = sim::read_scene(options, problems);
    if (result.channels.empty()) result.channels = result.scene.sensors.front().channels;
    return result;
}

Labelled calibration_rows(const CalibrationScene& c, std::size_t max) {
    const Labelled all = rows_of(c.scene, std::size_t(c.scene.samples));
    Labelled chosen{.name = all.name, .channels = c.channels, .sessions = {}, .rows = {}};
    std::vector<std::size_t> columns, labels;
    for (const auto& name : c.channels)
        columns.push_back(std::size_t(std::find(all.channels.begin(), all.channels.end(), name) - all.channels.begin()));
    for (const auto& name : c.components)
        labels.push_back(
            std::size_t(std::find(kComponentNames.begin(), kComponentNames.end(), name) - kComponentNames.begin()));
    const auto settle = std::llround(c.settle_s * c.scene.rate_Hz);
    long long still = 0;
    const LabelledRow* before = nullptr;
    for (const auto& row : all.rows) {
        const auto same = [&](std::size_t l) { return before != nullptr && before->wrench_S[l] == row.wrench_S[l]; };
        still = std::all_of(labels.begin(), labels.end(), same) ? still + 1 : 0;
        before = &row;
        if (still < settle || double(row.t_ns) * 1e-9 < c.from_s) continue;
        LabelledRow kept{.line = row.line, .channel = {}, .wrench_S = kUnseen, .session = 0, .t_ns = row.t_ns};
        for (const std::size_t k : columns) kept.channel.push_back(row.channel.at(k));
        for (const std::size_t l : labels) kept.wrench_S.at(l) = row.wrench_S.at(l);
        chosen.rows.push_back(std::move(kept));
    }
    if (chosen.rows.size() > max) {
        std::vector<LabelledRow> thinned;
        for (std::size_t i = 0; i < max; ++i) thinned.push_back(chosen.rows[i * chosen.rows.size() / max]);
        chosen.rows = std::move(thinned);
    }
    return chosen;
}

}  // namespace tactiled::ctl
