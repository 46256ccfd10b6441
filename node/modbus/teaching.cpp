#include "node/modbus/teaching.hpp"

#include <fmt/format.h>

#include "node/log.hpp"

namespace tactiled::modbus {

void Teaching::begin(std::uint32_t id, const Weighing& weighing) noexcept {
    thread_.join();  // it has ended: state() was idle
    state_.store(storing, std::memory_order_release);
    try {
        thread_.start("teach", 0, -1, [this, id, weighing] {
            try {
                store(id, weighing);
                state_.store(stored, std::memory_order_release);
            } catch (const std::exception& error) {
                log_line(LogLevel::warning, "Modbus TEACH {}: {}", id, error.what());
                state_.store(failed, std::memory_order_release);
            }
        });
    } catch (const std::exception&) { state_.store(failed, std::memory_order_release); }
}

void Teaching::store(std::uint32_t id, const Weighing& weighing) {
    if (!is_teachable(weighing))
        throw SetupError(fmt::format("{:.4f} kg, sd {:.4f} kg, may be nothing at all", weighing.mass_kg, weighing.sd_kg));
    const ObjectsLock lock(path_);
    Problems problems;
    std::vector<TaughtObject> taught = load_objects(path_, problems);
    problems.throw_if_any();
    TaughtObject* known = nullptr;
    for (auto& object : taught)
        if (object.id == id) known = &object;
    TaughtObject object = known != nullptr ? with_one_more(*known, weighing) : summary_of({&weighing, 1});
    object.id = id;
    if (known == nullptr) object.name = fmt::format("object{}", id);
    if (const auto confusion = confused_with(object, taught))
        throw SetupError(fmt::format(
            "it cannot be distinguished from object {} (\"{}\"): their weights are {:.1f} sd of each apart, {:g} are "
            "needed",
            confusion->other->id, confusion->other->name, confusion->apart_sd, kApart_sd));
    if (known != nullptr)
        *known = object;
    else if (taught.size() < grasp::Grasp::kMaxObjects)
        taught.push_back(object);
    else
        throw SetupError(fmt::format("{} objects are taught, no more fit", taught.size()));
    store_objects(path_, taught);
    objects_ = std::move(taught);
}

}  // namespace tactiled::modbus
