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
                objects_ = teach_grasp(path_, id, fmt::format("object{}", id), weighing);
                state_.store(stored, std::memory_order_release);
            } catch (const std::exception& error) {
                log_line(LogLevel::warning, "Modbus TEACH {}: {}", id, error.what());
                state_.store(failed, std::memory_order_release);
            }
        });
    } catch (const std::exception&) { state_.store(failed, std::memory_order_release); }
}

}  // namespace tactiled::modbus
