#include "node/lab/chart/figure.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <sstream>

#include "node/lab/chart/axis.hpp"
#include "node/lab/chart/labels.hpp"

namespace tactiled::ctl {
namespace {

std::vector<std::string> texts(const std::vector<Tick>& ticks) {
    std::vector<std::string> result;
    for (const auto& tick : ticks) result.push_back(tick.text);
    return result;
}

Figure two_series() {
    Figure figure;
    figure.title = "error < time & space";
    figure.x = {"time, ns", true};
    figure.y = {"error, N", true};
    figure.series = {{"ours", Symbol::circle, Stroke::solid, {{10, 1, "a"}, {100, 0.1, "b"}}},
                     {"theirs", Symbol::cross, Stroke::none, {{12, 1.1, "c"}, {1000, 0, "exact"}}}};
    return figure;
}

TEST(LogTicks, ArePowersOfTenAndBetweenThemWhereFew) {
    EXPECT_EQ(texts(log_ticks({0.5, 60})), (std::vector<std::string>{"0.5", "1", "2", "5", "10", "20", "50"}));
    EXPECT_EQ(texts(log_ticks({1, 1e4})), (std::vector<std::string>{"1", "10", "100", "1000", "10000"}));
    EXPECT_EQ(texts(log_ticks({1e-9, 1e-6})), (std::vector<std::string>{"10⁻⁹", "10⁻⁸", "10⁻⁷", "10⁻⁶"}));
    EXPECT_LE(log_ticks({1e-30, 1e30}).size(), 9u);
    EXPECT_TRUE(log_ticks({0, 1}).empty());
}

// 40 points, many of them at one place: every label that is placed is in the frame, over no symbol and no other
// label.
TEST(Labels, OverlapNeitherEachOtherNorThePoints) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(40, 560);
    const Box frame{0, 0, 600, 400};
    std::size_t placed = 0;
    for (int round = 0; round < 20; ++round) {
        std::vector<LabelRequest> requests;
        for (int i = 0; i < 40; ++i) {
            const double x = i % 4 == 0 ? 300 : uniform(random), y = i % 4 == 0 ? 200 : uniform(random) * 0.65;
            requests.push_back({{x - 4, y - 4, x + 4, y + 4}, 70, 13});
        }
        requests.push_back({{290, 0, 310, 100}});  // a symbol without a label
        const auto places = place_labels(requests, {}, frame);
        ASSERT_EQ(places.size(), requests.size());
        EXPECT_FALSE(places.back());
        for (std::size_t i = 0; i < places.size(); ++i) {
            if (!places[i]) continue;
            ++placed;
            EXPECT_TRUE(frame.contains(places[i]->box));
            EXPECT_FALSE(places[i]->box.overlaps({290, 0, 310, 100}));
            for (std::size_t k = 0; k < places.size(); ++k) {
                EXPECT_FALSE(places[i]->box.overlaps(requests[k].symbol)) << i << " over the symbol of " << k;
                if (k != i && places[k]) { EXPECT_FALSE(places[i]->box.overlaps(places[k]->box)) << i << " over " << k; }
            }
        }
    }
    EXPECT_GT(placed, 20u * 36);
}

TEST(Labels, StandRightOfALonePointAndKeepOffItsLine) {
    const std::vector<LabelRequest> one{{{96, 96, 104, 104}, 40, 12}};
    const auto alone = place_labels(one, {}, {0, 0, 300, 200});
    ASSERT_TRUE(alone.at(0));
    EXPECT_GT(alone[0]->box.left, 104);
    EXPECT_NEAR((alone[0]->box.top + alone[0]->box.bottom) / 2, 100, 1e-9);
    const auto off_line = place_labels(one, {{100, 99, 300, 101}}, {0, 0, 300, 200});
    ASSERT_TRUE(off_line.at(0));
    EXPECT_FALSE(off_line[0]->box.overlaps({100, 99, 300, 101}));
    EXPECT_FALSE(place_labels(one, {}, {80, 80, 110, 110}).at(0)) << "there is no room";
}

TEST(FigureSvg, IsTheSameBytesForTheSameDataAndEscapesItsTexts) {
    const std::string svg = figure_svg(two_series());
    EXPECT_EQ(svg, figure_svg(two_series()));
    EXPECT_NE(svg.find("error &lt; time &amp; space"), svg.npos);
    for (const char* text : {">a<", ">b<", ">c<", ">exact<", ">ours<", ">theirs<", ">time, ns<", ">0<"})
        EXPECT_NE(svg.find(text), svg.npos) << text;
    EXPECT_EQ(svg.find("nan"), svg.npos);
}

TEST(FigureSvg, LeavesOutWhatIsNoNumber) {
    Figure figure = two_series();
    figure.series[0].points = {{std::nan(""), 1, "lost"}, {1, std::numeric_limits<double>::infinity(), "far"}};
    figure.series[1].points.clear();
    const std::string svg = figure_svg(figure);
    EXPECT_EQ(svg.find("lost"), svg.npos);
    EXPECT_EQ(svg.find("far"), svg.npos);
    EXPECT_EQ(svg.find("nan"), svg.npos);
    EXPECT_EQ(svg.find("inf"), svg.npos);
}

Figure bare(Figure::Series series) {
    return {.title = "",
            .x = {.label = "a & b", .range = Span{0, 10}},
            .y = {.label = "y", .range = Span{-1, 1}, .ticks = {{-1, "low"}, {1, "high"}}},
            .series = {std::move(series)},
            .width = 100,
            .height = 50};
}

// Returns the numbers of the first path whose attributes contain `mark`.
std::vector<double> path_of(const std::string& svg, const std::string& mark) {
    const std::size_t at = svg.find(" d=\"", svg.find(mark));
    std::vector<double> numbers;
    std::string text = svg.substr(at + 4, svg.find('"', at + 4) - at - 4);
    for (char& c : text)
        if (std::string("MLHVZh").find(c) != std::string::npos) c = ' ';
    std::istringstream in(text);
    for (double value = 0; in >> value;) numbers.push_back(value);
    return numbers;
}

// The foot of the plot is at 58, its top at 8; values beyond the axes are placed at their ends.
TEST(FigureSvg, PutsPointsWhereTheyBelong) {
    const double nan = std::nan("");
    const std::string svg =
        figure_svg(bare({"", Symbol::dot, Stroke::none, {{0, -1}, {10, 1}, {5, 0}, {nan, 0}, {20, 9}}}), Place::page);
    const auto at = path_of(svg, "stroke-linecap");  // x, y and the 0 of each dot
    ASSERT_EQ(at.size(), 12u) << svg;
    const double left = at[0];
    EXPECT_EQ(at, (std::vector<double>{left, 58, 0, left + 100, 8, 0, left + 50, 33, 0, left + 100, 8, 0}));
    EXPECT_NE(svg.find("a &amp; b"), svg.npos);
    for (const char* tick : {">0<", ">2<", ">10<", ">low<", ">high<"}) EXPECT_NE(svg.find(tick), svg.npos) << tick;
}

TEST(FigureSvg, EndsALineWhereAValueIsMissing) {
    const double nan = std::nan("");
    const std::string svg =
        figure_svg(bare({"", Symbol::none, Stroke::solid, {{0, 0}, {1, 0}, {nan, nan}, {2, 0}, {3, 0}}}));
    const std::string line = svg.substr(svg.find("stroke-width=\"1.5\""));
    EXPECT_EQ(std::count(line.begin(), line.begin() + std::ptrdiff_t(line.find("/>")), 'M'), 2);
}

TEST(FigureSvg, DrawsBarsFromCornerToCorner) {
    Figure::Series bars{.name = "", .points = {{2, -1}, {4, 0}}, .shape = Shape::bars};
    const auto at = path_of(figure_svg(bare(bars), Place::page), "fill-opacity");
    ASSERT_EQ(at.size(), 5u);  // M x y V y H x V y
    EXPECT_EQ(at[1], 58);
    EXPECT_EQ(at[2], 33);
    EXPECT_DOUBLE_EQ(at[3] - at[0], 20);
    EXPECT_EQ(at[4], 58);
}

// Numbers of eleven digits have no room beside each other.
TEST(FigureSvg, LeavesOutNumbersThatWouldOverlap) {
    Figure figure = bare({"", Symbol::dot});
    figure.x.range = Span{1e9, 1e9 + 10};
    const std::string svg = figure_svg(figure, Place::page);
    EXPECT_NE(svg.find(">1000000000<"), svg.npos);
    EXPECT_EQ(svg.find(">1000000002<"), svg.npos);
}

}  // namespace
}  // namespace tactiled::ctl
