// The datagrams of one recvmmsg call with the kernel's times of arrival, in preallocated memory.
#pragma once
#include <sys/socket.h>
#include <time.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace tactiled {

class UdpBatch {
public:
    static constexpr unsigned kMax = 32;

    // `bytes`: longest datagram. setup
    explicit UdpBatch(std::size_t bytes) : size_(bytes), bytes_(kMax * bytes) {
        for (unsigned i = 0; i < kMax; ++i) pieces_[i] = {bytes_.data() + i * size_, size_};
    }

    // Returns the result of recvmmsg. rt: one system call, does not wait
    int receive(int fd) noexcept {
        for (unsigned i = 0; i < used_; ++i) {
            messages_[i] = {};
            messages_[i].msg_hdr.msg_name = &from_[i];
            messages_[i].msg_hdr.msg_namelen = sizeof from_[i];
            messages_[i].msg_hdr.msg_iov = &pieces_[i];
            messages_[i].msg_hdr.msg_iovlen = 1;
            messages_[i].msg_hdr.msg_control = control_[i].bytes;
            messages_[i].msg_hdr.msg_controllen = sizeof control_[i].bytes;
        }
        const int n = ::recvmmsg(fd, messages_.data(), kMax, MSG_DONTWAIT, nullptr);
        used_ = n < 0 ? kMax : unsigned(n);
        return n;
    }
    [[nodiscard]] std::span<const std::uint8_t> datagram(unsigned i) const noexcept {
        return {bytes_.data() + i * size_, messages_[i].msg_len};
    }
    [[nodiscard]] const sockaddr_storage& from(unsigned i) const noexcept { return from_[i]; }
    [[nodiscard]] bool is_cut(unsigned i) const noexcept { return (messages_[i].msg_hdr.msg_flags & MSG_TRUNC) != 0; }
    // Returns the time of arrival on CLOCK_REALTIME. `overflows` keeps its value if the kernel reports none.
    std::uint64_t timestamp_ns(unsigned i, std::uint32_t& overflows) noexcept {
        std::uint64_t timestamp_ns = 0;
        msghdr* const head = &messages_[i].msg_hdr;
        for (cmsghdr* c = CMSG_FIRSTHDR(head); c != nullptr; c = CMSG_NXTHDR(head, c)) {
            if (c->cmsg_level != SOL_SOCKET) continue;
            if (c->cmsg_type == SO_RXQ_OVFL) std::memcpy(&overflows, CMSG_DATA(c), sizeof overflows);
            if (c->cmsg_type == SCM_TIMESTAMPNS) {
                timespec t;
                std::memcpy(&t, CMSG_DATA(c), sizeof t);
                timestamp_ns = std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
            }
        }
        return timestamp_ns;
    }

private:
    struct Control {
        alignas(cmsghdr) char bytes[CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))];
    };
    std::size_t size_;
    unsigned used_ = kMax;  // messages that the kernel has written since they were prepared
    std::vector<std::uint8_t> bytes_;
    std::array<sockaddr_storage, kMax> from_{};
    std::array<Control, kMax> control_{};
    std::array<iovec, kMax> pieces_{};
    std::array<mmsghdr, kMax> messages_{};
};

}  // namespace tactiled
