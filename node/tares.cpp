#include "node/tares.hpp"

namespace tactiled {
namespace {

tactiled_command_result result_of(Sensor::Tare ended) noexcept {
    switch (ended) {
        case Sensor::Tare::done: return TACTILED_COMMAND_OK;
        case Sensor::Tare::moved: return TACTILED_COMMAND_MOVING;
        case Sensor::Tare::loaded: return TACTILED_COMMAND_UNDER_LOAD;
        default: return TACTILED_COMMAND_FAILED;
    }
}

}  // namespace

// All or nothing at the start. Afterwards each sensor that rests takes its zero, whatever the others do.
bool Tares::begin(std::uint32_t mask, std::uint64_t now_ns) noexcept {
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if ((mask >> i & 1u) != 0 && !sensors_[i].can_tare()) return false;
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if ((mask >> i & 1u) != 0) sensors_[i].begin_tare(now_ns);
    start(mask);
    return true;
}

void Tares::begin_removal(std::uint32_t mask) noexcept {
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if ((mask >> i & 1u) != 0) sensors_[i].begin_untare();
    start(mask);
}

void Tares::start(std::uint32_t mask) noexcept {
    running_ = mask;
    result_ = TACTILED_COMMAND_OK;
    has_new_zero_ = false;
}

bool Tares::poll(std::uint64_t now_ns) noexcept {
    if (running_ == 0) return false;
    for (std::size_t i = 0; i < sensors_.size(); ++i) {
        if ((running_ >> i & 1u) == 0) continue;
        const Sensor::Tare tare = sensors_[i].poll_tare(now_ns);
        if (tare == Sensor::Tare::running || tare == Sensor::Tare::removing) continue;
        running_ &= ~(1u << i);
        if (result_ == TACTILED_COMMAND_OK) result_ = result_of(tare);
        has_new_zero_ |= tare == Sensor::Tare::done;
    }
    return running_ == 0;
}

}  // namespace tactiled
