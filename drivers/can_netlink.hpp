// The state of a CAN interface through rtnetlink: its kind, bus-off, up and down.
#pragma once
#include <cstdint>

#include "drivers/descriptor.hpp"

namespace tactiled {

struct CanInterface {
    bool is_can = false, is_up = false;
    bool has_bitrate = true;  // false: a controller without a configured bit rate, which cannot be set up
    bool is_bus_off = false;
    std::uint32_t mtu = 0;         // 16: classic frames only; 72: CAN FD
    std::uint32_t restart_ms = 0;  // delay of the kernel's automatic restart after a bus-off; 0: none
};

// A socket to rtnetlink. Requests wait for the kernel lock that each `ip link` takes.
class CanNetlink {
public:
    // Opens the socket. Returns errno, 0 on success. setup
    int open();
    void close() noexcept { fd_.reset(); }

    // Reads the state of an interface. Returns errno, 0 on success. rt: bounded by the kernel's lock; two system
    // calls
    int ask(int index, CanInterface& about) noexcept;
    // Sets the interface up or down. Returns errno, 0 on success. Needs CAP_NET_ADMIN. setup
    int set(int index, bool up) noexcept;

private:
    struct Request;
    struct Answer;
    int exchange(Request& request, Answer& answer) noexcept;

    Descriptor fd_;
    std::uint32_t number_ = 0;
};

}  // namespace tactiled
