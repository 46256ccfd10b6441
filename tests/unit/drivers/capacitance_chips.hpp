// Models of the chips that measure capacitance: AD7746, FDC1004, MPR121.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "tests/unit/drivers/model_chip.hpp"

namespace tactiled::test {

class ModelAd7746 final : public RegisterChip<0x13> {
public:
    ModelAd7746() { reset(); }
    void reset() override {
        reg = {0x07, 0, 0, 0, 0, 0, 0, 0, 0, 0x03, 0xA0};
        ends_ns_ = 0;
    }
    void write(Bytes bytes, std::uint64_t t_ns) override {
        if (bytes.size() == 1 && bytes[0] == 0xBF) return advance(t_ns), reset();
        RegisterChip::write(bytes, t_ns);
    }
    void disturb(unsigned which, std::uint8_t value) override { reg[7 + which % 6] = value; }
    void advance(std::uint64_t t_ns) override {
        for (; ends_ns_ != 0 && ends_ns_ <= t_ns; begin_next()) {
            if (ends_ns_ <= held_until_ns_) {  // its registers were being read
                ++n_dropped;
                continue;
            }
            // The input that was selected all the time, else a value that belongs to no electrode.
            const unsigned input = (reg[7] >> 6 & 1) + (selected_ns_ <= began_ns_ ? selected_ : kTorn);
            const std::uint32_t usual = 0x800000 + (input & 3) * 0x200000 + ++n_converted % 0x100000;
            const std::uint32_t code = next_code_.value_or(code_of ? code_of(input).value_or(usual) : usual);
            for (int i = 0; i < 3; ++i) reg[std::size_t(1 + i)] = std::uint8_t(code >> (16 - 8 * i));
            note(input, code, ends_ns_);
            reg[0] = std::uint8_t((reg[0] & ~0x0D) | (next_code_ ? next_status_ : 0));
            next_code_.reset();
            if ((reg[8] & 0x80) != 0)
                reg[4] = 0x80, reg[5] = 0xC8, reg[6] = 0, reg[0] &= 0x08;  // 25 degC: (4096 + 25) * 2048
            if ((reg[10] & 7) == 2) reg[10] = std::uint8_t(reg[10] & ~7), ends_ns_ = 0;
            if (ends_ns_ == 0) break;
        }
        t_ns_ = t_ns;
    }
    // The switch in front of CIN1 was changed.
    void select(unsigned electrode, std::uint64_t t_ns) {
        advance(t_ns);
        if (electrode != selected_) selected_ns_ = t_ns;
        selected_ = electrode;
    }
    std::function<std::optional<std::uint32_t>(unsigned input)> code_of;  // replaces the automatic number
    // Sets the code of the next conversion, with further bits of the status.
    void ends_at_code(std::uint32_t code, std::uint8_t status) {
        next_code_ = code;
        next_status_ = status;
    }

private:
    static constexpr unsigned kTorn = 1000;
    std::optional<std::uint32_t> next_code_;
    std::uint8_t next_status_ = 0;
    unsigned selected_ = 0;
    std::uint64_t selected_ns_ = 0;
    std::uint64_t began_ns_ = 0;  // begin of the running conversion
    [[nodiscard]] std::uint64_t conversion() const {
        static constexpr double kMs[] = {11, 11.9, 20, 38, 62, 77, 92, 109.6};
        return scaled((kMs[reg[10] >> 3 & 7] + ((reg[8] & 0x80) != 0 ? 20.1 : 0)) * 1e6);
    }
    void store(std::uint8_t at, std::uint8_t value) override {
        if (at > 6) RegisterChip::store(at, value);  // status and data can only be read
        if (at == 10) begins_ = true;
    }
    void written(std::uint64_t t_ns) override {
        if (!std::exchange(begins_, false)) return;
        const unsigned mode = reg[10] & 7;
        began_ns_ = t_ns;
        ends_ns_ = mode == 1 || mode == 2 ? t_ns + conversion() : 0;
    }
    void begin_next() {
        began_ns_ = ends_ns_;
        ends_ns_ = (reg[10] & 7) == 1 ? ends_ns_ + conversion() : 0;
    }
    void begin_read(std::uint8_t first, std::size_t n, std::uint64_t until_ns) override {
        if (first > 3 || first + n < 2) return;
        held_until_ns_ = until_ns;
    }
    std::uint8_t load(std::uint8_t at) override {
        const std::uint8_t value = reg[at];
        if (at == 3) reg[0] |= 0x07;  // the conversion was read
        return value;
    }
    std::uint64_t held_until_ns_ = 0;
    bool begins_ = false;
};

class ModelFdc1004 final : public WordChip {
public:
    ModelFdc1004() { reset(); }
    void reset() override {
        word.fill(0);
        for (std::size_t n = 0; n < 4; ++n) word[8 + n] = 0x1C00;
        word[0xFE] = 0x5449;
        word[0xFF] = 0x1004;
        ends_ns_ = 0;
    }
    void disturb(unsigned which, std::uint8_t value) override {
        which % 5 == 4 ? word[12] = std::uint16_t(word[12] ^ (value & 0x0C) << 8) : word[8 + which % 5] = value;
    }
    void advance(std::uint64_t t_ns) override {
        if (ends_ns_ != 0 && ends_ns_ <= t_ns) {
            ++n_converted;
            for (unsigned n = 0; n < 4; ++n) {
                if ((word[0x0C] >> (7 - n) & 1) == 0) continue;
                const unsigned input = word[8 + n] >> 13;
                const std::uint32_t code = input * 0x100000 + n_converted % 0x100000;
                word[std::size_t{2 * n}] = std::uint16_t(code >> 8);
                word[std::size_t{2 * n + 1}] = std::uint16_t(code << 8);
                note(input, code, ends_ns_);
                word[0x0C] |= std::uint16_t(8 >> n);
            }
            ends_ns_ = 0;
        }
        t_ns_ = t_ns;
    }
    bool never_done = false, done_stays = false;

private:
    void store(std::uint8_t at, std::uint16_t value) override {
        if (at == 0x0C && (value & 0x8000) != 0) return reset();
        if (at < 8 || at > 0x14) return;
        const auto done = std::uint16_t(word[0x0C] & 0x0F);
        word[at] = value;
        if (at != 0x0C) return;
        word[at] = std::uint16_t((value & 0xFFF0) | (done_stays ? done : 0));
        const auto enabled = unsigned(__builtin_popcount(value >> 4 & 0x0F));
        if (enabled != 0 && !never_done) ends_ns_ = t_ns_ + scaled(enabled * 1e7 / double(1u << ((value >> 10 & 3) - 1)));
    }
};

class ModelMpr121 final : public RegisterChip<0x81> {
public:
    ModelMpr121() { reset(); }
    void reset() override {
        reg.fill(0);
        reg[0x5C] = 0x10;
        reg[0x5D] = 0x24;
        ends_ns_ = 0;
    }
    void disturb(unsigned which, std::uint8_t value) override { reg[0x5C + which % 3] = value; }
    void advance(std::uint64_t t_ns) override {
        for (; ends_ns_ != 0 && ends_ns_ <= t_ns; ends_ns_ += conversion()) {
            ++n_converted;
            for (unsigned n = 0; n < 13; ++n) {
                const unsigned code = 1 + (n_converted * 13 + n) % 1000;
                reg[std::size_t{4 + 2 * n}] = std::uint8_t(code);
                reg[std::size_t{5 + 2 * n}] = std::uint8_t(code >> 8);
                note(n, code, ends_ns_);
            }
        }
        t_ns_ = t_ns;
    }

private:
    [[nodiscard]] std::uint64_t conversion() const {
        static constexpr unsigned kSamples[] = {4, 6, 10, 18};
        return scaled(kSamples[reg[0x5D] >> 3 & 3] * double(1u << (reg[0x5D] & 7)) * 1e6);
    }
    void store(std::uint8_t at, std::uint8_t value) override {
        if (at == 0x80 && value == 0x63) return reset();
        if (at != 0x5E && (reg[0x5E] & 0x3F) != 0) return;  // not in stop mode
        const bool ran = (reg[0x5E] & 0x3F) != 0;
        reg[at] = value;
        if (at != 0x5E) return;
        const bool runs = (value & 0x3F) != 0;
        if (runs != ran) ends_ns_ = runs ? t_ns_ + conversion() : 0;
    }
};

}  // namespace tactiled::test
