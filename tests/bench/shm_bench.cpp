// Shared memory between two processes on two CPUs: 256-byte messages, each word checked, through the ring of the daemon.
//   * hop: a bare cache line to the other CPU and back, halved; the yardstick of the others
//   * closed loop: from before publish until the reader has checked the message, which polls; the next one follows its
//   answer
//   * blocked: one message a millisecond, the reader sleeps; with the CPU time of the reader
//   * publish: 64 calls while the reader does not look
//   * a segment of 16 sensors: calls of the daemon and of a reader
//
//   shm_bench [--seconds 2] [--plant busy-reader]
//
// Exit status 1: a message was lost or wrong, or the blocked reader used more than 10 % of its CPU: then it did not sleep.
// `--plant busy-reader` is that error. SCHED_FIFO where it is permitted. Not shown: other loads of the caches.
#include <fmt/format.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <functional>
#include <new>
#include <string>
#include <vector>

#include "node/shm/writer.hpp"
#include "tests/bench/shm_transport.hpp"

namespace {

using namespace tactiled;

constexpr double kMaxBlockedCpu_percent = 10;
constexpr std::size_t kMaxTimes = 1 << 16;

struct Message {
    std::uint64_t number, sent_ns, words[30];
};

enum Phase : std::uint32_t { kIdle, kHop, kClosed, kBlocked, kEnd };

// Memory that the two processes share beside the ring.
struct Shared {
    alignas(128) std::atomic<std::uint32_t> phase{kIdle};
    alignas(128) std::atomic<std::uint32_t> in_phase{kIdle};
    alignas(128) std::atomic<std::uint64_t> taken{0};
    alignas(128) std::atomic<std::uint64_t> ping{0};
    alignas(128) std::atomic<std::uint64_t> pong{0};
    std::uint64_t wrong = 0, cpu_ns = 0, wall_ns = 0;
    std::size_t times = 0;
    std::uint32_t time_ns[kMaxTimes];
};

using Transport = testing::ShmTransport<Message>;

std::uint64_t cpu_ns() {
    timespec t{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

void use_cpu(int cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(cpu, &set);
    ::sched_setaffinity(0, sizeof set, &set);
    sched_param parameter{};
    parameter.sched_priority = 50;
    ::sched_setscheduler(0, SCHED_FIFO, &parameter);
}

void nap(unsigned us) { ::usleep(us); }

void read_messages(Transport& transport, Shared& shared) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    use_cpu(1);
    transport.init_sub();
    std::uint64_t expected = 1;
    const auto use = [&](const Message* m) {
        bool right = m->number == expected;
        for (std::uint64_t i = 0; i < std::size(m->words); ++i) right = right && m->words[i] == m->number + i;
        if (!right) ++shared.wrong;
        expected = m->number + 1;
        if (m->sent_ns != 0 && shared.times < kMaxTimes)
            shared.time_ns[shared.times++] = std::uint32_t(std::min<std::uint64_t>(monotonic_ns() - m->sent_ns, UINT32_MAX));
        shared.taken.store(m->number, std::memory_order_release);
    };
    for (;;) {
        const std::uint32_t phase = shared.phase.load();
        if (phase == kEnd) return;
        if (phase == shared.in_phase) {
            nap(50);
            continue;
        }
        if (phase == kIdle) {  // the results of the phase before it stay
            shared.in_phase = phase;
            continue;
        }
        while (transport.try_read(use)) continue;
        shared.times = 0;
        const std::uint64_t cpu0_ns = cpu_ns(), wall0_ns = monotonic_ns();
        shared.in_phase = phase;
        while (shared.phase.load(std::memory_order_relaxed) == phase) {
            if (phase == kHop)
                shared.pong.store(shared.ping.load(std::memory_order_acquire), std::memory_order_release);
            else if (phase == kClosed)
                transport.try_read(use);
            else
                transport.wait_read(use, 20);
        }
        shared.cpu_ns = cpu_ns() - cpu0_ns;
        shared.wall_ns = monotonic_ns() - wall0_ns;
    }
}

double quantile(std::vector<double>& values, double share) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[std::size_t(share * double(values.size() - 1))];
}

class Bench {
public:
    Bench(Transport& transport, Shared& shared, double seconds)
        : transport_(transport), shared_(shared), seconds_(seconds) {}

    void hop_and_closed_loop() {
        std::vector<double> hop, closed, in_hops;
        for (int burst = 0; burst < int(10 * seconds_); ++burst) {  // short: the kernel throttles what polls for long
            std::vector<double> hops;
            during(kHop, [&] {
                for (std::uint64_t i = 1; i <= 2000; ++i) {
                    const std::uint64_t begun_ns = monotonic_ns();
                    for (int k = 0; k < 8; ++k) {
                        shared_.ping.store(++pings_, std::memory_order_release);
                        while (shared_.pong.load(std::memory_order_acquire) != pings_) continue;
                    }
                    hops.push_back(double(monotonic_ns() - begun_ns) / 16);
                }
            });
            during(kClosed, [&] {
                for (int i = 0; i < 20'000; ++i) {
                    send(monotonic_ns());
                    while (shared_.taken.load(std::memory_order_acquire) != number_) continue;
                }
            });
            std::vector<double> times(shared_.time_ns, shared_.time_ns + shared_.times);
            in_hops.push_back(quantile(times, 0.5) / quantile(hops, 0.5));
            hop.push_back(quantile(hops, 0.5));
            closed.insert(closed.end(), times.begin(), times.end());
            nap(60'000);
        }
        fmt::print("hop p50 {:.1f} ns\n", quantile(hop, 0.5));
        fmt::print("closed loop p50 {:.0f} ns, p99 {:.0f} ns, {:.2f} hops, messages {}\n", quantile(closed, 0.5),
                   quantile(closed, 0.99), quantile(in_hops, 0.5), closed.size());
    }
    // Returns the share of its CPU that the reader used, %.
    double blocked() {
        std::vector<double> times;
        std::uint64_t cpu_ns = 0, wall_ns = 0;
        for (int burst = 0; burst < int(2 * seconds_); ++burst) {
            const std::uint64_t first = number_;
            during(kBlocked, [&] {
                std::uint64_t next_ns = monotonic_ns();
                for (int i = 0; i < 400; ++i) {
                    tactiled_sleep_until(next_ns += 1'000'000);
                    send(monotonic_ns());
                }
                nap(5000);
            });
            seen_ += shared_.times, sent_ += number_ - first;
            times.insert(times.end(), shared_.time_ns, shared_.time_ns + shared_.times);
            cpu_ns += shared_.cpu_ns, wall_ns += shared_.wall_ns;
        }
        const double cpu = 100 * double(cpu_ns) / double(wall_ns);
        fmt::print("blocked p50 {:.1f} us, p99 {:.1f} us, reader's CPU {:.1f} %, messages {} of {}\n",
                   quantile(times, 0.5) / 1e3, quantile(times, 0.99) / 1e3, cpu, seen_, sent_);
        return cpu;
    }
    void publish() {
        std::vector<double> calls;
        for (int i = 0; i < 500; ++i) {
            const std::uint64_t begun_ns = monotonic_ns();
            for (int k = 0; k < 64; ++k) send(0);
            calls.push_back(double(monotonic_ns() - begun_ns) / 64);
        }
        fmt::print("publish p50 {:.1f} ns\n", quantile(calls, 0.5));
    }
    bool lost() const { return seen_ != sent_; }

private:
    void send(std::uint64_t sent_ns) {
        ++number_;
        transport_.publish([&](Message* m) {
            m->number = number_;
            m->sent_ns = sent_ns;
            for (std::uint64_t i = 0; i < std::size(m->words); ++i) m->words[i] = number_ + i;
        });
    }
    void enter(Phase phase) {
        shared_.phase = phase;
        while (shared_.in_phase != phase) nap(50);
    }
    void during(Phase phase, const std::function<void()>& work) {
        enter(phase);
        work();
        enter(kIdle);
    }
    Transport& transport_;
    Shared& shared_;
    double seconds_;
    std::uint64_t number_ = 0, pings_ = 0, seen_ = 0, sent_ = 0;
};

// Time that the daemon itself adds to a reader and to the loop: a real segment of 16 sensors.
void segment_of_16_sensors() {
    SegmentPlan plan;
    plan.name = "shm-bench-" + std::to_string(::getpid());
    plan.sensors.resize(16);
    for (auto& s : plan.sensors) s.stale_ms = 10'000;
    plan.sensors[0].name[0] = 's';
    SegmentWriter writer(plan);
    writer.set_state(TACTILED_RUNNING);
    tactiled_sample s{}, got{};
    s.quality = TACTILED_GOOD;
    s.t_ns = tactiled_now_ns();
    writer.publish(0, s);
    constexpr int kCalls = 1000;
    const auto timed = [](int calls, const auto& call) {
        const std::uint64_t begun_ns = monotonic_ns();
        for (int i = 0; i < calls; ++i) call();
        return double(monotonic_ns() - begun_ns) / calls;
    };
    std::vector<double> attach, latest, none;
    std::string why;
    for (int i = 0; i < 300; ++i) attach.push_back(timed(1, [&] { Segment::try_open(plan.name, why).latest(0, got); }));
    const auto segment = Segment::open(plan.name);
    Reader reader(plan.name, "s");
    tactiled_node node{};
    for (int round = 0; round < 200; ++round) {
        s.t_ns = s.t_published_ns = node.t_ns = tactiled_now_ns();
        writer.publish(0, s);
        writer.publish(node);
        ++node.sequence;
        reader.next(got);
        latest.push_back(timed(kCalls, [&] { segment.latest(0, got); }));
        none.push_back(timed(kCalls, [&] { reader.next(got); }));
    }
    fmt::print("newest sample {:.1f} ns; nothing new {:.1f} ns\n", quantile(latest, 0.5), quantile(none, 0.5));
    fmt::print("attach and first read {:.1f} us; segment of 16 sensors {} bytes\n", quantile(attach, 0.5) / 1e3,
               std::uint64_t(segment.header().total_size));
}

int usage() {
    fmt::print(stderr, "shm_bench [--seconds 2] [--plant busy-reader]\n");
    return 2;
}

}  // namespace

int main(int argc, char** argv) {
    double seconds = 2;
    Transport transport;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (std::strcmp(argv[i], "--seconds") == 0)
            seconds = std::atof(argv[i + 1]);
        else if (std::strcmp(argv[i], "--plant") == 0 && std::strcmp(argv[i + 1], "busy-reader") == 0)
            transport.plant_busy_reader = true;
        else
            return usage();
    }
    if (argc % 2 == 0 || seconds < 0.5) return usage();
    void* memory = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (memory == MAP_FAILED) return 1;
    auto& shared = *new (memory) Shared;
    transport.before_fork();
    const pid_t reader = ::fork();
    if (reader == 0) {
        read_messages(transport, shared);
        ::_exit(0);
    }
    transport.init_pub();
    use_cpu(0);
    Bench bench(transport, shared, seconds);
    const double cpu = bench.blocked();
    bench.hop_and_closed_loop();
    shared.phase = kEnd;
    ::waitpid(reader, nullptr, 0);
    bench.publish();
    segment_of_16_sensors();
    fmt::print("wrong messages {}\n", shared.wrong);
    if (cpu > kMaxBlockedCpu_percent)
        fmt::print(stderr, "shm_bench: the blocked reader used {:.1f} % of its CPU, more than {} %: it does not sleep\n",
                   cpu, kMaxBlockedCpu_percent);
    if (bench.lost()) fmt::print(stderr, "shm_bench: messages were lost\n");
    return cpu > kMaxBlockedCpu_percent || bench.lost() || shared.wrong != 0 ? 1 : 0;
}
