// Sensors through the whole daemon: 8 channels of 24 bits a frame, over ptys.
//   * losses: every frame written is seen, once, in order
//   * torn reads: a reader polls flat out; each sample must be exactly what its frame carried
//   * latency: from before write() until the reader sees the sample, beside a bare wire in the same run: the same bytes go
//     through a pty or connection of their own to a thread that blocks in read().
//   * CPU time of the daemon, while its devices are silent and while they send
//
//   latency_bench [--seconds 10] [--rate 1000] [--links 1] [--sleepers 0] [--period-us N] [--idle 0] [--tcp 0] [--rt-reader
//   0]
//
// --sleepers: so many readers sleep until each record, on the last CPU; --idle: seconds of silence before the frames; --tcp
// 1: connections in place of ptys; --rt-reader 1: the reader that polls has SCHED_FIFO 60 on CPU 0. TACTILED_BIN=FOLDER
// measures another build's daemon with the same frames. A real UART (its FIFO, interrupts, USB's frames) is not shown.
#include <atomic>
#include <cstring>
#include <thread>

#include "tests/bench/bench_daemon.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::testing;

struct Arguments {
    double seconds = 10, rate = 1000, links = 1, sleepers = 0, period_us = 0, idle = 0, tcp = 0, rt_reader = 0;
};

Arguments arguments_of(int argc, char** argv) {
    Arguments o;
    const std::pair<const char*, double*> known[] = {
        {"--seconds", &o.seconds},     {"--rate", &o.rate}, {"--links", &o.links}, {"--sleepers", &o.sleepers},
        {"--period-us", &o.period_us}, {"--idle", &o.idle}, {"--tcp", &o.tcp},     {"--rt-reader", &o.rt_reader}};
    for (int i = 1; i + 1 < argc; i += 2)
        for (const auto& [name, value] : known)
            if (std::strcmp(argv[i], name) == 0) *value = std::atof(argv[i + 1]);
    return o;
}

// The write times of one link's device, and the next frame that the reader expects of it.
struct Course {
    explicit Course(std::size_t frames) : written(frames) {}
    std::vector<std::atomic<std::uint64_t>> written;
    std::uint32_t expected = 0;
};

struct Seen {
    std::vector<double> latency_us, published_us;
    std::uint64_t wrong = 0, out_of_order = 0, not_good = 0;

    void add(Course& course, const tactiled_sample& s, std::uint64_t now_ns) {
        if (s.quality != TACTILED_GOOD) {
            ++not_good;
            return;
        }
        if (!is_as_fed(s)) ++wrong;
        if ((s.device_sequence & 0xFFFF) != (course.expected & 0xFFFF)) ++out_of_order;
        course.expected += (s.device_sequence - course.expected) & 0xFFFF;
        if (course.expected < course.written.size()) {
            const std::uint64_t began_ns = course.written[course.expected].load();
            latency_us.push_back(double(now_ns - began_ns) / 1e3);
            published_us.push_back(double(s.t_published_ns - std::min(s.t_published_ns, began_ns)) / 1e3);
        }
        ++course.expected;
    }
};

// Readers that sleep until each record, on the last CPU.
class Sleepers {
public:
    Sleepers(const std::string& node, int n) {
        for (int i = 0; i < n; ++i)
            threads_.emplace_back([this, node] {
                cpu_set_t last;
                CPU_ZERO(&last);
                CPU_SET(std::thread::hardware_concurrency() - 1, &last);
                ::sched_setaffinity(0, sizeof last, &last);
                Reader reader(node, "s0");
                tactiled_sample s;
                while (!stop_) woken_ += reader.wait(s, 100, Wait::block) ? 1 : 0;
            });
    }
    ~Sleepers() {
        stop_ = true;
        for (auto& thread : threads_) thread.join();
        if (!threads_.empty()) fmt::print("{} sleeping readers took {} samples\n", threads_.size(), woken_.load());
    }

private:
    std::atomic<bool> stop_{false};
    std::atomic<std::uint64_t> woken_{0};
    std::vector<std::thread> threads_;
};

}  // namespace

int main(int argc, char** argv) {
    const Arguments o = arguments_of(argc, argv);
    const int links = int(o.links);
    BenchDaemon daemon(links, o.tcp != 0, "format = \"cobs\"\n",
                       o.period_us > 0 ? fmt::format("[realtime]\nperiod_us = {}\n", int(o.period_us)) : "");
    if (o.idle > 0) {
        const double before_s = daemon.cpu_s();
        ::usleep(useconds_t(o.idle * 1e6));
        fmt::print("daemon, devices silent: {:.1f} % of one CPU\n", 100 * (daemon.cpu_s() - before_s) / o.idle);
    }

    const auto total = std::uint64_t(o.seconds * o.rate);
    std::unique_ptr<Wire> bare = std::make_unique<PtyWire>("");
    if (o.tcp != 0) bare = std::make_unique<TcpWire>();
    const int bare_in = bare->read_end(), bare_out = bare->write_end();
    for (int i = 0; i < links; ++i) daemon.device(i).write_end();
    Course bare_course(total);
    std::vector<std::unique_ptr<Course>> courses;
    for (int i = 0; i < links; ++i) courses.push_back(std::make_unique<Course>(total));
    std::vector<double> bare_us;
    bare_us.reserve(total);
    Seen seen;
    seen.latency_us.reserve(total * std::size_t(links));
    seen.published_us.reserve(total * std::size_t(links));
    std::atomic<bool> done{false};
    std::atomic<std::uint64_t> refused{0};
    double cpu_s = 0;

    std::thread echo([&] {
        be_realtime(78);
        std::array<std::uint8_t, 512> bytes;
        for (std::uint64_t frames = 0; frames < total && !done;) {
            const ssize_t size = ::read(bare_in, bytes.data(), bytes.size());
            const std::uint64_t now = monotonic_ns();
            for (ssize_t i = 0; i < size; ++i)
                if (bytes[std::size_t(i)] == 0 && frames < total)
                    bare_us.push_back(double(now - bare_course.written[frames++].load()) / 1e3);
        }
    });
    const Sleepers sleepers(daemon.name(), int(o.sleepers));
    std::thread feeder([&] {
        be_realtime(70);  // below the daemon: the device is another computer, it does not wait for ours
        if (o.sleepers > 0) ::usleep(2'000'000);
        std::array<std::uint8_t, kCobsMaxEncoded> bytes;
        const double before_s = daemon.cpu_s();
        const std::uint64_t begin_ns = monotonic_ns() + 10'000'000, period_ns = std::uint64_t(1e9 / o.rate);
        const auto send = [&](int wire, Course& course, std::uint64_t n, std::uint64_t at_ns) {
            const std::size_t size = encode_fed(std::uint32_t(n), bytes);
            sleep_till(at_ns);
            course.written[n].store(monotonic_ns());
            if (::write(wire, bytes.data(), size) != ssize_t(size)) ++refused;
        };
        for (std::uint64_t n = 0; n < total; ++n)
            for (int i = 0; i <= links; ++i) {  // evenly over the period, the bare wire last, and all phases of a grid alike
                const std::uint64_t at_ns = begin_ns + n * period_ns +
                                            std::uint64_t(i) * period_ns / std::uint64_t(links + 1) +
                                            n * 7919 % 100 * period_ns / std::uint64_t(links + 1) / 200;
                if (i < links)
                    send(daemon.device(i).write_end(), *courses[std::size_t(i)], n, at_ns);
                else
                    send(bare_out, bare_course, n, at_ns);
            }
        cpu_s = daemon.cpu_s() - before_s;
        ::usleep(200'000);
        done = true;
    });

    if (o.rt_reader != 0) {
        cpu_set_t first;
        CPU_ZERO(&first);
        CPU_SET(0, &first);
        ::sched_setaffinity(0, sizeof first, &first);
        be_realtime(60);
    }
    std::uint64_t polls = 0;
    tactiled_sample s{}, newest{};
    while (!done) {
        ++polls;
        daemon.reader(0).segment().latest(0, newest);  // flat out, whether new or not
        if (newest.quality == TACTILED_GOOD && !is_as_fed(newest)) ++seen.wrong;
        for (int i = 0; i < links; ++i)
            while (daemon.reader(i).next(s)) seen.add(*courses[std::size_t(i)], s, monotonic_ns());
    }
    feeder.join();
    if (::write(bare_out, "", 1) != 1) return 1;  // ends a read() that still waits
    echo.join();
    std::uint64_t frames = 0, lost = 0, bad = 0, full = 0, reader_lost = 0;
    for (int i = 0; i < links; ++i) {
        const auto& count = daemon.reader(i).segment().link(std::uint32_t(i)).count;
        frames += count[TACTILED_LINK_FRAMES];
        lost += count[TACTILED_LINK_LOST];
        bad += count[TACTILED_LINK_BAD_CHECKSUM] + count[TACTILED_LINK_BAD_LENGTH];
        full += count[TACTILED_LINK_RING_FULL];
        reader_lost += daemon.reader(i).lost();
    }
    tactiled_node record{};
    daemon.reader(0).segment().latest_node(record);
    const std::uint64_t expected = total * std::uint64_t(links), missing = expected - seen.latency_us.size();
    fmt::print("{} links at {} Hz: frames written {}, seen {}, refused by a wire {}, out of order {}, not GOOD {}\n", links,
               o.rate, expected, seen.latency_us.size(), refused.load(), seen.out_of_order, seen.not_good);
    fmt::print("links: frames {}, lost {}, damaged {}, ring full {}; reader lost {}\n", frames, lost, bad, full,
               reader_lost);
    fmt::print("polls {}, torn or wrong reads {}; cycles {}, missed periods {}, worst cycle of the last second {} us\n",
               polls, seen.wrong, record.cycles, record.missed_cycles, record.worst_cycle_us);
    print_quantiles("bare wire: write() to blocking read()", bare_us);
    print_quantiles("tactiled: write() to seen", seen.latency_us);
    print_quantiles("tactiled: write() to published", seen.published_us);
    fmt::print("daemon, devices sending: {:.1f} % of one CPU\n", 100 * cpu_s / o.seconds);
    if (missing > 0)
        fmt::print(stderr, "latency_bench: {} frames were not seen GOOD; {} were not GOOD when the reader got time to run\n",
                   missing, seen.not_good);
    return seen.wrong + seen.out_of_order + missing == 0 ? 0 : 1;
}
