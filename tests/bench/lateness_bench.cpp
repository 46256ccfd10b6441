// Wake-up latency of the daemon's loop, beside a floor: a bare thread of the same priority on the same CPU at the same time,
// half a period away, that only sleeps. On a machine with other tenants an absolute time says nothing, and neither does a
// floor that ran before; run together they differ by what is the daemon's own.
//
//   lateness_bench [--seconds 12] [--runs 3] [--hogs 0] [--period-us 1000]
//
// While it runs, a device sends 1 kHz of 8 channels. With hogs (busy programs of ordinary priority) a second daemon, without
// the right to be real-time, runs beside: how much later it wakes shows that the rights of the first are in force. Exit
// status 0: the best run keeps daemon/floor within 1.3 at p50, 2 at p99, 4 at p99.9; with hogs, the second daemon's p99 is
// 5 times the first's. What it does not show: the worst case, which is the machine's; interrupts of a real port.
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/stat.h>
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

constexpr int kPriority = 80;
constexpr double kMax[] = {1.3, 2, 4}, kQuantiles[] = {0.5, 0.99, 0.999};

void pin(int cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(std::size_t(cpu), &set);
    sched_setaffinity(0, sizeof set, &set);
}

bool be_realtime(int priority) {
    sched_param p{};
    p.sched_priority = priority;
    return sched_setscheduler(0, SCHED_FIFO, &p) == 0;
}

void sleep_till(std::uint64_t t_ns) {
    const timespec t{time_t(t_ns / 1'000'000'000u), long(t_ns % 1'000'000'000u)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

Lateness operator-(Lateness a, const Lateness& b) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
    return a;
}

// A child process that ends with this object.
class Program {
public:
    Program(std::vector<std::string> words) {
        std::vector<char*> argv;
        for (auto& word : words) argv.push_back(word.data());
        argv.push_back(nullptr);
        if (::posix_spawnp(&pid_, argv[0], nullptr, nullptr, argv.data(), environ) != 0) pid_ = -1;
    }
    ~Program() {
        if (pid_ <= 0) return;
        ::kill(pid_, SIGTERM);
        ::waitpid(pid_, nullptr, 0);
    }
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;

private:
    pid_t pid_ = -1;
};

Segment wait_for(const std::string& node) {
    for (int i = 0; i < 1000; ++i) {
        std::string why;
        Segment segment = Segment::try_open(node, why);
        if (segment.is_open() && __atomic_load_n(&segment.header().state, __ATOMIC_RELAXED) == TACTILED_RUNNING)
            return segment;
        ::usleep(5000);
    }
    fmt::print(stderr, "lateness_bench: the daemon \"{}\" does not start\n", node);
    return {};
}

// Returns the phase of the loop's deadlines in its period: the earliest begin of its cycles.
std::uint64_t phase_of(const Segment& segment, std::uint64_t period_ns) {
    std::vector<std::uint64_t> phases;
    tactiled_node node;
    for (int i = 0; i < 500; ++i) {
        if (segment.latest_node(node)) phases.push_back(node.t_ns % period_ns);
        ::usleep(1000);
    }
    std::sort(phases.begin(), phases.end());  // on a circle: the deadline is where the widest gap ends
    std::uint64_t widest = phases.front() + period_ns - phases.back(), at = phases.front();
    for (std::size_t i = 1; i < phases.size(); ++i)
        if (phases[i] - phases[i - 1] > widest) widest = phases[i] - phases[i - 1], at = phases[i];
    return at;
}

Lateness floor(std::uint64_t phase_ns, std::uint64_t period_ns, const std::atomic<bool>& end) {
    Lateness counts{};
    std::uint64_t next_ns = monotonic_ns() / period_ns * period_ns + phase_ns + 10 * period_ns;
    while (!end) {
        sleep_till(next_ns);
        const std::uint64_t now_ns = monotonic_ns(), late_ns = now_ns > next_ns ? now_ns - next_ns : 0;
        ++counts[tactiled_lateness_bucket(late_ns)];
        next_ns += (late_ns / period_ns + 1) * period_ns;
    }
    return counts;
}

void print(const char* what, const Lateness& counts) {
    fmt::print("  {:<26}", what);
    for (const double q : kQuantiles) fmt::print(" {:9.1f}", lateness_quantile_ns(counts, q) / 1000);
    std::uint64_t n = 0;
    for (const auto count : counts) n += count;
    fmt::print(" {:9.0f} us  ({} wake-ups)\n", lateness_quantile_ns(counts, 1) / 1000, n);
}

void write_config(const std::string& folder, const std::string& node, int cpu, int period_us) {
    ::mkdir(folder.c_str(), 0755);
    write_fed_config(folder, node, "", 100);
    std::ofstream(folder + "/tactiled.toml", std::ios::app)
        << fmt::format("\n[realtime]\npriority = {}\ncpu = {}\nperiod_us = {}\n", kPriority, cpu, period_us);
}

}  // namespace

int main(int argc, char** argv) {
    int seconds = 12, runs = 3, hogs = 0, period_us = 1000;
    for (int i = 1; i + 1 < argc; i += 2)
        for (const auto& [name, value] :
             {std::pair{"--seconds", &seconds}, {"--runs", &runs}, {"--hogs", &hogs}, {"--period-us", &period_us}})
            if (std::strcmp(argv[i], name) == 0) *value = std::atoi(argv[i + 1]);
    const std::uint64_t period_ns = std::uint64_t(period_us) * 1000;

    cpu_set_t allowed;
    sched_getaffinity(0, sizeof allowed, &allowed);
    int cpu = CPU_SETSIZE - 1;
    while (!CPU_ISSET(std::size_t(cpu), &allowed)) --cpu;
    char made[] = "/tmp/tactiled-lateness-XXXXXX";
    if (::mkdtemp(made) == nullptr) return 1;
    ::chmod(made, 0755);
    const std::string folder = made, node = "lateness-" + std::to_string(::getpid());
    const std::string daemon = std::filesystem::canonical("/proc/self/exe").parent_path() / "tactiled";
    write_config(folder + "/fifo", node, cpu, period_us);
    write_config(folder + "/other", node + "-other", cpu, period_us);
    const Pty device(folder + "/fifo/dev");

    int failed = 1;
    {
        const Program fifo({daemon, "--config", folder + "/fifo/tactiled.toml"});
        std::unique_ptr<Program> other;
        if (hogs > 0)
            other = std::make_unique<Program>(std::vector<std::string>{"setpriv", "--reuid=65534", "--regid=65534",
                                                                       "--clear-groups", "--inh-caps=-all", daemon,
                                                                       "--config", folder + "/other/tactiled.toml"});
        const Segment ours = wait_for(node), theirs = hogs > 0 ? wait_for(node + "-other") : Segment();
        if (!ours.is_open() || (hogs > 0 && !theirs.is_open())) return 1;
        tactiled_node now;
        if (!ours.latest_node(now) || (now.status & TACTILED_RT_DEGRADED) != 0) {
            fmt::print(stderr, "lateness_bench: the daemon may not be real-time here\n");
            return 1;
        }
        std::vector<std::unique_ptr<Program>> busy;
        for (int i = 0; i < hogs; ++i)
            busy.push_back(std::make_unique<Program>(std::vector<std::string>{"sh", "-c", "while :; do :; done"}));

        std::atomic<bool> done{false};
        std::thread feeder([&] {
            be_realtime(70);
            std::array<std::uint8_t, kCobsMaxEncoded> bytes;
            const std::uint64_t begin_ns = monotonic_ns();
            for (std::uint64_t n = 0; !done; ++n) {
                sleep_till(begin_ns + n * 1'000'000 + n * 7919 % 1'000'000);
                (void)!::write(device.master(), bytes.data(), encode_fed(std::uint32_t(n), bytes));
            }
        });
        const std::uint64_t phase_ns = (phase_of(ours, period_ns) + period_ns / 2) % period_ns;
        fmt::print("period {} us, CPU {}, {} hogs, {} runs of {} s{:>15}{:>10}{:>10}{:>10}\n", period_us, cpu, hogs, runs,
                   seconds, "p50", "p99", "p99.9", "worst");
        for (int run = 0; run < runs; ++run) {
            std::atomic<bool> end{false};
            Lateness of_floor{};
            std::thread bare([&] {
                pin(cpu);
                be_realtime(kPriority);
                of_floor = floor(phase_ns, period_ns, end);
            });
            const Lateness before = ours.lateness(), before_other = hogs > 0 ? theirs.lateness() : Lateness{};
            ::sleep(unsigned(seconds));
            const Lateness late = ours.lateness() - before;
            end = true;
            bare.join();
            print("daemon", late);
            print("floor", of_floor);
            bool good = true;
            fmt::print("  {:<26}", "daemon / floor");
            for (int i = 0; i < 3; ++i) {
                const double ratio =
                    lateness_quantile_ns(late, kQuantiles[i]) / lateness_quantile_ns(of_floor, kQuantiles[i]);
                fmt::print(" {:9.2f}", ratio);
                good &= ratio <= kMax[i];
            }
            if (hogs > 0) {
                const Lateness ordinary = theirs.lateness() - before_other;
                const double ratio = lateness_quantile_ns(ordinary, 0.99) / lateness_quantile_ns(late, 0.99);
                fmt::print("\n");
                print("daemon without the right", ordinary);
                fmt::print("  its p99 / ours {:14.1f}", ratio);
                good &= ratio >= 5;
            }
            fmt::print("  {}\n", good ? "within" : "beyond");
            if (good) failed = 0;
        }
        done = true;
        feeder.join();
    }
    std::filesystem::remove_all(folder);
    return failed;
}
