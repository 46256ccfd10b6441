// Pairs of right sessions of many sensors made at random: none of them is a contradiction; turned and exchanged ones are.
#include "decoupling/fit/session_lines.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tactiled {
namespace {

// Channels of three loads: straight, in pairs that nearly repeat each other, or exponential (photodiodes). Resistors under
// one press at changing places bend, too, and determine the load badly.
enum class Kind { straight, pairs, diodes, resistors };

struct Sensor {
    std::mt19937_64 random;
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform{-1, 1};
    std::size_t channels;
    Kind kind;
    std::vector<std::array<double, 3>> gain;
    double first_load = 1;  // its greatest value

    Sensor(unsigned seed, std::size_t n, Kind its_kind) : random(seed), channels(n), kind(its_kind), gain(n) {
        for (std::size_t k = 0; k < n; ++k)
            for (std::size_t c = 0; c < 3; ++c)
                gain[k][c] = kind == Kind::pairs && k % 2 == 1 ? gain[k - 1][c] + 0.08 * uniform(random) : uniform(random);
    }
    [[nodiscard]] std::vector<std::size_t> components() const {
        return kind == Kind::resistors ? std::vector<std::size_t>{2} : std::vector<std::size_t>{0, 1, 2};
    }
    // Gains differ by 3 % between sessions and zeros by 5 % of a channel's width (sd).
    std::vector<LabelledRow> session(int n_rows = 300) {
        std::vector<double> own_gain(channels), zero(channels);
        for (std::size_t k = 0; k < channels; ++k) own_gain[k] = 1 + 0.03 * normal(random), zero[k] = 0.1 * normal(random);
        std::vector<LabelledRow> rows;
        for (int i = 0; i < n_rows; ++i) {
            LabelledRow row{.line = i + 2, .channel = {}, .wrench_S = kUnseen};
            const double x = uniform(random), y = uniform(random), press = 0.5 + 0.5 * uniform(random);
            for (const std::size_t c : components())
                row.wrench_S[c] = kind == Kind::resistors ? -press : (c == 0 ? first_load : 1) * uniform(random);
            for (std::size_t k = 0; k < channels; ++k) {
                double reading = 0;
                if (kind == Kind::resistors) {
                    const double share = press * std::exp(-(std::pow(x - gain[k][0], 2) + std::pow(y - gain[k][1], 2)));
                    reading = share / (share + 0.3);
                } else {
                    for (std::size_t c = 0; c < 3; ++c) reading += gain[k][c] * row.wrench_S[c];
                    if (kind == Kind::diodes) reading = std::exp(reading);
                }
                row.channel.push_back(own_gain[k] * reading + zero[k] + 0.005 * normal(random));
            }
            rows.push_back(std::move(row));
        }
        return rows;
    }
};

bool contradict(const std::vector<LabelledRow>& one, const std::vector<LabelledRow>& other) {
    std::vector<Rows> of_session(2);
    for (const LabelledRow& row : one) of_session[0].push_back(&row);
    for (const LabelledRow& row : other) of_session[1].push_back(&row);
    return contradicting(sessions_of(of_session)).pair.has_value();
}

TEST(SessionPairs, OfRightSessionsDoNotDisagree) {
    std::size_t pairs = 0;
    // Two pairs of channels hardly determine three loads.
    for (const std::size_t channels : {4u, 8u, 12u})
        for (const Kind kind : {Kind::straight, Kind::pairs, Kind::diodes, Kind::resistors})
            for (const int rows : {60, 300})
                for (unsigned seed = 1; seed <= (channels == 4 && kind == Kind::pairs ? 0u : 40u); ++seed, ++pairs) {
                    Sensor sensor(seed, channels, kind);
                    const auto one = sensor.session(rows), other = sensor.session(rows);
                    EXPECT_FALSE(contradict(one, other)) << channels << ' ' << int(kind) << ' ' << rows << ' ' << seed;
                }
    EXPECT_EQ(pairs, 880u);
}

TEST(SessionPairs, OfATurnedSensorAreSeen) {
    for (unsigned seed = 1; seed <= 60; ++seed) {
        Sensor sensor(seed, 8, Kind::straight);
        const std::vector<LabelledRow> one = sensor.session();
        std::vector<LabelledRow> turned = sensor.session();
        for (LabelledRow& row : turned) {
            std::swap(row.wrench_S[0], row.wrench_S[1]);
            row.wrench_S[1] = -row.wrench_S[1];
        }
        EXPECT_TRUE(contradict(one, turned)) << seed;
    }
}

TEST(SessionPairs, WithAnAxisThatIsHardlyLoadedDoNotDisagree) {
    for (unsigned seed = 1; seed <= 60; ++seed) {
        Sensor sensor(seed, 8, Kind::straight);
        const std::vector<LabelledRow> one = sensor.session();
        sensor.first_load = 0.02;
        EXPECT_FALSE(contradict(one, sensor.session())) << seed;
    }
}

// A skin that is pressed at a few places, other ones in each session: the line of one session is wrong for the places of the
// other, and yet one line serves both.
TEST(SessionPairs, AtOtherPlacesDoNotDisagree) {
    for (unsigned seed = 1; seed <= 60; ++seed) {
        std::mt19937_64 random(seed);
        std::uniform_real_distribution<double> uniform(-1, 1);
        std::normal_distribution<double> normal(0, 1);
        double place[8][2];
        for (auto& each : place) each[0] = uniform(random), each[1] = uniform(random);
        const auto session = [&] {
            std::vector<LabelledRow> rows;
            double gain[8];
            for (double& each : gain) each = 1 + 0.03 * normal(random);
            for (int poke = 0; poke < 15; ++poke) {
                const double x = uniform(random), y = uniform(random);
                for (int i = 0; i < 20; ++i) {
                    const double press = (1 - std::cos(0.3 * i)) / 2;
                    LabelledRow row{.line = poke * 20 + i + 2, .channel = {}, .wrench_S = kUnseen};
                    row.wrench_S[2] = -press, row.wrench_S[3] = -press * y, row.wrench_S[4] = press * x;
                    for (int k = 0; k < 8; ++k)
                        row.channel.push_back(gain[k] * press *
                                                  std::exp(-(std::pow(x - place[k][0], 2) + std::pow(y - place[k][1], 2))) +
                                              0.003 * normal(random));
                    rows.push_back(std::move(row));
                }
            }
            return rows;
        };
        const std::vector<LabelledRow> one = session();
        EXPECT_FALSE(contradict(one, session())) << seed;
    }
}

}  // namespace
}  // namespace tactiled
