// The Modbus thread: any number of TCP clients and one RTU line, none of which can delay another.
#pragma once
#include <sys/epoll.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "config/config.hpp"
#include "node/modbus/allow_list.hpp"
#include "node/modbus/connection.hpp"
#include "node/modbus/rtu.hpp"
#include "node/modbus/service.hpp"
#include "node/realtime.hpp"

namespace tactiled {

class ModbusServer {
public:
    // Starts to serve the segment of `node_name`. A port or tty that is not available is tried again each second.
    // setup: throws SetupError where libmodbus or epoll cannot be had
    ModbusServer(std::string node_name, const ModbusSettings& settings, CommandRing& commands);
    ~ModbusServer();
    ModbusServer(const ModbusServer&) = delete;
    ModbusServer& operator=(const ModbusServer&) = delete;

    struct Counts {
        std::atomic<std::uint64_t> accepted{0}, refused{0}, closed{0};
    };
    const Counts& counts() const noexcept { return counts_; }
    // Returns false if the port of [modbus] listen was not available when this object was constructed.
    [[nodiscard]] bool listens_from_the_start() const noexcept { return listens_from_the_start_; }

private:
    struct Client : modbus::Connection {
        Client(int fd, std::uint64_t now_ns, int max_per_s, const sockaddr_storage& from, bool is_plc)
            : Connection(fd, now_ns, max_per_s), peer(from), plc(is_plc) {}
        sockaddr_storage peer;
        bool plc;  // has a reserved place
    };

    void serve() noexcept;
    void cycle();
    int wait_for(std::span<epoll_event> events) const noexcept;
    void tick(std::uint64_t now_ns);  // called some times per second
    [[nodiscard]] bool set_tick(std::uint64_t interval_ns) noexcept;
    [[nodiscard]] std::uint64_t next_due_ns() const noexcept;
    void serve_held_back(std::uint64_t now_ns);
    void serve_line(std::uint64_t now_ns, bool readable);
    void try_to_listen(std::uint64_t now_ns);
    void accept_all(std::uint64_t now_ns);
    void admit(int fd, const sockaddr_storage& peer, bool plc, std::uint64_t now_ns);
    [[nodiscard]] std::size_t places_of(const sockaddr_storage& host, bool plc) const;
    bool make_room(const sockaddr_storage& peer, bool plc, std::uint64_t now_ns);
    void serve_client(int fd, std::uint32_t events, std::uint64_t now_ns);
    void close_overdue(std::uint64_t now_ns);
    void close(int fd);

    ModbusSettings settings_;
    modbus::AllowList allowed_, plcs_, writers_;
    modbus::Service service_;
    modbus::Responder tcp_{ModbusWire::tcp};
    modbus::RtuLine line_;
    int watched_line_ = -1;

    Descriptor epoll_, ticks_, listener_;
    std::uint64_t tick_ns_ = 0;
    std::uint64_t listen_again_ns_ = 0, complain_again_ns_ = 0;
    std::uint64_t looked_ns_ = 0;  // last time at which requests were looked for, on the clock that continues during suspend
    bool listens_from_the_start_ = true;
    bool accepting_paused_ = false;  // out of descriptors: the port stays open, and waiting clients wait a second
    std::string complaint_;
    std::map<int, std::unique_ptr<Client>> clients_;  // key: descriptor
    Counts counts_;
    std::atomic<bool> stop_{false};
    RtThread thread_;
};

}  // namespace tactiled
