// Samples of several CAN messages whose parts are lost, late and doubled, as the fuzzer likes. Each part holds the number of
// its sample. Oracles: a frame never mixes two samples; none comes twice or goes back; what came whole is given; `lost` is
// exactly what is missing before a frame, as far as the counter can tell, and never less.
#include <array>

#include "drivers/wire/can_sample.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;
using fuzz::Input;

constexpr std::uint64_t kPeriod_ns = 1'000'000, kWindow_ns = 10 * kPeriod_ns;

CanDevice device_of(unsigned parts, unsigned bits, bool at_end) {
    CanDevice device;
    device.n_channels = std::uint8_t(parts);
    device.window_ns = kWindow_ns;
    for (unsigned p = 0; p < parts; ++p) {
        CanPart part;
        part.id = 0x100 + p;
        CanSignal number;  // the number of the sample, whole
        number.start = at_end ? 32 : 0;
        number.length = 32;
        part.channels.push_back({std::uint8_t(p), number});
        CanSignal counter = number;
        counter.length = bits;
        part.sequence = counter;
        part.bytes = bytes_needed(number);
        device.parts.push_back(part);
    }
    return device;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(data, size);
    const unsigned parts = 1 + input.byte() % 5, bits = input.byte() % 2 == 0 ? 8 : 16;
    const bool at_end = input.byte() % 2 != 0;
    LinkCounts counts;
    CanSamples samples({device_of(parts, bits, at_end)}, counts);
    const std::uint32_t half = 1u << (bits - 1);  // a counter of this many bits cannot show a larger gap
    std::uint64_t t_ns = 1'000'000'000;
    std::uint32_t number = 1, last = 0, given = 0, disorder = 0;
    bool again = false, exact = true;  // an old part came since the last fresh one; ever since the last frame
    Frame frame;
    const auto send = [&](std::uint32_t n, unsigned part) {
        std::array<std::uint8_t, 8> bytes{};
        for (unsigned k = 0; k < 4; ++k) bytes[(at_end ? 4 : 0) + k] = std::uint8_t(n >> 8 * k);
        if (given != 0 && (n <= last || n - last >= half)) ++disorder;
        samples.take({0x100 + part, bytes, t_ns});
        if (!samples.next(frame)) return false;
        for (unsigned k = 0; k < parts; ++k) check(frame.channel[k] == double(n));
        const bool contested = frame.n_channels == 0;  // by a second device under the name, as it seems
        check(n > last && (frame.n_channels == parts || (contested && disorder >= 4)) && frame.missing == 0);
        check(frame.t_ns <= t_ns && frame.t_ns + kWindow_ns >= t_ns);
        if (given != 0 && n - last < half && !contested)
            check(exact ? frame.lost == n - last - 1 : frame.lost >= n - last - 1);
        check(!samples.next(frame));
        last = n;
        ++given;
        exact = true;
        return true;
    };
    while (!input.is_empty()) {
        const unsigned what = input.byte();
        t_ns += kPeriod_ns;
        if (what < 96) {  // whole, its parts turned round
            bool got = false;
            for (unsigned p = 0; p < parts; ++p) got = send(number, (p + what) % parts);
            if (given == 0 || number - last < half) check(got);
            ++number;
            again = false;
        } else if (what < 128) {  // lost
            number += 1 + what % 4;
        } else if (what < 192) {  // one part of it
            (void)send(number, what % parts);
            ++number;
            again = false;
        } else if (what < 224 && !again &&
                   number > 8) {  // an old one; two that follow each other are a device that restarted
            again = true;
            exact = false;
            (void)send(number - 1 - what % 8, input.byte() % parts);
        } else {
            t_ns += input.byte() * kPeriod_ns;
        }
    }
    check(counts[TACTILED_LINK_FRAMES] == given);
    return 0;
}
