// A daemon that reads pseudo-terminals or connections, for the benchmarks of the path from the wire to shared memory.
#pragma once
#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
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
    sched_setscheduler(0, SCHED_FIFO, &p);  // if permitted
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

// The path from a device to its reader: one end to write into, one to read from. TCP over loopback is delivered in
// the writer's own system call; a pty needs a kernel thread in between.
class Wire {
public:
    virtual ~Wire() = default;
    virtual int write_end() = 0;
    virtual int read_end() = 0;            // for a reader in this process
    virtual std::string keys() const = 0;  // keys of the [[link]]
};

class PtyWire final : public Wire {
public:
    explicit PtyWire(const std::string& path) : path_(path), pty_(path) {}
    int write_end() override { return pty_.master(); }
    int read_end() override { return pty_.slave(); }
    std::string keys() const override { return fmt::format("driver = \"uart\"\ndevice = \"{}\"\nbaud = 921600\n", path_); }

private:
    std::string path_;
    Pty pty_;
};

class TcpWire final : public Wire {
public:
    TcpWire() {
        listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        address_.sin_family = AF_INET;
        address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof address_;
        if (::bind(listener_, reinterpret_cast<sockaddr*>(&address_), size) != 0 || ::listen(listener_, 1) != 0 ||
            ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address_), &size) != 0)
            std::abort();
    }
    ~TcpWire() override {
        for (const int fd : {listener_, accepted_, connected_})
            if (fd >= 0) ::close(fd);
    }
    int write_end() override {
        if (accepted_ >= 0) return accepted_;
        accepted_ = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        const int on = 1;
        ::setsockopt(accepted_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
        return accepted_;
    }
    int read_end() override {
        if (connected_ >= 0) return connected_;
        connected_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (::connect(connected_, reinterpret_cast<sockaddr*>(&address_), sizeof address_) != 0) std::abort();
        return connected_;
    }
    std::string keys() const override {
        // "direct": the loopback holds nothing back, and a thread that the machine holds up is no reason to connect again.
        return fmt::format("driver = \"tcp\"\naddress = \"127.0.0.1:{}\"\npath = \"direct\"\n", ntohs(address_.sin_port));
    }

private:
    sockaddr_in address_{};
    int listener_ = -1, accepted_ = -1, connected_ = -1;
};

class BenchDaemon {
public:
    // Starts the daemon beside this program, or of `TACTILED_BIN`, with one sensor "s0", "s1", ... for each link.
    // `link_keys`: the keys of each link for its format; `more`: the rest of the configuration.
    BenchDaemon(int links, bool over_tcp, const std::string& link_keys, const std::string& more)
        : name_(fmt::format("bench-{}", ::getpid())) {
        char folder[] = "/tmp/tactiled-bench-XXXXXX";
        if (::mkdtemp(folder) == nullptr) std::abort();
        folder_ = folder;
        write_fed_config(folder_, name_, "", 100);
        std::string text = fmt::format("[node]\nname = \"{}\"\ncontrol = \"{}/control.sock\"\n\n{}\n", name_, folder_, more);
        for (int i = 0; i < links; ++i) {
            if (over_tcp)
                devices_.push_back(std::make_unique<TcpWire>());
            else
                devices_.push_back(std::make_unique<PtyWire>(fmt::format("{}/dev{}", folder_, i)));
            text += fmt::format("[[link]]\nname = \"l{}\"\n{}{}\n", i, devices_.back()->keys(), link_keys);
            text += fmt::format(
                "[[sensor]]\nname = \"s{0}\"\nlink = \"l{0}\"\nmodel = \"generic\"\ncalibration = \"fed.toml\"\n", i);
        }
        text += "[modbus]\nlisten = \"\"\n";
        std::ofstream(folder_ + "/tactiled.toml") << text;

        const char* const other = std::getenv("TACTILED_BIN");
        const std::string beside = std::filesystem::canonical("/proc/self/exe").parent_path();
        const std::string program = std::string(other != nullptr ? other : beside) + "/tactiled";
        const std::string config = folder_ + "/tactiled.toml";
        const char* words[] = {program.c_str(), "--config", config.c_str(), nullptr};
        log_ = folder_ + "/log";
        posix_spawn_file_actions_t actions;
        ::posix_spawn_file_actions_init(&actions);
        ::posix_spawn_file_actions_addopen(&actions, 1, log_.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
        ::posix_spawn_file_actions_adddup2(&actions, 1, 2);
        const int failed = ::posix_spawn(&pid_, program.c_str(), &actions, nullptr, const_cast<char**>(words), environ);
        ::posix_spawn_file_actions_destroy(&actions);
        if (failed != 0) give_up(fmt::format("{} cannot be started: {}", program, std::strerror(failed)));
        ::clock_getcpuclockid(pid_, &cpu_);
        for (int i = 0; i < links; ++i) await(i);
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
    Wire& device(int link) { return *devices_[std::size_t(link)]; }
    double cpu_s() const {
        timespec t{};
        ::clock_gettime(cpu_, &t);
        return double(t.tv_sec) + double(t.tv_nsec) * 1e-9;
    }

private:
    // Waits until the sensor of link `i` has a reader and the link is open.
    void await(int i) {
        auto& reader = readers_.emplace_back();
        for (int n = 0; n < 1000 && (reader == nullptr || !reader->is_attached()); ++n) {
            ::usleep(5000);
            int status = 0;
            if (::waitpid(pid_, &status, WNOHANG) == pid_) {
                pid_ = 0;
                give_up(fmt::format("the daemon ended with status {}", WIFEXITED(status) ? WEXITSTATUS(status) : -1));
            }
            reader = std::make_unique<Reader>(name_, fmt::format("s{}", i));
        }
        if (!reader->is_attached()) give_up(fmt::format("sensor s{} has no segment after 5 s", i));
        const auto& link = reader->segment().link(std::uint32_t(i));
        const auto is_open = [&] { return __atomic_load_n(&link.state, __ATOMIC_RELAXED) == TACTILED_LINK_OPEN; };
        for (int n = 0; n < 400 && !is_open(); ++n) ::usleep(5000);
        if (!is_open()) give_up(fmt::format("link l{} is not open after 2 s", i));
    }
    // Prints the reason and the daemon's log, and ends the program with status 1.
    [[noreturn]] void give_up(const std::string& reason) {
        if (pid_ > 0) {
            ::kill(pid_, SIGTERM);
            ::waitpid(pid_, nullptr, 0);
        }
        std::ifstream log(log_);
        const std::string text((std::istreambuf_iterator<char>(log)), std::istreambuf_iterator<char>());
        fmt::print(stderr, "{}. Its log:\n{}", reason, text);
        std::filesystem::remove_all(folder_);
        std::exit(1);
    }
    std::string name_, folder_, log_;
    std::vector<std::unique_ptr<Wire>> devices_;
    std::vector<std::unique_ptr<Reader>> readers_;
    pid_t pid_ = 0;
    clockid_t cpu_ = 0;
};

}  // namespace tactiled::testing
