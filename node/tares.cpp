#include "node/tares.hpp"

#include <utility>

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

// for the file, before and after a tare; together with the longest tare, less than a commander waits
constexpr std::uint64_t kPatienceNs = 1'250'000'000;

}  // namespace

// All or nothing: no tare begins if one sensor cannot be tared. Afterwards each sensor succeeds or fails separately.
bool Tares::begin(std::uint32_t mask, std::uint64_t now_ns) noexcept {
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if ((mask >> i & 1u) != 0 && !sensors_[i].can_tare()) return false;
    announce(mask, false, now_ns);
    return true;
}

void Tares::begin_removal(std::uint32_t mask, std::uint64_t now_ns) noexcept { announce(mask, true, now_ns); }

void Tares::announce(std::uint32_t mask, bool removes, std::uint64_t now_ns) noexcept {
    waiting_ = mask;
    removes_ = removes;
    result_ = TACTILED_COMMAND_OK;
    has_new_zero_ = false;
    to_keep_ = order_ = 0;
    ended_ns_ = now_ns;
    if (store_ == nullptr) return start(now_ns);
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if ((mask >> i & 1u) != 0) store_->add_change(std::uint32_t(i), sensors_[i]);
    order_ = store_->commit();
}

// The tare of a sensor whose device has disconnected meanwhile fails.
void Tares::start(std::uint64_t now_ns) noexcept {
    running_ = std::exchange(waiting_, 0);
    order_ = 0;
    if (store_ != nullptr) to_keep_ = running_;
    for (std::size_t i = 0; i < sensors_.size(); ++i) {
        if ((running_ >> i & 1u) == 0) continue;
        if (removes_) {
            sensors_[i].begin_untare();
        } else if (sensors_[i].can_tare()) {
            sensors_[i].begin_tare(now_ns);
        } else {
            running_ &= ~(1u << i);
            result_ = TACTILED_COMMAND_FAILED;
        }
    }
}

// Returns true if the command has ended because the file cannot be written.
bool Tares::has_announced(std::uint64_t now_ns) noexcept {
    const bool is_late = now_ns > ended_ns_ + kPatienceNs;
    if (order_ != 0 && !is_late && !store_->is_done(order_)) return false;
    if (order_ != 0 && !is_late && store_->is_usable()) {
        start(now_ns);
        return false;
    }
    waiting_ = order_ = 0;
    result_ = TACTILED_COMMAND_NOT_STORED;
    return true;
}

bool Tares::poll(std::uint64_t now_ns) noexcept {
    if (waiting_ != 0) return has_announced(now_ns);
    if (running_ == 0) return to_keep_ != 0 && follow_store(now_ns);
    for (std::size_t i = 0; i < sensors_.size(); ++i) {
        if ((running_ >> i & 1u) == 0) continue;
        const Sensor::Tare tare = sensors_[i].poll_tare(now_ns);
        if (tare == Sensor::Tare::running || tare == Sensor::Tare::removing) continue;
        running_ &= ~(1u << i);
        if (result_ == TACTILED_COMMAND_OK) result_ = result_of(tare);
        has_new_zero_ |= tare == Sensor::Tare::done;
    }
    ended_ns_ = now_ns;
    return running_ == 0 && (to_keep_ == 0 || follow_store(now_ns));
}

// Returns true if the zeros are in the file, or cannot be stored.
bool Tares::follow_store(std::uint64_t now_ns) noexcept {
    const bool is_late = now_ns > ended_ns_ + kPatienceNs;
    if (order_ == 0 && !is_late) {
        for (std::size_t i = 0; i < sensors_.size(); ++i)
            if ((to_keep_ >> i & 1u) != 0 && sensors_[i].is_finding_zeros() && sensors_[i].is_delivering()) return false;
        for (std::size_t i = 0; i < sensors_.size(); ++i)
            if ((to_keep_ >> i & 1u) != 0) store_->add(std::uint32_t(i), sensors_[i]);
        order_ = store_->commit();
        if (order_ != 0) return false;
    } else if (!is_late && !store_->is_done(order_)) {
        return false;
    }
    const bool is_kept = order_ != 0 && store_->is_done(order_) && store_->is_usable();
    if (!is_kept && result_ == TACTILED_COMMAND_OK) result_ = TACTILED_COMMAND_NOT_STORED;
    to_keep_ = order_ = 0;
    return true;
}

}  // namespace tactiled
