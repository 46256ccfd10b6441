#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "node/ctl/array_text.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kStates = 4;  // the first ones of kTaxelStates leave no force

// Plain: from no press to the largest one; the states. Colours are numbers of the palette of 256.
constexpr std::string_view kRamp = ".:-=+*#%@", kMarks = "?!x~";
constexpr int kColours[] = {236, 54, 90, 126, 162, 203, 209, 215, 222, 230}, kMarkColours[] = {27, 51, 28, 120};
constexpr int kMaxDark = 203;            // the colours after it are bright
constexpr int kNone = -1, kCentre = -2;  // a place without a taxel; the centre of pressure

// A picture of the array with square cells, row 0 on top.
struct Raster {
    unsigned rows = 0, columns = 0;
    std::vector<float> press_N;  // the largest press in a cell; NaN: no force
    std::vector<int> state;      // bit number of the state of a cell without a force; kNone: no taxel
    long centre = kNone;         // cell of the centre of pressure
};

struct Box {
    float x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY, pitch_x = 0, pitch_y = 0;
};

// The box around the places, and the spacing of the taxels in the picture.
Box box_of(const tactiled_array_plan& plan, const float* places) {
    Box box;
    for (std::uint32_t i = 0; i < plan.n_taxels; ++i) {
        const float x = places[i * 6], y = places[i * 6 + 1];
        box.x0 = std::min(box.x0, x), box.x1 = std::max(box.x1, x);
        box.y0 = std::min(box.y0, y), box.y1 = std::max(box.y1, y);
    }
    const float wide = box.x1 - box.x0, high = box.y1 - box.y0;
    const float even = std::max(
        {std::sqrt(wide * high / float(plan.n_taxels)), wide / float(plan.n_taxels), high / float(plan.n_taxels), 1e-6f});
    box.pitch_x = plan.columns > 1 ? wide / float(plan.columns - 1) : even;
    box.pitch_y = plan.rows > 1 ? high / float(plan.rows - 1) : even;
    if (plan.columns == 1) box.pitch_x = box.pitch_y;
    if (plan.rows == 1) box.pitch_y = box.pitch_x;
    return box;
}

Raster raster_of(const SegmentView& segment, std::uint32_t sensor, const Array& array, unsigned max_columns,
                 unsigned max_rows) {
    const tactiled_array_plan& plan = segment.c()->array[sensor];
    const float* const places = tactiled_taxel_places(segment.c(), sensor);
    const Box box = box_of(plan, places);
    const float wide = box.x1 - box.x0 + box.pitch_x, high = box.y1 - box.y0 + box.pitch_y;
    // Cells are square, as large as the smaller spacing, and larger where the picture would not fit.
    const float cell = std::max({std::min(box.pitch_x, box.pitch_y), wide / float(max_columns), high / float(max_rows)});
    Raster raster;
    const auto count = [&](float length, unsigned max) { return std::clamp(unsigned(std::lround(length / cell)), 1u, max); };
    raster.columns = count(wide, max_columns);
    raster.rows = count(high, max_rows);
    raster.press_N.assign(std::size_t(raster.rows) * raster.columns, kNan);
    raster.state.assign(raster.press_N.size(), kNone);
    const auto index = [](float at, float from, float length, unsigned n) {
        return std::size_t(std::clamp((at - from) / length * float(n), 0.f, float(n) - 1));
    };
    const auto cell_at = [&](float x, float y) {
        return index(box.y1 + box.pitch_y / 2, y, high, raster.rows) * raster.columns +
               index(x, box.x0 - box.pitch_x / 2, wide, raster.columns);
    };
    for (std::uint32_t i = 0; i < plan.n_taxels; ++i) {
        const std::size_t at = cell_at(places[i * 6], places[i * 6 + 1]);
        const float press = press_N(segment, sensor, array, i);
        raster.press_N[at] = std::fmax(raster.press_N[at], press);
        if (!std::isfinite(press) && array.states()[i] != 0)
            raster.state[at] = std::countr_zero(unsigned(array.states()[i]));
        else
            raster.state[at] = std::max(raster.state[at], 0);
    }
    const float* const centre = array.head().cop_S_m;
    if (std::isfinite(centre[0]) && std::isfinite(centre[1])) raster.centre = long(cell_at(centre[0], centre[1]));
    return raster;
}

// Returns the step of the press in a cell, 0 .. n - 1.
std::size_t step_of(float press_N, float scale_N, std::size_t n) {
    return std::size_t(std::clamp(press_N / scale_N * float(n), 0.f, float(n) - 1));
}

// Two characters for each cell.
std::string plain_line(const Raster& raster, unsigned row, float scale_N) {
    std::string line;
    for (unsigned column = 0; column < raster.columns; ++column) {
        const std::size_t at = std::size_t(row) * raster.columns + column;
        const char c = std::isfinite(raster.press_N[at]) ? kRamp[step_of(raster.press_N[at], scale_N, kRamp.size())]
                       : raster.state[at] == kNone       ? ' '
                                                         : kMarks[std::size_t(raster.state[at]) % kStates];
        line += long(at) == raster.centre ? std::string("()") : std::string(2, c);
    }
    return line;
}

int colour_at(const Raster& raster, unsigned row, unsigned column, float scale_N) {
    if (row >= raster.rows) return kNone;
    const std::size_t at = std::size_t(row) * raster.columns + column;
    if (long(at) == raster.centre) return kCentre;
    if (std::isfinite(raster.press_N[at])) return kColours[step_of(raster.press_N[at], scale_N, std::size(kColours))];
    return raster.state[at] == kNone ? kNone : kMarkColours[std::size_t(raster.state[at]) % kStates];
}

// Two rows of cells in a line of half blocks. The centre of pressure is a plus on the colour of the other half.
std::string coloured_line(const Raster& raster, unsigned row, float scale_N) {
    std::string line;
    for (unsigned column = 0; column < raster.columns; ++column) {
        const int upper = colour_at(raster, row, column, scale_N), lower = colour_at(raster, row + 1, column, scale_N);
        const auto paint = [&](int ink, int paper, const char* c) {
            line += (ink >= 0 ? fmt::format("\x1b[38;5;{}m", ink) : "") +
                    (paper >= 0 ? fmt::format("\x1b[48;5;{}m", paper) : "") + c + "\x1b[0m";
        };
        const int other = std::max({0, upper, lower});
        if (upper == kCentre || lower == kCentre)
            paint(other > kMaxDark ? 16 : 15, other, "+");  // black or white
        else if (upper == kNone)
            paint(lower, kNone, lower == kNone ? " " : "▄");
        else
            paint(upper, lower, "▀");
    }
    return line;
}

// In mm, rounded; never -0.
float tenths(float value_m) { return std::round(1e4f * value_m) / 10 + 0.f; }

std::string padded(const std::string& text, unsigned width) { return fmt::format("{:<{}.{}}", text, width, width); }

}  // namespace

Ink ink_of_output() {
    for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
        const char* const value = std::getenv(name);
        if (value == nullptr || *value == 0) continue;
        const std::string locale = value;
        const bool is_utf8 = locale.find("UTF-8") != locale.npos || locale.find("utf8") != locale.npos;
        return is_utf8 && wants_colour() ? Ink::colours : Ink::plain;
    }
    return Ink::plain;
}

std::vector<std::string> heat_map(const SegmentView& segment, std::uint32_t sensor, const Array& array, unsigned width,
                                  unsigned height, Ink ink) {
    const tactiled_array& head = array.head();
    const std::string name = segment.sensor(sensor).name;
    if (head.sample.quality == TACTILED_BAD || head.sample.quality == TACTILED_NO_VALUE)
        return {padded(fmt::format("{}: no map: {}", name, quality_text(head.sample.quality, head.sample.reasons)), width)};
    const bool plain = ink == Ink::plain;
    const Raster raster = raster_of(segment, sensor, array, plain ? width / 2 : width, plain ? height : 2 * height);
    // Without a press the noise has the first colour.
    const float scale_N = std::isfinite(head.peak_N) ? head.peak_N : INFINITY;
    std::vector<std::string> lines;
    lines.push_back(padded(name + (head.sample.quality == TACTILED_UNCERTAIN ? " UNCERTAIN" : ""), width));
    lines.push_back(padded((std::isfinite(head.peak_N) ? fmt::format("0 .. {:.3g} N", head.peak_N) : "no press") +
                               (head.n_out == 0 ? "" : fmt::format(", {} out", head.n_out)),
                           width));
    const float sd_mm = 1e3f * std::max(head.cop_sd_m[0], head.cop_sd_m[1]);
    lines.push_back(padded(std::isfinite(head.cop_S_m[0])
                               ? fmt::format("{} {:.1f} {:.1f} +-{:.2f} mm", plain ? "()" : "+", tenths(head.cop_S_m[0]),
                                             tenths(head.cop_S_m[1]), sd_mm)
                               : "no centre of pressure",
                           width));
    const unsigned columns = plain ? 2 * raster.columns : raster.columns;
    for (unsigned row = 0; row < raster.rows; row += plain ? 1 : 2)
        lines.push_back((plain ? plain_line(raster, row, scale_N) : coloured_line(raster, row, scale_N)) +
                        std::string(width - columns, ' '));
    return lines;
}

std::string heat_map_legend(Ink ink) {
    std::string out = ink == Ink::plain ? "() centre of pressure" : "+ centre of pressure";
    for (std::size_t bit = 0; bit < kStates; ++bit)
        out += fmt::format(
            "  {} {}",
            ink == Ink::plain ? std::string(1, kMarks[bit]) : fmt::format("\x1b[38;5;{}m█\x1b[0m", kMarkColours[bit]),
            kTaxelStates[bit]);
    return out;
}

}  // namespace tactiled::ctl
