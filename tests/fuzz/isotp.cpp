// A receiver of ISO-TP, and a device that sends messages by the book, of whose frames the fuzzer loses, doubles, holds up
// and invents some. Oracles: any bytes give no more than they hold; a message that came undisturbed is given; one that is
// given after a clean beginning is one that the device has sent; every beginning ends as a message or as a loss; what has no
// room here is not asked for.
#include <vector>

#include "drivers/wire/isotp.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;
using fuzz::Input;

using Bytes = std::vector<std::uint8_t>;

Bytes message_of(std::size_t size, std::uint8_t seed) {
    Bytes bytes(size);
    for (std::size_t k = 0; k < size; ++k) bytes[k] = std::uint8_t(seed + k * 31);
    return bytes;
}

std::vector<Bytes> frames_of(const Bytes& message) {  // each has 8 bytes
    std::vector<Bytes> frames;
    std::size_t at = 0;
    if (message.size() < 8)
        frames.push_back({std::uint8_t(message.size())});
    else
        frames.push_back({std::uint8_t(0x10 | message.size() >> 8), std::uint8_t(message.size())});
    for (unsigned n = 1; at < message.size(); ++at) {
        if (frames.back().size() == 8) frames.push_back({std::uint8_t(0x20 | (n++ & 15))});
        frames.back().push_back(message[at]);
    }
    return frames;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(data, size);
    IsoTp receiver;
    std::uint64_t t_ns = 1'000'000'000;
    std::uint32_t begun = 0, ended = 0, lost = 0;
    const auto take = [&](std::span<const std::uint8_t> frame) {
        const auto found = receiver.take(frame, t_ns += 1'000'000);
        const std::size_t length = receiver.message().size();
        lost += receiver.take_lost();
        if (found == IsoTp::Found::first) {
            ++begun;
            const std::size_t announced = std::size_t(frame[0] & 0x0F) << 8 | frame[1];
            check((receiver.answer()[0] == 0x32) == (announced > IsoTp::kMaxBytes));  // 0x32: no room
        }
        if (found != IsoTp::Found::message) return false;
        check(length >= 1 && length <= IsoTp::kMaxBytes && receiver.t_ns() <= t_ns);
        if ((frame[0] >> 4) == 0)
            check(std::equal(receiver.message().begin(), receiver.message().end(),
                             frame.begin() + (frame.size() > 8 ? 2 : 1)));
        else
            ++ended;
        return true;
    };
    while (!input.is_empty()) {
        const unsigned what = input.byte();
        if (what < 64) {  // anything
            (void)take(input.take(input.byte() % 65u));
            continue;
        }
        const Bytes message = message_of(1 + input.number(2) % IsoTp::kMaxBytes, input.byte());
        const auto frames = frames_of(message);
        bool disturbed = false, given = false, foreign = false;
        for (std::size_t n = 0; n < frames.size(); ++n) {
            const unsigned fate = what < 128 ? 255 : input.byte();
            if (fate < 16) {  // lost
                disturbed = true;
            } else if (fate < 24) {  // late
                t_ns += IsoTp::kPatience_ns + 1;
                disturbed |= n != 0;
                given = take(frames[n]);
            } else if (fate < 32 && n + 1 < frames.size()) {  // doubled
                disturbed = true;
                (void)take(frames[n]);
                given = take(frames[n]);
                foreign |= n == 0;   // begins anew, so that nothing is wrong after all
            } else if (fate < 40) {  // another device's, between
                disturbed = foreign = true;
                (void)take(input.take(8));
                given = take(frames[n]);
            } else {
                given = take(frames[n]);
            }
        }
        if (!disturbed) check(given);
        if (given && !foreign) check(Bytes(receiver.message().begin(), receiver.message().end()) == message);
    }
    const std::uint8_t one[2] = {1, 0};
    (void)take(one);  // ends what is under way
    check(begun == ended + lost);
    return 0;
}
