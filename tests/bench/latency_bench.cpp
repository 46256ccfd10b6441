// One sensor through the whole daemon: 1 kHz, 8 channels of 24 bits, 921600 baud, over a pty.
//   * losses: every frame written is seen, once, in order
//   * torn reads: a reader polls flat out; each sample must be exactly what its frame carried
//   * latency: from the last byte written until the reader sees the sample, beside a bare pty in the same run: half a period
//     later the same bytes go through a second pty to a thread that blocks in read().
//
//   latency_bench [--seconds 10] [--rate 1000] [--period-us N]
//
// Not shown: a real UART (its FIFO, its interrupts, USB's frames), and a machine without other tenants.
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <memory>
#include <thread>
#include <vector>

#include "tactiled/reader.hpp"
#include "tests/system/pty_feeder.hpp"

extern char** environ;

namespace {

using namespace tactiled;
using namespace tactiled::testing;

void be_realtime(int priority) {
    sched_param p{};
    p.sched_priority = priority;
    sched_setscheduler(0, SCHED_FIFO, &p);  // where allowed
}

void sleep_till(std::uint64_t t_ns) {
    const timespec t{time_t(t_ns / 1'000'000'000u), long(t_ns % 1'000'000'000u)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

void print(const char* what, std::vector<double>& us) {
    std::sort(us.begin(), us.end());
    const auto at = [&](double q) { return us[std::min(us.size() - 1, std::size_t(q * double(us.size())))]; };
    fmt::print("{:<46} p50 {:8.1f}  p99 {:8.1f}  p99.9 {:8.1f}  worst {:8.1f} us  ({} values)\n", what, at(0.5), at(0.99),
               at(0.999), us.back(), us.size());
}

}  // namespace

int main(int argc, char** argv) {
    double seconds = 10, rate = 1000;
    int period_us = 0;  // the default
    for (int i = 1; i + 1 < argc; i += 2) {
        if (std::strcmp(argv[i], "--seconds") == 0) seconds = std::atof(argv[i + 1]);
        if (std::strcmp(argv[i], "--rate") == 0) rate = std::atof(argv[i + 1]);
        if (std::strcmp(argv[i], "--period-us") == 0) period_us = std::atoi(argv[i + 1]);
    }
    char folder[] = "/tmp/tactiled-latency-XXXXXX";
    if (::mkdtemp(folder) == nullptr) return 1;
    const std::string node = "latency-" + std::to_string(::getpid());
    const Pty device(std::string(folder) + "/dev"), bare("");
    write_fed_config(folder, node, "", 100);
    if (period_us != 0) std::ofstream(std::string(folder) + "/tactiled.toml", std::ios::app)
        << "\n[realtime]\nperiod_us = " << period_us << "\n";

    const std::string program = std::filesystem::canonical("/proc/self/exe").parent_path() / "tactiled";
    const std::string config = std::string(folder) + "/tactiled.toml";
    const char* words[] = {program.c_str(), "--config", config.c_str(), nullptr};
    pid_t daemon = 0;
    if (::posix_spawn(&daemon, program.c_str(), nullptr, nullptr, const_cast<char**>(words), environ) != 0) return 1;
    std::unique_ptr<Reader> reader;
    for (int i = 0; i < 1000 && (reader == nullptr || !reader->is_attached()); ++i) {
        ::usleep(5000);
        reader = std::make_unique<Reader>(node, "left");
    }
    for (int i = 0; i < 400 && __atomic_load_n(&reader->segment().link(0).state, __ATOMIC_RELAXED) != TACTILED_LINK_OPEN;
         ++i)
        ::usleep(5000);
    ::usleep(100'000);

    const auto total = std::uint64_t(seconds * rate);
    std::vector<std::atomic<std::uint64_t>> written(total), bare_written(total);
    std::vector<double> latency, published, bare_latency;
    latency.reserve(total);
    published.reserve(total);
    bare_latency.reserve(total);
    std::atomic<bool> done{false};
    std::uint64_t refused = 0;

    std::thread echo([&] {
        be_realtime(78);
        std::array<std::uint8_t, 512> bytes;
        for (std::uint64_t n = 0, frames = 0; frames < total && n < 2 * total; ++n) {
            const ssize_t size = ::read(bare.slave(), bytes.data(), bytes.size());
            const std::uint64_t now = monotonic_ns();
            for (ssize_t i = 0; i < size; ++i)
                if (bytes[std::size_t(i)] == 0 && frames < total)
                    bare_latency.push_back(double(now - bare_written[frames++].load()) / 1e3);
        }
    });
    std::thread feeder([&] {
        be_realtime(70);  // below the daemon: the device is another computer, it does not wait for ours
        std::array<std::uint8_t, kCobsMaxEncoded> bytes;
        const std::uint64_t begin = monotonic_ns() + 10'000'000, period = std::uint64_t(1e9 / rate);
        for (std::uint64_t n = 0; n < total; ++n) {
            const std::size_t size = encode_fed(std::uint32_t(n), bytes);
            // Every phase against the pipeline's grid alike: a device does not know of it.
            sleep_till(begin + n * period + n * 7919 % 250 * 1000);
            written[n].store(monotonic_ns());
            if (::write(device.master(), bytes.data(), size) != ssize_t(size)) ++refused;
            sleep_till(begin + n * period + period / 2);
            bare_written[n].store(monotonic_ns());
            if (::write(bare.master(), bytes.data(), size) != ssize_t(size)) ++refused;
        }
        ::usleep(200'000);
        done = true;
    });

    std::uint64_t seen = 0, wrong = 0, out_of_order = 0, other = 0, polls = 0;
    std::uint32_t expected = 0;
    tactiled_sample s{}, newest{};
    while (!done) {
        ++polls;
        reader->segment().latest(0, newest);  // flat out, whether new or not
        if (newest.quality == TACTILED_GOOD && !is_as_fed(newest)) ++wrong;
        while (reader->next(s)) {
            const std::uint64_t now = monotonic_ns();
            if (s.quality != TACTILED_GOOD) {
                ++other;
                continue;
            }
            if (!is_as_fed(s)) ++wrong;
            if ((s.device_sequence & 0xFFFF) != (expected & 0xFFFF)) ++out_of_order;
            if (expected < total) {
                const std::uint64_t began = written[expected].load();
                latency.push_back(double(now - began) / 1e3);
                published.push_back(double(s.t_published_ns - std::min(s.t_published_ns, began)) / 1e3);
            }
            ++expected;
            ++seen;
        }
    }
    feeder.join();
    echo.join();
    const auto& link = reader->segment().link(0);
    tactiled_node record{};
    reader->segment().latest_node(record);
    fmt::print(
        "frames written {}, seen {}, lost {}, refused by the pty {}, out of order {}, not GOOD {} (the wait before the "
        "first)\n",
        total, seen, total - seen, refused, out_of_order, other);
    fmt::print("link: frames {}, lost {}, bad checksum {}, bad length {}, ring full {}; reader lost {}\n",
               link.count[TACTILED_LINK_FRAMES], link.count[TACTILED_LINK_LOST], link.count[TACTILED_LINK_BAD_CHECKSUM],
               link.count[TACTILED_LINK_BAD_LENGTH], link.count[TACTILED_LINK_RING_FULL], reader->lost());
    fmt::print("polls {}, torn or wrong reads {}; pipeline turns {}, missed periods {}\n", polls, wrong, record.cycles,
               record.missed_cycles);
    print("bare pty: write() to blocking read()", bare_latency);
    print("tactiled: write() to seen in shared memory", latency);
    print("tactiled: write() to published", published);
    ::kill(daemon, SIGTERM);
    rusage used{};
    ::wait4(daemon, nullptr, 0, &used);
    const auto cpu_s = [](const timeval& t) { return double(t.tv_sec) + double(t.tv_usec) / 1e6; };
    fmt::print("daemon: {:.1f} % of one CPU\n", 100 * (cpu_s(used.ru_utime) + cpu_s(used.ru_stime)) / seconds);
    std::filesystem::remove_all(folder);
    return wrong + out_of_order + (total - seen) == 0 ? 0 : 1;
}
