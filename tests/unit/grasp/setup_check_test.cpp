// Errors of [grasp] are found in a guided grasp, and each by its name.
#include "decoupling/grasp/setup_check.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

namespace tactiled::grasp {
namespace {

constexpr double kG = 9.80665, kPi = std::numbers::pi;
using Vector3 = Eigen::Vector3d;
Vector as_vector(const Vector3& v) { return {v.x(), v.y(), v.z()}; }

Eigen::Matrix3d frame_of(std::size_t jaw, std::size_t jaws) {
    const double psi = 2 * kPi * double(jaw) / double(jaws);
    Eigen::Matrix3d S_from_G;
    S_from_G << -std::sin(psi), std::cos(psi), 0, 0, 0, -1, -std::cos(psi), -std::sin(psi), 0;
    return S_from_G;
}

// A right set-up as it would be seen, with sensors that err by some percent.
GuidedGrasp guided(std::size_t jaws, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto normal = [&](double sd) { return std::normal_distribution<double>(0, sd)(random); };
    const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    GuidedGrasp seen;
    seen.jaws_of_gripper = unsigned(jaws);
    seen.mass_kg = std::exp(uniform(std::log(0.05), std::log(2)));
    const double tilt = uniform(0, 5) * kPi / 180, where = uniform(0, 2 * kPi);
    const Vector3 down(kG * std::sin(tilt) * std::cos(where), kG * std::sin(tilt) * std::sin(where), kG * std::cos(tilt));
    seen.gravity_G_m_s2 = {0, 0, kG};
    seen.lower_jaw = 0;
    seen.tilt_rad = 30 * kPi / 180;
    const double angle = uniform(25, 35) * kPi / 180;  // a person tilts about as exactly
    const Vector3 to_jaw = -frame_of(0, jaws).row(2).transpose();
    const Vector3 tilted = kG * (std::cos(angle) * Vector3::UnitZ() + std::sin(angle) * to_jaw);
    const double press_N = seen.mass_kg * kG / double(jaws) * uniform(2, 6), stiff = uniform(1, 4);
    for (std::size_t j = 0; j < jaws; ++j) {
        CheckedJaw jaw;
        jaw.name = "jaw " + std::to_string(j);
        const Eigen::Matrix3d S_from_G = frame_of(j, jaws);
        for (int r = 0; r < 3; ++r) jaw.S_from_G[std::size_t(r)] = as_vector(S_from_G.row(r));
        jaw.contact_on_N = 0.1 * press_N;
        jaw.full_scale_N = 4 * press_N;
        const double gain = 1 + normal(0.02), share = (1 + normal(0.04)) / double(jaws);
        const auto reads = [&](const Vector3& pull_N, double squeeze) {
            const Vector3 pull_S = S_from_G * pull_N;
            Vector3 f(pull_S.x() * (jaws == 2 ? 0.5 : 2 / (1 + stiff) / double(jaws)), pull_S.y() * share,
                      pull_S.z() * (jaws == 2 ? 0.5 : 2 * stiff / (1 + stiff) / double(jaws)) - squeeze * press_N);
            f.head<2>() += Eigen::Vector2d(normal(0.004), normal(0.004)) * f.z();
            return as_vector(gain * f);
        };
        jaw.closed_N = reads(Vector3::Zero(), 1);
        jaw.lifted_N = reads(seen.mass_kg * down, 1.02);
        jaw.tilted_N = reads(seen.mass_kg * tilted, 0.98);
        seen.jaws.push_back(jaw);
    }
    return seen;
}

TEST(SetupCheck, FindsNothingInARightSetUp) {
    for (const std::size_t jaws : {2u, 3u, 4u, 6u})
        for (std::uint64_t seed = 0; seed < 200; ++seed) {
            const auto found = check_setup(guided(jaws, seed));
            EXPECT_TRUE(found.empty()) << jaws << " jaws, seed " << seed << ": " << int(found.front().fault);
        }
}

TEST(SetupCheck, FindsGravityWithTheWrongSign) {
    for (const std::size_t jaws : {2u, 3u, 4u})
        for (std::uint64_t seed = 0; seed < 50; ++seed) {
            GuidedGrasp seen = guided(jaws, seed);
            seen.gravity_G_m_s2 = {0, 0, -kG};
            const auto found = check_setup(seen);
            ASSERT_EQ(found.size(), 1u) << jaws << " jaws, seed " << seed;
            EXPECT_EQ(found[0].fault, SetupFault::gravity_sign);
        }
}

TEST(SetupCheck, FindsATurnedJawAndItsTrueAxis) {
    for (const std::size_t jaws : {2u, 3u, 4u})
        for (const int degrees : {90, 180, 270})
            for (std::uint64_t seed = 0; seed < 20; ++seed) {
                GuidedGrasp seen = guided(jaws, seed);
                const std::size_t turned = seed % jaws;
                const std::array<Vector, 3> right = seen.jaws[turned].S_from_G;
                const Vector3 x(right[0].data()), y(right[1].data());
                const double a = -degrees * kPi / 180;
                seen.jaws[turned].S_from_G[0] = as_vector(std::cos(a) * x + std::sin(a) * y);
                seen.jaws[turned].S_from_G[1] = as_vector(-std::sin(a) * x + std::cos(a) * y);
                const auto found = check_setup(seen);
                ASSERT_EQ(found.size(), 1u) << jaws << " jaws, seed " << seed;
                ASSERT_EQ(found[0].fault, SetupFault::turned) << jaws << " jaws, seed " << seed;
                EXPECT_EQ(found[0].jaw, turned);
                for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(found[0].x_S_in_G[k], right[0][k], 1e-9);
            }
}

TEST(SetupCheck, FindsJawsThatAreExchanged) {
    for (const std::size_t jaws : {2u, 3u, 4u})
        for (std::uint64_t seed = 0; seed < 50; ++seed) {
            GuidedGrasp seen = guided(jaws, seed);
            std::swap(seen.jaws[0].S_from_G, seen.jaws[1].S_from_G);
            seen.lower_jaw = 0;
            // The person lowers the jaw that the configuration calls the first one: its place is that of the other sensor.
            std::swap(seen.jaws[0].name, seen.jaws[1].name);
            GuidedGrasp told = seen;
            const double angle = 30 * kPi / 180;
            const Vector3 to_jaw = -frame_of(0, jaws).row(2).transpose();
            told.tilted_gravity_G_m_s2 = as_vector(kG * (std::cos(angle) * Vector3::UnitZ() + std::sin(angle) * to_jaw));
            const auto found = check_setup(told);
            ASSERT_EQ(found.size(), 1u) << jaws << " jaws, seed " << seed;
            ASSERT_EQ(found[0].fault, SetupFault::exchanged) << jaws << " jaws, seed " << seed;
            EXPECT_EQ(found[0].jaw, 0u);
            EXPECT_EQ(found[0].other, 1u);
        }
}

TEST(SetupCheck, FindsAThresholdThatTheJawNeverReaches) {
    GuidedGrasp seen = guided(2, 1);
    seen.jaws[1].contact_on_N = -1.2 * seen.jaws[1].closed_N[2];
    auto found = check_setup(seen);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].fault, SetupFault::contact);
    EXPECT_EQ(found[0].jaw, 1u);
    seen.jaws[1].contact_on_N = seen.jaws[1].full_scale_N;
    EXPECT_EQ(check_setup(seen).front().fault, SetupFault::contact);
}

TEST(SetupCheck, FindsSharesThatAreNotThoseOfTheJaws) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
        GuidedGrasp seen = guided(2, seed);
        seen.jaws[0].share = seed % 2 == 0 ? 0.7 : 0.2;
        seen.jaws[1].share = 1 - seen.jaws[0].share;
        const auto found = check_setup(seen);
        ASSERT_EQ(found.size(), 1u) << seed;
        ASSERT_EQ(found[0].fault, SetupFault::shares) << seed;
        EXPECT_NEAR(found[0].shares[0], 0.5, 0.08);
        EXPECT_NEAR(found[0].shares[0] + found[0].shares[1], 1, 1e-9);
    }
}

TEST(SetupCheck, FindsAJawThatCarriesNothingAndAWrongMass) {
    GuidedGrasp seen = guided(3, 3);
    for (auto reading : {&CheckedJaw::lifted_N, &CheckedJaw::tilted_N})
        (seen.jaws[2].*reading)[0] = (seen.jaws[2].*reading)[1] = 0;
    seen.jaws[2].closed_N[0] = seen.jaws[2].closed_N[1] = 0;
    auto found = check_setup(seen);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].fault, SetupFault::dead);
    EXPECT_EQ(found[0].jaw, 2u);
    seen = guided(2, 4);
    seen.mass_kg *= 1.3;
    found = check_setup(seen);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].fault, SetupFault::sum);
    EXPECT_NEAR(found[0].value, 1 / 1.3, 0.06);
}

}  // namespace
}  // namespace tactiled::grasp
