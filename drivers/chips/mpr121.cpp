// MPR121: 13 capacitive electrodes, 10 bits. Frame: the filtered data of ELE0 .. ELE11 and of the proximity
// electrode, in counts; `electrodes` sets their number.
//
// Registers, soft reset and the rule that registers can be written only in stop mode are those of Adafruit's library.
// The following is from knowledge of the data sheet and was not checked on a chip: register 0x5D reads 0x24 after a
// reset; OVCF, bit 15 of the touch status, is set if the chip stopped itself; one transfer gives both bytes of an
// electrode from one conversion. The chip does not signal a new conversion. It is read at 1 / 1.1 of its rate, so
// that each frame is a new one even with the slowest clock, and is up to one interval old.
#include <array>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kTouch = 0x00, kConfig = 0x5C, kElectrodes = 0x5E, kSoftReset = 0x80;
constexpr std::uint8_t kOverCurrent = 0x80;  // in register 1
constexpr std::uint8_t kNoBaseline = 0x40;   // baseline tracking off, because it would remove a constant force
constexpr std::uint8_t kResetConfig2 = 0x24;
constexpr std::size_t kData = 4, kMax = 13;  // the first electrode's register
constexpr std::uint16_t kSaturationLimit = 0x3FF;
constexpr unsigned kSamples[] = {4, 6, 10, 18};
constexpr std::uint32_t kResetUs = 1000;

class Mpr121 final : public Chip {
public:
    explicit Mpr121(Options& options)
        : electrodes_(unsigned(options.integer("electrodes", {1, kMax}, kMax))),
          samples_(choice(options, "samples", {4, 6, 10, 18}, 4)),
          interval_(choice(options, "interval_ms", {1, 2, 4, 8, 16, 32, 64, 128}, 1)) {
        const auto current = unsigned(options.integer("charge_uA", {1, 63}, 16));
        const unsigned time = 1 + choice(options, "charge_us", {0.5, 1, 2, 4, 8, 16, 32}, 0.5);
        const unsigned on = electrodes_ == kMax ? 0x30u | 12u : electrodes_;
        set_ = {std::uint8_t(current), std::uint8_t(time << 5 | samples_ << 3 | interval_), std::uint8_t(kNoBaseline | on)};
    }

    Progress set_up(Port& port, unsigned step) noexcept override {
        if (step == 0) return {port.write({kSoftReset, 0x63}), Progress::more, kResetUs};
        std::array<std::uint8_t, 3> found{};
        Answer answer = port.read(kConfig, found);
        if (answer == Answer::ok && found[1] != kResetConfig2) return {.kind = Progress::wrong, .found = found[1]};
        if (answer == Answer::ok) answer = port.write({kElectrodes, 0});  // stop mode
        if (answer == Answer::ok) answer = port.write({kConfig, set_[0], set_[1]});
        if (answer == Answer::ok) answer = port.write({kElectrodes, set_[2]});
        // Waits for the conversion after the first whole one, because the filter begins with an old value.
        return {answer, Progress::done, std::uint32_t(conversion_ns() / 1000)};
    }

    Reading read(Port& port, Frame& frame) noexcept override {
        std::array<std::uint8_t, kData + 2 * kMax> all{};
        std::array<std::uint8_t, 3> found{};
        Answer answer = port.read(kTouch, {all.data(), kData + 2 * electrodes_});
        if (answer == Answer::ok) answer = port.read(kConfig, found);
        if (answer != Answer::ok) return {answer};
        if (found != set_ || (all[1] & kOverCurrent) != 0) return {.kind = Reading::was_reset};
        frame = Frame{};
        frame.n_channels = std::uint8_t(electrodes_);
        for (unsigned n = 0; n < electrodes_; ++n) {
            const auto count = std::uint16_t(all[kData + 2 * n] | (all[kData + 2 * n + 1] & 3) << 8);
            frame.channel[n] = count;
            if (count == 0 || count == kSaturationLimit) frame.saturated |= 1u << n;
        }
        return {.kind = Reading::frame};
    }

    Pace pace() const noexcept override { return Pace::timed; }
    std::uint64_t conversion_ns() const noexcept override { return (kSamples[samples_] << interval_) * 1'100'000u; }
    Identity identity() const noexcept override { return {"its register 0x5d after a reset reads", kResetConfig2}; }

private:
    unsigned electrodes_, samples_, interval_;
    std::array<std::uint8_t, 3> set_{};  // registers 0x5C .. 0x5E
};

std::unique_ptr<Chip> make(Options& options) { return std::make_unique<Mpr121>(options); }
const ChipEntry entry{.name = "mpr121", .min_address = 0x5A, .max_address = 0x5D, .make = make};

}  // namespace
}  // namespace tactiled
