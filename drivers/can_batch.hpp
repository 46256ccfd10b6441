// The messages of one recvmmsg call with the kernel's timestamps, in preallocated memory.
#pragma once
#include <linux/can.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <sys/socket.h>
#include <time.h>

#include <array>
#include <cstdint>
#include <cstring>

namespace tactiled {

class CanBatch {
public:
    static constexpr unsigned kMax = 64;

    struct Timestamps {
        std::uint64_t software_ns = 0, hardware_ns = 0;  // on CLOCK_REALTIME; on the adapter's clock. 0: none
    };

    // Receives messages. Returns the result of recvmmsg. rt: one system call, does not wait
    int receive(int fd) noexcept {
        for (unsigned i = 0; i < kMax; ++i) {
            pieces_[i] = {&frames_[i], sizeof frames_[i]};
            messages_[i] = {};
            messages_[i].msg_hdr.msg_iov = &pieces_[i];
            messages_[i].msg_hdr.msg_iovlen = 1;
            messages_[i].msg_hdr.msg_control = control_[i].bytes;
            messages_[i].msg_hdr.msg_controllen = sizeof control_[i].bytes;
        }
        return ::recvmmsg(fd, messages_.data(), kMax, MSG_DONTWAIT, nullptr);
    }
    [[nodiscard]] const canfd_frame& frame(unsigned i) const noexcept { return frames_[i]; }
    // Returns the maximum payload of the kind of frame that the record's size identifies. Returns 0 if the record is
    // no frame, or if it declares more bytes than it can have.
    [[nodiscard]] std::size_t max_bytes(unsigned i) const noexcept {
        const std::size_t max = messages_[i].msg_len == CAN_MTU     ? CAN_MAX_DLEN
                                : messages_[i].msg_len == CANFD_MTU ? CANFD_MAX_DLEN
                                                                    : 0;
        return frames_[i].len <= max ? max : 0;
    }
    // `overflows` keeps its value if the kernel reports none, which it does while nothing was lost.
    Timestamps timestamps(unsigned i, std::uint32_t& overflows) noexcept {
        Timestamps timestamps;
        msghdr* const head = &messages_[i].msg_hdr;
        for (cmsghdr* c = CMSG_FIRSTHDR(head); c != nullptr; c = CMSG_NXTHDR(head, c)) {
            if (c->cmsg_level != SOL_SOCKET) continue;
            if (c->cmsg_type == SO_RXQ_OVFL) std::memcpy(&overflows, CMSG_DATA(c), sizeof overflows);
            if (c->cmsg_type == SCM_TIMESTAMPING) {
                scm_timestamping t;
                std::memcpy(&t, CMSG_DATA(c), sizeof t);
                timestamps = {ns_of(t.ts[0]), ns_of(t.ts[2])};
            }
        }
        return timestamps;
    }

private:
    template <class T>  // timespec, or the kernel's structure of the same meaning
    static std::uint64_t ns_of(const T& t) noexcept {
        return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
    }

    struct Control {
        alignas(cmsghdr) char bytes[CMSG_SPACE(sizeof(scm_timestamping)) + CMSG_SPACE(sizeof(std::uint32_t))];
    };
    std::array<canfd_frame, kMax> frames_{};
    std::array<Control, kMax> control_{};
    std::array<iovec, kMax> pieces_{};
    std::array<mmsghdr, kMax> messages_{};
};

}  // namespace tactiled
