// Faults, singly and in pairs, in the simulated world.   SEEDS=20000 and SECONDS=1000 in the environment: longer runs
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

#include "faults.hpp"
#include "plants.hpp"
#include "plc_page.hpp"

namespace tactiled::faults {
namespace {

std::uint64_t number(const char* name, std::uint64_t otherwise) {
    const char* text = std::getenv(name);
    return text != nullptr ? std::strtoull(text, nullptr, 10) : otherwise;
}

TEST(World, WithoutAFaultEverySampleIsGoodAndRight) {
    World world(number("SEED", 1));
    world.tares = true;
    world.run_ms(150);
    const std::uint64_t before = world.findings().samples - world.findings().good;
    world.run_ms(1000 * number("SECONDS", 50));
    const Findings& f = world.findings();
    EXPECT_EQ(f.total(), 0u) << f.first;
    EXPECT_EQ(f.samples - f.good, before);
    EXPECT_GT(f.samples, 40'000u);
    EXPECT_GT(f.tares, 20u);
    EXPECT_GT(f.stable_weights, 100u);
    fmt::print("{} samples, {} answers of registers, {} tares, {} looks at a stable weight; {} not GOOD after the start\n",
               f.samples, f.reads, f.tares, f.stable_weights, f.samples - f.good - before);
}

TEST(World, NoFaultAndNoPairOfFaultsMakesAnUndetectedWrongValueOrHarmsAnotherSensor) {
    const std::uint64_t seeds = number("SEEDS", combinations());  // each fault and each pair once
    std::uint64_t red = 0, samples = 0, good = 0;
    for (std::uint64_t seed = number("SEED", 0), end = seed + seeds; seed < end && red < 20; ++seed) {
        const Findings f = run_seed(seed);
        samples += f.samples;
        good += f.good;
        if (f.total() != 0) ++red, ADD_FAILURE() << name_of_seed(seed) << ": " << f.total() << ", first: " << f.first;
    }
    EXPECT_GT(good, 2 * samples / 3);
    fmt::print("{} seeds, {} samples, {} of them GOOD\n", seeds, samples, good);
}

TEST(World, ASeedIsReplayedToTheLastBit) {
    for (const std::uint64_t seed : {3ull, 27ull, 101ull, 333ull}) {
        const Findings once = run_seed(seed), again = run_seed(seed);
        EXPECT_EQ(once.digest, again.digest) << name_of_seed(seed);
        EXPECT_EQ(once.samples, again.samples);
        EXPECT_NE(once.digest, run_seed(seed + combinations()).digest) << "another seed, other times";
    }
}

TEST(World, ThePageForThePlcIsWhatItSays) {
    const std::string path = TACTILED_SOURCE_DIR "/tests/faults/PLC.md", page = plc_page();
    if (std::getenv("WRITE_PAGE") != nullptr) std::ofstream(path) << page;
    std::ifstream file(path);
    const std::string shown{std::istreambuf_iterator<char>(file), {}};
    EXPECT_EQ(shown, page) << "WRITE_PAGE=1 writes it";
}

TEST(Witness, FindsEveryPlantedBug) {
    for (const Plant& plant : plants()) {
        std::uint64_t found = 0, seed = 0;
        for (std::uint64_t i = 0; i < 3 * faults().size() && found == 0; ++i) {  // each fault singly, at three times
            seed = i / faults().size() * combinations() + i % faults().size();
            found = run_seed(seed, &plant).count[plant.found_as];
        }
        EXPECT_GT(found, 0u) << plant.name << " is not found as: " << name_of(plant.found_as);
        fmt::print("{}: found as \"{}\" in {}\n", plant.name, name_of(plant.found_as), name_of_seed(seed));
    }
}

}  // namespace
}  // namespace tactiled::faults
