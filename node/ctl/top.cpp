// tactilectl top: shows sensors, links, grasp and arrays live in a terminal of 80 x 24; in a pipe it prints one snapshot
// after the other.
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <thread>

#include "node/ctl/array_text.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/grasp_text.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

constexpr const char* kHome = "\x1b[H";         // to the first column of the first line
constexpr const char* kClearLine = "\x1b[K\n";  // the rest of the line
constexpr const char* kClearBelow = "\x1b[J";

// At most 2 + 2 + 16 + 1 + 3 lines of 80 columns.
std::string table(const Segment& segment, const Snapshot& snapshot) {
    const auto& node = snapshot.node;
    std::string out =
        fmt::format("{:.80}\n", fmt::format("{}  pid {}  heartbeat {}  longest cycle {} us{}{}", segment.header().name,
                                            segment.header().pid, node.heartbeat, node.worst_cycle_us,
                                            (node.status & TACTILED_RT_DEGRADED) != 0 ? "  RT_DEGRADED" : "",
                                            (node.status & TACTILED_SIMULATED) != 0 ? "  simulated" : ""));
    const Liveness liveness = liveness_of(segment);
    if (!liveness.runs()) out = fmt::format("{}: {}\n", liveness.word, liveness.why);
    std::istringstream faults(fault_lines(node));
    for (std::string line; std::getline(faults, line);) out += fmt::format("{:.80}\n", line);
    out += fmt::format("{:<10} {:>8} {:>8} {:>8} {:>6} {:>6} {:>5} {:>5}  {}\n", "sensor", "fx/N", "fy/N", "fz/N", "sd fz",
                       "Hz", "ms", "lost", "quality");
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        const auto& s = snapshot.sensor[i];
        out += fmt::format("{:<10.10} {} {} {} {} {} {} {:>5}  {}\n", segment.sensor(i).name, number(s.force_S_N[0], 8, 3),
                           number(s.force_S_N[1], 8, 3), number(s.force_S_N[2], 8, 3), number(s.sd_force_N[2], 6, 3),
                           number(double(s.rate_Hz), 6, 0), number(age_ms(s, snapshot.taken_ns), 5, 0), s.lost,
                           coloured(s.quality, quality_text(s.quality, s.reasons).substr(0, 14)));
    }
    const auto sum = [&](tactiled_link_count kind) {
        std::uint64_t total = 0;
        for (std::uint32_t i = 0; i < segment.n_links(); ++i)
            total += __atomic_load_n(&segment.link(i).count[kind], __ATOMIC_RELAXED);
        return total;
    };
    unsigned open = 0;
    for (std::uint32_t i = 0; i < segment.n_links(); ++i) open += segment.link(i).state == TACTILED_LINK_OPEN ? 1 : 0;
    out += fmt::format("{:.80}\n", fmt::format("links {} of {} open  frames {}  lost {}  bad {}  skipped {} B  ring full {}",
                                               open, segment.n_links(), sum(TACTILED_LINK_FRAMES), sum(TACTILED_LINK_LOST),
                                               sum(TACTILED_LINK_BAD_CHECKSUM) + sum(TACTILED_LINK_BAD_LENGTH) +
                                                   sum(TACTILED_LINK_BAD_VALUE),
                                               sum(TACTILED_LINK_SKIPPED), sum(TACTILED_LINK_RING_FULL)));
    return out + grasp_lines(segment, node.grasp) + tool_lines(node.tool);
}

constexpr unsigned kColumns = 80;
constexpr std::size_t kMapsAbreast = 3, kMinMapLines = 6, kMaxMapLines = 8, kDefaultLines = 24, kNoLimit = 1000;

// Heat maps side by side.
std::string abreast(const Segment& segment, std::span<const std::uint32_t> sensors, unsigned width, unsigned height) {
    std::vector<std::vector<std::string>> maps;
    std::size_t lines = 0;
    Array array;
    for (const std::uint32_t sensor : sensors) {
        segment.latest(sensor, array);
        maps.push_back(heat_map(segment, sensor, array, width, height, ink_of_output()));
        lines = std::max(lines, maps.back().size());
    }
    std::string out;
    for (std::size_t line = 0; line < lines; ++line)
        for (const auto& map : maps)
            out += (line < map.size() ? map[line] : std::string(width, ' ')) + (&map == &maps.back() ? "\n" : "  ");
    return out;
}

// Heat maps of the sensors with taxels, in at most `lines` lines.
std::string array_maps(const Segment& segment, std::size_t lines) {
    std::vector<std::uint32_t> sensors;
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if (segment.has_array(i)) sensors.push_back(i);
    const std::size_t columns = std::clamp<std::size_t>(sensors.size(), 1, kMapsAbreast);
    const unsigned width = (kColumns - 2 * unsigned(columns - 1)) / unsigned(columns);
    if (sensors.empty() || lines == 0) return "";
    std::string out = heat_map_legend(ink_of_output()) + "\n";
    --lines;
    for (std::span<const std::uint32_t> left = sensors; !left.empty();) {
        if (lines < kMinMapLines)
            return out + fmt::format("{} more: tactilectl read {} --array\n", left.size(), segment.sensor(left[0]).name);
        const std::size_t n = std::min(left.size(), columns);
        const std::string row = abreast(segment, left.first(n), width, unsigned(std::min(kMaxMapLines, lines - kMapHead)));
        out += row;
        lines -= std::size_t(std::ranges::count(row, '\n'));
        left = left.subspan(n);
    }
    return out;
}

// The table, the maps that fit below it, and the note.
std::string screen(const Segment& segment, const Snapshot& snapshot, const std::string& note) {
    const std::string above = table(segment, snapshot);
    winsize size{};
    const std::size_t lines =
        ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row != 0 ? size.ws_row : kDefaultLines;
    const auto used = std::size_t(std::ranges::count(above + note, '\n')) + 1;
    return above + array_maps(segment, lines > used ? lines - used : 0) + note;
}

// Each line overwrites the old one: no flicker, and no rest of a longer line.
void draw(const std::string& text) {
    std::string screen = kHome;
    for (const char c : text)
        if (c == '\n')
            screen += kClearLine;
        else
            screen += c;
    fmt::print("{}{}", screen, kClearBelow);
}

// While it lives, the terminal passes each key on at once and does not show it.
class Keys {
public:
    Keys() : is_terminal_(::tcgetattr(STDIN_FILENO, &before_) == 0) {
        if (!is_terminal_) return;
        termios now = before_;
        now.c_lflag &= ~tcflag_t(ICANON | ECHO);
        ::tcsetattr(STDIN_FILENO, TCSANOW, &now);
    }
    ~Keys() {
        if (is_terminal_) ::tcsetattr(STDIN_FILENO, TCSANOW, &before_);
    }
    Keys(const Keys&) = delete;
    Keys& operator=(const Keys&) = delete;
    // Returns true if q was pressed within `seconds`; sleeps for so long otherwise.
    [[nodiscard]] bool is_quit(double seconds) const {
        const std::uint64_t until_ns = monotonic_ns() + std::uint64_t(seconds * 1e9);
        for (std::uint64_t now_ns = 0; interrupted == 0 && (now_ns = monotonic_ns()) < until_ns;) {
            pollfd input{is_terminal_ ? STDIN_FILENO : -1, POLLIN, 0};
            char key = 0;
            if (::poll(&input, 1, int((until_ns - now_ns) / 1'000'000) + 1) == 1 &&
                (::read(STDIN_FILENO, &key, 1) != 1 || key == 'q'))
                return true;
        }
        return false;
    }

private:
    termios before_{};
    bool is_terminal_;
};

struct Args {
    std::string node = "gripper";
    std::string note;
    bool json = false;
    long count = 0;  // 0: until interrupted
    double interval_s = 0.5;
};

int top(const Args& args) {
    catch_interrupt();
    const bool redraw = !args.json && ::isatty(STDOUT_FILENO) != 0;
    std::optional<Keys> keys;
    if (redraw) {
        keys.emplace();
        fmt::print("\x1b[2J");
    }
    int exit_status = kGood;
    for (long n = 0; interrupted == 0; ++n) {
        std::string why;
        // opened each time: the daemon may have been restarted
        const Segment segment = Segment::try_open(args.node, why);
        Snapshot snapshot;
        if (segment.is_open() && segment.snapshot(snapshot)) {
            if (args.json)
                fmt::print("{}\n", status_json(segment, snapshot).dump());
            else if (redraw)
                draw(screen(segment, snapshot, args.note.empty() ? "" : "\n" + args.note + "\n"));
            else
                fmt::print("{}\n", table(segment, snapshot) + array_maps(segment, kNoLimit));
            exit_status = liveness_of(segment).is_dead()  ? kNotReachable
                          : is_healthy(segment, snapshot) ? kGood
                                                          : kUnhealthy;
        } else {
            const std::string text = fmt::format("tactilectl: {}\n", why.empty() ? "the daemon is starting" : why);
            if (redraw)
                draw(text);  // replaces the last values
            else
                fmt::print(stderr, "{}", text);
            exit_status = kNotReachable;
        }
        std::fflush(stdout);
        if (n + 1 == args.count || std::ferror(stdout) != 0) break;
        if (keys && keys->is_quit(args.interval_s)) break;
        if (!keys) std::this_thread::sleep_for(std::chrono::duration<double>(args.interval_s));
    }
    return exit_status;
}

}  // namespace

Run add_top(Command verb) {
    auto args = std::make_shared<Args>();
    add_node_option(verb, args->node);
    verb.add_option("--note", args->note, "text to keep below the table, in a terminal");
    verb.add_flag("--json", args->json, "one JSON object a line");
    verb.add_option("--count", args->count, "end after so many").integer_in(1L, 1'000'000'000L);
    verb.add_option("--interval", args->interval_s, "seconds between two").number_in(0.01, 3600.0).show_default();
    return [args] { return top(*args); };
}

}  // namespace tactiled::ctl
