// TCA9548A: a switch of eight buses, at 0x70 .. 0x77. Its single register is the mask of connected channels, which
// takes effect at the STOP, so selecting a channel takes a transfer of its own. (Register and rule are from knowledge
// of the data sheet.)
#pragma once
#include <cstdint>

#include "drivers/chips/bus.hpp"

namespace tactiled {

inline constexpr unsigned kMuxMin = 0x70, kMuxMax = 0x77, kMuxChannels = 8;

// All switches of one bus. No other program uses them, so their state is remembered and not read.
class Muxes {
public:
    explicit Muxes(I2cBus& bus) noexcept : bus_(bus) {}

    void add(std::uint8_t address) noexcept { muxes_[address - kMuxMin].present = true; }

    // Connects one channel of one switch and disconnects the others, so that two chips of one address never answer together.
    // Writes only registers that change. rt: blocks on the bus
    [[nodiscard]] Answer select(std::uint8_t address, unsigned channel) noexcept {
        for (unsigned i = 0; i < kMuxChannels; ++i)
            if (kMuxMin + i != address)
                if (const Answer answer = set(i, 0); answer != Answer::ok) return answer;
        return set(address - kMuxMin, std::uint8_t(1u << channel));
    }

    // After an error the state of the switches is unknown: a switch that lost its supply for a moment has no channel
    // selected.
    void forget() noexcept {
        for (Mux& mux : muxes_) mux.known = false;
    }

private:
    struct Mux {
        bool present = false, known = false;
        std::uint8_t mask = 0;
    };

    Answer set(unsigned index, std::uint8_t mask) noexcept {
        Mux& mux = muxes_[index];
        if (!mux.present || (mux.known && mux.mask == mask)) return Answer::ok;
        mux.known = false;
        const Answer answer = bus_.transfer(std::uint8_t(kMuxMin + index), {&mask, 1}, {});
        if (answer != Answer::ok) return answer;
        mux = {true, true, mask};
        return Answer::ok;
    }

    I2cBus& bus_;
    Mux muxes_[kMuxChannels];
};

}  // namespace tactiled
