// ADS1115: voltages, 16 bits, converted one after the other. Frame: one channel for each of `inputs`, in their order,
// in counts.
//
// Registers, multiplexer, ranges and rates are those of Linux's drivers/iio/adc/ti-ads1015.c. From knowledge of the
// data sheet: the clock is off by up to 10 %, and bit 15 of the configuration is 0 while a single conversion runs. In
// continuous mode the bus does not show when a conversion is new, so each conversion is triggered. A conversion that
// is read was therefore begun after the previous one was read, with the present settings. A conversion thus costs
// four transfers.
#include <algorithm>
#include <array>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kConversion = 0, kConfig = 1;
constexpr std::uint16_t kStart = 0x8000, kIdle = 0x8000, kSingle = 0x0100, kNoComparator = 0x0003;
constexpr unsigned kRates_Hz[] = {8, 16, 32, 64, 128, 250, 475, 860};
// from power-down to the begin of a conversion, from knowledge of the data sheet
constexpr std::uint64_t kWakeNs = 25'000;
const std::vector<std::string> kInputs{"AIN0-AIN1", "AIN0-AIN3", "AIN1-AIN3", "AIN2-AIN3", "AIN0", "AIN1", "AIN2", "AIN3"};

class Ads1115 final : public Chip {
public:
    explicit Ads1115(Options& options)
        : rate_(choice(options, "rate_Hz", {8, 16, 32, 64, 128, 250, 475, 860}, 860)),
          range_(choice(options, "range_V", {6.144, 4.096, 2.048, 1.024, 0.512, 0.256}, 2.048)) {
        for (const std::string& name : options.texts("inputs", {1, 8})) {
            const auto found = std::find(kInputs.begin(), kInputs.end(), name);
            if (found == kInputs.end())
                options.problem("inputs", "input " + in_quotes(name) + " is unknown; known: AIN0 .. AIN3, AIN0-AIN1, " +
                                              "AIN0-AIN3, AIN1-AIN3, AIN2-AIN3");
            else
                inputs_.push_back(unsigned(found - kInputs.begin()));
        }
        if (!options.has("inputs")) options.problem("inputs", "key \"inputs\" is missing, such as [\"AIN0-AIN1\"]");
        if (inputs_.empty()) inputs_.push_back(0);
    }

    Progress set_up(Port& port, unsigned) noexcept override {
        at_ = 0;
        std::array<std::uint8_t, 2> found{};
        Answer answer = port.write({kConfig, std::uint8_t(config() >> 8), std::uint8_t(config() & 0xFF)});
        if (answer == Answer::ok) answer = port.read(kConfig, found);
        if (answer == Answer::ok && (big16(found.data()) & ~kIdle) != config())
            return {.kind = Progress::wrong, .found = big16(found.data()) & std::uint64_t{0x7FFF}};
        if (answer == Answer::ok) answer = begin(port);
        if (answer == Answer::ok) answer = port.read(kConfig, found);
        if (answer == Answer::ok && (big16(found.data()) & kIdle) != 0)
            answer = Answer::failed;  // the conversion did not begin
        return {answer, Progress::done};
    }

    Reading read(Port& port, Frame& frame) noexcept override {
        std::array<std::uint8_t, 2> before{}, data{}, after{};
        Answer answer = port.read(kConfig, before);
        if (answer != Answer::ok) return {answer};
        if ((big16(before.data()) & ~kIdle) != config()) return {.kind = Reading::was_reset};
        if ((big16(before.data()) & kIdle) == 0) return {};
        answer = port.read(kConversion, data);
        if (answer == Answer::ok) answer = port.read(kConfig, after);  // after a reset of the chip the value would be 0
        if (answer != Answer::ok) return {answer};
        if (after != before) return {.kind = Reading::was_reset};
        if (at_ == 0) frame_ = Frame{};
        const auto code = std::int16_t(big16(data.data()));
        frame_.channel[at_] = code;
        frame_.n_channels = std::uint8_t(at_ + 1);
        if (code == INT16_MAX || code == INT16_MIN) frame_.saturated |= 1u << at_;
        const bool complete = at_ + 1 == inputs_.size();
        if (complete) frame = frame_;
        at_ = complete ? 0 : at_ + 1;
        answer = begin(port);
        if (complete) return {.kind = Reading::frame, .began = answer == Answer::ok};
        return {answer, Reading::part, true};
    }

    Pace pace() const noexcept override { return Pace::triggered; }
    unsigned conversions() const noexcept override { return unsigned(inputs_.size()); }
    std::uint64_t conversion_ns() const noexcept override { return 1'000'000'000u / kRates_Hz[rate_] + kWakeNs; }
    Identity identity() const noexcept override { return {"its register 1 reads back", config()}; }

private:
    [[nodiscard]] std::uint16_t config() const noexcept {
        return std::uint16_t(inputs_[at_] << 12 | range_ << 9 | kSingle | rate_ << 5 | kNoComparator);
    }
    Answer begin(Port& port) noexcept {
        const auto set = std::uint16_t(config() | kStart);
        return port.write({kConfig, std::uint8_t(set >> 8), std::uint8_t(set)});
    }

    unsigned rate_, range_;
    std::vector<unsigned> inputs_;
    std::size_t at_ = 0;  // index of the input that is being converted
    Frame frame_;
};

std::unique_ptr<Chip> make(Options& options) { return std::make_unique<Ads1115>(options); }
const ChipEntry entry{.name = "ads1115", .min_address = 0x48, .max_address = 0x4B, .make = make};

}  // namespace
}  // namespace tactiled
