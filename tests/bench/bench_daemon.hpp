// A daemon that reads pseudo-terminals, for the benchmarks of the path from the wire to shared memory.
#pragma once
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "tactiled/reader.hpp"
#include "tests/system/pty_feeder.hpp"

extern char** environ;

namespace tactiled::testing {

inline void be_realtime(int priority) {
    sched_param p{};
    p.sched_priority = priority;
    sched_setscheduler(0, SCHED_FIFO, &p);  // where allowed
}

inline void sleep_till(std::uint64_t t_ns) {
    const timespec t{time_t(t_ns / 1'000'000'000u), long(t_ns % 1'000'000'000u)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

// Prints quantiles of `us`, which is sorted.
inline void print_quantiles(const char* what, std::vector<double>& us) {
    if (us.empty()) return;
    std::sort(us.begin(), us.end());
    const auto at = [&](double q) { return us[std::min(us.size() - 1, std::size_t(q * double(us.size())))]; };
    const auto late = us.end() - std::upper_bound(us.begin(), us.end(), 1000.0);
    fmt::print("{:<42} p50 {:7.1f}  p99 {:7.1f}  p99.9 {:8.1f}  worst {:8.1f} us  {} of {} above 1 ms\n", what, at(0.5),
               at(0.99), at(0.999), us.back(), late, us.size());
}

class BenchDaemon {
public:
    // Starts the daemon beside this program, or of `TACTILED_BIN`, with one sensor "s0", "s1", ... for each link.
    // `link_keys`: the keys of each link after `device`; `more`: the rest of the configuration.
    BenchDaemon(int links, const std::string& link_keys, const std::string& more) : name_(fmt::format("bench-{}", ::getpid())) {
        char folder[] = "/tmp/tactiled-bench-XXXXXX";
        if (::mkdtemp(folder) == nullptr) std::abort();
        folder_ = folder;
        write_fed_config(folder_, name_, "", 100);
        std::string text = fmt::format("[node]\nname = \"{}\"\ncontrol = \"{}/control.sock\"\n\n{}\n", name_, folder_, more);
        for (int i = 0; i < links; ++i) {
            devices_.push_back(std::make_unique<Pty>(fmt::format("{}/dev{}", folder_, i)));
            text += fmt::format("[[link]]\nname = \"l{0}\"\ndriver = \"uart\"\ndevice = \"{1}/dev{0}\"\n{2}\n", i, folder_, link_keys);
            text += fmt::format("[[sensor]]\nname = \"s{0}\"\nlink = \"l{0}\"\nmodel = \"generic\"\ncalibration = \"fed.toml\"\n", i);
        }
        text += "[modbus]\nlisten = \"\"\n";
        std::ofstream(folder_ + "/tactiled.toml") << text;

        const char* const other = std::getenv("TACTILED_BIN");
        const std::string beside = std::filesystem::canonical("/proc/self/exe").parent_path();
        const std::string program = std::string(other != nullptr ? other : beside) + "/tactiled";
        const std::string config = folder_ + "/tactiled.toml";
        const char* words[] = {program.c_str(), "--config", config.c_str(), nullptr};
        if (::posix_spawn(&pid_, program.c_str(), nullptr, nullptr, const_cast<char**>(words), environ) != 0) std::abort();
        ::clock_getcpuclockid(pid_, &cpu_);
        for (int i = 0; i < links; ++i) {
            auto& reader = readers_.emplace_back();
            for (int n = 0; n < 1000 && (reader == nullptr || !reader->is_attached()); ++n) {
                ::usleep(5000);
                reader = std::make_unique<Reader>(name_, fmt::format("s{}", i));
            }
            const auto& link = reader->segment().link(std::uint32_t(i));
            for (int n = 0; n < 400 && __atomic_load_n(&link.state, __ATOMIC_RELAXED) != TACTILED_LINK_OPEN; ++n) ::usleep(5000);
        }
        ::usleep(300'000);
    }
    ~BenchDaemon() {
        ::kill(pid_, SIGTERM);
        ::waitpid(pid_, nullptr, 0);
        std::filesystem::remove_all(folder_);
    }
    BenchDaemon(const BenchDaemon&) = delete;
    BenchDaemon& operator=(const BenchDaemon&) = delete;

    const std::string& name() const { return name_; }
    Reader& reader(int link) { return *readers_[std::size_t(link)]; }
    const Pty& device(int link) const { return *devices_[std::size_t(link)]; }
    double cpu_s() const {
        timespec t{};
        ::clock_gettime(cpu_, &t);
        return double(t.tv_sec) + double(t.tv_nsec) * 1e-9;
    }

private:
    std::string name_, folder_;
    std::vector<std::unique_ptr<Pty>> devices_;
    std::vector<std::unique_ptr<Reader>> readers_;
    pid_t pid_ = 0;
    clockid_t cpu_ = 0;
};

}  // namespace tactiled::testing
