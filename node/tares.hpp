// A tare, or the removal of one, of several sensors at once: one command, one result.
#pragma once
#include <cstdint>
#include <vector>

#include "node/sensor.hpp"
#include "node/zero_store.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class Tares {
public:
    explicit Tares(std::vector<Sensor>& sensors) : sensors_(sensors) {}
    // Stores the zeros in `store`, which must outlive the loop. Before the loop. setup
    void keep_in(ZeroStore& store) noexcept { store_ = &store; }

    // Begins a tare of the sensors in `mask`, after the file of zeros states that their zeros change. Returns false, and
    // begins no tare, if one of the sensors cannot be tared now. is_running() must be false. rt: bounded by the number of
    // sensors
    [[nodiscard]] bool begin(std::uint32_t mask, std::uint64_t now_ns) noexcept;
    // Begins to remove the tare of the sensors in `mask`, after the file of zeros states that their zeros change.
    // is_running() must be false. rt: bounded by the number of sensors
    void begin_removal(std::uint32_t mask, std::uint64_t now_ns) noexcept;
    // Collects the results of the sensors. Returns true if the last sensor has finished and its zero is stored.
    // rt: bounded by the number of sensors
    [[nodiscard]] bool poll(std::uint64_t now_ns) noexcept;

    [[nodiscard]] bool is_running() const noexcept { return (waiting_ | running_ | to_keep_) != 0; }
    // True if a zero can be stored for a restart.
    [[nodiscard]] bool can_keep() const noexcept { return store_ == nullptr || store_->is_usable(); }
    // Returns the first result other than OK of a sensor in the last command, else OK.
    [[nodiscard]] tactiled_command_result result() const noexcept { return result_; }
    // True if the last command left every zero unchanged, because the force moved or was too large.
    [[nodiscard]] bool was_refused() const noexcept {
        return !has_new_zero_ && (result_ == TACTILED_COMMAND_MOVING || result_ == TACTILED_COMMAND_UNDER_LOAD);
    }

private:
    void announce(std::uint32_t mask, bool removes, std::uint64_t now_ns) noexcept;
    void start(std::uint64_t now_ns) noexcept;
    [[nodiscard]] bool has_announced(std::uint64_t now_ns) noexcept;
    [[nodiscard]] bool follow_store(std::uint64_t now_ns) noexcept;

    std::vector<Sensor>& sensors_;
    ZeroStore* store_ = nullptr;
    std::uint32_t waiting_ = 0;   // bit n: sensor n begins after the file states that its zero changes
    bool removes_ = false;        // the sensors of waiting_ begin a removal and not a tare
    std::uint32_t running_ = 0;   // bit n: sensor n has not finished
    std::uint32_t to_keep_ = 0;   // bit n: the zero of sensor n may have changed and is not stored yet
    std::uint32_t order_ = 0;     // number of the order in the store; 0 = not given yet
    std::uint64_t ended_ns_ = 0;  // time at which the last sensor finished, or the order for waiting_ was given
    tactiled_command_result result_ = TACTILED_COMMAND_OK;
    bool has_new_zero_ = false;  // a sensor of the last command has a new zero
};

}  // namespace tactiled
