// AD7746: capacitance, two inputs, 24 bits, and the chip's temperature. Frame: CIN1 in pF, and CIN2 in pF if channels = 2;
// or the electrodes that a switch successively connects to CIN1; then the temperature in degC if requested.
//
// Registers, their bits, the conversion times and the active-low ready bits are those of Linux's drivers/iio/cdc/ad7746.c.
// The following is from knowledge of the data sheet and was not checked on a chip: a reset takes 200 us; RDY waits for both
// converters if both are on, one after the other; degC = code / 2048 - 4096. A conversion that ends while the data registers
// are read is lost (documented for the similar AD7747), so a poll reads only the status.
#include <array>
#include <cmath>
#include <limits>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kReset = 0xBF, kStatus = 0, kCapSetup = 7, kConfig = 10, kCapDacA = 11;
constexpr std::uint8_t kExcError = 0x08, kBothBusy = 0x04, kCapBusy = 0x01, kIdle = 0x07;
constexpr std::uint8_t kCapOn = 0x80, kCin2 = 0x40, kDifferential = 0x20, kVtOn = 0x80, kDacOn = 0x80;
constexpr std::uint8_t kContinuous = 1, kSingle = 2, kMode = 7;
constexpr std::uint8_t kVtFastest = 0;  // 50 Hz, 20 ms
constexpr std::uint32_t kVtUs = 20'100, kResetUs = 1000;
constexpr std::uint32_t kCapUs[] = {11'000, 11'900, 20'000, 38'000, 62'000, 77'000, 92'000, 109'600};
constexpr double kPfPerCount = 4.096 / 0x800000;
constexpr std::uint32_t kZero = 0x800000, kTop = 0xFFFFFF;
constexpr unsigned kMaxElectrodes = 16;

class Ad7746 final : public Chip {
public:
    explicit Ad7746(Options& options)
        : rate_(choice(options, "rate_Hz", {91, 84, 50, 26, 16, 13, 11, 9}, 91)),
          electrodes_(unsigned(options.integer("electrodes", {0, kMaxElectrodes}, 0))),
          channels_(electrodes_ != 0 ? electrodes_ : unsigned(options.integer("channels", {1, 2}, 1))),
          differential_(options.flag("differential", false)),
          temperature_(options.flag("temperature", false)) {
        if (electrodes_ == 1)
            options.problem("electrodes", "one electrode needs no switch: leave electrodes and select out");
        if (electrodes_ != 0 && options.has("channels"))
            options.problem("channels", "the switch is in front of CIN1: electrodes and channels cannot both be there");
        const std::string excitation = options.one_of("excitation", {"a", "b", "both"}, "a");
        excitation_ = std::uint8_t(0x03 | (excitation != "b" ? 0x08 : 0) | (excitation != "a" ? 0x20 : 0));  // 3: +-VDD / 2
        dac_a_ = dacs(options, "capdac_a");
        dac_b_ = dacs(options, "capdac_b");
    }

    Progress set_up(Port& port, unsigned step) noexcept override {
        if (step == 0) return {port.write({kReset}), Progress::more, kResetUs};
        at_ = 0;
        is_stale_ = false;
        const Settings set = settings();
        Answer answer = port.select(0);
        if (answer == Answer::ok) answer = port.write({kCapSetup, set[0], set[1], set[2], set[3], set[4], set[5]});
        std::array<std::uint8_t, 13> all{};
        if (answer == Answer::ok) answer = port.read(kStatus, all);
        if (answer != Answer::ok) return {answer};
        const Settings found{all[7], all[8], all[9], all[10], all[11], all[12]};
        const auto status = std::uint8_t(all[0] & kIdle);  // the converter is idle since the reset, so nothing is ready
        if (found != set || status != kIdle) return {.kind = Progress::wrong, .found = packed(status, found)};
        return {port.write({kConfig, std::uint8_t(config() | mode())}), Progress::done};
    }

    Reading read(Port& port, Frame& frame) noexcept override {
        if (is_stale_) return {.kind = Reading::was_reset};
        std::array<std::uint8_t, 13> all{};
        const std::uint8_t busy = converts_temperature() ? kBothBusy : kCapBusy;
        Answer answer = port.read(kStatus, {all.data(), 1});
        if (answer != Answer::ok || (all[0] & busy) != 0) return {answer};
        const std::uint64_t taken_ns = port.now_ns();
        answer = port.read(kStatus, all);  // reads all settings, too: they show whether the chip was reset meanwhile
        if (answer != Answer::ok) return {answer};
        Settings found{all[7], all[8], all[9], all[10], all[11], all[12]}, set = settings();
        if (channels_ == 1)
            set[3] |= kContinuous;
        else
            found[3] &= std::uint8_t(~kMode);  // the converter is idle again, or not yet
        if (found != set || (all[0] & busy) != 0) return {.kind = Reading::was_reset};
        take(big24(&all[1]), big24(&all[4]), (all[0] & kExcError) != 0);
        if (channels_ == 1) {
            frame = frame_;
            return {.kind = Reading::frame, .taken_ns = taken_ns};
        }
        const bool complete = at_ + 1 == channels_;
        if (complete) frame = frame_;
        at_ = complete ? 0 : at_ + 1;
        answer = begin(port);
        if (complete) return {.kind = Reading::frame, .began = answer == Answer::ok};
        return {answer, Reading::part, true};
    }

    Pace pace() const noexcept override { return channels_ == 1 ? Pace::continuous : Pace::triggered; }
    ReadyEdge ready_edge() const noexcept override { return ReadyEdge::falling; }  // RDY
    bool is_noisy() const noexcept override { return true; }
    unsigned electrodes() const noexcept override { return electrodes_; }
    std::uint64_t conversion_ns() const noexcept override {
        return (kCapUs[rate_] + (converts_temperature() ? kVtUs : 0)) * std::uint64_t{1000};
    }
    unsigned conversions() const noexcept override { return channels_; }
    Identity identity() const noexcept override { return {"its registers 0 and 7 .. 12 read", packed(kIdle, settings())}; }

private:
    using Settings = std::array<std::uint8_t, 6>;  // registers 7 .. 12

    std::array<std::uint8_t, kMaxElectrodes> dacs(Options& options, std::string_view key) const {
        std::array<std::uint8_t, kMaxElectrodes> codes{};
        const auto values = options.numbers(key, {0, 127}, {0, channels_});
        for (std::size_t i = 0; i < values.size(); ++i)
            codes[i] = values[i] > 0 ? std::uint8_t(kDacOn | unsigned(std::lround(values[i]))) : std::uint8_t{0};
        return codes;
    }

    [[nodiscard]] std::uint8_t config() const noexcept { return std::uint8_t(kVtFastest << 6 | rate_ << 3); }
    [[nodiscard]] std::uint8_t mode() const noexcept { return channels_ == 1 ? kContinuous : kSingle; }
    [[nodiscard]] bool converts_temperature() const noexcept { return temperature_ && at_ + 1 == channels_; }

    // Settings for the channel that is being converted, without the mode.
    [[nodiscard]] Settings settings() const noexcept {
        const auto cap =
            std::uint8_t(kCapOn | (electrodes_ == 0 && at_ == 1 ? kCin2 : 0) | (differential_ ? kDifferential : 0));
        return {cap, std::uint8_t(converts_temperature() ? kVtOn : 0), excitation_, config(), dac_a_[at_], dac_b_[at_]};
    }
    static std::uint64_t packed(std::uint8_t status, const Settings& settings) noexcept {
        std::uint64_t all = status;
        for (const std::uint8_t one : settings) all = all << 8 | one;
        return all;
    }

    // All electrodes share one converter and its CAPDACs. If the ready bit of the previous conversion stayed set, the
    // value of another electrode would be read.
    Answer begin(Port& port) noexcept {
        const Settings set = settings();
        Answer answer = port.select(at_);
        if (answer == Answer::ok) answer = port.write({kCapSetup, set[0], set[1]});
        if (answer == Answer::ok) answer = port.write({kCapDacA, set[4], set[5]});
        if (answer == Answer::ok) answer = port.write({kConfig, std::uint8_t(config() | kSingle)});
        std::uint8_t status = 0;
        if (answer == Answer::ok) answer = port.read(kStatus, {&status, 1});
        is_stale_ = answer == Answer::ok && (status & kCapBusy) == 0;
        return answer;
    }

    void take(std::uint32_t cap, std::uint32_t vt, bool not_excited) noexcept {
        if (at_ == 0) frame_ = Frame{};
        const std::uint32_t bit = 1u << at_;
        frame_.n_channels = std::uint8_t(at_ + 1);
        frame_.channel[at_] = (double(cap) - kZero) * kPfPerCount;
        if (cap == 0 || cap == kTop) frame_.saturated |= bit;
        if (not_excited) {
            frame_.channel[at_] = std::numeric_limits<double>::quiet_NaN();
            frame_.missing |= bit;
        }
        if (!converts_temperature()) return;
        frame_.channel[frame_.n_channels++] = double(vt) / 2048 - 4096;
    }

    unsigned rate_, electrodes_, channels_;  // channels_: number of inputs or of electrodes
    bool differential_, temperature_;
    std::uint8_t excitation_ = 0;
    std::array<std::uint8_t, kMaxElectrodes> dac_a_{}, dac_b_{};
    unsigned at_ = 0;        // index of the channel that is being converted
    bool is_stale_ = false;  // the ready bit of the previous conversion is still set
    Frame frame_;
};

std::unique_ptr<Chip> make(Options& options) { return std::make_unique<Ad7746>(options); }
const ChipEntry entry{.name = "ad7746", .min_address = 0x48, .max_address = 0x48, .make = make};

}  // namespace
}  // namespace tactiled
