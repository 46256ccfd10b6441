// FDC1004: four capacitances, 24 bits. Frame: one channel for each of `inputs`, in their order, in pF, including the
// CAPDAC.
//
// Registers, identity, LSB and CAPDAC step are those of open drivers (such as vincent290587/FDC1004). A CAPDAC step
// is only about 3.125 pF, and a jump of 1.4 pF was reported from 7 to 8, so the CAPDAC is set once and not changed.
// DONE was reported to be missing at times: then the chip is reset. From knowledge of the data sheet: a reset takes
// less than 1 ms; the command to begin clears DONE. Each round verifies that, because the previous measurement would
// otherwise be read again. Each round is triggered, so that a value is not overwritten between the reads of its two
// registers.
#include <algorithm>
#include <array>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kMeasure = 0x08, kControl = 0x0C, kManufacturer = 0xFE, kDevice = 0xFF;
constexpr std::uint32_t kIdentity = 0x54491004;
constexpr std::uint32_t kResetUs = 1000;
constexpr std::uint16_t kReset = 0x8000, kRateBits = 0x0C00;
constexpr unsigned kToDac = 4, kToNothing = 7;
constexpr double kCountsPerPf = 1 << 19, kPfPerDac = 3.125;

class Fdc1004 final : public Chip {
public:
    explicit Fdc1004(Options& options) : rate_(1 + choice(options, "rate_Hz", {100, 200, 400}, 400)) {
        const auto dacs = options.numbers("capdac", {0, 31}, {0, 4});
        for (const std::string& name : options.texts("inputs", {1, 4})) {
            const std::size_t n = inputs_++;
            const auto dac = n < dacs.size() ? unsigned(dacs[n]) : 0u;
            const bool single = name.size() == 4, pair = name.size() == 9 && name[4] == '-';
            const unsigned a = number(name, 0), b = pair ? number(name, 5) : 9;
            if ((!single && !pair) || a > 3 || (pair && (b > 3 || b <= a)))
                options.problem("inputs", "input " + in_quotes(name) +
                                              " is unknown; known: CIN1 .. CIN4, and pairs such as " +
                                              "CIN1-CIN2, the lower number first");
            else if (pair && dac != 0)
                options.problem("capdac", "a pair of inputs has no CAPDAC: 0 for " + in_quotes(name));
            offset_pF_[n] = dac * kPfPerDac;
            set_[n] = std::uint16_t((a & 3) << 13 | (pair ? b & 3 : dac != 0 ? kToDac : kToNothing) << 10 | dac << 5);
        }
        if (!options.has("inputs")) options.problem("inputs", "key \"inputs\" is missing, such as [\"CIN1\", \"CIN2\"]");
        if (inputs_ == 0) inputs_ = 1;
    }

    Progress set_up(Port& port, unsigned step) noexcept override {
        if (step == 0) {
            std::uint16_t manufacturer = 0, device = 0;
            Answer answer = read_word(port, kManufacturer, manufacturer);
            if (answer == Answer::ok) answer = read_word(port, kDevice, device);
            const std::uint32_t found = std::uint32_t(manufacturer) << 16 | device;
            if (answer == Answer::ok && found != kIdentity) return {.kind = Progress::wrong, .found = found};
            if (answer == Answer::ok) answer = write_word(port, kControl, kReset);
            return {answer, Progress::more, kResetUs};
        }
        Answer answer = Answer::ok;
        for (std::size_t n = 0; n < inputs_ && answer == Answer::ok; ++n)
            answer = write_word(port, std::uint8_t(kMeasure + n), set_[n]);
        if (answer == Answer::ok) answer = begin(port);
        return {answer, Progress::done};
    }

    Reading read(Port& port, Frame& frame) noexcept override {
        if (is_stale_) return {.kind = Reading::was_reset};
        std::uint16_t control = 0;
        Answer answer = read_word(port, kControl, control);
        if (answer != Answer::ok) return {answer};
        if ((control & kRateBits) != rate()) return {.kind = Reading::was_reset};
        if ((control & done()) != done()) return {};
        Frame taken;
        taken.n_channels = std::uint8_t(inputs_);
        for (std::size_t n = 0; n < inputs_; ++n) {
            std::uint16_t high = 0, low = 0;
            answer = read_word(port, std::uint8_t(2 * n), high);
            if (answer == Answer::ok) answer = read_word(port, std::uint8_t(2 * n + 1), low);
            if (answer != Answer::ok) return {answer};
            const std::uint32_t code = std::uint32_t(high) << 8 | low >> 8;
            taken.channel[n] = signed24(code) / kCountsPerPf + offset_pF_[n];
            if (code == 0x7FFFFF || code == 0x800000) taken.saturated |= 1u << n;
        }
        // Detects a reset just before the command to begin, after which some values would be 0 or those of another input.
        answer = read_word(port, kControl, control);
        bool is_same = (control & kRateBits) == rate();
        for (std::size_t n = 0; n < inputs_ && answer == Answer::ok && is_same; ++n) {
            std::uint16_t found = 0;
            answer = read_word(port, std::uint8_t(kMeasure + n), found);
            is_same = found == set_[n];
        }
        if (answer != Answer::ok) return {answer};
        if (!is_same) return {.kind = Reading::was_reset};
        frame = taken;
        return {.kind = Reading::frame, .began = begin(port) == Answer::ok};
    }

    Pace pace() const noexcept override { return Pace::triggered; }
    std::uint64_t conversion_ns() const noexcept override { return inputs_ * 10'000'000u >> (rate_ - 1); }
    Identity identity() const noexcept override { return {"its registers 0xfe and 0xff read", kIdentity}; }

private:
    static unsigned number(const std::string& name, std::size_t from) noexcept {  // 0 .. 3 of "CIN1" .. "CIN4"
        if (name.compare(from, 3, "CIN") != 0 || name.size() < from + 4) return 9;
        return unsigned(name[from + 3] - '1');
    }
    static Answer read_word(Port& port, std::uint8_t reg, std::uint16_t& value) noexcept {
        std::array<std::uint8_t, 2> bytes{};
        const Answer answer = port.read(reg, bytes);
        value = big16(bytes.data());
        return answer;
    }
    static Answer write_word(Port& port, std::uint8_t reg, std::uint16_t value) noexcept {
        return port.write({reg, std::uint8_t(value >> 8), std::uint8_t(value)});
    }

    [[nodiscard]] std::uint16_t rate() const noexcept { return std::uint16_t(rate_ << 10); }
    [[nodiscard]] std::uint16_t done() const noexcept { return std::uint16_t(0x0F & ~(0x0F >> inputs_)); }
    Answer begin(Port& port) noexcept {
        Answer answer = write_word(port, kControl, std::uint16_t(rate() | done() << 4));
        std::uint16_t control = 0;
        if (answer == Answer::ok) answer = read_word(port, kControl, control);
        is_stale_ = answer == Answer::ok && (control & done()) != 0;
        return answer;
    }

    unsigned rate_;
    std::size_t inputs_ = 0;
    std::array<std::uint16_t, 4> set_{};
    std::array<double, 4> offset_pF_{};
    bool is_stale_ = false;  // the DONE bit of the previous round is still set
};

std::unique_ptr<Chip> make(Options& options) { return std::make_unique<Fdc1004>(options); }
const ChipEntry entry{.name = "fdc1004", .min_address = 0x50, .max_address = 0x50, .make = make};

}  // namespace
}  // namespace tactiled
