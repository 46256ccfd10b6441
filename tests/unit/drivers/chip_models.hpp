// Chips as their buses see them: register-accurate in what the drivers use, each with a clock of its own that may be off.
// Every conversion has a code that no other has for long, and is written down, so that a test can tell where a value came
// from and how old it is. Used in virtual time by the tests, and in real time by tests/kernel/usbip_i2c.cpp.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace tactiled::test {

using Bytes = std::span<const std::uint8_t>;

class ModelChip {
public:
    virtual ~ModelChip() = default;
    // A write ended at `t_ns`; a read lasted from `t_ns` to `until_ns`.
    virtual void write(Bytes bytes, std::uint64_t t_ns) = 0;
    virtual void read(std::span<std::uint8_t> out, std::uint64_t t_ns, std::uint64_t until_ns) = 0;
    virtual void advance(std::uint64_t t_ns) = 0;
    virtual void reset() = 0;  // as if its supply had been away for a moment
    // A setting changes by itself: a register that says how the chip converts, not what it converted.
    virtual void disturb(unsigned which, std::uint8_t value) = 0;

    // When the conversion of `input` that gave `code` ended; 0: there was none.
    [[nodiscard]] std::uint64_t converted_ns(unsigned input, std::int64_t code) const {
        const auto found = converted_.find({input, code});
        return found == converted_.end() ? 0 : found->second;
    }

    // When the conversion that runs ends; 0: none runs.
    [[nodiscard]] std::uint64_t ends_ns() const { return ends_ns_; }
    [[nodiscard]] std::uint64_t ended_ns() const { return ended_ns_; }  // of the last one

    double period_scale = 1;  // > 1: a slow clock
    bool is_dead = false;     // does not acknowledge
    std::uint32_t n_converted = 0, n_dropped = 0;

protected:
    void note(unsigned input, std::int64_t code, std::uint64_t t_ns) { converted_[{input, code}] = ended_ns_ = t_ns; }
    [[nodiscard]] std::uint64_t scaled(double ns) const { return std::uint64_t(ns * period_scale); }

    std::uint64_t t_ns_ = 0;  // up to when it has lived
    std::uint64_t ended_ns_ = 0;
    std::uint64_t ends_ns_ = 0;  // the conversion that runs; 0: none runs

private:
    std::map<std::pair<unsigned, std::int64_t>, std::uint64_t> converted_;
};

// Registers of one byte and a pointer that a write sets and every byte moves on.
template <std::size_t N>
class RegisterChip : public ModelChip {
public:
    void write(Bytes bytes, std::uint64_t t_ns) override {
        advance(t_ns);
        pointer_ = bytes[0];
        for (std::size_t i = 1; i < bytes.size(); ++i) store(std::uint8_t(pointer_++ % N), bytes[i]);
        written(t_ns);
    }
    void read(std::span<std::uint8_t> out, std::uint64_t t_ns, std::uint64_t until_ns) override {
        advance(t_ns);
        begin_read(std::uint8_t(pointer_ % N), out.size(), until_ns);
        for (std::uint8_t& byte : out) byte = load(std::uint8_t(pointer_++ % N));
    }
    std::array<std::uint8_t, N> reg{};

protected:
    virtual void store(std::uint8_t at, std::uint8_t value) { reg[at] = value; }
    virtual std::uint8_t load(std::uint8_t at) { return reg[at]; }
    virtual void written(std::uint64_t) {}
    virtual void begin_read(std::uint8_t, std::size_t, std::uint64_t) {}

private:
    unsigned pointer_ = 0;
};

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
        for (; ends_ns_ != 0 && ends_ns_ <= t_ns; ends_ns_ = (reg[10] & 7) == 1 ? ends_ns_ + conversion() : 0) {
            if (ends_ns_ <= held_until_ns_) {  // its registers were being read
                ++n_dropped;
                continue;
            }
            // What was selected all the while, else what belongs to no electrode.
            const unsigned input = (reg[7] >> 6 & 1) + (selected_ns_ <= ends_ns_ - conversion() ? selected_ : kTorn);
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
    // A switch in front of CIN1 was turned.
    void select(unsigned electrode, std::uint64_t t_ns) {
        advance(t_ns);
        if (electrode != selected_) selected_ns_ = t_ns;
        selected_ = electrode;
    }
    std::function<std::optional<std::uint32_t>(unsigned input)> code_of;  // instead of a number of its own
    // What the next conversion gives, with further bits of the status.
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
        ends_ns_ = mode == 1 || mode == 2 ? t_ns + conversion() : 0;
    }
    void begin_read(std::uint8_t first, std::size_t n, std::uint64_t until_ns) override {
        if (first > 3 || first + n < 2) return;
        held_until_ns_ = until_ns;
    }
    std::uint8_t load(std::uint8_t at) override {
        const std::uint8_t value = reg[at];
        if (at == 3) reg[0] |= 0x07;  // taken
        return value;
    }
    std::uint64_t held_until_ns_ = 0;
    bool begins_ = false;
};

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
                --settling_;  // still of what was before
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

// Registers of two bytes; a pointer that does not move.
class WordChip : public ModelChip {
public:
    void write(Bytes bytes, std::uint64_t t_ns) override {
        advance(t_ns);
        pointer_ = bytes[0];
        if (bytes.size() >= 3) store(pointer_, std::uint16_t(bytes[1] << 8 | bytes[2]));
    }
    void read(std::span<std::uint8_t> out, std::uint64_t t_ns, std::uint64_t) override {
        advance(t_ns);
        for (std::size_t i = 0; i < out.size(); ++i) out[i] = std::uint8_t(word[pointer_] >> (i % 2 == 0 ? 8 : 0));
    }
    std::array<std::uint16_t, 256> word{};

protected:
    virtual void store(std::uint8_t at, std::uint16_t value) { word[at] = value; }

private:
    std::uint8_t pointer_ = 0;
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
        if ((command_ & 0xF0) == 0x40 && bytes.size() > 1) reg[command_ >> 2 & 3] = bytes[1];
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
        std::copy(all.begin(), all.end(), out.begin());
    }
    void disturb(unsigned which, std::uint8_t value) override { reg[which % 3] = value; }
    void advance(std::uint64_t t_ns) override {
        for (; ends_ns_ != 0 && ends_ns_ <= t_ns; ends_ns_ = (reg[1] & 8) != 0 ? ends_ns_ + conversion() : 0) {
            code_ = ++n_converted % 0x100000;
            ++count_;
            note(0, code_, ends_ns_);
        }
        t_ns_ = t_ns;
    }
    std::array<std::uint8_t, 4> reg{};
    unsigned n_flipped = 0;  // data to come with a wrong bit

private:
    [[nodiscard]] std::uint64_t conversion() const {
        static constexpr double kHz[] = {20, 45, 90, 175, 330, 600, 1000, 1000};
        return scaled(1e9 / kHz[reg[1] >> 5] / ((reg[1] & 0x10) != 0 ? 2 : 1));
    }
    std::uint8_t command_ = 0, count_ = 0;
    std::uint32_t code_ = 0;
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
