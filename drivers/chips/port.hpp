// Access of a chip to its registers: its address, the bus switch in front of it, and the counters of its link.
#pragma once
#include <array>
#include <cassert>
#include <cstring>
#include <initializer_list>

#include "drivers/chips/bus.hpp"
#include "drivers/chips/tca9548a.hpp"
#include "drivers/driver.hpp"

namespace tactiled {

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
