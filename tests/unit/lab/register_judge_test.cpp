// Registers of devices whose format is known are judged: the right format, or none.
#include "node/lab/register_judge.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

namespace tactiled::ctl {
namespace {

struct RegisterDevice {
    NumberType type = NumberType::float32;
    bool low_word_first = false, low_byte_first = false;

    void put(std::vector<std::uint16_t>& words, double value) const {
        std::uint64_t bits = 0;
        const bool is_signed = type == NumberType::int16 || type == NumberType::int32;
        const std::size_t n = words_of(type);
        if (type == NumberType::float64)
            bits = std::bit_cast<std::uint64_t>(value);
        else if (type == NumberType::float32)
            bits = std::bit_cast<std::uint32_t>(float(value));
        else {
            const double span = std::exp2(16.0 * double(n)), low = is_signed ? -span / 2 : 0;
            bits = std::uint64_t(std::int64_t(std::clamp(std::round(value), low, low + span - 1)));
        }
        for (std::size_t i = 0; i < n; ++i) {
            const auto word = std::uint16_t(bits >> 16 * (low_word_first ? i : n - 1 - i));
            words.push_back(low_byte_first ? std::uint16_t(word << 8 | word >> 8) : word);
        }
    }
    [[nodiscard]] bool is(const Interpretation& one, std::uint16_t at) const {
        return one.type == type && one.low_word_first == low_word_first && one.low_byte_first == low_byte_first &&
               one.at == at;
    }
};

struct Axis {
    double zero, gain, noise;
};
const std::vector<Axis> kThreeAxes = {{0.1, 5, 0.02}, {-0.3, -4, 0.02}, {0.2, -20, 0.02}};

// A press of a second that is held: 0, rising from row 20 on, 1 from row 40 on; `rows` rows from register 100 on.
RegisterRows pressed(const RegisterDevice& device, const std::vector<Axis>& axes, double unit, std::size_t rows = 75) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise;
    RegisterRows answers{100, {}};
    for (std::size_t i = 0; i < rows; ++i) {
        const double load = std::clamp((double(i) - 20) / 20, 0.0, 1.0);
        auto& row = answers.rows.emplace_back();
        for (const Axis& axis : axes) device.put(row, (axis.zero + axis.gain * load + axis.noise * noise(random)) / unit);
    }
    return answers;
}

const RegisterDevice kDevices[] = {{NumberType::int16, false, false},   {NumberType::int16, false, true},
                                   {NumberType::int32, false, false},   {NumberType::int32, true, false},
                                   {NumberType::float32, false, false}, {NumberType::float32, true, false},
                                   {NumberType::float32, false, true},  {NumberType::float32, true, true},
                                   {NumberType::float64, false, false}, {NumberType::float64, true, false}};

// Counts of an integer: 0.01 N in one word, 1e-5 N in two.
double unit_of(NumberType type) { return type == NumberType::int16 ? 0.01 : type == NumberType::int32 ? 1e-5 : 1; }

TEST(RegisterJudge, APressTellsTypeAndOrder) {
    for (const RegisterDevice& device : kDevices) {
        const auto answers = pressed(device, kThreeAxes, unit_of(device.type));
        const auto ranked = judge_registers(answers, 100, answers.rows[0].size());
        EXPECT_TRUE(device.is(ranked.front(), 100)) << ranked.front().text();
        EXPECT_TRUE(is_clear(ranked)) << ranked[equals(ranked).back()].text() << " beside " << ranked.front().text();
        EXPECT_EQ(ranked.front().is_readable(), device.type != NumberType::float64 && !device.low_byte_first);
        ASSERT_EQ(ranked.front().numbers.size(), 3u);
        EXPECT_NEAR(ranked.front().numbers[2].back() * unit_of(device.type), -19.8, 0.1);  // N
    }
}

TEST(RegisterJudge, NoiseAtRestIsNeverTakenForAnotherFormat) {
    for (const RegisterDevice& device : kDevices) {
        const auto answers = pressed(device, kThreeAxes, unit_of(device.type), 20);
        const auto ranked = judge_registers(answers, 100, answers.rows[0].size());
        EXPECT_TRUE(!is_clear(ranked) || device.is(ranked.front(), 100)) << ranked.front().text();
    }
}

// The manual counts from 1: the numbers begin one register before or after the stated one.
TEST(RegisterJudge, ABlockThatBeginsOneRegisterBesideIsFound) {
    for (const RegisterDevice& device : kDevices) {
        if (words_of(device.type) == 1) continue;
        const auto answers = pressed(device, kThreeAxes, unit_of(device.type));
        const std::size_t n = answers.rows[0].size();
        for (const std::uint16_t stated : {std::uint16_t(99), std::uint16_t(101)}) {
            const auto ranked = judge_registers(answers, stated, n);  // the device refuses registers beside the block
            EXPECT_TRUE(is_clear(ranked) && device.is(ranked.front(), 100)) << stated << " " << ranked.front().text();
        }
    }
}

TEST(RegisterJudge, TwoEqualBlocksBesideTheStatedRegisterAreNotDecided) {
    const RegisterDevice device;
    auto axes = kThreeAxes;
    axes.insert(axes.begin(), {0.4, 3, 0.02});
    const auto ranked = judge_registers(pressed(device, axes, 1), 101, 6);
    EXPECT_FALSE(is_clear(ranked));
    bool before = false, after = false;
    for (const std::size_t i : equals(ranked)) {
        before |= device.is(ranked[i], 100);
        after |= device.is(ranked[i], 102);
    }
    EXPECT_TRUE(before && after);
}

TEST(RegisterJudge, RegistersThatNeverChangeAreNotDecided) {
    for (const unsigned word : {0u, 1u, 934u, 0x41A0u, 0xFFFFu}) {
        const RegisterRows answers{100, std::vector(75, std::vector<std::uint16_t>(6, std::uint16_t(word)))};
        const auto ranked = judge_registers(answers, 100, 6);
        EXPECT_FALSE(is_clear(ranked)) << word << " " << ranked.front().text();
    }
}

TEST(RegisterJudge, PositiveIntegersMayBeSignedOrNot) {
    const RegisterDevice device{NumberType::int16, false, false};
    const auto ranked = judge_registers(pressed(device, {{10, 5, 0.02}, {9, 4, 0.02}, {8, 20, 0.02}}, 0.01), 100, 3);
    const auto like_best = equals(ranked);
    EXPECT_FALSE(is_clear(ranked));
    EXPECT_EQ(like_best.size(), 2u);
    for (const std::size_t i : like_best) EXPECT_EQ(words_of(ranked[i].type), 1u) << ranked[i].text();
}

// A number that never crosses 0, as one sign reads it, is as smooth for the other one.
TEST(RegisterJudge, ASignThatNeverShowsIsNotDecided) {
    for (const NumberType type : {NumberType::uint16, NumberType::int16, NumberType::uint32, NumberType::int32})
        for (const double part : {0.02, 0.2, 0.45, 0.55, 0.8, 0.98}) {  // relative to all values of the type
            const bool is_signed = type == NumberType::int16 || type == NumberType::int32;
            const double span = std::exp2(16. * double(words_of(type)));
            const double middle = is_signed && part > 0.5 ? (part - 1) * span : part * span, move = 0.01 * span;
            const auto answers = pressed({type, false, false}, {{middle, move, move / 300}, {middle, -move, move / 300}}, 1);
            const auto ranked = judge_registers(answers, 100, answers.rows[0].size());
            EXPECT_FALSE(is_clear(ranked)) << name_of(type) << " " << part << ": " << ranked.front().text();
            EXPECT_EQ(words_of(ranked.front().type), words_of(type));
        }
}

TEST(RegisterJudge, RandomWordsAreNoSensor) {
    std::mt19937_64 random(3);
    RegisterRows answers{100, {}};
    for (int i = 0; i < 75; ++i) {
        auto& row = answers.rows.emplace_back();
        for (int k = 0; k < 8; ++k) row.push_back(std::uint16_t(random()));
    }
    EXPECT_FALSE(is_clear(judge_registers(answers, 101, 6)));
}

// A device of random type, order, axes, steps, motion, neighbours and place.
struct RandomDevice {
    RegisterDevice device;
    RegisterRows answers;
    std::uint16_t stated = 100;  // the numbers begin at 100
    std::size_t count = 0;
    bool moves = false;

    explicit RandomDevice(std::uint64_t seed) : random_(seed) {
        device.type = NumberType(below(6));
        const std::size_t words = words_of(device.type), n = 1 + below(6);
        device.low_word_first = words > 1 && below(2) == 0;
        device.low_byte_first = below(10) == 0;
        if (words > 1) stated = std::uint16_t(99 + below(3));
        count = n * words;
        const bool is_float = device.type >= NumberType::float32;
        const bool has_sign = device.type != NumberType::uint16 && device.type != NumberType::uint32;
        const double full = std::exp2(16.0 * double(words) - (has_sign ? 1 : 0)) - 1;
        const double largest = is_float ? log_between(0.01, 1000) : log_between(3, full);
        const bool from_middle = !has_sign && below(2) == 0;  // offset binary code
        const double step = !is_float ? 1 : below(3) == 0 ? largest * log_between(1e-4, 0.1) : below(2) == 0 ? 0.01 : 0;
        std::vector<Axis> axes(n + 2);  // the last two are beside the block
        for (Axis& axis : axes) {
            const double gain = below(15) == 0 ? 0 : largest * log_between(0.03, 1);
            axis = {from_middle     ? full / 2
                    : below(2) == 0 ? 0
                                    : gain * between(has_sign ? -1 : 0, 1),
                    has_sign && below(2) == 0 ? -gain : gain, below(10) == 0 ? 0 : gain * log_between(1e-6, 0.3)};
        }
        const std::size_t motion = below(4), beside = below(4), repeats = 1 + below(2), rows = 30 + below(70);
        moves = motion != 0;
        const auto random_word = std::uint16_t(below(65536));
        std::normal_distribution<double> noise;
        for (std::size_t i = 0; i < rows; i += repeats) {
            const double x = double(i) / double(rows);
            const double loads[] = {0, std::clamp(5 * x - 1.5, 0.0, 1.0), std::sin(12 * x), std::floor(5 * x) / 5};
            std::vector<std::uint16_t> before, numbers, after;
            const auto put = [&](std::vector<std::uint16_t>& words_out, const Axis& axis) {
                const double value = axis.zero + axis.gain * loads[motion] + axis.noise * noise(random_);
                device.put(words_out, step > 0 ? std::round(value / step) * step : value);
            };
            for (std::size_t k = 0; k < n; ++k) put(numbers, axes[k]);
            if (beside == 1) before = after = {0, 0};
            if (beside == 2) put(before, axes[n]), put(after, axes[n + 1]);
            if (beside == 3) before = {random_word, 1}, after = {std::uint16_t(random_word + i), random_word};
            add_row(before, numbers, after, beside != 0, repeats);
        }
    }

private:
    // The answer holds the stated and the true block, and one register more on both sides unless the device refuses.
    void add_row(std::vector<std::uint16_t> before, const std::vector<std::uint16_t>& numbers,
                 const std::vector<std::uint16_t>& after, bool beside, std::size_t repeats) {
        before.insert(before.begin(), 2, 0);
        const std::size_t start = before.size();
        before.insert(before.end(), numbers.begin(), numbers.end());
        before.insert(before.end(), after.begin(), after.end());
        before.insert(before.end(), 2, 0);
        const int margin = beside ? 1 : 0, shift = stated - 100;
        const auto low = std::ptrdiff_t(start) + std::min(shift - margin, 0);
        const auto high = std::ptrdiff_t(start + count) + std::max(shift + margin, 0);
        answers.first = std::uint16_t(100 + low - std::ptrdiff_t(start));
        for (std::size_t i = 0; i < repeats; ++i) answers.rows.emplace_back(before.begin() + low, before.begin() + high);
    }
    std::size_t below(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_); }
    double between(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random_); }
    double log_between(double a, double b) { return std::exp(between(std::log(a), std::log(b))); }
    std::mt19937_64 random_;
};

TEST(RegisterJudge, RandomDevicesAreReadRightOrNotAtAll) {
    constexpr int kRandomDevices = 500;
    int wrong = 0, right = 0, floats = 0, right_floats = 0;
    for (std::uint64_t seed = 1; seed <= kRandomDevices; ++seed) {
        const RandomDevice random(seed);
        const auto ranked = judge_registers(random.answers, random.stated, random.count);
        const bool is_right = random.device.is(ranked.front(), 100), clear = is_clear(ranked);
        const bool is_easy =
            random.device.type == NumberType::float32 && random.moves && random.count >= 6 && random.stated == 100;
        right += clear && is_right;
        wrong += clear && !is_right;
        floats += is_easy;
        right_floats += is_easy && clear && is_right;
        if (clear && !is_right) fmt::print("seed {}: {}\n", seed, ranked.front().text());
    }
    fmt::print("{} right, {} wrong of {}; {} of {} float32 that move\n", right, wrong, kRandomDevices, right_floats, floats);
    EXPECT_LE(wrong, 1);
    EXPECT_GE(right, kRandomDevices / 5);
    EXPECT_GE(2 * right_floats, floats);
}

}  // namespace
}  // namespace tactiled::ctl
