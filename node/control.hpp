// The control socket: what a local user may ask the daemon for. AF_UNIX, one packet a request, one packet an answer;
// who may connect is the file's mode, 0660.
//
//     request   NODE tare MASK | NODE untare MASK | NODE clear    MASK: bit n = sensor n, decimal or 0x...
//     answer    STATE RESULT                             enum tactiled_command_state and _result, decimal
#pragma once
#include <atomic>
#include <string>
#include <thread>

#include "node/pipeline.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

class ControlSocket {
public:
    // Replaces a socket that a dead daemon left. setup: throws SetupError where `path` cannot be bound
    ControlSocket(const std::string& path, const std::string& group, const std::string& node_name, Ring<Command>& commands);
    ~ControlSocket();
    ControlSocket(const ControlSocket&) = delete;
    ControlSocket& operator=(const ControlSocket&) = delete;

private:
    void serve() noexcept;
    std::string answer(const std::string& request) noexcept;
    std::string carry_out(Command command) noexcept;

    std::string path_;
    std::string node_name_;
    Ring<Command>& commands_;
    std::uint32_t number_ = 0;
    int listener_ = -1;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

// Sends one request to the socket at `path`; "" with `why` set when there is no answer within `timeout_ms`.
std::string ask_daemon(const std::string& path, const std::string& request, int timeout_ms, std::string& why);

}  // namespace tactiled
