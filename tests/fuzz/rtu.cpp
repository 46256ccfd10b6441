// A Modbus RTU line: bytes in pieces with gaps, to the server behind a pty. Oracle, against a model of the standard's frames
// with a bit by bit CRC: a frame is answered that is whole, for us and no echo of our answer; nothing else is, and every
// frame is counted once.
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "node/modbus/rtu.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::modbus;
using fuzz::check;
using fuzz::Input;

using Bytes = std::vector<std::uint8_t>;
constexpr std::uint8_t kUs = 5;
constexpr std::uint64_t kSilence_ns = 1'750'000;

std::uint16_t slow_crc(std::span<const std::uint8_t> bytes) {
    unsigned crc = 0xFFFF;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xA001 : crc >> 1;
    }
    return std::uint16_t(crc);
}

Bytes with_crc(Bytes bytes) {
    const std::uint16_t crc = slow_crc(bytes);
    bytes.push_back(std::uint8_t(crc & 0xFF));
    bytes.push_back(std::uint8_t(crc >> 8));
    return bytes;
}

bool is_frame(const Bytes& bytes) {
    return bytes.size() >= 4 && bytes.size() <= kMaxRtu && slow_crc(bytes) == 0;  // a CRC over itself is 0
}

// The server's answer in this test: function 4 reads numbers, function 6 is confirmed, the rest is refused.
bool reads(std::span<const std::uint8_t> pdu) {
    return pdu.size() == 5 && pdu[0] == kReadInputRegisters && pdu[1] == 0 && pdu[3] == 0 && pdu[4] >= 1 && pdu[4] <= 125;
}
bool writes(std::span<const std::uint8_t> pdu) { return pdu.size() == 5 && pdu[0] == kWriteRegister && pdu[1] == 0; }

std::size_t answer(Responder& responder, std::span<const std::uint8_t> frame) {
    static Tables tables;
    for (std::size_t i = 0; i < 512; ++i) tables.registers[i] = std::uint16_t(i * 259);
    const auto pdu = responder.pdu_of(frame);
    return reads(pdu) || writes(pdu) ? responder.reply(frame, tables) : responder.refuse(frame, kIllegalFunction);
}

Bytes answer_of_model(const Bytes& frame) {
    const std::span pdu(frame.data() + 1, frame.size() - 3);
    if (writes(pdu)) return frame;
    if (!reads(pdu)) return with_crc({frame[0], std::uint8_t(pdu[0] | 0x80), kIllegalFunction});
    Bytes bytes{frame[0], pdu[0], std::uint8_t(2 * pdu[4])};
    for (unsigned i = pdu[2]; i < pdu[2] + unsigned(pdu[4]); ++i)
        bytes.insert(bytes.end(), {std::uint8_t(i * 259 >> 8), std::uint8_t(i * 259)});
    return with_crc(bytes);
}

class Line {
public:
    Line() : master_(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)) {
        check(master_ >= 0 && ::grantpt(master_) == 0 && ::unlockpt(master_) == 0);
        path_ = ::ptsname(master_);
    }
    const std::string& path() const { return path_; }
    // A pty hands bytes over when the kernel comes to it.
    void say(const Bytes& bytes, int other_end) const {
        check(::write(master_, bytes.data(), bytes.size()) == ssize_t(bytes.size()));
        for (int there = 0; std::size_t(there) < bytes.size();) ::ioctl(other_end, FIONREAD, &there);
    }
    Bytes hear(std::size_t min) const {
        Bytes bytes;
        std::array<std::uint8_t, 4096> some;
        pollfd ready{master_, POLLIN, 0};
        for (;;) {
            const ssize_t n = ::read(master_, some.data(), some.size());
            if (n > 0)
                bytes.insert(bytes.end(), some.begin(), some.begin() + n);
            else if (bytes.size() >= min || ::poll(&ready, 1, 1000) != 1)
                return bytes;
        }
    }

private:
    int master_;
    std::string path_;
};

// The standard's rules for a line, and for an adapter that receives its own bytes.
struct Model {
    Bytes pending, sent;
    std::uint64_t last_ns = 0, echo_until_ns = 0, frames = 0, refused = 0;
    bool has_sent = false;

    void receive(const Bytes& bytes, std::uint64_t now_ns) {
        if (!pending.empty() && now_ns > last_ns + kSilence_ns) {  // the line was silent and not read
            ++refused;
            pending.clear();
        }
        pending.insert(pending.end(), bytes.begin(), bytes.end());
        last_ns = now_ns;
    }
    // The expected answer.
    Bytes tick(std::uint64_t now_ns) {
        if (pending.empty() || now_ns < last_ns + kSilence_ns) return {};
        const Bytes frame = std::exchange(pending, {});
        if (frame.size() > kMaxRtu) return ++refused, Bytes{};
        if (std::exchange(has_sent, false) && now_ns <= echo_until_ns && frame == sent) return {};
        if (!is_frame(frame)) return ++refused, Bytes{};
        if (frame[0] != kUs && frame[0] != 0) return {};
        ++frames;
        if (frame[0] == 0) return {};
        sent = answer_of_model(frame);
        has_sent = true;
        echo_until_ns = now_ns + std::uint64_t(double(sent.size()) * 11 * 1e9 / 115200) + 2 * kSilence_ns + 2'000'000;
        return sent;
    }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const Line wire;
    static RtuLine line({wire.path(), 115200, "none", kUs, 0, false});
    static const Answer answer = [](auto frame) { return ::answer(line.responder, frame); };
    static std::uint64_t now_ns = 1;
    now_ns += 2'000'000'000;  // whatever the input before has left is over
    line.tick(answer, now_ns);
    check(line.fd() >= 0);
    (void)wire.hear(0);
    const RtuLine::Counts began = line.counts();
    Input input(data, size);
    Model model;
    while (!input.is_empty()) {
        const unsigned what = input.byte();
        now_ns += what / 8 % 4 == 0 ? kSilence_ns / 4 : kSilence_ns - 1 + what / 8 % 4;
        if (what / 32 % 2 == 0) {
            line.tick(answer, now_ns);
            const Bytes expected = model.tick(now_ns);
            check(wire.hear(expected.size()) == expected);
        }
        Bytes bytes;
        switch (what % 4) {
            case 0: {
                const auto taken = input.take(input.byte());
                bytes.assign(taken.begin(), taken.end());
                break;
            }
            case 1: {
                bytes = {kUs, 4, 0, input.byte(), 0, input.byte()};
                if ((what & 4) != 0) bytes.resize(kMaxRtu - 2);  // the longest frame
                bytes = with_crc(bytes);
                break;
            }
            case 2: bytes = with_crc({input.byte(), 6, 0, input.byte(), 0, input.byte()}); break;
            case 3: bytes = model.sent; break;
        }
        if (bytes.empty()) continue;
        wire.say(bytes, line.fd());
        check(line.receive(now_ns));
        model.receive(bytes, now_ns);
    }
    now_ns += 2 * kSilence_ns;
    line.tick(answer, now_ns);
    const Bytes expected = model.tick(now_ns);
    check(wire.hear(expected.size()) == expected);
    check(line.counts().frames - began.frames == model.frames);
    check(line.counts().bad_frames - began.bad_frames == model.refused);
    return 0;
}
