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
    Box symbol;
    double width = 0, height = 0;  // size of the label; 0 = none, but no other label is placed over the symbol
};

struct Line {
    double from_x, from_y, to_x, to_y;
};
// Appends small boxes that cover the line.
void cover(const Line& line, std::vector<Box>& boxes);

struct Label {
    Box box;
    std::optional<Line> leader;  // joins the label to its symbol if it is far from it
};

// Returns a place for each request; none if there is no room or no label. All places are in `frame`, over no symbol and
// no other label. The nearest one is taken; a place over `crossed` (lines), or with a leader over other things, counts as
// farther. Right of the symbol is preferred to left, above and below. The requests are served in their order and in the
// opposite one; the result is the better of both.
std::vector<std::optional<Label>> place_labels(const std::vector<LabelRequest>& requests, const std::vector<Box>& crossed,
                                               const Box& frame);

}  // namespace tactiled
