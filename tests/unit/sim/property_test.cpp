// The simulator's promises for every effect and every scene, over 2,500 random ones. RC_PARAMS="max_success=100000
// seed=7" in the environment selects more and other ones.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>

#include "drivers/sim/simulation.hpp"
#include "tests/unit/sim/random_scene.hpp"

namespace tactiled::sim {
namespace {

#ifdef __SANITIZE_ADDRESS__
constexpr int kScenes = 500;
#elif defined(__SANITIZE_THREAD__)
constexpr int kScenes = 50;
#else
constexpr int kScenes = 2500;
#endif

// Set before RapidCheck reads it, once, at its first use.
const bool asked = [] {
    return ::setenv("RC_PARAMS", fmt::format("seed=20 max_success={} noshrink=0", kScenes).c_str(), 0) == 0;
}();

// Calls what(block a, block b, sample) for each sample of two runs of the scene's first sensor.
template <typename F>
void compare(Simulation& a, Simulation& b, F&& what) {
    for (;;) {
        const Block& x = a.advance(0);
        const Block& y = b.advance(0);
        if (x.n == 0) return;
        for (std::size_t n = 0; n < x.n; ++n) what(x, y, n);
    }
}

// Returns the largest difference between the results of both runs, in N of the channels.
double difference_N(const Scene& scene, const std::string& a, const std::string& b) {
    Simulation one(scene, a), other(scene, b);
    const Sensor& sensor = scene.sensors[0];
    double max = 0;
    compare(one, other, [&](const Block& x, const Block& y, std::size_t n) {
        if (x.dropped[n] || y.dropped[n]) return;
        std::array<double, kMaxSensorChannels> change{};
        for (std::size_t k = 0; k < sensor.n(); ++k) {
            if (((x.missing[n] | y.missing[n]) >> k & 1u) != 0) continue;
            if (!std::isfinite(x.channel[k][n]) || !std::isfinite(y.channel[k][n])) RC_FAIL("not finite");
            change[k] = x.channel[k][n] - y.channel[k][n];
        }
        max = std::max(max, sensor.largest_N(change));
    });
    return max;
}

// With all effects active none changes a channel by more than its bound; and the bounds are useful: half of them are
// at most ten times the actual change.
TEST(Effects, AmongAllOthersStayWithinTheirBounds) {
    std::map<std::string_view, std::vector<double>> looseness;  // bound over actual change, if there was a change
    EXPECT_TRUE(rc::check([&] {
        const RandomScene random = random_scene();
        RC_LOG(random.text());
        const Scene scene = random.scene();
        Simulation simulation(scene, "all");
        simulation.measure_shares(true);
        while (simulation.advance(0).n > 0) {}
        const Choice& choice = simulation.choice(0);
        for (std::size_t d = 0; d < choice.decisions.size(); ++d) {
            const Decision& decision = choice.decisions[d];
            const double N = simulation.shares_N(0)[d], bound = decision.bound.change_N;
            if (!(N <= bound * kRounding + kNothing_N))
                RC_FAIL(fmt::format("{} made {} N, its bound is {} N", decision.effect->name, N, bound));
            if (N > 1e-4 * choice.wanted_N) looseness[decision.effect->name].push_back(bound / N);
        }
    }));
    std::vector<double> all;
    for (auto& [name, ratios] : looseness) {
        std::sort(ratios.begin(), ratios.end());
        fmt::print("    {:24} {:6} scenes, bound / largest change: {:8.2f} median\n", name, ratios.size(),
                   ratios[ratios.size() / 2]);
        all.insert(all.end(), ratios.begin(), ratios.end());
    }
    ASSERT_FALSE(all.empty());
    std::sort(all.begin(), all.end());
    fmt::print("    {:24} {:6} in all,  bound / largest change: {:8.2f} median\n", "", all.size(), all[all.size() / 2]);
    EXPECT_LE(all[all.size() / 2], 10);
}

RC_GTEST_PROP(Effects, LeftOutByAutoMakeNoLargerErrorThanGuaranteed, ()) {
    const RandomScene random = random_scene();
    Scene scene = random.scene();
    scene.wanted_accuracy_N = scene.sensors[0].resolution_N * *rc::gen::element(0.01, 0.1, 0.5, 2.0, 10.0);
    const auto choice = choose(scene, scene.sensors[0], scene.motion.extent(scene.sensors[0]), "auto");
    const double N = difference_N(scene, "auto", "all");
    RC_LOG(random.text());
    RC_LOG(fmt::format("{} N, guaranteed {} N, wanted {} N", N, choice.guaranteed_N, choice.wanted_N));
    RC_ASSERT(N <= choice.guaranteed_N * kRounding + kNothing_N);
    RC_ASSERT(choice.guaranteed_N <= choice.wanted_N);
}

// Directly after its effect, with all effects before it active, no level differs by more than its stated error.
RC_GTEST_PROP(Levels, StayWithinTheirErrors, ()) {
    const RandomScene random = random_scene();
    const Scene scene = random.scene();
    const Choice choice = choose(scene, scene.sensors[0], scene.motion.extent(scene.sensors[0]), "auto");
    std::vector<std::size_t> with_levels;
    for (std::size_t d = 0; d < choice.decisions.size(); ++d)
        if (!choice.decisions[d].levels.empty()) with_levels.push_back(d);
    if (with_levels.empty()) return;
    const std::size_t last = *rc::gen::elementOf(with_levels);
    std::string names;
    for (std::size_t d = 0; d <= last; ++d) names += (d == 0 ? "" : ",") + std::string(choice.decisions[d].effect->name);
    const Level& level = *rc::gen::elementOf(choice.decisions[last].levels);
    const double N = difference_N(scene, names, fmt::format("{}:{}", names, level.name));
    RC_LOG(random.text());
    RC_LOG(fmt::format("{}:{} {} N, says {} N", choice.decisions[last].effect->name, level.name, N, level.error_N));
    RC_ASSERT(N <= level.error_N * kRounding + kNothing_N);
}

RC_GTEST_PROP(Extent, HoldsEverySample, ()) {
    const RandomScene random = random_scene();
    RC_LOG(random.text());
    const Scene scene = random.scene();
    const Extent e = scene.motion.extent(scene.sensors[0]);
    Simulation simulation(scene, "none");
    std::array<double, kAxes> before{}, min{}, max{};
    bool holds = true;
    for (const Block* b = &simulation.advance(0); b->n > 0; b = &simulation.advance(0))
        for (std::size_t n = 0; n < b->n; ++n) {
            for (std::size_t axis = 0; axis < kAxes; ++axis) {
                const double load = b->load[axis][n];
                holds &= std::abs(load) <= e.max[axis] * kRounding;
                holds &= std::abs(load - before[axis]) <= e.change(Axis(axis), 1 / scene.rate_Hz) * kRounding + 1e-15;
                before[axis] = load;
                min[axis] = std::min(min[axis], load);
                max[axis] = std::max(max[axis], load);
            }
            const double shear = std::hypot(b->load[kFx][n], b->load[kFy][n]), press = -b->load[kFz][n];
            holds &= shear - scene.body.friction * press <= e.shear_excess_N * kRounding + kNothing_N;
            holds &= b->speed_m_s[n] <= e.speed_m_s * kRounding && b->slide_m[n] <= e.slide_m * kRounding + 1e-15;
            holds &= std::abs(b->x_m[n]) <= e.x_m * kRounding && std::abs(b->y_m[n]) <= e.y_m * kRounding;
            holds &= std::abs(b->ambient_K[n]) <= e.ambient_K * kRounding;
            holds &= std::abs(b->body_K[n] - b->ambient_K[n]) <= e.body_K * kRounding + 1e-12;
            holds &= std::abs(b->acceleration_m_s2[n]) <= e.acceleration_m_s2 * kRounding;
            if (!holds) RC_FAIL(fmt::format("at {} s", b->t_s[n]));
        }
    for (std::size_t axis = 0; axis < kAxes; ++axis) RC_ASSERT(max[axis] - min[axis] <= e.span[axis] * kRounding);
}

// The bits are the same for any block size, and with any other effects before it in the list.
RC_GTEST_PROP(Simulation, GivesTheSameBitsWhateverTheBlockSize, ()) {
    const RandomScene random = random_scene();
    const Scene scene = random.scene();
    Simulation one(scene, "all"), other(scene, "all", *rc::gen::inRange<std::size_t>(1, Block::kSize));
    const auto values = [&](Simulation& simulation) {
        std::vector<double> all;
        for (;;) {
            const Block& block = simulation.advance(0);
            if (block.n == 0) return all;
            for (std::size_t n = 0; n < block.n; ++n) {
                for (std::size_t k = 0; k < scene.sensors[0].n(); ++k) all.push_back(block.channel[k][n]);
                all.push_back(double(block.missing[n]) + 1e9 * block.lost[n] + 1e12 * block.dropped[n]);
            }
        }
    };
    RC_ASSERT(values(one) == values(other));
}

}  // namespace
}  // namespace tactiled::sim
