// Places for the labels of a figure's points: beside their points, over no symbol and no other label.
#pragma once
#include <optional>
#include <vector>

namespace tactiled {

struct Box {  // y grows downwards
    double left, top, right, bottom;
    [[nodiscard]] bool overlaps(const Box& other) const noexcept {
        return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
    }
    [[nodiscard]] bool contains(const Box& other) const noexcept {
        return left <= other.left && other.right <= right && top <= other.top && other.bottom <= bottom;
    }
};

struct LabelRequest {
    Box symbol;  // box of its symbol
    double width, height;
};

// A leader from the symbol to the nearest point of its label is drawn if the distance is larger than this.
inline constexpr double kLeader = 14;
struct Leader {
    double from_x, from_y, to_x, to_y;
    [[nodiscard]] bool needed() const noexcept;
};
Leader leader_between(const Box& symbol, const Box& label);

// Returns a place for each request, greedily in their order: the nearest free one, with right of the symbol preferred
// to left, above and below. All are in `frame`, over no request's symbol, no box of `taken` and no other label. A
// label or leader is placed over `crossed` (lines) only if there is no other place. The result is empty if there is
// no room.
std::vector<std::optional<Box>> place_labels(const std::vector<LabelRequest>& requests, const std::vector<Box>& taken,
                                             std::vector<Box> crossed, const Box& frame);

}  // namespace tactiled
