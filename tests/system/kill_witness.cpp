// Kills the daemon with kill -9 at random moments and starts it again, while readers poll continuously.   kill_witness
// [KILLS] [SEED] Fails if a reader call takes a second, a GOOD sample is wrong or old, a value crosses a restart without a
// new epoch, or a start needs any cleanup.
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "tactiled/reader.hpp"
#include "tests/system/pty_feeder.hpp"

extern char** environ;

namespace {

using namespace tactiled;
using namespace tactiled::testing;

constexpr int kStaleMs = 100;

struct Findings {
    std::atomic<std::uint64_t> calls{0}, good{0}, bad{0}, wrong{0}, old{0}, without_discontinuity{0}, backwards{0},
        longest_ns{0};
};

// Counts events that a reader must never see.
class Witness {
public:
    explicit Witness(Findings& findings) : findings_(findings) {}

    template <class Call>
    bool time(Call call) {
        const std::uint64_t before = monotonic_ns();
        const bool got = call();
        const std::uint64_t took = monotonic_ns() - before;
        ++findings_.calls;
        if (took > findings_.longest_ns) findings_.longest_ns = took;
        before_ns_ = before;
        return got;
    }
    void look(const tactiled_sample& s, const tactiled_header& header) {
        if (s.quality != TACTILED_GOOD) {
            ++findings_.bad;
            return;
        }
        ++findings_.good;
        if (!is_as_fed(s)) ++findings_.wrong;
        if (before_ns_ > s.t_ns && before_ns_ - s.t_ns > std::uint64_t(kStaleMs) * 1'000'000u) ++findings_.old;
        if (s.epoch >> 16 != (header.epoch & 0xFFFFu) || (header.pid != pid_ && s.epoch == epoch_))
            ++findings_.without_discontinuity;
        pid_ = header.pid;
        if (s.epoch == epoch_ && s.t_ns < t_ns_) ++findings_.backwards;
        epoch_ = s.epoch;
        t_ns_ = s.t_ns;
    }

private:
    Findings& findings_;
    std::uint64_t before_ns_ = 0, t_ns_ = 0;
    std::uint32_t epoch_ = 0, pid_ = 0;
};

pid_t start(const std::string& folder) {
    const std::string program = std::filesystem::canonical("/proc/self/exe").parent_path() / "tactiled";
    const std::string config = folder + "/tactiled.toml";
    const char* words[] = {program.c_str(), "--config", config.c_str(), nullptr};
    posix_spawn_file_actions_t quiet;
    posix_spawn_file_actions_init(&quiet);
    posix_spawn_file_actions_addopen(&quiet, 2, (folder + "/log").c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    pid_t pid = -1;
    if (::posix_spawn(&pid, program.c_str(), &quiet, nullptr, const_cast<char**>(words), environ) != 0) std::abort();
    posix_spawn_file_actions_destroy(&quiet);
    return pid;
}

// A reader that sleeps on the node ring and subscribes to events. It is killed in each cycle and must not leave
// anything that blocks the daemon.
int be_a_victim(const char* node) {
    Reader reader(node, "left");
    tactiled_sample s{};
    int connection = -1;
    for (bool subscribed = false;;) {
        (void)reader.wait(s, 100, Wait::block);
        if (!subscribed && reader.is_attached())
            subscribed =
                tactiled_ask_descriptor(reader.segment().c(), "events", &connection, monotonic_ns() + 1'000'000'000u) >= 0;
    }
}

pid_t start_a_victim(const std::string& node) {
    const std::string program = std::filesystem::canonical("/proc/self/exe");
    const char* words[] = {program.c_str(), "--victim", node.c_str(), nullptr};
    pid_t pid = -1;
    if (::posix_spawn(&pid, program.c_str(), nullptr, nullptr, const_cast<char**>(words), environ) != 0) std::abort();
    return pid;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc == 3 && std::string(argv[1]) == "--victim") return be_a_victim(argv[2]);
    const int kills = argc > 1 ? std::atoi(argv[1]) : 40;
    std::mt19937 random(argc > 2 ? unsigned(std::atoi(argv[2])) : 1u);
    char folder[] = "/tmp/tactiled-kill-XXXXXX";
    if (::mkdtemp(folder) == nullptr) return 1;
    const std::string node = "kill-" + std::to_string(::getpid());
    const Pty device(std::string(folder) + "/dev");
    write_fed_config(folder, node, "", kStaleMs);

    std::atomic<bool> stop{false};
    std::thread feeder([&] {
        std::array<std::uint8_t, kCobsMaxEncoded> bytes;
        for (std::uint32_t n = 0; !stop; ++n) {
            const std::size_t size = encode_fed(n, bytes);
            [[maybe_unused]] const auto sent = ::write(device.master(), bytes.data(), size);  // full without a reader: lost
            ::usleep(950);
        }
    });
    Findings findings;
    std::thread newest([&] {
        Reader reader(node, "left");
        Witness witness(findings);
        tactiled_sample s{};
        while (!stop) {
            witness.time([&] { return s = reader.latest(), true; });
            if (reader.is_attached()) witness.look(s, reader.segment().header());
        }
    });
    std::thread follower([&] {
        Reader reader(node, "left");
        Witness witness(findings);
        tactiled_sample s{};
        while (!stop)
            if (witness.time([&] { return reader.wait(s, 20, Wait::block); })) witness.look(s, reader.segment().header());
    });

    std::vector<double> ready_ms;
    int not_started = 0, wrong_epoch = 0;
    std::uint32_t last_epoch = 0;
    for (int n = 0; n < kills; ++n) {
        const std::uint64_t began = monotonic_ns();
        const pid_t daemon = start(folder), victim = start_a_victim(node);
        // Half of the kills are at any moment of the start, half during normal operation.
        const auto patience_us = std::uniform_int_distribution<unsigned>(0, n % 2 == 0 ? 20'000 : 60'000)(random);
        if (n % 2 == 1) {
            Reader reader(node, "left");
            bool good = false;
            while (!good && monotonic_ns() - began < 5'000'000'000u) {
                good = reader.latest().quality == TACTILED_GOOD && reader.segment().header().pid == std::uint32_t(daemon);
                ::usleep(500);
            }
            if (!good) ++not_started;
            ready_ms.push_back(double(monotonic_ns() - began) / 1e6);
            if (good && reader.segment().header().epoch <= last_epoch) ++wrong_epoch;
            last_epoch = reader.segment().header().epoch;
        }
        ::usleep(patience_us);
        const bool reader_first = random() % 2 == 0;
        for (const pid_t pid : {reader_first ? victim : daemon, reader_first ? daemon : victim}) {
            ::kill(pid, SIGKILL);
            ::waitpid(pid, nullptr, 0);
        }
    }
    ::usleep(2 * kStaleMs * 1000);
    const bool stale_at_last = Reader(node, "left").latest().quality == TACTILED_BAD;
    stop = true;
    feeder.join();
    newest.join();
    follower.join();
    // Only the last victim's segment may be left.
    int left_behind = 0;
    const std::string run_folder = Segment::open(node).c()->folder;
    for (const auto& file : std::filesystem::directory_iterator(run_folder))
        if (file.path().filename().string().find(node) != std::string::npos) ++left_behind;
    std::filesystem::remove(run_folder + "/tactiled." + node);
    std::filesystem::remove_all(folder);

    std::sort(ready_ms.begin(), ready_ms.end());
    fmt::print("kills of daemon and reader {} each, reader calls {}, GOOD {}, not GOOD {}\n", kills, findings.calls.load(),
               findings.good.load(), findings.bad.load());
    fmt::print("wrong {}, old {}, without a break {}, backwards {}, longest call {:.1f} ms\n", findings.wrong.load(),
               findings.old.load(), findings.without_discontinuity.load(), findings.backwards.load(),
               double(findings.longest_ns) / 1e6);
    fmt::print("starts that did not become GOOD {}, wrong epoch {}, files left {}, stale after the last kill {}\n",
               not_started, wrong_epoch, left_behind, stale_at_last ? "yes" : "NO");
    if (!ready_ms.empty())
        fmt::print("start to GOOD: p50 {:.0f} ms, worst {:.0f} ms\n", ready_ms[ready_ms.size() / 2], ready_ms.back());
    const bool clean = findings.wrong + findings.old + findings.without_discontinuity + findings.backwards == 0 &&
                       not_started == 0 && wrong_epoch == 0 && left_behind <= 1 && stale_at_last &&
                       findings.longest_ns < 1'000'000'000u && findings.good > 0;
    return clean ? 0 : 1;
}
