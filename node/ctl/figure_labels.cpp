#include "node/ctl/figure_labels.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled::ctl {
namespace {

constexpr double kGap = 3;      // between symbol and label
constexpr double kStep = 6;     // of the rings that are searched
constexpr int kDirections = 8;  // in the first ring; more further out
constexpr double kTurn = 2 * 3.14159265358979323846;

// The box of a label whose nearest point to the symbol lies in this direction, `distance` off it.
Box beside(const LabelWish& wish, double cos, double sin, double distance) {
    const Box& s = wish.symbol;
    const double x = (s.left + s.right) / 2 + cos * ((s.right - s.left) / 2 + distance + wish.width / 2);
    const double y = (s.top + s.bottom) / 2 + sin * ((s.bottom - s.top) / 2 + distance + wish.height / 2);
    return {x - wish.width / 2, y - wish.height / 2, x + wish.width / 2, y + wish.height / 2};
}

bool is_free(const Box& box, const std::vector<Box>& of) {
    return std::none_of(of.begin(), of.end(), [&](const Box& other) { return box.overlaps(other); });
}

// Of a line, piece by piece.
std::vector<Box> boxes_of(const Leader& line) {
    std::vector<Box> boxes;
    const int n = 1 + int(std::hypot(line.to_x - line.from_x, line.to_y - line.from_y) / 2);
    for (int i = 0; i < n; ++i) {  // not its end, at the label
        const double share = double(i) / n, x = std::lerp(line.from_x, line.to_x, share),
                     y = std::lerp(line.from_y, line.to_y, share);
        boxes.push_back({x - 1, y - 1, x + 1, y + 1});
    }
    return boxes;
}

// The direction of try i of n: right, left, above, below, then between them.
double direction(int i, int n) {
    static constexpr int kFirst[kDirections] = {0, 4, 6, 2, 7, 1, 5, 3};  // eighths of a turn
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

double text_width(std::string_view text, double font_size) {
    double width = 0;  // in parts of the size; DejaVu Sans is the widest that is common
    for (const char c : text) {
        if ((static_cast<unsigned char>(c) & 0xC0u) == 0x80) continue;  // goes on with a character
        if (std::string_view("iljI.,:;|'!() ").find(c) != std::string_view::npos)
            width += 0.38;
        else if (std::string_view("mwMW%").find(c) != std::string_view::npos)
            width += 0.98;
        else
            width += c >= 'A' && c <= 'Z' ? 0.74 : 0.64;
    }
    return width * font_size;
}

std::vector<std::optional<Box>> place_labels(const std::vector<LabelWish>& wishes, const std::vector<Box>& taken,
                                             std::vector<Box> crossed, const Box& frame) {
    std::vector<Box> solid = taken;
    for (const LabelWish& wish : wishes) solid.push_back(wish.symbol);
    const double furthest = std::hypot(frame.right - frame.left, frame.bottom - frame.top);
    std::vector<std::optional<Box>> result;
    for (const LabelWish& wish : wishes) {
        std::optional<Box> place;
        for (const bool avoids_lines : {true, false}) {
            const double limit = avoids_lines ? furthest / 6 : furthest;
            for (double distance = kGap; distance < limit && !place; distance += kStep) {
                const int n = kDirections + int(distance / kStep) * 2;
                for (int i = 0; i < n && !place; ++i) {
                    const double at = direction(i, n);
                    const Box box = beside(wish, std::cos(at), std::sin(at), distance);
                    const Leader leader = leader_between(wish.symbol, box);
                    const auto line = leader.needed() ? boxes_of(leader) : std::vector<Box>{};
                    const bool clear =
                        std::all_of(line.begin(), line.end(), [&](const Box& b) { return is_free(b, solid); });
                    if (!frame.contains(box) || !is_free(box, solid) || !clear) continue;
                    if (avoids_lines && !is_free(box, crossed)) continue;
                    place = box;
                    crossed.insert(crossed.end(), line.begin(), line.end());
                }
            }
        }
        if (place) solid.push_back(*place);
        result.push_back(place);
    }
    return result;
}

}  // namespace tactiled::ctl
