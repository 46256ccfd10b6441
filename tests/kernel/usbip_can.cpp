// usbip_can PORT: plays a candleLight adapter (gs_usb) to this kernel's vhci_hcd: a can0 with the state of a controller,
// hardware stamps, error frames, overflows, a jammed transmitter; pulled out when it ends. Commands, a line each, on
// standard input:
//   rx ID HEX      a message came, stamped now; ID in hex, + 80000000: 29 bits
//   now ID         the same, its data the stamp itself: us modulo 1,000,000, 32 bits with the lowest byte first
//   err BITS HEX   an error frame: bits of CAN_ERR_*, eight bytes
//   over           the controller loses messages before the next one
//   broken 0|1     each start of the controller ends in bus-off
//   stall 0|1      nothing is sent any more: messages wait in the queue
#include <poll.h>
#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/kernel/usbip.hpp"

namespace {

using namespace tactiled::test::usbip;

// ---- the protocol of gs_usb ----

struct [[gnu::packed]] Message {  // struct gs_host_frame with a classic frame and its timestamp
    std::uint32_t echo, id;
    std::uint8_t length, channel, flags, reserved, data[8];
    std::uint32_t timestamp_us;
};
static_assert(sizeof(Message) == 24);
constexpr std::uint32_t kReceived = 0xFFFF'FFFF;  // not an echo of one that was sent
constexpr std::uint8_t kOverflow = 1;
constexpr std::uint32_t kErrorFrame = 0x2000'0000, kBusOff = 0x40;
enum : std::uint8_t { kMode = 2, kTimingLimits = 4, kDeviceConfig = 5, kTimestamp = 6 };

constexpr std::uint8_t kDevice[18] = {18, 1, 0, 2, 0, 0, 0, 64, 0x50, 0x1D, 0x6F, 0x60, 0, 1, 1, 2, 3, 1};
constexpr std::uint8_t kConfiguration[32] = {9,    2, 32, 0, 1,    1, 0,  0x80, 50, 9, 4, 0,    0, 2,  0xFF, 0xFF,
                                             0xFF, 0, 7,  5, 0x81, 2, 64, 0,    0,  7, 5, 0x02, 2, 64, 0,    0};

std::uint32_t now_us() {
    timespec t;
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return std::uint32_t(std::uint64_t(t.tv_sec) * 1'000'000u + std::uint64_t(t.tv_nsec) / 1000);
}

// ---- the adapter ----

class Adapter {
public:
    explicit Adapter(int socket) : socket_(socket) {}

    void command(const std::string& line) {
        char hex[32] = "";
        unsigned number = 0;
        if (std::sscanf(line.c_str(), "rx %x %16s", &number, hex) >= 1)
            receive(number, hex, std::exchange(overflows_, false) ? kOverflow : 0);
        else if (std::sscanf(line.c_str(), "now %x", &number) == 1)
            receive(number, "", 0, true);
        else if (std::sscanf(line.c_str(), "err %x %16s", &number, hex) == 2)
            receive(kErrorFrame | number, hex, 0);
        else if (line == "over")
            overflows_ = true;
        else if (std::sscanf(line.c_str(), "broken %u", &number) == 1)
            broken_ = number != 0;
        else if (std::sscanf(line.c_str(), "stall %u", &number) == 1)
            stalled_ = number != 0;
        else
            std::fprintf(stderr, "usbip_can: what is \"%s\"?\n", line.c_str());
    }

    // Handles one request of the kernel; returns false at the end.
    bool request() {
        Header header;
        if (!read_all(socket_, &header, sizeof header)) return false;
        if (ntohl(header.command) == kUnlink) return unlink(header);
        const bool in = ntohl(header.direction) == 1;
        std::vector<std::uint8_t> data(ntohl(header.submit.length));
        if (!in && !data.empty() && !read_all(socket_, data.data(), data.size())) return false;
        switch (ntohl(header.endpoint)) {
            case 1: waiting_.push_back(header.sequence); break;
            case 2:
                answer(header.sequence, 0, nullptr, data.size());
                if (!stalled_) echo(data);
                break;
            default: control(header, in, data);
        }
        deliver();
        return true;
    }

private:
    void receive(std::uint32_t id, std::string_view hex, std::uint8_t flags, bool timestamp_as_data = false) {
        Message message{};
        message.echo = kReceived;
        message.id = id;
        message.flags = flags;
        message.timestamp_us = now_us();
        message.length = std::uint8_t(hex.size() / 2);
        for (std::size_t k = 0; k < message.length; ++k)
            message.data[k] = std::uint8_t(std::stoul(std::string(hex.substr(2 * k, 2)), nullptr, 16));
        if (timestamp_as_data) {
            const std::uint32_t us = message.timestamp_us % 1'000'000;
            std::memcpy(message.data, &us, message.length = sizeof us);
        }
        messages_.push_back(message);
        deliver();
    }

    void echo(const std::vector<std::uint8_t>& sent) {
        Message message{};
        std::memcpy(&message, sent.data(), std::min(sent.size(), sizeof message));
        message.timestamp_us = now_us();
        messages_.push_back(message);
    }

    void deliver() {
        for (; !waiting_.empty() && !messages_.empty(); waiting_.pop_front(), messages_.pop_front())
            answer(waiting_.front(), 0, &messages_.front(), sizeof(Message));
    }

    bool unlink(const Header& header) {
        const auto found = std::find(waiting_.begin(), waiting_.end(), header.unlink.sequence);
        Header reply{};
        reply.command = htonl(kUnlinked);
        reply.sequence = header.sequence;
        reply.answer.status =
            found != waiting_.end() ? htonl(std::uint32_t(-104)) : 0;  // -ECONNRESET: it will not be answered
        if (found != waiting_.end()) waiting_.erase(found);
        return ::write(socket_, &reply, sizeof reply) == sizeof reply;
    }

    void control(const Header& header, bool in, std::vector<std::uint8_t>& data) {
        const std::uint8_t* const setup = header.submit.setup;
        std::size_t size = in ? 0 : data.size();
        int status = 0;
        const auto reply = [&](const void* bytes, std::size_t n) {
            size = std::min(n, data.size());
            std::memcpy(data.data(), bytes, size);
        };
        if ((setup[0] & 0x60) == 0x40) {
            const std::uint32_t config[3] = {0, 2, 1}, now = now_us();  // one channel
            // With timestamps; 48 MHz, and the limits of a bit's segments.
            const std::uint32_t limits[10] = {1u << 4, 48'000'000, 1, 16, 1, 8, 4, 1, 1024, 1};
            if (setup[1] == kDeviceConfig) reply(config, sizeof config);
            if (setup[1] == kTimingLimits) reply(limits, sizeof limits);
            if (setup[1] == kTimestamp) reply(&now, sizeof now);
            if (setup[1] == kMode && broken_ && data.size() >= 4 && data[0] == 1)
                receive(kErrorFrame | kBusOff, "0000000000000000", 0);
        } else if (setup[1] == 6) {  // a descriptor
            const std::uint8_t language[4] = {4, 3, 9, 4}, text[8] = {8, 3, 'E', 0, 'M', 0, 'U', 0};
            if (setup[3] == 1)
                reply(kDevice, sizeof kDevice);
            else if (setup[3] == 2)
                reply(kConfiguration, sizeof kConfiguration);
            else if (setup[3] == 3 && setup[2] == 0)
                reply(language, sizeof language);
            else if (setup[3] == 3)
                reply(text, sizeof text);
            else
                status = -32;  // -EPIPE: there is none
        } else if (setup[1] == 0) {
            const std::uint8_t healthy[2] = {0, 0};
            reply(healthy, sizeof healthy);
        }
        answer(header.sequence, status, in ? data.data() : nullptr, size);
    }

    // `data` is nullptr where the host has sent. `sequence` is big endian as it came.
    void answer(std::uint32_t sequence, int status, const void* data, std::size_t size) {
        std::vector<std::uint8_t> bytes(sizeof(Header) + (data != nullptr ? size : 0));
        Header header{};
        header.command = htonl(kSubmitted);
        header.sequence = sequence;
        header.answer.status = htonl(std::uint32_t(status));
        header.answer.length = htonl(std::uint32_t(size));
        std::memcpy(bytes.data(), &header, sizeof header);
        if (data != nullptr) std::memcpy(bytes.data() + sizeof header, data, size);
        if (::write(socket_, bytes.data(), bytes.size()) != ssize_t(bytes.size())) std::exit(1);
    }

    int socket_;
    std::deque<std::uint32_t> waiting_;  // requests for a message, as they came
    std::deque<Message> messages_;       // messages without a request yet
    bool overflows_ = false, broken_ = false, stalled_ = false;
};

}  // namespace

int main(int count, char** words) try {
    const int cable = plug(count > 1 ? std::atoi(words[1]) : 0, 2);
    Adapter adapter(cable);
    std::string line;
    for (;;) {
        pollfd waiting[2] = {{cable, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
        if (::poll(waiting, 2, -1) < 0) return 1;
        if (waiting[1].revents != 0) {
            char bytes[4096];
            const ssize_t n = ::read(STDIN_FILENO, bytes, sizeof bytes);
            if (n <= 0) return 0;
            for (const char c : std::string_view(bytes, std::size_t(n)))
                if (c == '\n')
                    adapter.command(std::exchange(line, {}));
                else
                    line += c;
        }
        if (waiting[0].revents != 0 && !adapter.request()) return 0;
    }
} catch (const std::exception& error) {
    std::fprintf(stderr, "usbip_can: %s\n", error.what());
    return 1;
}
