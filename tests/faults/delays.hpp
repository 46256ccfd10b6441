// Delays of a path and changes of a device, each as an episode that ends as it began.
#pragma once
#include <random>
#include <vector>

#include "freshness.hpp"

namespace tactiled::faults {

// Streams that show this; numbers and arrivals are counted and printed in any case, see drivers/wire/freshness.md.
enum SeenBy { kByAll, kByClocks, kByCounters, kByNone };

struct Kind {
    const char* name;
    void (*episode)(FreshnessRun& run, std::mt19937_64& random);  // ends as it began
    SeenBy seen = kByAll;
    double may_last_s = 0;  // allowed seconds in 1000 h where it is seen
    bool from_the_start = false;
    double clock_period_s = 0;
    void (*change)(Stream& stream, std::mt19937_64& random) = nullptr;  // the device is another one
};

inline double between(std::mt19937_64& random, double a, double b) { return a + (b - a) * double(random() >> 11) * 0x1p-53; }

extern const std::vector<Kind> kKinds;     // paths and changes of a device
extern const std::vector<Kind> kOddKinds;  // devices, servers and machines that differ from what the formats expect

// A counter that begins again within the time for which the link is closed, or by which a copy is late, shows neither that
// frames are missing nor that one is old.
void longer_counter(Stream& stream, std::mt19937_64& random);

// Episodes to which a test or another kind refers.
void slow_bridge(FreshnessRun& run, std::mt19937_64& random);
void slower_bridge(FreshnessRun& run, std::mt19937_64& random);
void link_down(FreshnessRun& run, std::mt19937_64& random);
void restart_of_the_device(FreshnessRun& run, std::mt19937_64& random);
void pause_of_the_device(FreshnessRun& run, std::mt19937_64& random);

}  // namespace tactiled::faults
