// The taxels of arrays as registers. Each connection has its own snapshot, so a client never sees values of two frames, and
// no client changes what another one reads.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "node/modbus/encode.hpp"
#include "node/modbus/request_validator.hpp"

namespace tactiled::modbus {

// The snapshot that a connection has latched. At most 24 KiB.
struct LatchedTaxels {
    unsigned sensor = kSensorBlocks;  // kSensorBlocks: none is latched
    std::uint64_t until_ns = 0;
    std::array<std::uint16_t, kHeadSize> head{};
    std::vector<std::uint16_t> values;  // empty if the sensor has no array
};

class Taxels {
public:
    // A snapshot expires after this time. 4,096 values take 33 requests of 150 ms over RTU at 19,200 baud, and 12,288 values
    // 100 requests of 50 ms over TCP.
    static constexpr std::uint64_t kExpiresNs = kExpires_s * 1'000'000'000ull;

    // Reads `run`, which is in one head or one page. The token of a head latches the newest array of its sensor. All other
    // registers are those of the latched snapshot: kDeviceFailure if it has expired, if its sensor has no value now, or if
    // it is another sensor's; kIllegalAddress for a page that the array does not have. Allocates.
    [[nodiscard]] Exception read(Run run, const View& view, LatchedTaxels& latched, std::uint64_t now_ns,
                                 std::span<std::uint16_t> out);

private:
    void latch(unsigned sensor, const View& view, LatchedTaxels& latched, std::uint64_t now_ns);

    Array array_;
    std::uint16_t token_ = 0;  // the last snapshot of any connection
};

}  // namespace tactiled::modbus
