// Stamps of other clocks, whatever they say. Oracles: a software stamp becomes a time between the moment when the socket was
// last empty (less its 10 ms) and now; an adapter's, a time not after the message came, nor wildly before what its own clock
// has ever shown.
#include "drivers/wire/clock_fit.hpp"
#include "tests/fuzz/input.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace tactiled;
    using fuzz::check;
    fuzz::Input input(data, size);
    ArrivalTime arrival;
    ClockFit fit;
    std::uint64_t now_ns = 1'000'000'000, wall_ns = 1'700'000'000'000'000'000, device_ns = 0, empty_ns = 0;
    while (!input.is_empty()) {
        const unsigned what = input.byte();
        const std::uint64_t step_ns = std::uint64_t{1} << what / 8;
        now_ns += step_ns;
        wall_ns += step_ns;
        device_ns += step_ns;
        switch (what % 8) {
            case 0: wall_ns = std::uint64_t(input.number(4)) << 32 | input.number(4); break;  // set
            case 1: device_ns = std::uint64_t(input.number(4)) << 32 | input.number(4); break;
            case 2: arrival.seen_empty(empty_ns = now_ns); break;
            case 3: (void)arrival.look(now_ns, wall_ns); break;
            default: {
                const std::uint64_t timestamp_ns = wall_ns - (std::uint64_t{1} << input.byte() % 64);
                (void)arrival.look(now_ns, wall_ns);
                const std::uint64_t t_ns = arrival.of(timestamp_ns);
                check(t_ns <= now_ns && t_ns + 10'000'000 >= empty_ns);
                const std::uint64_t on_bus_ns = fit.monotonic_ns(device_ns - (std::uint64_t{1} << input.byte() % 30), t_ns);
                check(std::int64_t(t_ns - on_bus_ns) >= 0);  // a time before the boot is one, too
            }
        }
    }
    return 0;
}
