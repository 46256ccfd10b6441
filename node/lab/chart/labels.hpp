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
    Box symbol;  // beside which
    double width, height;
};

// From the symbol to the nearest point of its label: drawn where they are further apart than this.
inline constexpr double kLeader = 14;
struct Leader {
    double from_x, from_y, to_x, to_y;
    [[nodiscard]] bool needed() const noexcept;
};
Leader leader_between(const Box& symbol, const Box& label);

// A place for each request, greedily in their order: the nearest that is free, right of the symbol before left, above and
// below. All lie in `frame`, over no request's symbol, nothing in `taken` and no other label. Over what is `crossed`
// (lines), or with a leader over any of them, only where there is no other place. The result is empty if there is no room.
std::vector<std::optional<Box>> place_labels(const std::vector<LabelRequest>& requests, const std::vector<Box>& taken,
                                             std::vector<Box> crossed, const Box& frame);

}  // namespace tactiled
