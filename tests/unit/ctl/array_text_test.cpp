// Arrays as text, JSON and maps of characters.
#include "node/ctl/array_text.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "node/shm/writer.hpp"

namespace tactiled::ctl {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// A sensor "pad" with taxels of one component, z.
class ArrayTextTest : public testing::Test {
protected:
    struct Place {
        float x_m, y_m, normal_x = 0, normal_z = 1;
    };
    static std::vector<Place> grid(unsigned rows, unsigned columns) {
        std::vector<Place> places;
        for (unsigned i = 0; i < rows * columns; ++i)
            places.push_back({1e-3f * float(i % columns), -1e-3f * float(i / columns)});
        return places;
    }
    // The shape of the array: its taxels press with 1 N at `pressed` and else with nothing.
    void make(unsigned rows, unsigned columns, const std::vector<Place>& places, std::size_t pressed,
              std::uint32_t components = 4) {
        SegmentPlan plan;
        plan.name = "array-text-" + std::to_string(::getpid());
        plan.watchdog_ms = 10'000;
        plan.array_history = 8;
        plan.sensors.resize(1);
        std::strcpy(plan.sensors[0].name, "pad");
        plan.sensors[0].stale_ms = 10'000;
        plan.sensors[0].n_taxels = std::uint32_t(places.size());
        plan.sensors[0].taxel_components = components;
        plan.sensors[0].taxel_rows = rows;
        plan.sensors[0].taxel_columns = columns;
        plan.places.emplace_back();
        for (const Place& p : places)
            plan.places[0].insert(plan.places[0].end(), {p.x_m, p.y_m, 0, p.normal_x, 0, p.normal_z});
        writer_.reset();
        writer_ = std::make_unique<SegmentWriter>(plan);
        writer_->set_state(TACTILED_RUNNING);
        n_components_ = std::size_t(std::popcount(components));
        force_.assign(places.size() * n_components_, 0.f);
        force_[pressed * n_components_ + n_components_ - 1] = -1;
        state_.assign(places.size(), 0);
        head_ = {};
        head_.sample.quality = TACTILED_GOOD;
        head_.peak_N = 1;
        head_.peak_sd_N = 0.02f;
        head_.peak_taxel = std::uint32_t(pressed);
        head_.cop_S_m[0] = places[pressed].x_m;
        head_.cop_S_m[1] = places[pressed].y_m;
        segment_ = Segment::open(plan.name);
    }
    void put_out(std::size_t taxel, std::uint8_t state) {
        for (std::size_t c = 0; c < n_components_; ++c) force_[taxel * n_components_ + c] = kNan;
        state_[taxel] = state;
        ++head_.n_out;
    }
    Array read() {
        std::vector<std::uint64_t> record(
            tactiled_array_size(std::uint32_t(state_.size()), segment_.sensor(0).taxel_components) / 8);
        head_.sample.t_ns = head_.sample.t_published_ns = monotonic_ns();
        auto* const bytes = reinterpret_cast<char*>(record.data());
        std::memcpy(bytes, &head_, sizeof head_);
        std::memcpy(bytes + sizeof head_, force_.data(), force_.size() * sizeof(float));
        std::memcpy(bytes + sizeof head_ + force_.size() * sizeof(float), state_.data(), state_.size());
        writer_->publish_array(0, 0, record.data());
        tactiled_node node{};
        node.t_ns = monotonic_ns();
        writer_->publish(node);
        Array array;
        EXPECT_TRUE(segment_.latest(0, array));
        return array;
    }
    // The lines of the map without those above it.
    std::vector<std::string> picture(unsigned width, unsigned height, Ink ink = Ink::plain) {
        auto lines = heat_map(segment_, 0, read(), width, height, ink);
        if (ink == Ink::plain) {
            for (const auto& line : lines) EXPECT_EQ(line.size(), width) << line;
        }
        lines.erase(lines.begin(), lines.begin() + std::ptrdiff_t(std::min(lines.size(), kMapHead)));
        return lines;
    }

    std::unique_ptr<SegmentWriter> writer_;
    Segment segment_;
    tactiled_array head_{};
    std::vector<float> force_;
    std::vector<std::uint8_t> state_;
    std::size_t n_components_ = 1;
};

using Lines = std::vector<std::string>;

TEST_F(ArrayTextTest, ASmallGridIsDrawnTaxelByTaxelWithItsMarks) {
    make(3, 4, grid(3, 4), 6);
    force_[5] = -0.55f;
    put_out(0, TACTILED_TAXEL_MISSING);
    put_out(3, TACTILED_TAXEL_SATURATED);
    put_out(8, TACTILED_TAXEL_DEAD);
    put_out(11, TACTILED_TAXEL_FROZEN);
    EXPECT_EQ(picture(10, 8), (Lines{"??....!!  ", "..++()..  ", "xx....~~  "}));
    const auto lines = heat_map(segment_, 0, read(), 30, 8, Ink::plain);
    EXPECT_EQ(lines[0], "pad                           ");
    EXPECT_EQ(lines[1], "0 .. 1 N, 4 out               ");
    EXPECT_EQ(lines[2], "() 2.0 -1.0 +-0.00 mm         ");
}

TEST_F(ArrayTextTest, ALargeGridIsScaledDownAndKeepsItsPeak) {
    for (const std::size_t pressed : {0u, 2080u, 4095u}) {
        make(64, 64, grid(64, 64), pressed);
        head_.cop_S_m[0] = kNan;
        const auto lines = picture(26, 8);
        EXPECT_LE(lines.size(), 8u);
        EXPECT_EQ(std::ranges::count_if(lines, [](const std::string& line) { return line.find("@@") != line.npos; }), 1);
    }
}

TEST_F(ArrayTextTest, AMarkOfALargeGridNeedsACellWithoutAnyForce) {
    make(16, 16, grid(16, 16), 255);
    for (const std::size_t i : {0u, 1u, 16u}) put_out(i, TACTILED_TAXEL_DEAD);
    EXPECT_EQ(picture(16, 8)[0].substr(0, 4), "....");
    put_out(17, TACTILED_TAXEL_DEAD);
    EXPECT_EQ(picture(16, 8)[0].substr(0, 4), "xx..");
}

TEST_F(ArrayTextTest, AListIsDrawnAtItsPlacesAndTheGapsAreEmpty) {
    make(0, 0, {{0, 0}, {1e-3f, 0}, {0, -1e-3f}, {1e-3f, -1e-3f}, {3e-3f, -3e-3f}}, 1);
    const auto lines = picture(20, 8);
    EXPECT_EQ(lines.front().substr(0, 4), "..()");
    EXPECT_NE(lines.back().find(".."), 0u);
    EXPECT_NE(lines.back().find(".."), std::string::npos);
}

TEST_F(ArrayTextTest, ARowAndAColumnAreDrawn) {
    make(1, 5, grid(1, 5), 2);
    EXPECT_EQ(picture(12, 8), (Lines{"....()....  "}));
    make(4, 1, grid(4, 1), 2);
    EXPECT_EQ(picture(4, 8), (Lines{"..  ", "..  ", "()  ", "..  "}));
    make(0, 0, {{0, 0}}, 0);
    EXPECT_EQ(picture(4, 8), (Lines{"()  "}));
}

TEST_F(ArrayTextTest, TwoRowsOfATaxelAreAColouredLine) {
    make(3, 2, grid(3, 2), 0);
    head_.cop_S_m[0] = kNan;
    const auto lines = picture(2, 8, Ink::colours);
    ASSERT_EQ(lines.size(), 2u);
    EXPECT_EQ(lines[0], "\x1b[38;5;230m\x1b[48;5;236m▀\x1b[0m\x1b[38;5;236m\x1b[48;5;236m▀\x1b[0m");
    EXPECT_EQ(lines[1], "\x1b[38;5;236m▀\x1b[0m\x1b[38;5;236m▀\x1b[0m");
}

TEST_F(ArrayTextTest, TheCentreIsAPlusOnTheColourBesideIt) {
    make(2, 1, grid(2, 1), 1);
    head_.cop_S_m[0] = -1e-5f;
    head_.cop_S_m[1] = 0;
    EXPECT_EQ(picture(1, 8, Ink::colours), (Lines{"\x1b[38;5;16m\x1b[48;5;230m+\x1b[0m"}));
    EXPECT_EQ(heat_map(segment_, 0, read(), 30, 8, Ink::plain)[2], "() 0.0 0.0 +-0.00 mm          ");
}

TEST_F(ArrayTextTest, WithoutAPressTheNoiseHasTheFirstStep) {
    make(2, 2, grid(2, 2), 0);
    head_.peak_N = head_.cop_S_m[0] = kNan;
    EXPECT_EQ(picture(4, 8), (Lines{"....", "...."}));
}

TEST_F(ArrayTextTest, ABadArrayHasNoMapAndNoNumber) {
    make(2, 2, grid(2, 2), 0);
    head_.sample.quality = TACTILED_BAD;
    head_.sample.reasons = TACTILED_STALE;
    tactiled_invalidate_array(&head_, 0, TACTILED_STALE);
    force_.assign(4, kNan);
    const auto lines = heat_map(segment_, 0, read(), 40, 8, Ink::plain);
    EXPECT_EQ(lines, (Lines{"pad: no map: bad:stale                  "}));
    std::string json = "{";
    append_array_json(segment_, 0, read(), json);
    json.back() = '}';
    const auto object = nlohmann::json::parse(json);
    EXPECT_EQ(object["fz_N"], nlohmann::json::parse("[null,null,null,null]"));
    EXPECT_TRUE(object["peak_N"].is_null() && object["peak_taxel"].is_null() && object["cop_S_m"][0].is_null());
}

TEST_F(ArrayTextTest, ThePressIsAlongTheNormal) {
    make(0, 0, {{0, 0, 0.6f, 0.8f}, {1e-3f, 0, 0, 1}}, 0, 5);  // x and z
    force_ = {-1, -2, 3, -4};
    const Array array = read();
    EXPECT_FLOAT_EQ(press_N(segment_, 0, array, 0), 0.6f + 1.6f);
    EXPECT_FLOAT_EQ(press_N(segment_, 0, array, 1), 4);
    std::string json = "{";
    append_array_json(segment_, 0, array, json);
    json.back() = '}';
    const auto object = nlohmann::json::parse(json);
    EXPECT_EQ(object["fx_N"], nlohmann::json::parse("[-1.0,3.0]"));
    EXPECT_EQ(object["fz_N"], nlohmann::json::parse("[-2.0,-4.0]"));
    EXPECT_FALSE(object.contains("fy_N"));
    std::string rows;
    append_array_csv(segment_, 0, array, rows);
    EXPECT_NE(rows.find(",0,0,0,0,-1,,-2,,\"good\"\n"), std::string::npos) << rows;
}

TEST_F(ArrayTextTest, TheTableHasARowOfTheGridInEachLine) {
    make(2, 3, grid(2, 3), 4);
    put_out(0, TACTILED_TAXEL_SATURATED);
    const std::string text = array_table(segment_, 0, read());
    EXPECT_NE(text.find("at taxel 4 (row 1, column 1)\ntaxels without a force: 1\n"), std::string::npos) << text;
    EXPECT_NE(text.find("saturated   0.0000   0.0000\n   0.0000   1.0000   0.0000\n"), std::string::npos) << text;
}

}  // namespace
}  // namespace tactiled::ctl
