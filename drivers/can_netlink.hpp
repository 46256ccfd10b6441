// A CAN interface as rtnetlink knows it: what it is, whether it is bus-off, down and up. Set-up only: the kernel answers
// under a lock that every `ip link` takes.
#pragma once
#include <cstdint>
#include <string>

namespace tactiled {

struct CanInterface {
    bool is_can = false, is_up = false;
    bool has_bitrate = true;  // false: a controller that was never told one, and so cannot go up
    bool is_bus_off = false;
    std::uint32_t mtu = 0;         // 16: classic frames only; 72: CAN FD too
    std::uint32_t restart_ms = 0;  // the kernel's own restart after a bus-off; 0: none
};

// Returns "", or what is wrong. setup
std::string ask_interface(int index, CanInterface& about);
// Sets it up or down: errno, 0 = done. Needs CAP_NET_ADMIN. setup
int set_interface(int index, bool up);

}  // namespace tactiled
