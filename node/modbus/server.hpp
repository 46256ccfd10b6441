// Modbus TCP: one thread, any number of clients, none of which can delay another. A reader of shared memory like any other:
// it could be a process of its own.
#pragma once
#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include "config/config.hpp"
#include "node/modbus/allow_list.hpp"
#include "node/modbus/connection.hpp"
#include "node/modbus/encode.hpp"
#include "node/modbus/responder.hpp"

namespace tactiled {

class ModbusServer {
public:
    // Starts to serve the segment of `node_name`. A port that is not to be had is asked for again each second.
    // setup: throws SetupError where libmodbus or epoll cannot be had
    ModbusServer(std::string node_name, const ModbusSettings& settings);
    ~ModbusServer();
    ModbusServer(const ModbusServer&) = delete;
    ModbusServer& operator=(const ModbusServer&) = delete;

    struct Counts {
        std::atomic<std::uint64_t> requests{0}, exceptions{0}, accepted{0}, refused{0}, closed{0};
    };
    const Counts& counts() const noexcept { return counts_; }

private:
    void serve();
    void try_to_listen(std::uint64_t now_ns);
    void stop_listening() noexcept;
    void accept_all(std::uint64_t now_ns);
    bool make_room(std::uint64_t now_ns);
    void serve_client(int fd, std::uint64_t now_ns);
    void close_overdue(std::uint64_t now_ns);
    void close(int fd);
    std::size_t answer(std::span<const std::uint8_t> adu, std::span<std::uint8_t, modbus::kMostAdu> out);

    std::string node_name_;
    ModbusSettings settings_;
    modbus::AllowList allowed_;
    modbus::Responder responder_;
    Segment segment_;
    std::uint64_t segment_tried_ns_ = 0;

    int epoll_ = -1, listener_ = -1;
    std::uint64_t listen_again_ns_ = 0, looked_for_overdue_ns_ = 0;
    bool looks_away_ = false;  // out of descriptors: the port stays ours, who waits there waits a second
    std::string complaint_;
    std::map<int, std::unique_ptr<modbus::Connection>> clients_;  // by descriptor
    Counts counts_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace tactiled
