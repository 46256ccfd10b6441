#include "drivers/can_netlink.hpp"

#include <fmt/format.h>
#include <linux/can/netlink.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <span>

namespace tactiled {
namespace {

struct Request {
    nlmsghdr header{};
    ifinfomsg link{};
};

struct Answer {
    alignas(nlmsghdr) char bytes[16384];  // an interface with all its statistics has 2 kB
    std::size_t size = 0;
};

// Sends a request and takes the answer. Returns an errno, 0 = done.
int ask(Request request, Answer& answer) {
    const int fd = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (fd < 0) return errno;
    const timeval patience{0, 500'000};
    ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    request.header.nlmsg_len = sizeof request;
    request.header.nlmsg_seq = 1;
    const ssize_t sent = ::send(fd, &request, sizeof request, 0);
    const ssize_t size = sent < 0 ? -1 : ::recv(fd, answer.bytes, sizeof answer.bytes, 0);
    const int error = size < 0 ? errno : 0;
    ::close(fd);
    if (error != 0) return error;
    answer.size = std::size_t(size);
    const auto* header = reinterpret_cast<const nlmsghdr*>(answer.bytes);
    if (answer.size < sizeof *header || header->nlmsg_len > answer.size) return EBADMSG;
    if (header->nlmsg_type != NLMSG_ERROR) return 0;
    if (header->nlmsg_len < NLMSG_LENGTH(sizeof(nlmsgerr))) return EBADMSG;
    return -static_cast<const nlmsgerr*>(NLMSG_DATA(header))->error;
}

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

std::string ask_interface(int index, CanInterface& about) {
    Request request;
    request.header.nlmsg_type = RTM_GETLINK;
    request.header.nlmsg_flags = NLM_F_REQUEST;
    request.link.ifi_family = AF_UNSPEC;
    request.link.ifi_index = index;
    Answer answer;
    if (const int error = ask(request, answer); error != 0)
        return fmt::format("the kernel says nothing about it (rtnetlink): {}", std::strerror(error));
    const auto* header = reinterpret_cast<const nlmsghdr*>(answer.bytes);
    if (header->nlmsg_type != RTM_NEWLINK || header->nlmsg_len < NLMSG_LENGTH(sizeof(ifinfomsg)))
        return "the kernel's answer about it (rtnetlink) is not understood";
    const auto* link = static_cast<const ifinfomsg*>(NLMSG_DATA(header));
    about = CanInterface{};
    about.is_can = link->ifi_type == ARPHRD_CAN;
    about.is_up = (link->ifi_flags & IFF_UP) != 0;
    const std::size_t head = NLMSG_LENGTH(sizeof(ifinfomsg));
    const auto of_controller = [&](int type, std::span<const char> bytes) {
        if (type == IFLA_CAN_STATE) about.is_bus_off = number(bytes) == CAN_STATE_BUS_OFF;
        if (type == IFLA_CAN_RESTART_MS) about.restart_ms = number(bytes);
        if (type == IFLA_CAN_BITTIMING) about.has_bitrate = number(bytes) != 0;
    };
    std::span<const char> data;
    bool is_controller = false, has_timing = false;
    each_attribute({answer.bytes + head, header->nlmsg_len - head}, [&](int type, std::span<const char> bytes) {
        if (type == IFLA_MTU) about.mtu = number(bytes);
        if (type != IFLA_LINKINFO) return;
        each_attribute(bytes, [&](int kind, std::span<const char> of_kind) {
            if (kind == IFLA_INFO_KIND) is_controller = std::string_view(of_kind.data(), of_kind.size()).starts_with("can");
            if (kind == IFLA_INFO_DATA) data = of_kind;
        });
    });
    if (!is_controller) return "";  // vcan and slcan have no state
    each_attribute(data, [&](int type, std::span<const char> bytes) {
        has_timing |= type == IFLA_CAN_BITTIMING;
        of_controller(type, bytes);
    });
    if (!has_timing) about.has_bitrate = false;
    return "";
}

int set_interface(int index, bool up) {
    Request request;
    request.header.nlmsg_type = RTM_NEWLINK;
    request.header.nlmsg_flags = NLM_F_REQUEST | NLM_F_ACK;
    request.link.ifi_family = AF_UNSPEC;
    request.link.ifi_index = index;
    request.link.ifi_change = IFF_UP;
    request.link.ifi_flags = up ? unsigned(IFF_UP) : 0u;
    Answer answer;
    return ask(request, answer);
}

}  // namespace tactiled
