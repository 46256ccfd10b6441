#include "drivers/can_netlink.hpp"

#include <linux/can/netlink.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <cerrno>
#include <cstring>
#include <span>
#include <string_view>

namespace tactiled {
namespace {

// Calls what(type, bytes) for each attribute.
template <class F>
void each_attribute(std::span<const char> bytes, F&& what) {
    while (bytes.size() >= sizeof(rtattr)) {
        rtattr attribute;
        std::memcpy(&attribute, bytes.data(), sizeof attribute);
        if (attribute.rta_len < sizeof attribute || attribute.rta_len > bytes.size()) return;
        what(attribute.rta_type & NLA_TYPE_MASK, bytes.subspan(RTA_LENGTH(0), attribute.rta_len - RTA_LENGTH(0)));
        const std::size_t step = RTA_ALIGN(attribute.rta_len);
        bytes = bytes.subspan(step < bytes.size() ? step : bytes.size());
    }
}

std::uint32_t number(std::span<const char> bytes) {
    std::uint32_t value = 0;
    if (bytes.size() >= sizeof value) std::memcpy(&value, bytes.data(), sizeof value);
    return value;
}

}  // namespace

struct CanNetlink::Request {
    nlmsghdr header{};
    ifinfomsg link{};

    Request(unsigned type, unsigned flags, int index) {
        header.nlmsg_len = sizeof *this;
        header.nlmsg_type = std::uint16_t(type);
        header.nlmsg_flags = std::uint16_t(NLM_F_REQUEST | flags);
        link.ifi_family = AF_UNSPEC;
        link.ifi_index = index;
    }
};

struct CanNetlink::Answer {
    alignas(nlmsghdr) char bytes[16384];  // the record of an interface with all its statistics has 2 kB

    [[nodiscard]] const nlmsghdr& header() const { return *reinterpret_cast<const nlmsghdr*>(bytes); }
};

int CanNetlink::open() {
    fd_.reset(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
    if (fd_ < 0) return errno;
    const timeval patience{0, 500'000};
    return ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) == 0 ? 0 : errno;
}

int CanNetlink::exchange(Request& request, Answer& answer) noexcept {
    request.header.nlmsg_seq = ++number_;
    if (::send(fd_, &request, sizeof request, 0) < 0) return errno;
    for (int older = 0; older < 4; ++older) {  // skips answers to earlier requests that timed out
        const ssize_t size = ::recv(fd_, answer.bytes, sizeof answer.bytes, 0);
        if (size < 0) return errno;
        const nlmsghdr& header = answer.header();
        if (std::size_t(size) < sizeof header || header.nlmsg_len > std::size_t(size)) return EBADMSG;
        if (header.nlmsg_seq != number_) continue;
        if (header.nlmsg_type != NLMSG_ERROR) return 0;
        if (header.nlmsg_len < NLMSG_LENGTH(sizeof(nlmsgerr))) return EBADMSG;
        return -reinterpret_cast<const nlmsgerr*>(answer.bytes + NLMSG_HDRLEN)->error;
    }
    return EBADMSG;
}

int CanNetlink::ask(int index, CanInterface& about) noexcept {
    Request request(RTM_GETLINK, 0, index);
    Answer answer;
    if (const int error = exchange(request, answer); error != 0) return error;
    const nlmsghdr& header = answer.header();
    const std::size_t head = NLMSG_LENGTH(sizeof(ifinfomsg));
    if (header.nlmsg_type != RTM_NEWLINK || header.nlmsg_len < head) return EBADMSG;
    const auto* link = reinterpret_cast<const ifinfomsg*>(answer.bytes + NLMSG_HDRLEN);
    about = CanInterface{};
    about.is_can = link->ifi_type == ARPHRD_CAN;
    about.is_up = (link->ifi_flags & IFF_UP) != 0;
    std::span<const char> data;
    bool is_controller = false;  // vcan and slcan have no state
    each_attribute({answer.bytes + head, header.nlmsg_len - head}, [&](int type, std::span<const char> bytes) {
        if (type == IFLA_MTU) about.mtu = number(bytes);
        if (type != IFLA_LINKINFO) return;
        each_attribute(bytes, [&](int kind, std::span<const char> of_kind) {
            if (kind == IFLA_INFO_KIND) is_controller = std::string_view(of_kind.data(), of_kind.size()).starts_with("can");
            if (kind == IFLA_INFO_DATA) data = of_kind;
        });
    });
    if (!is_controller) return 0;
    about.has_bitrate = false;
    each_attribute(data, [&](int type, std::span<const char> bytes) {
        if (type == IFLA_CAN_STATE) about.is_bus_off = number(bytes) == CAN_STATE_BUS_OFF;
        if (type == IFLA_CAN_RESTART_MS) about.restart_ms = number(bytes);
        if (type == IFLA_CAN_BITTIMING) about.has_bitrate = number(bytes) != 0;
    });
    return 0;
}

int CanNetlink::set(int index, bool up) noexcept {
    Request request(RTM_NEWLINK, NLM_F_ACK, index);
    request.link.ifi_change = IFF_UP;
    request.link.ifi_flags = up ? unsigned(IFF_UP) : 0u;
    Answer answer;
    return exchange(request, answer);
}

}  // namespace tactiled
