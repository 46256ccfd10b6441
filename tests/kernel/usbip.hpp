// The interface to emulate a USB device for the kernel of the test machine: the messages of vhci_hcd over a socket
// pair (the kernel's Documentation/usb/usbip_protocol.rst).
#pragma once
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <stdexcept>

namespace tactiled::test::usbip {

struct Submit {
    std::uint32_t flags, length, start_frame, packets, interval;
    std::uint8_t setup[8];
};
struct Answer {
    std::uint32_t status, length, start_frame, packets, errors;
    std::uint8_t unused[8];
};
struct Unlink {
    std::uint32_t sequence;
    std::uint8_t unused[24];
};
struct [[gnu::packed]] Header {  // big endian, but for `setup`
    std::uint32_t command, sequence, device, direction, endpoint;
    union {
        Submit submit;
        Answer answer;
        Unlink unlink;
    };
};
static_assert(sizeof(Header) == 48);
enum : std::uint32_t { kSubmit = 1, kUnlink = 2, kSubmitted = 3, kUnlinked = 4 };

inline bool read_all(int fd, void* to, std::size_t size) {
    for (auto* at = static_cast<char*>(to); size > 0;) {
        const ssize_t n = ::read(fd, at, size);
        if (n <= 0) return false;
        at += n;
        size -= std::size_t(n);
    }
    return true;
}

// Plugs device `number` of bus 1 into a port of the kernel's hub; our end of its cable. Closing it pulls it out.
inline int plug(int port, unsigned number) {
    int pair[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0) throw std::runtime_error("socketpair");
    std::FILE* const attach = std::fopen("/sys/devices/platform/vhci_hcd.0/attach", "w");
    if (attach == nullptr) throw std::runtime_error("no vhci_hcd: is the module loaded?");
    std::fprintf(attach, "%d %d %u %d", port, pair[1], 0x10000 + number, 2);  // 2: full speed
    if (std::fclose(attach) != 0) throw std::runtime_error("vhci_hcd refused");
    ::close(pair[1]);
    return pair[0];
}

}  // namespace tactiled::test::usbip
