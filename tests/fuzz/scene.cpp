// Texts as scenes. Oracles: what an accepted scene simulates is finite, and auto differs from all by no more than it
// guarantees.
//   fuzz_scene CORPUS config/scenes -max_len=4000 -only_ascii=1
#include <cmath>
#include <cstdlib>

#include "drivers/sim/simulation.hpp"

using namespace tactiled;
using namespace tactiled::sim;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Problems problems;
    Scene scene;
    try {
        scene =
            read_scene(Options::parse_text({reinterpret_cast<const char*>(data), size}, "fuzz.toml", problems), problems);
    } catch (const SetupError&) { return 0; }
    scene.samples = std::min<std::uint64_t>(scene.samples, 300);
    Simulation automatic(scene, "auto"), all(scene, "all");
    for (std::size_t i = 0; i < scene.sensors.size(); ++i) {
        const Sensor& sensor = scene.sensors[i];
        const double limit_N = automatic.choice(i).guaranteed_N * (1 + 1e-9) + 1e-12 * (1 + sensor.full_scale_N);
        for (;;) {
            const Block& a = automatic.advance(i);
            const Block& b = all.advance(i);
            if (a.n == 0) break;
            for (std::size_t n = 0; n < a.n; ++n) {
                std::array<double, kMaxSensorChannels> change{};
                for (std::size_t k = 0; k < sensor.n(); ++k) {
                    if (((a.missing[n] | b.missing[n]) >> k & 1u) != 0) continue;
                    if (!std::isfinite(a.channel[k][n]) || !std::isfinite(b.channel[k][n])) std::abort();
                    change[k] = a.channel[k][n] - b.channel[k][n];
                }
                if (!a.dropped[n] && !b.dropped[n] && !(sensor.largest_N(change) <= limit_N)) std::abort();
            }
        }
    }
    return 0;
}
