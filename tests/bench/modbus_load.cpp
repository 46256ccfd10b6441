// Modbus over loopback, beside the least that a server can do: an epoll loop in its own process that takes 12 bytes and
// gives back 73, unparsed. Both servers take turns, round by round; the ratio within a round counts.
//
//   modbus_load PORT PID [rounds]        a running daemon, `max_requests_per_s = 0`, `max_clients = 64`
//
// The clients run on CPU 0; the echo and the daemon's Modbus thread on CPU 1: left alone, the scheduler puts one pair on one
// CPU and the other on two, which makes a factor of two.
//
// First a client that waits for each answer, then 16 and 48 of them; then one that asks 200 times a second and is alone, or
// beside a neighbour that asks for unknown functions, sends half a frame, sends a byte each 40 ms, or asks without end and
// never reads. Each answer is checked: transaction, protocol, length, function, byte count. Not shown: a network.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/tcp.h>
#include <sched.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tactiled/reader.hpp"

namespace {

using tactiled::monotonic_ns;
constexpr std::size_t kRequest = 12, kAnswer = 9 + 2 * 32;
using Request = std::array<std::uint8_t, kRequest>;

[[noreturn]] void fail(const std::string& what) {
    fmt::print(stderr, "modbus_load: {}: {}\n", what, std::strerror(errno));
    std::exit(1);
}

void pin(int thread, int cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(cpu, &set);
    if (::sched_setaffinity(thread, sizeof set, &set) != 0) fail("affinity");
}

void pin_modbus_thread(const std::string& pid, int cpu) {
    for (const auto& task : std::filesystem::directory_iterator("/proc/" + pid + "/task")) {
        std::string name;
        std::getline(std::ifstream(task.path() / "comm"), name);
        if (name == "modbus") return pin(std::stoi(task.path().filename()), cpu);
    }
    fail("process " + pid + " has no thread \"modbus\"");
}

sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(std::uint16_t(port));
    return address;
}

// The echo: forked, ends with us. Returns its port.
int start_echo() {
    const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof address;
    if (::bind(listener, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(listener, 64) != 0) fail("echo");
    ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size);
    if (::fork() != 0) return ntohs(address.sin_port);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    pin(0, 1);
    const int epoll = ::epoll_create1(0);
    const auto watch = [&](int fd) {
        epoll_event event{};
        event.events = EPOLLIN;
        event.data.fd = fd;
        ::epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event);
    };
    watch(listener);
    for (std::array<epoll_event, 64> events;;) {
        const int n = ::epoll_wait(epoll, events.data(), int(events.size()), -1);
        for (int i = 0; i < n; ++i) {
            const int fd = events[std::size_t(i)].data.fd;
            if (fd == listener) {
                const int client = ::accept(listener, nullptr, nullptr), one = 1;
                ::setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
                watch(client);
                continue;
            }
            std::array<std::uint8_t, kAnswer> bytes{};
            if (::recv(fd, bytes.data(), kRequest, 0) != ssize_t(kRequest)) {
                ::close(fd);
                continue;
            }
            bytes[5] = kAnswer - 6;
            bytes[8] = kAnswer - 9;
            ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        }
    }
}

class Client {
public:
    explicit Client(int port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        const sockaddr_in address = loopback(port);
        const int one = 1;
        if (::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) fail("connect");
        ::setsockopt(fd_, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    }
    Client(Client&& other) noexcept : fd_(std::exchange(other.fd_, -1)), number_(other.number_) {}
    ~Client() { ::close(fd_); }
    [[nodiscard]] int fd() const { return fd_; }
    Request request(std::uint8_t function = 3) {
        ++number_;
        return {std::uint8_t(number_ >> 8), std::uint8_t(number_), 0, 0, 0, 6, 1, function, 0, 0, 0, 32};
    }
    bool ask() {
        const Request bytes = request();
        return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == ssize_t(bytes.size());
    }
    void take() const {
        std::array<std::uint8_t, 300> b{};
        const ssize_t n = ::recv(fd_, b.data(), b.size(), 0);
        if (n != ssize_t(kAnswer) || b[0] != std::uint8_t(number_ >> 8) || b[1] != std::uint8_t(number_) ||
            b[5] != kAnswer - 6 || b[7] != 3 || b[8] != kAnswer - 9)
            fail(fmt::format("wrong answer of {} bytes", n));
    }

private:
    int fd_;
    unsigned number_ = 0;
};

double at(std::vector<double>& values, double share) {
    std::sort(values.begin(), values.end());
    return values[std::size_t(share * double(values.size() - 1))];
}

struct Load {
    double p50_us = 0, per_s = 0;
};
Load closed_loop(int port, int clients, double seconds) {
    std::vector<Client> all;
    for (int i = 0; i < clients; ++i) all.emplace_back(port);
    const int epoll = ::epoll_create1(0);
    std::vector<std::uint64_t> asked_ns(all.size());
    std::vector<double> us;
    for (std::size_t i = 0; i < all.size(); ++i) {
        epoll_event event{};
        event.events = EPOLLIN;
        event.data.u64 = i;
        ::epoll_ctl(epoll, EPOLL_CTL_ADD, all[i].fd(), &event);
        asked_ns[i] = monotonic_ns();
        if (!all[i].ask()) fail("send");
    }
    const std::uint64_t begun_ns = monotonic_ns(), end_ns = begun_ns + std::uint64_t(seconds * 1e9);
    while (monotonic_ns() < end_ns) {
        std::array<epoll_event, 64> events;
        const int n = ::epoll_wait(epoll, events.data(), int(events.size()), 1000);
        if (n <= 0) fail("no answer for a second");
        for (int k = 0; k < n; ++k) {
            const std::size_t i = events[std::size_t(k)].data.u64;
            all[i].take();
            const std::uint64_t now_ns = monotonic_ns();
            us.push_back(double(now_ns - asked_ns[i]) / 1e3);
            asked_ns[i] = now_ns;
            if (!all[i].ask()) fail("send");
        }
    }
    ::close(epoll);
    const double per_s = double(us.size()) / seconds;
    return {at(us, 0.5), per_s};
}

// The worst wait of a client that asks at 200 Hz, counted from when its request was due. `neighbour` is called each 5 ms.
double worst_wait_us(int port, double seconds, const std::function<void(int)>& neighbour) {
    Client client(port);
    double worst = 0;
    const std::uint64_t begun_ns = monotonic_ns();
    for (int n = 1; n <= int(seconds * 200); ++n) {
        neighbour(n);
        const std::uint64_t due_ns = begun_ns + std::uint64_t(n) * 5'000'000u;
        for (std::uint64_t now = monotonic_ns(); now < due_ns; now = monotonic_ns())
            if (due_ns - now > 200'000) ::usleep(100);
        if (!client.ask()) fail("send");
        client.take();
        worst = std::max(worst, double(monotonic_ns() - due_ns) / 1e3);
    }
    return worst;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) {
        fmt::print(stderr, "usage: modbus_load PORT PID [rounds]\n");
        return 2;
    }
    const int port = std::atoi(argv[1]), rounds = argc > 3 ? std::atoi(argv[3]) : 9;
    const int echo = start_echo();
    pin(0, 0);
    pin_modbus_thread(argv[2], 1);
    for (const int clients : {1, 16, 48}) {
        std::vector<double> ours_us, raw_us, ours_per_s, raw_per_s, slower, rate;
        for (int round = 0; round < rounds; ++round) {
            const Load raw = closed_loop(echo, clients, 0.5), ours = closed_loop(port, clients, 0.5);
            raw_us.push_back(raw.p50_us), ours_us.push_back(ours.p50_us), slower.push_back(ours.p50_us / raw.p50_us);
            raw_per_s.push_back(raw.per_s), ours_per_s.push_back(ours.per_s), rate.push_back(ours.per_s / raw.per_s);
        }
        fmt::print(
            "{:2} clients: wait p50 {:6.1f} us, echo {:6.1f}, ratio {:.2f};  {:7.0f} requests/s, echo {:7.0f}, ratio "
            "{:.2f}\n",
            clients, at(ours_us, .5), at(raw_us, .5), at(slower, .5), at(ours_per_s, .5), at(raw_per_s, .5), at(rate, .5));
    }

    using Neighbour = std::function<void(int)>;
    std::vector<Client> side;
    const auto say = [&](const void* bytes, std::size_t size) {
        return ::send(side.back().fd(), bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    };
    const std::vector<std::pair<const char*, Neighbour>> neighbours{
        {"alone", [](int) {}},
        {"unknown function",
         [&](int n) {
             if (side.empty()) side.emplace_back(port);
             const Request bytes = side.back().request(0x41);
             if (n % 4 == 0) say(bytes.data(), bytes.size());
         }},
        {"half a frame",
         [&](int n) {
             if (n % 60 != 1) return;
             side.emplace_back(port);
             say("\0\1\0\0\0", 5);
         }},
        {"a byte each 40 ms",
         [&](int n) {
             if (side.empty()) side.emplace_back(port);
             if (n % 8 == 0) say(&"\0\1\0\0\0\6\1\3\0\0\0\40"[n / 8 % 12], 1);
         }},
        {"asks without end, never reads",
         [&](int) {
             if (side.empty()) side.emplace_back(port);
             for (int k = 0; k < 64; ++k) {
                 const Request bytes = side.back().request();
                 if (say(bytes.data(), bytes.size()) < 0) break;
             }
         }},
    };
    std::map<std::string, std::vector<double>> waits, ratios;
    for (int round = 0; round < rounds; ++round) {
        double alone = 0;
        for (const auto& [name, neighbour] : neighbours) {
            const double us = worst_wait_us(port, 1.0, neighbour);
            side.clear();
            if (alone == 0) alone = us;
            waits[name].push_back(us);
            ratios[name].push_back(us / alone);
        }
    }
    for (const auto& [name, unused] : neighbours)
        fmt::print("worst wait at 200 Hz, {:30} median of rounds {:7.0f} us, {:.2f} times alone, worst round {:7.0f} us\n",
                   name, at(waits[name], .5), at(ratios[name], .5), at(waits[name], 1));
}
