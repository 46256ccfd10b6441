#include "node/lab/chart/labels.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tactiled {
namespace {

constexpr double kGap = 3;            // between symbol and label
constexpr double kStep = 6;           // width of the rings that are searched
constexpr int kDirections = 8;        // in the first ring; outer rings have more
constexpr double kLeader = 14;        // distance from which a leader is drawn
constexpr double kOverLine = 80;      // distance that a place over a line counts for
constexpr double kLeaderOver = 1000;  // distance that a leader over a symbol or a label counts for
constexpr double kNoRoom = 1e4;       // distance that a label without a place counts for
constexpr double kTurn = 2 * std::numbers::pi;

// Returns the box of a label whose nearest point to the symbol is in this direction at `distance`.
Box beside(const LabelRequest& request, double direction, double distance) {
    const Box& s = request.symbol;
    const double x = (s.left + s.right) / 2 + std::cos(direction) * ((s.right - s.left) / 2 + distance + request.width / 2);
    const double y = (s.top + s.bottom) / 2 + std::sin(direction) * ((s.bottom - s.top) / 2 + distance + request.height / 2);
    return {x - request.width / 2, y - request.height / 2, x + request.width / 2, y + request.height / 2};
}

// Returns the direction of try i of n: right, left, above, below, then in between.
double direction(int i, int n) {
    static constexpr int kFirst[kDirections] = {0, 4, 6, 2, 7, 1, 5, 3};  // eighths of a circle
    return i < kDirections ? kTurn * kFirst[i] / kDirections : kTurn * i / n;
}

bool is_free(const Box& box, const std::vector<Box>& of) {
    return std::none_of(of.begin(), of.end(), [&](const Box& other) { return box.overlaps(other); });
}

Label label_at(const Box& symbol, const Box& box) {
    const double x = (symbol.left + symbol.right) / 2, y = (symbol.top + symbol.bottom) / 2;
    const double to_x = std::clamp(x, box.left, box.right), to_y = std::clamp(y, box.top, box.bottom);
    const double length = std::hypot(to_x - x, to_y - y), reach = (symbol.right - symbol.left) / 2 * 1.42;
    if (length - reach <= kLeader) return {box, std::nullopt};
    return {box, Line{std::lerp(x, to_x, reach / length), std::lerp(y, to_y, reach / length), to_x, to_y}};
}

// Symbols at the begin of the leader do not hide it.
bool is_clear(const Line& leader, const Box& symbol, std::vector<Box> of) {
    std::erase_if(of, [&](const Box& other) { return other.overlaps(symbol); });
    std::vector<Box> line;
    cover(leader, line);
    return std::all_of(line.begin(), line.end(), [&](const Box& piece) { return is_free(piece, of); });
}

// Returns the place with the least cost, a distance, and adds that to `cost`; one without room costs most.
std::optional<Label> place(const LabelRequest& request, const std::vector<Box>& solid, const std::vector<Box>& crossed,
                           const Box& frame, double& cost) {
    std::optional<Label> best;
    double best_distance = kNoRoom;
    const double furthest = std::hypot(frame.right - frame.left, frame.bottom - frame.top);
    for (double ring = kGap; ring < std::min(furthest, best_distance); ring += kStep) {
        const int n = kDirections + int(ring / kStep) * 2;
        for (int i = 0; i < n; ++i) {
            const Label label = label_at(request.symbol, beside(request, direction(i, n), ring));
            if (!frame.contains(label.box) || !is_free(label.box, solid)) continue;
            double distance = ring + (is_free(label.box, crossed) ? 0 : kOverLine);
            if (label.leader && !is_clear(*label.leader, request.symbol, solid)) distance += kLeaderOver;
            if (distance >= best_distance) continue;
            best = label;
            best_distance = distance;
        }
    }
    cost += best_distance;
    return best;
}

}  // namespace

void cover(const Line& line, std::vector<Box>& boxes) {
    const int n = 1 + int(std::hypot(line.to_x - line.from_x, line.to_y - line.from_y) / 2);
    for (int i = 0; i < n; ++i) {
        const double share = double(i) / n, x = std::lerp(line.from_x, line.to_x, share),
                     y = std::lerp(line.from_y, line.to_y, share);
        boxes.push_back({x - 1, y - 1, x + 1, y + 1});
    }
}

std::vector<std::optional<Label>> place_labels(const std::vector<LabelRequest>& requests, const std::vector<Box>& crossed,
                                               const Box& frame) {
    std::vector<std::optional<Label>> best;
    double least = std::numeric_limits<double>::infinity();
    for (const bool backwards : {false, true}) {
        std::vector<Box> solid, lines = crossed;
        for (const LabelRequest& request : requests) solid.push_back(request.symbol);
        std::vector<std::optional<Label>> labels(requests.size());
        double cost = 0;
        for (std::size_t k = 0; k < requests.size(); ++k) {
            const std::size_t i = backwards ? requests.size() - 1 - k : k;
            if (requests[i].width <= 0) continue;
            labels[i] = place(requests[i], solid, lines, frame, cost);
            if (labels[i]) solid.push_back(labels[i]->box);
            if (labels[i] && labels[i]->leader) cover(*labels[i]->leader, lines);
        }
        if (cost < least) best = labels, least = cost;
    }
    return best;
}

}  // namespace tactiled
