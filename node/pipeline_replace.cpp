// What a reload changes, put into the running pipeline.
#include <type_traits>
#include <utility>

#include "node/pipeline.hpp"
#include "node/realtime.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

bool Pipeline::replace(Replacement& replacement, int patience_ms) noexcept {
    taken_.store(false, std::memory_order_relaxed);
    replacement_.store(&replacement, std::memory_order_release);  // pairs with the exchange in deliver()
    for (int ms = 0; !taken_.load(std::memory_order_acquire); ++ms) {
        // Taken back, unless the loop has it in its hands just now: then it is done in microseconds.
        if (ms >= patience_ms && replacement_.exchange(nullptr, std::memory_order_relaxed) != nullptr) return false;
        sleep_until(monotonic_ns() + 1'000'000u);
    }
    return true;
}

// A sensor that measures otherwise begins a new epoch with a BAD sample: what follows is not comparable to what was.
void Pipeline::take(Replacement& replacement, std::uint64_t now_ns) noexcept {
    static_assert(std::is_nothrow_swappable_v<Sensor>);
    if (replacement.grasping != nullptr) {
        replacement.grasping->succeed(*grasping_);
        std::swap(grasping_, replacement.grasping);
    }
    for (auto& part : replacement.sensors) {
        Sensor& running = sensors_[part.index];
        if (part.measures_alike) {
            running.retune(*part.sensor);
            continue;
        }
        part.sensor->succeed(running);
        std::swap(running, *part.sensor);
        publish_discontinuity(part.index, running.marker(now_ns));
    }
    // The directory changes behind the samples: an old force beside the new CAL_ID would look like one of the new
    // calibration.
    publish_node(now_ns);
    segment_.begin_reload();
    for (auto& part : replacement.sensors)
        if (!part.measures_alike) segment_.set_sensor(part.index, part.entry);
    segment_.end_reload(replacement.calibration_id);
}

}  // namespace tactiled
