// tactilectl play: plays a recording as a device behind a pty, so that the daemon opens it as it opens a serial port.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <memory>

#include "config/options.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/fit/columns.hpp"
#include "node/ctl/command_line.hpp"
#include "node/lab/port.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string in, pty;
    Wire wire;
    double speed = 1, rate_Hz = 0;
    bool loop = false;
    std::vector<std::string> columns;
};

struct Row {
    double t_s;
    std::vector<double> channel;  // NaN: missing
};

// The columns that may be channels: no time, label, session or temperature.
std::vector<std::string> channel_names(const CsvReader& csv) {
    std::vector<std::string> names, ignored;
    for (const Column& column : class_columns(csv.columns(), {}, nullptr, ignored))
        if (column.kind != ColumnKind::time && column.kind != ColumnKind::label && column.kind != ColumnKind::session &&
            column.kind != ColumnKind::temperature)
            names.push_back(column.name);
    return names;
}

std::vector<Row> read_rows(const Args& args) {
    CsvReader csv(args.in);
    std::vector<std::string> names = args.columns;
    if (names.empty()) names = channel_names(csv);
    if (names.empty() || names.size() > kMaxChannels)
        throw SetupError(fmt::format("{}: has {} channels; a frame carries 1 .. {}", args.in, names.size(), kMaxChannels));
    std::vector<std::size_t> columns;
    for (const auto& name : names) {
        const auto at = csv.find(name);
        if (!at) csv.refuse(fmt::format("has no column \"{}\"", name));
        columns.push_back(*at);
    }
    const auto time = csv.find("t_s");
    if (!time && args.rate_Hz <= 0) csv.refuse("has no column t_s: give --rate");
    std::vector<Row> rows;
    while (csv.next()) {
        Row row{time ? csv.number(*time) : 0, {}};
        if (!rows.empty() && !(row.t_s >= rows.back().t_s)) csv.refuse("t_s goes back");
        for (const auto column : columns) row.channel.push_back(csv.number(column));
        rows.push_back(std::move(row));
    }
    if (rows.empty()) csv.refuse("has no rows");
    return rows;
}

int play(const Args& args) {
    catch_interrupt();
    const std::vector<Row> rows = read_rows(args);
    const double length_s =
        rows.size() < 2 ? 1 : (rows.back().t_s - rows.front().t_s) * double(rows.size()) / double(rows.size() - 1);
    const std::array ports{std::make_unique<Port>(args.pty)};
    wait_for_reader(*ports[0]);

    std::uint64_t sent = 0, dropped = 0, number = 0;
    const std::uint64_t began_ns = monotonic_ns();
    ports[0]->set_clock(began_ns / 1000, began_ns);
    for (std::uint64_t lap = 0; interrupted == 0 && (lap == 0 || args.loop); ++lap) {
        for (std::size_t i = 0; i < rows.size() && interrupted == 0; ++i, ++number) {
            const double due_s = args.rate_Hz > 0 ? double(number) / args.rate_Hz
                                                  : (double(lap) * length_s + rows[i].t_s - rows.front().t_s) / args.speed;
            const std::uint64_t due_ns = began_ns + std::uint64_t(due_s * 1e9);
            args.wire.answer_until(due_ns, ports);

            Frame frame;
            frame.sequence = std::uint32_t(number);
            frame.device_time_us = due_ns / 1000;
            frame.n_channels = std::uint8_t(rows[i].channel.size());
            std::copy(rows[i].channel.begin(), rows[i].channel.end(), frame.channel.begin());
            ++(args.wire.send(*ports[0], frame) ? sent : dropped);
        }
    }
    let_reader_finish();
    fmt::print(stderr, "play: {} frames sent, {} dropped because no program read them\n", sent, dropped);
    return kGood;
}

}  // namespace

Run add_play(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("--in", args->in, "signals.csv: t_s and channels; labels, sessions and temperatures are left out")
        .required();
    verb.add_option("--pty", args->pty, "the name under which the daemon opens it (a symbolic link)").required();
    args->wire.add_options(verb);
    verb.add_option("--speed", args->speed, "times faster than t_s").positive().show_default();
    verb.add_option("--rate", args->rate_Hz, "rows a second, instead of t_s").positive();
    verb.add_option("--columns", args->columns, "which columns, in which order").delimiter(',');
    verb.add_flag("--loop", args->loop, "from the start again, until interrupted");
    return [args] { return play(*args); };
}

}  // namespace tactiled::ctl
