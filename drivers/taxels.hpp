// The raw values of the taxels of an array in one frame. They travel beside the frame, which has no channels then
// (Frame::n_channels = 0): in the driver until its next read(), and in the same slot of the link's ring.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

namespace tactiled {

inline constexpr std::size_t kMaxTaxels = 4096;
inline constexpr std::size_t kMaxTaxelValues = 8;  // raw values of one taxel: five of a pad, eight of a table

struct TaxelShape {
    std::uint16_t taxels = 0;  // 0 = the link has no array
    std::uint16_t values = 0;  // per taxel
    [[nodiscard]] std::size_t size() const noexcept { return std::size_t(taxels) * values; }
    bool operator==(const TaxelShape&) const = default;
};

// Value v of taxel i is value[v * shape.taxels + i], in the wiring order of the device. NaN = missing; an infinite
// number = at the lower or upper limit of its range (saturated).
struct Taxels {
    TaxelShape shape;
    std::span<const float> value;
};

}  // namespace tactiled
