// The server over real loopback sockets, on a real segment that a writer fills at full speed.
#pragma once
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "node/modbus/server.hpp"
#include "node/shm/writer.hpp"

namespace tactiled::test {

using Bytes = std::vector<std::uint8_t>;

inline std::uint16_t free_port() {
    const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), size), 0);
    ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
    ::close(fd);
    return ntohs(address.sin_port);
}

// A client that sends exactly the given bytes.
class Client {
public:
    explicit Client(std::uint16_t port, const char* from = "127.0.0.1", int receive_buffer = 0) {
        fd_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (receive_buffer != 0) ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        ::inet_pton(AF_INET, from, &address.sin_addr);
        ::bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address);
        ::inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
        address.sin_port = htons(port);
        connected_ = ::connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    }
    ~Client() { ::close(fd_); }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    bool send(const Bytes& bytes) const {
        return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == ssize_t(bytes.size());
    }
    int fd() const { return fd_; }
    // Returns one whole answer, or nothing: closed, or silent for `ms`.
    Bytes answer(int ms = 2000) {
        Bytes bytes;
        while (bytes.size() < 6 || bytes.size() < 6u + std::size_t(bytes[4] << 8 | bytes[5])) {
            pollfd p{fd_, POLLIN, 0};
            const std::size_t want =
                bytes.size() < 6 ? 6 - bytes.size() : 6u + std::size_t(bytes[4] << 8 | bytes[5]) - bytes.size();
            std::uint8_t buffer[300];
            if (::poll(&p, 1, ms) != 1) return {};
            const ssize_t size = ::recv(fd_, buffer, want, 0);
            if (size <= 0) {
                closed_ = true;
                return {};
            }
            bytes.insert(bytes.end(), buffer, buffer + size);
        }
        return bytes;
    }
    bool is_closed_within(int ms) {
        const std::uint64_t until = monotonic_ns() + std::uint64_t(ms) * 1'000'000u;
        while (!closed_ && monotonic_ns() < until) (void)answer(10);
        return closed_;
    }

private:
    int fd_ = -1;
    bool connected_ = false, closed_ = false;
};

inline Bytes read_request(std::uint16_t transaction, std::uint16_t at, std::uint16_t count, std::uint8_t function = 4) {
    return {std::uint8_t(transaction >> 8),
            std::uint8_t(transaction),
            0,
            0,
            0,
            6,
            1,
            function,
            std::uint8_t(at >> 8),
            std::uint8_t(at),
            std::uint8_t(count >> 8),
            std::uint8_t(count)};
}
inline std::uint16_t register_at(const Bytes& answer, std::size_t i) {
    return std::uint16_t(answer[9 + 2 * i] << 8 | answer[10 + 2 * i]);
}

class ServerTest : public testing::Test {
protected:
    ServerTest() : writer_((fill_plan(), plan_)), port_(free_port()) {
        writer_.set_state(TACTILED_RUNNING);
        publish(0);
    }
    ~ServerTest() override {
        stop_ = true;
        if (flood_.joinable()) flood_.join();
    }
    void fill_plan() {
        plan_.name = "server-test-" + std::to_string(::getpid());
        plan_.history = 64;
        plan_.sensors.resize(2);
        for (auto& s : plan_.sensors) s.stale_ms = 10'000;
    }
    // Frame n: every force of every sensor is n mod 30000, in steps of the register.
    void publish(std::uint64_t n) {
        tactiled_node node{};
        for (std::uint32_t i = 0; i < 2; ++i) {
            tactiled_sample s{};
            s.sequence = n;
            s.t_ns = monotonic_ns();
            s.quality = TACTILED_GOOD;
            for (int k = 0; k < 3; ++k) {
                s.force_S_N[k] = 0.01 * double(n % 30000);
                s.torque_S_Nm[k] = 0.001 * double(n % 30000);
            }
            writer_.publish(i, s);
            node.count[i] = n + 1;
        }
        node.sequence = n;
        node.t_ns = monotonic_ns();
        node.heartbeat = 7;
        node.status = TACTILED_READY;
        writer_.publish(node);
    }
    // Runs the pipeline at 4 kHz, or as fast as possible.
    void run_pipeline(unsigned pause_us) {
        flood_ = std::thread([this, pause_us] {
            for (std::uint64_t n = 1; !stop_; ++n) {
                publish(n);
                if (pause_us != 0) ::usleep(pause_us);
            }
        });
    }
    std::unique_ptr<ModbusServer> serve(int max_clients = 8, const std::vector<std::string>& allow = {}) {
        ModbusSettings settings{};
        settings.listen = "127.0.0.1:" + std::to_string(port_);
        settings.allow = allow;
        settings.max_clients = max_clients;
        return std::make_unique<ModbusServer>(plan_.name, settings, commands_);
    }

    SegmentPlan plan_;
    SegmentWriter writer_;
    CommandRing commands_{16};
    std::uint16_t port_;
    std::thread flood_;
    std::atomic<bool> stop_{false};
};

}  // namespace tactiled::test
