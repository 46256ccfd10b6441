// A CAN interface as rtnetlink knows it: what it is, whether it is bus-off, down and up.
#pragma once
#include <cstdint>

namespace tactiled {

struct CanInterface {
    bool is_can = false, is_up = false;
    bool has_bitrate = true;  // false: a controller that was never told one, and so cannot go up
    bool is_bus_off = false;
    std::uint32_t mtu = 0;         // 16: classic frames only; 72: CAN FD too
    std::uint32_t restart_ms = 0;  // the kernel's own restart after a bus-off; 0: none
};

// A socket to rtnetlink. Its questions wait for the lock that every `ip link` takes.
class CanNetlink {
public:
    ~CanNetlink() { close(); }
    // Errno, 0 = done. setup
    int open();
    void close() noexcept;

    // Errno, 0 = done. rt: bounded by the kernel's lock; two system calls
    int ask(int index, CanInterface& about) noexcept;
    // Sets the interface up or down: errno, 0 = done. Needs CAP_NET_ADMIN. setup
    int set(int index, bool up) noexcept;

private:
    struct Request;
    struct Answer;
    int exchange(Request& request, Answer& answer) noexcept;

    int fd_ = -1;
    std::uint32_t number_ = 0;
};

}  // namespace tactiled
