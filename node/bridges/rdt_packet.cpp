#include "node/bridges/rdt_packet.hpp"

#include <cmath>
#include <limits>

namespace tactiled::bridges::rdt {
namespace {

constexpr std::uint32_t kHeader = 0x1234;

std::uint32_t big_endian(std::span<const std::uint8_t> bytes) {
    std::uint32_t value = 0;
    for (const std::uint8_t byte : bytes) value = value << 8 | byte;
    return value;
}

void put(Record& record, std::size_t word, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) record[4 * word + i] = std::uint8_t(value >> (24 - 8 * i));
}

}  // namespace

std::optional<Request> parse_request(std::span<const std::uint8_t> bytes) {
    if (bytes.size() != 8 || big_endian(bytes.first(2)) != kHeader) return std::nullopt;
    return Request{std::uint16_t(big_endian(bytes.subspan(2, 2))), big_endian(bytes.subspan(4, 4))};
}

std::optional<Wrench> values_of(const tactiled_sample& sample, std::uint32_t zero) {
    if (sample.quality != TACTILED_GOOD && sample.quality != TACTILED_UNCERTAIN) return std::nullopt;
    Wrench values{};
    for (std::size_t i = 0; i < 6; ++i) {
        if ((zero >> i & 1u) != 0) continue;
        values[i] = i < 3 ? sample.force_S_N[i] : sample.torque_S_Nm[i - 3];
        if (!std::isfinite(values[i])) return std::nullopt;
    }
    return values;
}

std::optional<Record> encode(std::uint32_t rdt_sequence, std::uint32_t ft_sequence, std::uint32_t status,
                             const Wrench& values, const Scale& scale) {
    Record record{};
    put(record, 0, rdt_sequence);
    put(record, 1, ft_sequence);
    put(record, 2, status);
    for (std::size_t i = 0; i < 6; ++i) {
        const double counts = std::nearbyint(values[i] * (i < 3 ? scale.counts_per_N : scale.counts_per_Nm));
        if (!(std::fabs(counts) <= double(std::numeric_limits<std::int32_t>::max()))) return std::nullopt;
        put(record, 3 + i, std::uint32_t(std::int32_t(counts)));
    }
    return record;
}

}  // namespace tactiled::bridges::rdt
