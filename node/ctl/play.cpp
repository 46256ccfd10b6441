// tactilectl play: a recording as a device behind a pty, so that the daemon opens it as it opens a serial port.
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <pty.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>

#include "config/options.hpp"
#include "decoupling/fit/csv.hpp"
#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "node/ctl/verb.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

struct Wish {
    std::string in, pty, format = "lines";
    int bits = 24;
    double counts_per_unit = 1, speed = 1, rate_Hz = 0;
    bool loop = false, checksum = false, sequence = false, time = false;
    std::vector<std::string> columns;
};

struct Row {
    double t_s;
    std::vector<double> channel;  // NaN: missing
};

bool is_label(const std::string& column) {
    static const std::vector<std::string> kLabels{"t_s", "session", "fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"};
    return std::find(kLabels.begin(), kLabels.end(), column) != kLabels.end();
}

std::vector<Row> read_rows(const Wish& wish) {
    CsvReader csv(wish.in);
    std::vector<std::string> names = wish.columns;
    if (names.empty())
        std::copy_if(csv.columns().begin(), csv.columns().end(), std::back_inserter(names), std::not_fn(is_label));
    if (names.empty() || names.size() > kMaxChannels)
        throw SetupError(fmt::format("{}: has {} channels; a frame carries 1 .. {}", wish.in, names.size(), kMaxChannels));
    std::vector<std::size_t> columns;
    for (const auto& name : names) {
        const auto at = csv.find(name);
        if (!at) csv.refuse(fmt::format("has no column \"{}\"", name));
        columns.push_back(*at);
    }
    const auto time = csv.find("t_s");
    if (!time && wish.rate_Hz <= 0) csv.refuse("has no column t_s: give --rate");
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

// The device's end of a pty, reachable as `link`.
class Port {
public:
    explicit Port(const std::string& link) : link_(link) {
        char name[128];
        int slave = -1;
        if (::openpty(&master_, &slave, name, nullptr, nullptr) != 0)
            throw SetupError(fmt::format("pty: {}", std::strerror(errno)));
        termios raw{};
        ::tcgetattr(slave, &raw);
        ::cfmakeraw(&raw);
        ::tcsetattr(slave, TCSANOW, &raw);
        ::close(slave);
        ::fcntl(master_, F_SETFL, O_NONBLOCK);
        std::error_code error;
        const auto kind = std::filesystem::symlink_status(link, error).type();
        if (kind == std::filesystem::file_type::symlink) std::filesystem::remove(link, error);  // an earlier run's
        std::filesystem::create_symlink(name, link, error);
        if (error) throw SetupError(fmt::format("{}: {}", link, error.message()));
    }
    ~Port() {
        ::unlink(link_.c_str());
        ::close(master_);
    }
    Port(const Port&) = delete;
    Port& operator=(const Port&) = delete;

    // True while somebody has the other end open.
    bool has_reader() const {
        pollfd p{master_, POLLOUT, 0};
        ::poll(&p, 1, 0);
        return (p.revents & POLLHUP) == 0;
    }
    // As a UART: what does not fit is gone. False then.
    bool send(const void* bytes, std::size_t size) const { return ::write(master_, bytes, size) == ssize_t(size); }

private:
    std::string link_;
    int master_ = -1;
};

int play(const Wish& wish) {
    catch_interrupt();
    const std::vector<Row> rows = read_rows(wish);
    const AsciiFormat ascii{unsigned(rows.front().channel.size()), wish.checksum, wish.sequence, wish.time};
    const double length_s =
        rows.size() < 2 ? 1 : (rows.back().t_s - rows.front().t_s) * double(rows.size()) / double(rows.size() - 1);
    const Port port(wish.pty);
    while (interrupted == 0 && !port.has_reader()) ::usleep(2'000);
    ::usleep(20'000);  // the opener sets its tty up and flushes it

    std::uint64_t sent = 0, dropped = 0, number = 0;
    const std::uint64_t began_ns = monotonic_ns();
    for (std::uint64_t lap = 0; interrupted == 0 && (lap == 0 || wish.loop); ++lap) {
        for (std::size_t i = 0; i < rows.size() && interrupted == 0; ++i, ++number) {
            const double due_s = wish.rate_Hz > 0 ? double(number) / wish.rate_Hz
                                                  : (double(lap) * length_s + rows[i].t_s - rows.front().t_s) / wish.speed;
            const std::uint64_t due_ns = began_ns + std::uint64_t(due_s * 1e9);
            const timespec due{time_t(due_ns / 1'000'000'000u), long(due_ns % 1'000'000'000u)};
            while (interrupted == 0 && ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) == EINTR) {}

            Frame frame;
            frame.sequence = std::uint32_t(number);
            frame.device_time_us = wish.time ? due_ns / 1000 : 0;
            frame.n_channels = std::uint8_t(rows[i].channel.size());
            for (std::size_t k = 0; k < rows[i].channel.size(); ++k) {
                frame.channel[k] = rows[i].channel[k] * wish.counts_per_unit;
                if (std::isnan(frame.channel[k])) frame.missing |= 1u << k;
            }
            bool whole = false;
            if (wish.format == "cobs") {
                std::array<std::uint8_t, kCobsMostEncoded> bytes;
                whole = port.send(bytes.data(), encode_cobs(frame, wish.bits, bytes));
            } else {
                std::array<char, kAsciiMostBytes * 2> line;
                whole = port.send(line.data(), encode_ascii(frame, ascii, line));
            }
            ++(whole ? sent : dropped);
        }
    }
    if (interrupted == 0) ::usleep(200'000);  // what the reader has not taken goes with the port
    fmt::print(stderr, "play: {} frames sent, {} dropped because nobody took them\n", sent, dropped);
    return kGood;
}

}  // namespace

void add_play(CLI::App& app, Run& run) {
    auto wish = std::make_shared<Wish>();
    auto* verb = app.add_subcommand("play", "Plays a recording as a device behind a pty");
    verb->add_option("--in", wish->in, "signals.csv: t_s and channels; label columns are left out")->required();
    verb->add_option("--pty", wish->pty, "the name under which the daemon opens it (a symbolic link)")->required();
    verb->add_option("--format", wish->format, "wire format")
        ->check(CLI::IsMember({"lines", "cobs"}))
        ->capture_default_str();
    verb->add_option("--bits", wish->bits, "cobs: width of a channel")
        ->check(CLI::IsMember({24, 32}))
        ->capture_default_str();
    verb->add_option("--counts-per-unit", wish->counts_per_unit, "what is sent = value in the file x this")
        ->capture_default_str();
    verb->add_option("--speed", wish->speed, "times faster than t_s says")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    verb->add_option("--rate", wish->rate_Hz, "rows a second, instead of t_s")->check(CLI::PositiveNumber);
    verb->add_option("--columns", wish->columns, "which columns, in which order")->delimiter(',');
    verb->add_flag("--loop", wish->loop, "from the start again, until interrupted");
    verb->add_flag("--checksum", wish->checksum, "lines: with a checksum");
    verb->add_flag("--sequence", wish->sequence, "lines: with a leading counter (cobs always has one)");
    verb->add_flag("--time", wish->time, "with the device's time");
    verb->callback([wish, &run] { run = [wish] { return play(*wish); }; });
}

}  // namespace tactiled::ctl
