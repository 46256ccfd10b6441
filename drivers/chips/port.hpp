// Access of a chip to its registers: its address, the bus switch in front of it, and the counters of its link.
#pragma once
#include <array>
#include <cassert>
#include <cstdint>
#include <cstring>
#include <initializer_list>

#include "drivers/chips/bus.hpp"
#include "drivers/driver.hpp"

namespace tactiled {

inline constexpr unsigned kMuxMin = 0x70, kMuxMax = 0x77, kMuxChannels = 8;

// TCA9548A: a switch of eight buses, at 0x70 .. 0x77. Its single register is the mask of connected channels, which
// takes effect at the STOP, so selecting a channel takes a transfer of its own. (Register and rule are from knowledge
// of the data sheet.) This class has all switches of one bus. No other program uses them, so their state is remembered and
// not read.
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

struct Place {
    std::uint8_t address = 0;
    std::uint8_t mux = 0;  // address of the switch; 0: directly on the bus
    std::uint8_t channel = 0;
};

class Port {
public:
    Port(I2cBus& bus, Muxes& muxes, Place place, LinkCounts& counts, Selector* selector = nullptr) noexcept
        : bus_(bus), muxes_(muxes), place_(place), counts_(counts), selector_(selector) {}

    // Writes a register address or a command and the bytes that follow it. rt: blocks on the bus
    [[nodiscard]] Answer write(std::initializer_list<std::uint8_t> bytes) noexcept {
        return transfer({bytes.begin(), bytes.size()}, {});
    }
    // Reads the registers from `first` on, in one transfer. rt: blocks on the bus
    [[nodiscard]] Answer read(std::uint8_t first, std::span<std::uint8_t> in) noexcept { return transfer({&first, 1}, in); }

    // Connects the chip's analog switch to that electrode. rt: as Selector::select
    [[nodiscard]] Answer select(unsigned electrode) noexcept {
        return selector_ == nullptr || selector_->select(electrode) ? Answer::ok : Answer::disconnected;
    }

    [[nodiscard]] const Place& place() const noexcept { return place_; }
    [[nodiscard]] std::uint64_t now_ns() const noexcept { return bus_.now_ns(); }

private:
    Answer transfer(std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept {
        assert(!out.empty() && out.size() <= I2cBus::kMaxBytes && in.size() <= I2cBus::kMaxBytes);
        Answer answer = place_.mux != 0 ? muxes_.select(place_.mux, place_.channel) : Answer::ok;
        if (answer == Answer::ok) answer = bus_.transfer(place_.address, out, in);
        if (answer == Answer::ok) {
            counts_[TACTILED_LINK_BYTES] += std::uint32_t(in.size());
        } else {
            ++counts_[TACTILED_LINK_BUS_ERROR];
            muxes_.forget();
        }
        return answer;
    }

    I2cBus& bus_;
    Muxes& muxes_;
    Place place_;
    LinkCounts& counts_;
    Selector* selector_;  // nullptr: none
};

// Convert two or three bytes, big endian, which all these chips send. rt: wait-free
constexpr std::uint16_t big16(const std::uint8_t* at) noexcept { return std::uint16_t(at[0] << 8 | at[1]); }
constexpr std::uint32_t big24(const std::uint8_t* at) noexcept {
    return std::uint32_t(at[0]) << 16 | std::uint32_t(at[1]) << 8 | at[2];
}
constexpr std::int32_t signed24(std::uint32_t code) noexcept {
    return std::int32_t(code) - ((code & 0x800000u) != 0 ? 0x1000000 : 0);
}

}  // namespace tactiled
