// One text line from before write() until another process sees its force in shared memory, beside the same line
// through a bare pty to a thread that blocks in read(). Only the daemon is real-time: the reader spins at normal
// priority, like a robot's controller without rights.
//
//   wire_bench [--frames 3000] [--rate 500]         TACTILED_BIN=FOLDER measures another build's daemon
#include <atomic>
#include <cstring>
#include <thread>

#include "tests/bench/bench_daemon.hpp"

using namespace tactiled;
using namespace tactiled::testing;

int main(int argc, char** argv) {
    double frames = 3000, rate = 500;
    for (int i = 1; i + 1 < argc; i += 2)
        for (const auto& [name, value] : {std::pair{"--frames", &frames}, {"--rate", &rate}})
            if (std::strcmp(argv[i], name) == 0) *value = std::atof(argv[i + 1]);
    BenchDaemon daemon(1, false, "format = \"lines\"\nchannels = 8", "");
    const Pty bare("");
    std::atomic<std::uint64_t> read_ns{0};
    std::thread blocked([&] {
        char bytes[256] = {};
        for (ssize_t size = 1; size > 0 && bytes[size - 1] != 'q';) {
            size = ::read(bare.slave(), bytes, sizeof bytes);
            read_ns.store(monotonic_ns());
        }
    });
    std::vector<double> seen_us, bare_us;
    std::uint64_t unseen = 0;
    const std::uint64_t begin_ns = monotonic_ns() + 10'000'000, period_ns = std::uint64_t(1e9 / rate);
    tactiled_sample s{};
    while (daemon.reader(0).next(s)) {}
    for (std::uint64_t n = 0; n < std::uint64_t(frames); ++n) {
        const std::string line = fmt::format("{},2,3,4,5,6,7,8\n", n + 1);
        sleep_till(begin_ns + n * period_ns);
        std::uint64_t wrote_ns = monotonic_ns();
        if (::write(daemon.device(0).write_end(), line.data(), line.size()) < 0) return 1;
        std::uint64_t now_ns = wrote_ns;
        bool is_seen = false;
        while (!is_seen && now_ns < wrote_ns + period_ns / 2) {
            is_seen = daemon.reader(0).next(s) && s.quality == TACTILED_GOOD && s.raw_force_S_N[0] == 0.001 * double(n + 1);
            now_ns = monotonic_ns();
        }
        if (is_seen)
            seen_us.push_back(double(now_ns - wrote_ns) / 1e3);
        else
            ++unseen;

        sleep_till(begin_ns + n * period_ns + period_ns / 2);
        wrote_ns = monotonic_ns();
        if (::write(bare.master(), line.data(), line.size()) < 0) return 1;
        while (read_ns.load() < wrote_ns && monotonic_ns() < wrote_ns + period_ns / 2) {}
        if (read_ns.load() >= wrote_ns) bare_us.push_back(double(read_ns.load() - wrote_ns) / 1e3);
    }
    if (::write(bare.master(), "q", 1) != 1) return 1;
    blocked.join();
    print_quantiles("bare pty: write() to blocking read()", bare_us);
    print_quantiles("tactiled: write() to seen by a spinner", seen_us);
    fmt::print("not seen within half a period: {}\n", unseen);
    return 0;
}
