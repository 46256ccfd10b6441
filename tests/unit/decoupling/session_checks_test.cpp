// Sessions of one recording in which the sensor was turned, channels were exchanged, or readings have another unit.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

// Eight straight channels of three loads, so that five combinations of them show nothing but noise. `gains_sd`, `zeros_sd`:
// of each session, relative to the channel.
Labelled spare_channels(unsigned seed, std::size_t sessions, double gains_sd, double zeros_sd) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Labelled labelled;
    labelled.name = "spare.csv";
    double gain[8][3];
    for (int k = 0; k < 8; ++k) {
        labelled.channels.push_back("c" + std::to_string(k + 1));
        for (double& g : gain[k]) g = normal(random);
    }
    for (std::size_t session = 0; session < sessions; ++session) {
        labelled.sessions.push_back(std::to_string(session + 1));
        double gains[8], zeros[8];
        for (int k = 0; k < 8; ++k) gains[k] = 1 + gains_sd * normal(random), zeros[k] = zeros_sd * normal(random);
        for (int i = 0; i < 150; ++i) {
            double load[3]{};
            if (i >= 5)
                for (double& part : load) part = uniform(random);
            LabelledRow row{
                .line = std::int64_t(labelled.rows.size()) + 2, .channel = {}, .wrench_S = kUnseen, .session = session};
            for (int k = 0; k < 8; ++k) {
                double reading = 3e-4 * normal(random);
                for (int c = 0; c < 3; ++c) reading += gain[k][c] * load[c];
                row.channel.push_back(zeros[k] + gains[k] * reading);
            }
            for (std::size_t c = 0; c < 3; ++c) row.wrench_S[c] = 10 * load[c];
            labelled.rows.push_back(row);
        }
    }
    return labelled;
}

template <class F>
Labelled changed(Labelled labelled, std::size_t session, const F& change) {
    for (LabelledRow& row : labelled.rows)
        if (row.session == session) change(row);
    return labelled;
}

void turn(LabelledRow& row) {
    const double fx = row.wrench_S[0];
    row.wrench_S[0] = row.wrench_S[1];
    row.wrench_S[1] = -fx;
}
void exchange(LabelledRow& row) { std::swap(row.channel[1], row.channel[4]); }
void count(LabelledRow& row) {
    for (double& x : row.channel) x = 500 * x + 20;
}
void millinewtons(LabelledRow& row) { row.wrench_S[2] *= 1000; }

void expect_in(const std::string& text, std::initializer_list<const char*> parts) {
    for (const char* part : parts) EXPECT_NE(text.find(part), std::string::npos) << part << "\nin: " << text;
}

TEST(Sessions, ThatContradictTheOthersAreNamedWhicheverTheyAre) {
    const Labelled right = spare_channels(1, 4, 0, 0);
    for (const auto change : {turn, exchange, count, millinewtons}) {
        expect_in(refusal(changed(right, 0, change), by("matrix")),
                  {"session 1 contradicts 2, 3 and 4", "in", "session \"1\" (from spare.csv:2 on)", "--session 2,3,4"});
        expect_in(refusal(changed(right, 2, change), by("matrix")),
                  {"session 3 contradicts 1, 2 and 4", "session \"3\" (from spare.csv:302 on)", "--session 1,2,4"});
    }
    expect_in(refusal(changed(changed(spare_channels(1, 5, 0, 0), 0, turn), 3, turn), by("matrix")),
              {"sessions 1 and 4 contradict 2, 3 and 5", "--session 2,3,5"});
}

TEST(Sessions, TwoThatContradictEachOtherAreBothNamed) {
    for (const auto change : {turn, exchange, count, millinewtons})
        expect_in(refusal(changed(spare_channels(2, 2, 0, 0), 0, change), by("matrix")),
                  {"sessions 1 and 2 contradict each other; the recording does not show which is wrong",
                   "--session 1 or --session 2"});
}

// Other gains hide a turn and an exchange from one straight line through two sessions.
TEST(Sessions, WithOtherGainsShowTurnsAndExchangesAllTheSame) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const Labelled right = spare_channels(seed, 4, 0.03, 0.05);
        EXPECT_EQ(refusal(right, by("matrix")), "") << seed;
        EXPECT_FALSE(warns(fit(right, by("matrix")), "contradict")) << seed;
        expect_in(refusal(changed(right, 0, turn), by("matrix")),
                  {"session 1 contradicts 2, 3 and 4", "mounted otherwise there"});
        // An exchange of channels that are nearly alike is within what gains may differ by, and only a warning.
        const Labelled wrong = changed(right, 3, exchange);
        std::string said = refusal(wrong, by("matrix"));
        if (said.empty())
            for (const std::string& warning : fit(wrong, by("matrix")).warnings) said += warning;
        expect_in(said, {"session 4 contradicts 1, 2 and 3", "the channels c2 and c5 seem to be exchanged"});
    }
}

// A session with little load along an axis, or with loads that always go together, contradicts no other.
TEST(Sessions, WithFewerAxesAreRight) {
    const Labelled right = spare_channels(3, 2, 0.03, 0);
    const Labelled small = changed(right, 1, [](LabelledRow& row) {
        for (std::size_t k = 0; k < row.channel.size(); ++k) row.channel[k] *= 0.2;
        for (std::size_t c = 0; c < 3; ++c) row.wrench_S[c] *= 0.2;
    });
    EXPECT_EQ(refusal(small, by("matrix")), "");
    Labelled unknown = right;
    for (std::size_t i = 0; i < unknown.rows.size(); i += 2) unknown.rows[i].wrench_S[1] = kNaN;
    EXPECT_EQ(refusal(unknown, by("matrix")), "");
}

}  // namespace
}  // namespace tactiled
