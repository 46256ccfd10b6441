#include "node/lab/chart/labels.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace tactiled {
namespace {

constexpr double kGap = 3;      // between symbol and label
constexpr double kStep = 6;     // width of the rings that are searched
constexpr int kDirections = 8;  // in the first ring; outer rings have more
constexpr double kTurn = 2 * std::numbers::pi;

// Returns the box of a label whose nearest point to the symbol is in this direction at `distance`.
Box beside(const LabelRequest& request, double cos, double sin, double distance) {
    const Box& s = request.symbol;
    const double x = (s.left + s.right) / 2 + cos * ((s.right - s.left) / 2 + distance + request.width / 2);
    const double y = (s.top + s.bottom) / 2 + sin * ((s.bottom - s.top) / 2 + distance + request.height / 2);
    return {x - request.width / 2, y - request.height / 2, x + request.width / 2, y + request.height / 2};
}

bool is_free(const Box& box, const std::vector<Box>& of) {
    return std::none_of(of.begin(), of.end(), [&](const Box& other) { return box.overlaps(other); });
}

// Returns the boxes of a line, piece by piece.
std::vector<Box> boxes_of(const Leader& line) {
    std::vector<Box> boxes;
    const int n = 1 + int(std::hypot(line.to_x - line.from_x, line.to_y - line.from_y) / 2);
    for (int i = 0; i < n; ++i) {  // without its end, at the label
        const double share = double(i) / n, x = std::lerp(line.from_x, line.to_x, share),
                     y = std::lerp(line.from_y, line.to_y, share);
        boxes.push_back({x - 1, y - 1, x + 1, y + 1});
    }
    return boxes;
}

// Symbols at the begin of the leader do not hide it.
bool is_clear(const Leader& leader, const Box& symbol, const std::vector<Box>& of) {
    const auto line = boxes_of(leader);
    return std::none_of(of.begin(), of.end(),
                        [&](const Box& other) { return !other.overlaps(symbol) && !is_free(other, line); });
}

// Fallbacks if no place is completely free, in this order: off the lines of the figure and with a clear leader; over
// a line; with a leader over others.
enum class Pass { off_lines, leader_clear, any };

// Returns the direction of try i of n: right, left, above, below, then in between.
double direction(int i, int n) {
    static constexpr int kFirst[kDirections] = {0, 4, 6, 2, 7, 1, 5, 3};  // eighths of a circle
    return i < kDirections ? kTurn * kFirst[i] / kDirections : kTurn * i / n;
}

}  // namespace

bool Leader::needed() const noexcept { return std::hypot(to_x - from_x, to_y - from_y) > kLeader; }

Leader leader_between(const Box& symbol, const Box& label) {
    const double x = (symbol.left + symbol.right) / 2, y = (symbol.top + symbol.bottom) / 2;
    const double to_x = std::clamp(x, label.left, label.right), to_y = std::clamp(y, label.top, label.bottom);
    const double length = std::hypot(to_x - x, to_y - y), reach = (symbol.right - symbol.left) / 2 * 1.42;
    const double share = length > reach ? reach / length : 1;
    return {std::lerp(x, to_x, share), std::lerp(y, to_y, share), to_x, to_y};
}

std::vector<std::optional<Box>> place_labels(const std::vector<LabelRequest>& requests, const std::vector<Box>& taken,
                                             std::vector<Box> crossed, const Box& frame) {
    std::vector<Box> solid = taken;
    for (const LabelRequest& request : requests) solid.push_back(request.symbol);
    const double furthest = std::hypot(frame.right - frame.left, frame.bottom - frame.top);
    std::vector<std::optional<Box>> result;
    for (const LabelRequest& request : requests) {
        std::optional<Box> place;
        for (const Pass pass : {Pass::off_lines, Pass::leader_clear, Pass::any}) {
            const double limit = pass == Pass::off_lines ? furthest / 6 : furthest;
            for (double distance = kGap; distance < limit && !place; distance += kStep) {
                const int n = kDirections + int(distance / kStep) * 2;
                for (int i = 0; i < n && !place; ++i) {
                    const double at = direction(i, n);
                    const Box box = beside(request, std::cos(at), std::sin(at), distance);
                    if (!frame.contains(box) || !is_free(box, solid)) continue;
                    if (pass == Pass::off_lines && !is_free(box, crossed)) continue;
                    const Leader leader = leader_between(request.symbol, box);
                    if (pass != Pass::any && leader.needed() && !is_clear(leader, request.symbol, solid)) continue;
                    place = box;
                }
            }
        }
        if (place) {
            solid.push_back(*place);
            const Leader leader = leader_between(request.symbol, *place);
            if (leader.needed()) std::ranges::copy(boxes_of(leader), std::back_inserter(crossed));
        }
        result.push_back(place);
    }
    return result;
}

}  // namespace tactiled
