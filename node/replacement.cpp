// Exchanges sensors and the grasp of the running pipeline after the configuration was read again.
#include <type_traits>
#include <utility>

#include "node/pipeline.hpp"

namespace tactiled {

bool Pipeline::replace(Replacement& replacement, int patience_ms) noexcept {
    return replacement_.offer(replacement, wake_, patience_ms);
}

void Pipeline::take_replacement(std::uint64_t now_ns) noexcept {
    Replacement* const offered = replacement_.take();
    if (offered == nullptr) return;
    take(*offered, now_ns);
    replacement_.give_back();
}

// A sensor that measures differently begins a new epoch with a BAD sample, because later samples are not comparable to
// earlier samples.
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
        (void)running.marker(now_ns);
        publish(part.index);
    }
    // The directory changes after the samples. Otherwise a reader could take a force of the old calibration for a force of
    // the new one.
    publish_node(now_ns);
    segment_.begin_reload();
    for (auto& part : replacement.sensors)
        if (!part.measures_alike) segment_.set_sensor(part.index, part.entry);
    segment_.end_reload(replacement.calibration_id);
}

}  // namespace tactiled
