// NAU7802: a bridge, two inputs, 24 bits. Frame: input 1 in counts, and input 2 in counts if channels = 2.
//
// Registers, rates, the 200 us until PUR and the six conversions after a change of input are those of Linux's
// drivers/iio/adc/nau7802.c. The following is done by widely used libraries and was not checked on a chip: register
// 0x1F ends in 0xF; CALS starts a calibration of the offset and returns to 0 at its end, and CAL_ERR reports a
// failure.
#include <array>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kPower = 0x00, kGain = 0x01, kRate = 0x02, kData = 0x12, kAdc = 0x15, kRevision = 0x1F;
constexpr std::uint8_t kReset = 0x01, kDigital = 0x02, kAnalog = 0x04, kPowered = 0x08, kStart = 0x10, kReady = 0x20,
                       kInternalAvdd = 0x80;
constexpr std::uint8_t kCalibrate = 0x04, kCalibrationFailed = 0x08, kInput2 = 0x80;
constexpr unsigned kRates_Hz[] = {10, 20, 40, 80, 320};
constexpr std::uint8_t kRateCodes[] = {0, 1, 2, 3, 7};
// conversions that are still affected by the previous input
constexpr unsigned kSettling = 6;
constexpr unsigned kMaxAsked = 200;                                // polls for the end of a calibration, 10 ms apart
constexpr std::uint32_t kPowerUpUs = 1000, kAvddSettlesUs = 5000;  // the second from knowledge of the data sheet

class Nau7802 final : public Chip {
public:
    explicit Nau7802(Options& options)
        : rate_(choice(options, "rate_Hz", {10, 20, 40, 80, 320}, 320)),
          gain_(std::uint8_t(choice(options, "gain", {1, 2, 4, 8, 16, 32, 64, 128}, 128))),
          channels_(unsigned(options.integer("channels", {1, 2}, 1))) {
        const unsigned avdd = choice(options, "avdd_V", {4.5, 4.2, 3.9, 3.6, 3.3, 3.0, 2.7, 2.4, 0}, 3.0);
        const bool internal = avdd < 8;
        gain_ |= std::uint8_t((internal ? avdd : 0) << 3);
        power_ = std::uint8_t(kDigital | kAnalog | kPowered | (internal ? kInternalAvdd : 0));
    }

    Progress set_up(Port& port, unsigned step) noexcept override {
        at_ = 0;
        std::uint8_t value = 0;
        Answer answer = Answer::ok;
        switch (step) {
            case 0:
                answer = port.read(kRevision, {&value, 1});
                if (answer == Answer::ok && (value & 0x0F) != 0x0F) return {.kind = Progress::wrong, .found = value};
                if (answer == Answer::ok) answer = port.write({kPower, kReset});
                if (answer == Answer::ok) answer = port.write({kPower, kDigital});
                return {answer, Progress::more, kPowerUpUs};
            case 1:
                answer = port.read(kPower, {&value, 1});
                if (answer == Answer::ok && (value & kPowered) == 0) answer = Answer::failed;
                if (answer == Answer::ok) answer = port.write({kPower, std::uint8_t(power_ & ~kPowered)});
                if (answer == Answer::ok) answer = port.write({kGain, gain_});
                if (answer == Answer::ok) answer = port.write({kAdc, 0x30});
                asked_ = 0;
                return {answer, Progress::more, kAvddSettlesUs};
            default: return calibrate(port);
        }
    }

    Reading read(Port& port, Frame& frame) noexcept override {
        bool is_ready = false, is_same = false;
        Answer answer = check(port, is_ready, is_same);
        if (answer == Answer::ok && !is_same) return {.kind = Reading::was_reset};
        if (answer != Answer::ok || !is_ready) return {answer};
        std::array<std::uint8_t, 3> data{};
        const std::uint64_t taken_ns = port.now_ns();
        answer = port.read(kData, data);
        // after a reset of the chip the value would be 0
        if (answer == Answer::ok) answer = check(port, is_ready, is_same);
        if (answer != Answer::ok) return {answer};
        if (!is_same) return {.kind = Reading::was_reset};
        if (settling_ > 0) {
            --settling_;
            return {.kind = Reading::part, .taken_ns = taken_ns};
        }
        if (at_ == 0) frame_ = Frame{};
        const std::uint32_t code = big24(data.data());
        frame_.channel[at_] = signed24(code);
        if (code == 0x7FFFFF || code == 0x800000) frame_.saturated |= 1u << at_;
        frame_.n_channels = std::uint8_t(at_ + 1);
        const bool complete = at_ + 1 == channels_;
        if (complete) frame = frame_;
        if (channels_ == 1) return {.kind = Reading::frame, .taken_ns = taken_ns};
        at_ = complete ? 0 : 1;
        settling_ = kSettling;
        answer = port.write({kRate, rate()});
        return {complete ? Answer::ok : answer, complete ? Reading::frame : Reading::part};
    }

    // With two inputs most conversions are discarded anyway, so a missed conversion is no loss.
    Pace pace() const noexcept override { return channels_ == 1 ? Pace::continuous : Pace::triggered; }
    // DRDY with CRP = 0, the value after a reset
    ReadyEdge ready_edge() const noexcept override { return ReadyEdge::rising; }
    bool is_noisy() const noexcept override { return true; }
    unsigned conversions() const noexcept override { return channels_; }
    std::uint64_t conversion_ns() const noexcept override { return 1'000'000'000u / kRates_Hz[rate_]; }
    Identity identity() const noexcept override { return {"its register 0x1f reads", 0x0F}; }

private:
    [[nodiscard]] std::uint8_t rate() const noexcept {
        return std::uint8_t(kRateCodes[rate_] << 4 | (at_ == 1 ? kInput2 : 0));
    }

    // Calibrates the offsets of all inputs, the first input last, so that it stays selected. Called until it is done.
    Progress calibrate(Port& port) noexcept {
        std::uint8_t value = 0;
        Answer answer = Answer::ok;
        if (asked_ == 0) calibrating_ = channels_;
        if (asked_ > 0) {
            answer = port.read(kRate, {&value, 1});
            if (answer == Answer::ok && ((value & kCalibrationFailed) != 0 || asked_ > kMaxAsked)) answer = Answer::failed;
            if (answer != Answer::ok) return {answer};
            if ((value & kCalibrate) != 0) {
                ++asked_;
                return {Answer::ok, Progress::more, 10'000};
            }
            --calibrating_;
        }
        asked_ = 1;
        at_ = calibrating_ > 0 ? calibrating_ - 1 : 0;
        if (calibrating_ > 0) return {port.write({kRate, std::uint8_t(rate() | kCalibrate)}), Progress::more, 10'000};
        answer = port.write({kRate, rate()});
        if (answer == Answer::ok) answer = port.write({kPower, std::uint8_t((power_ & ~kPowered) | kStart)});
        settling_ = kSettling;
        return {answer, Progress::done};
    }

    // A reset powers the chip down and clears gain, rate and supply.
    Answer check(Port& port, bool& is_ready, bool& is_same) const noexcept {
        std::array<std::uint8_t, 3> found{};
        const Answer answer = port.read(kPower, found);
        is_ready = (found[0] & kReady) != 0;
        is_same = (found[0] & (kDigital | kAnalog | kPowered | kInternalAvdd)) == power_ && found[1] == gain_ &&
                  found[2] == rate();
        return answer;
    }

    unsigned rate_;
    std::uint8_t gain_, power_ = 0;  // registers 1 and 0
    unsigned channels_;
    unsigned at_ = 0, settling_ = 0, asked_ = 0, calibrating_ = 0;
    Frame frame_;
};

std::unique_ptr<Chip> make(Options& options) { return std::make_unique<Nau7802>(options); }
const ChipEntry entry{.name = "nau7802", .min_address = 0x2A, .max_address = 0x2A, .make = make};

}  // namespace
}  // namespace tactiled
