// The bytes of RDT ("raw data transfer"), the UDP protocol of ATI's Net F/T: requests of 8 bytes, records of 36, big-endian.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "tactiled/layout.h"

namespace tactiled::bridges::rdt {

enum Command : std::uint16_t {
    kStop = 0,
    kStream = 2,     // records as they are measured
    kBuffered = 3,   // the same here: a datagram may hold one record
    kMultiUnit = 4,  // the same here
    kBias = 0x42
};
struct Request {
    std::uint16_t command;
    std::uint32_t count;  // records; 0: until kStop
};
// nullopt: no request of this protocol.
std::optional<Request> parse_request(std::span<const std::uint8_t> bytes);

// fx fy fz in N, mx my mz in Nm, frame S.
using Wrench = std::array<double, 6>;
struct Scale {
    double counts_per_N = 1e6, counts_per_Nm = 1e6;
};
inline constexpr std::size_t kRecordSize = 36;
using Record = std::array<std::uint8_t, kRecordSize>;

// The values that a record may carry, or nullopt where there is none: RDT has no NaN. `zero`: bit 0..5, components that the
// sensor cannot see and that are sent as 0.
std::optional<Wrench> values_of(const tactiled_sample& sample, std::uint32_t zero);
// `status`: edge.hpp. nullopt where a value does not fit into 32 bits of counts.
std::optional<Record> encode(std::uint32_t rdt_sequence, std::uint32_t ft_sequence, std::uint32_t status,
                             const Wrench& values, const Scale& scale);

}  // namespace tactiled::bridges::rdt
