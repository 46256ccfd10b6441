// The common part of model chips: a clock, a log of conversions, and registers of one byte or of two. A model chip is
// register-accurate in the parts that the drivers use, with its own clock, which may be off. Every conversion has a
// code that is unique for long, and is logged, so that a test can determine the source and the age of a value. The
// tests use them in virtual time, tests/kernel/usbip_i2c.cpp in real time.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <utility>

namespace tactiled::test {

using Bytes = std::span<const std::uint8_t>;

class ModelChip {
public:
    virtual ~ModelChip() = default;
    // Notes a write that ended at `t_ns`, or a read from `t_ns` to `until_ns`.
    virtual void write(Bytes bytes, std::uint64_t t_ns) = 0;
    virtual void read(std::span<std::uint8_t> out, std::uint64_t t_ns, std::uint64_t until_ns) = 0;
    virtual void advance(std::uint64_t t_ns) = 0;
    virtual void reset() = 0;  // like a short loss of its supply
    // Changes a setting without a command: a register of the configuration, not of the result.
    virtual void disturb(unsigned which, std::uint8_t value) = 0;

    // Returns the end of the conversion of `input` that gave `code`; 0: there was none.
    [[nodiscard]] std::uint64_t converted_ns(unsigned input, std::int64_t code) const {
        const auto found = converted_.find({input, code});
        return found == converted_.end() ? 0 : found->second;
    }

    // Returns the end of the running conversion; 0: none runs.
    [[nodiscard]] std::uint64_t ends_ns() const { return ends_ns_; }
    [[nodiscard]] std::uint64_t ended_ns() const { return ended_ns_; }  // end of the last one

    double period_scale = 1;  // > 1: a slow clock
    bool is_dead = false;     // does not acknowledge
    std::uint32_t n_converted = 0, n_dropped = 0;

protected:
    void note(unsigned input, std::int64_t code, std::uint64_t t_ns) { converted_[{input, code}] = ended_ns_ = t_ns; }
    [[nodiscard]] std::uint64_t scaled(double ns) const { return std::uint64_t(ns * period_scale); }

    std::uint64_t t_ns_ = 0;  // time of its present state
    std::uint64_t ended_ns_ = 0;
    std::uint64_t ends_ns_ = 0;  // the conversion that runs; 0: none runs

private:
    std::map<std::pair<unsigned, std::int64_t>, std::uint64_t> converted_;
};

// Registers of one byte and a pointer that a write sets and every byte advances.
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

// Registers of two bytes with a constant pointer.
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

}  // namespace tactiled::test
