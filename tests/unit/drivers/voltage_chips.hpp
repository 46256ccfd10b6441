// Models of the chips that measure voltage: NAU7802, ADS1115, ADS122C04.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tests/unit/drivers/model_chip.hpp"

namespace tactiled::test {

class ModelNau7802 final : public RegisterChip<0x20> {
public:
    ModelNau7802() { reset(); }
    void reset() override {
        reg.fill(0);
        reg[0x1F] = 0x0F;
        ends_ns_ = powered_ns_ = calibrated_ns_ = 0;
    }
    void disturb(unsigned which, std::uint8_t value) override {
        reg[which % 3] = std::uint8_t((value & ~0x28) | (reg[which % 3] & 0x28));
    }
    void advance(std::uint64_t t_ns) override {
        if (powered_ns_ != 0 && powered_ns_ <= t_ns) reg[0] |= 0x08, powered_ns_ = 0;
        if (calibrated_ns_ != 0 && calibrated_ns_ <= t_ns) reg[2] = std::uint8_t(reg[2] & ~0x04), calibrated_ns_ = 0;
        for (; ends_ns_ != 0 && ends_ns_ <= t_ns; ends_ns_ += conversion()) {
            const unsigned input = reg[2] >> 7;
            const std::uint32_t code = input * 0x200000 + ++n_converted % 0x100000;
            for (int i = 0; i < 3; ++i) reg[std::size_t(0x12 + i)] = std::uint8_t(code >> (16 - 8 * i));
            if (settling_ > 0)
                --settling_;  // still affected by the previous setting
            else
                note(input, code, ends_ns_);
            reg[0] |= 0x20;
        }
        t_ns_ = t_ns;
    }

private:
    [[nodiscard]] std::uint64_t conversion() const {
        static constexpr double kHz[] = {10, 20, 40, 80, 10, 10, 10, 320};
        return scaled(1e9 / kHz[reg[2] >> 4 & 7]);
    }
    void store(std::uint8_t at, std::uint8_t value) override {
        const std::uint8_t before = reg[at];
        if (at == 0x1F || (at >= 0x12 && at <= 0x14)) return;
        reg[at] = at == 0 ? std::uint8_t((value & ~0x28) | (before & 0x28)) : value;
        if (at == 0 && (value & 1) != 0) reset();
        if (at == 0 && (value & 2) != 0 && (before & 0x0A) == 0) powered_ns_ = t_ns_ + 200'000;
        if (at == 0 && (value & 0x10) != 0 && (before & 0x10) == 0) ends_ns_ = t_ns_ + conversion();
        if (at == 2 && ((value ^ before) & 0xF0) != 0) settling_ = 5;
        if (at == 2 && (value & 4) != 0) calibrated_ns_ = t_ns_ + 5 * conversion();
    }
    std::uint8_t load(std::uint8_t at) override {
        if (at == 0x14) reg[0] = std::uint8_t(reg[0] & ~0x20);
        return reg[at];
    }
    std::uint64_t powered_ns_ = 0, calibrated_ns_ = 0;
    unsigned settling_ = 0;
};

class ModelAds1115 final : public WordChip {
public:
    ModelAds1115() { reset(); }
    void reset() override {
        word.fill(0);
        word[1] = 0x8583;
        ends_ns_ = 0;
    }
    void disturb(unsigned which, std::uint8_t value) override {
        (void)which, word[1] = std::uint16_t((word[1] & 0x80FF) | (value & 0x7F) << 8);
    }
    void advance(std::uint64_t t_ns) override {
        if (ends_ns_ != 0 && ends_ns_ <= t_ns) {
            const unsigned input = word[1] >> 12 & 7;
            const auto code = std::uint16_t(input * 0x1000 + ++n_converted % 0x1000);
            word[0] = code;
            word[1] |= 0x8000;
            note(input, std::int16_t(code), ends_ns_);
            ends_ns_ = 0;
        }
        t_ns_ = t_ns;
    }

private:
    void store(std::uint8_t at, std::uint16_t value) override {
        if (at != 1) return;
        static constexpr double kHz[] = {8, 16, 32, 64, 128, 250, 475, 860};
        word[1] = std::uint16_t((value & 0x7FFF) | (word[1] & 0x8000));
        if ((value & 0x8000) == 0) return;
        word[1] &= 0x7FFF;
        ends_ns_ = t_ns_ + scaled(1e9 / kHz[value >> 5 & 7]) + 25'000;
    }
};

class ModelAds122c04 final : public ModelChip {
public:
    void reset() override {
        reg.fill(0);
        count_ = 0;
        code_ = 0;
        ends_ns_ = 0;
    }
    void write(Bytes bytes, std::uint64_t t_ns) override {
        advance(t_ns);
        command_ = bytes[0];
        if ((command_ & 0xFE) == 0x06) reset();
        if ((command_ & 0xFE) == 0x08) ends_ns_ = t_ns + conversion();
        if ((command_ & 0xF0) == 0x40 && bytes.size() > 1)
            reg[command_ >> 2 & 3] = std::uint8_t(bytes[1] ^ (n_flipped_writes > 0 && n_flipped_writes-- == 1 ? 0x10 : 0));
    }
    void read(std::span<std::uint8_t> out, std::uint64_t t_ns, std::uint64_t) override {
        advance(t_ns);
        std::vector<std::uint8_t> all;
        if ((command_ & 0xF0) == 0x20) {
            all = {reg[command_ >> 2 & 3]};
        } else if ((command_ & 0xF0) == 0x10) {
            if ((reg[2] & 0x40) != 0) all = {count_};
            for (int i = 0; i < 3; ++i) all.push_back(std::uint8_t(code_ >> (16 - 8 * i)));
        }
        if ((reg[2] & 0x30) == 0x20) {
            std::uint32_t crc = 0xFFFF;
            for (const std::uint8_t byte : all)
                for (int bit = 7; bit >= 0; --bit)
                    crc = (crc << 1 ^ (((crc >> 15 ^ byte >> bit) & 1) != 0 ? 0x1021 : 0)) & 0xFFFF;
            all.push_back(std::uint8_t(crc >> 8));
            all.push_back(std::uint8_t(crc));
        }
        all.resize(out.size(), 0xFF);
        if (n_flipped > 0 && (command_ & 0xF0) == 0x10) --n_flipped, all[2] ^= 0x10;
        if (n_flipped_registers > 0 && (command_ & 0xF0) == 0x20) --n_flipped_registers, all[0] ^= 0x10;
        std::copy(all.begin(), all.end(), out.begin());
    }
    void disturb(unsigned which, std::uint8_t value) override { reg[which % 4] = value; }
    void advance(std::uint64_t t_ns) override {
        for (; ends_ns_ != 0 && ends_ns_ <= t_ns; ends_ns_ = (reg[1] & 8) != 0 ? ends_ns_ + conversion() : 0) {
            code_ = ++n_converted % 0x100000;
            ++count_;
            note(0, code_, ends_ns_);
        }
        t_ns_ = t_ns;
    }
    std::array<std::uint8_t, 4> reg{};
    unsigned n_flipped = 0, n_flipped_registers = 0;  // data, registers to come with a wrong bit
    unsigned n_flipped_writes = 0;                    // the write after that many registers has a wrong bit

private:
    [[nodiscard]] std::uint64_t conversion() const {
        static constexpr double kHz[] = {20, 45, 90, 175, 330, 600, 1000, 1000};
        return scaled(1e9 / kHz[reg[1] >> 5] / ((reg[1] & 0x10) != 0 ? 2 : 1));
    }
    std::uint8_t command_ = 0, count_ = 0;
    std::uint32_t code_ = 0;
};

}  // namespace tactiled::test
