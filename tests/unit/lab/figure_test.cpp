#include "node/lab/chart/figure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

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
    figure.series = {{"ours", Symbol::circle, Stroke::solid, {{10, 1, "a"}, {100, 0.1, "b"}}, ""},
                     {"theirs", Symbol::cross, Stroke::none, {{12, 1.1, "c"}, {1000, 0, "exact"}}, ""}};
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
        const auto places = place_labels(requests, {{290, 0, 310, 100}}, {}, frame);
        ASSERT_EQ(places.size(), requests.size());
        for (std::size_t i = 0; i < places.size(); ++i) {
            if (!places[i]) continue;
            ++placed;
            EXPECT_TRUE(frame.contains(*places[i]));
            EXPECT_FALSE(places[i]->overlaps({290, 0, 310, 100}));
            for (std::size_t k = 0; k < places.size(); ++k) {
                EXPECT_FALSE(places[i]->overlaps(requests[k].symbol)) << i << " over the symbol of " << k;
                if (k != i && places[k]) { EXPECT_FALSE(places[i]->overlaps(*places[k])) << i << " over " << k; }
            }
        }
    }
    EXPECT_GT(placed, 20u * 36);
}

TEST(Labels, StandRightOfALonePointAndKeepOffItsLine) {
    const std::vector<LabelRequest> one{{{96, 96, 104, 104}, 40, 12}};
    const auto alone = place_labels(one, {}, {}, {0, 0, 300, 200});
    ASSERT_TRUE(alone.at(0));
    EXPECT_GT(alone[0]->left, 104);
    EXPECT_NEAR((alone[0]->top + alone[0]->bottom) / 2, 100, 1e-9);
    const auto off_line = place_labels(one, {}, {{100, 99, 300, 101}}, {0, 0, 300, 200});
    ASSERT_TRUE(off_line.at(0));
    EXPECT_FALSE(off_line[0]->overlaps({100, 99, 300, 101}));
    EXPECT_FALSE(place_labels(one, {}, {}, {80, 80, 110, 110}).at(0)) << "there is no room";
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

}  // namespace
}  // namespace tactiled::ctl
