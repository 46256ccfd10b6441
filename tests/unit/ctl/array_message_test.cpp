// The array of a sample as messages of a recording, decoded by hand.
#include "node/ctl/array_message.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "drivers/mcap/cdr.hpp"

namespace tactiled::ctl {
namespace {

constexpr float kNoForce = std::numeric_limits<float>::quiet_NaN();
constexpr std::uint64_t kWall_ns = 1'700'000'000'000'000'123u;

std::string text_of(CdrReader& cdr) {
    std::string out(cdr.get<std::uint32_t>(), 0);
    cdr.get(std::span(out.data(), out.size()));
    EXPECT_EQ(out.back(), '\0');
    out.pop_back();
    return out;
}

void expect_time(CdrReader& cdr) {
    EXPECT_EQ(cdr.get<std::int32_t>(), 1'700'000'000);
    EXPECT_EQ(cdr.get<std::uint32_t>(), 123u);
}

// A cloud of three taxels, the last of which has no force; x and z are measured.
struct ThreeTaxels {
    std::vector<float> place = {1e-3f, 2e-3f, 3e-3f, 0,     0,     1,     4e-3f, 5e-3f, 6e-3f,
                                0.6f,  0,     0.8f,  7e-3f, 8e-3f, 9e-3f, 0,     0,     1};
    std::vector<float> force = {1, -2, -3, -4, kNoForce, kNoForce};
    std::vector<std::uint8_t> state = {0, TACTILED_TAXEL_DOUBTED, TACTILED_TAXEL_DEAD};
    std::uint32_t rows = 0, columns = 0;

    [[nodiscard]] std::string encoded() const {
        std::string out;
        encode_cloud({rows, columns, 5, place, force.data(), state.data()}, "pad", kWall_ns, out);
        return out;
    }
};

TEST(ArrayMessage, ACloudHasAPointForEachTaxelWithTheFieldsThatItNames) {
    const std::string bytes = ThreeTaxels{}.encoded();
    CdrReader cdr(bytes);
    expect_time(cdr);
    EXPECT_EQ(text_of(cdr), "pad");
    EXPECT_EQ(cdr.get<std::uint32_t>(), 1u);  // height
    EXPECT_EQ(cdr.get<std::uint32_t>(), 3u);  // width
    const std::vector<std::string> names = {"x", "y", "z", "press_N", "fx_N", "fz_N", "state"};
    ASSERT_EQ(cdr.get<std::uint32_t>(), names.size());
    for (std::uint32_t k = 0; k < names.size(); ++k) {
        EXPECT_EQ(text_of(cdr), names[k]);
        EXPECT_EQ(cdr.get<std::uint32_t>(), 4 * k);
        EXPECT_EQ(cdr.get<std::uint8_t>(), k < 6 ? 7 : 6);  // FLOAT32, UINT32
        EXPECT_EQ(cdr.get<std::uint32_t>(), 1u);
    }
    EXPECT_EQ(cdr.get<std::uint8_t>(), 0);  // little-endian
    EXPECT_EQ(cdr.get<std::uint32_t>(), 28u);
    EXPECT_EQ(cdr.get<std::uint32_t>(), 84u);
    ASSERT_EQ(cdr.get<std::uint32_t>(), 84u);
    float point[3][7];
    cdr.get(std::span(&point[0][0], 21));
    std::uint32_t state[3];
    for (int i = 0; i < 3; ++i) std::memcpy(&state[i], &point[i][6], sizeof state[i]);
    EXPECT_EQ(cdr.get<std::uint8_t>(), 0);  // not dense
    EXPECT_FALSE(cdr.failed());
    EXPECT_EQ(point[0][0], 1e-3f);
    EXPECT_EQ(point[1][2], 6e-3f);
    EXPECT_EQ(point[0][3], 2);  // the press is along the normal
    EXPECT_FLOAT_EQ(point[1][3], 0.6f * 3 + 0.8f * 4);
    EXPECT_EQ(point[1][4], -3);
    EXPECT_EQ(point[1][5], -4);
    for (int field = 3; field < 6; ++field) EXPECT_TRUE(std::isnan(point[2][field])) << field;
    EXPECT_EQ(std::vector<std::uint32_t>(state, state + 3), (std::vector<std::uint32_t>{0, 32, 4}));
}

TEST(ArrayMessage, TheCloudOfAGridHasItsRowsAndColumns) {
    ThreeTaxels cloud;
    cloud.rows = 3;
    cloud.columns = 1;
    const std::string bytes = cloud.encoded();
    CdrReader cdr(bytes);
    expect_time(cdr);
    (void)text_of(cdr);
    EXPECT_EQ(cdr.get<std::uint32_t>(), 3u);
    EXPECT_EQ(cdr.get<std::uint32_t>(), 1u);
}

TEST(ArrayMessage, TheResultsAreThoseOfTheRecord) {
    tactiled_array array{};
    array.sample.t_ns = 77;
    array.n_out = 1, array.n_contact = 2, array.peak_taxel = 3;
    float number = 0.5f;
    for (float* member :
         {&array.peak_N, &array.peak_sd_N, &array.cop_S_m[0], &array.cop_S_m[1], &array.cop_S_m[2], &array.cop_sd_m[0],
          &array.cop_sd_m[1], &array.cop_sd_m[2], &array.area_m2, &array.area_sd_m2, &array.axis_rad, &array.axis_sd_rad})
        *member = number++;
    std::string bytes;
    encode_array(array, kWall_ns, bytes);
    CdrReader cdr(bytes);
    expect_time(cdr);
    EXPECT_EQ(cdr.get<std::uint64_t>(), 77u);
    for (const std::uint32_t expected : {1u, 2u, 3u}) EXPECT_EQ(cdr.get<std::uint32_t>(), expected);
    for (int k = 0; k < 12; ++k) EXPECT_EQ(cdr.get<float>(), 0.5f + float(k));
    EXPECT_FALSE(cdr.failed());
    EXPECT_EQ(bytes.size(), kCdrHead + 8 + 8 + 12 + 48);
}

}  // namespace
}  // namespace tactiled::ctl
