// ADS122C04: one voltage, 24 bits, with a counter of conversions. Frame: one channel, in counts.
//
// Commands, registers, and the order of counter, data and CRC are those of SparkFun's library and of TI's example.
// The following is from knowledge of the data sheet and was not checked on a chip: all registers are 0 after a reset,
// which takes less than 1 ms; the counter advances with each conversion; the CRC is CCITT's (0x1021, from 0xFFFF)
// over counter and data; RDATA returns counter and data of one conversion.
#include <algorithm>
#include <array>
#include <boost/crc.hpp>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kReset = 0x06, kStart = 0x08, kReadData = 0x10, kReadRegister = 0x20, kWriteRegister = 0x40;
constexpr std::uint8_t kTurbo = 0x10, kContinuous = 0x08, kNoPga = 0x01, kReady = 0x80, kCounter = 0x40, kCrc16 = 0x20;
constexpr std::uint32_t kResetUs = 1000;
constexpr unsigned kRates_Hz[] = {20, 45, 90, 175, 330, 600, 1000};
constexpr unsigned kWithCounter = 2;  // index of the register that enables counter and CRC
constexpr unsigned kSingleEnded = 8;  // code of the first single-ended input
const std::vector<std::string> kInputs{"AIN0-AIN1", "AIN0-AIN2", "AIN0-AIN3", "AIN1-AIN0", "AIN1-AIN2", "AIN1-AIN3",
                                       "AIN2-AIN3", "AIN3-AIN2", "AIN0",      "AIN1",      "AIN2",      "AIN3"};

constexpr std::uint8_t at(std::uint8_t command, unsigned reg) noexcept { return std::uint8_t(command | reg << 2); }

std::uint16_t crc16(std::span<const std::uint8_t> bytes) noexcept {
    boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false> crc;
    crc.process_bytes(bytes.data(), bytes.size());
    return crc.checksum();
}

class Ads122c04 final : public Chip {
public:
    explicit Ads122c04(Options& options)
        : rate_(choice(options, "rate_Hz", {20, 45, 90, 175, 330, 600, 1000}, 1000)),
          turbo_(options.flag("turbo", false)),
          crc_(options.flag("crc", true)) {
        const std::string name = options.one_of("input", kInputs, "AIN0-AIN1");
        const auto input = unsigned(std::find(kInputs.begin(), kInputs.end(), name) - kInputs.begin());
        const unsigned gain = choice(options, "gain", {1, 2, 4, 8, 16, 32, 64, 128}, 1);
        const bool single_ended = input >= kSingleEnded && input < kInputs.size();
        if (single_ended && gain > 2) options.problem("gain", "gain > 4 needs a pair of inputs, such as \"AIN0-AIN1\"");
        const std::string reference = options.one_of("reference", {"internal", "pins", "supply"}, "internal");
        const unsigned vref = reference == "internal" ? 0 : reference == "pins" ? 1 : 2;
        set_ = {std::uint8_t(input << 4 | gain << 1 | (single_ended ? kNoPga : 0)),
                std::uint8_t(rate_ << 5 | (turbo_ ? kTurbo : 0) | kContinuous | vref << 1),
                std::uint8_t(kCounter | (crc_ ? kCrc16 : 0)), 0};
    }

    Progress set_up(Port& port, unsigned step) noexcept override {
        Answer answer = Answer::ok;
        if (step == 0) return {port.write({kReset}), Progress::more, kResetUs};
        std::uint64_t found = 0;
        for (unsigned i = 0; i < set_.size() && answer == Answer::ok; ++i) {
            std::uint8_t value = 0;
            answer = port.read(at(kReadRegister, i), {&value, 1});
            found = found << 8 | value;
        }
        if (answer != Answer::ok) return {answer};
        if (found != 0) return {.kind = Progress::wrong, .found = found};
        for (unsigned i = 0; i < set_.size() && answer == Answer::ok; ++i)
            answer = port.write({at(kWriteRegister, i), set_[i]});
        bool is_good = true;  // a write has no checksum
        for (unsigned i = 0; i < set_.size() && answer == Answer::ok; ++i) {
            std::uint8_t value = 0;
            answer = read_checked(port, at(kReadRegister, i), value, is_good);
            if (answer == Answer::ok && value != set_[i]) return {.kind = Progress::wrong, .found = value};
        }
        if (answer == Answer::ok) answer = port.write({kStart});
        if (answer == Answer::ok) answer = read_data(port, is_good);
        if (answer == Answer::ok && !is_good) answer = Answer::failed;
        count_ = data_[0];
        return {answer, Progress::done};
    }

    Reading read(Port& port, Frame& frame) noexcept override {
        bool is_good = false;
        Answer answer = read_data(port, is_good);
        if (answer != Answer::ok || (is_good && data_[0] == count_)) return {answer};
        bool is_same = true;
        answer = check(port, is_good, is_same);
        if (answer != Answer::ok) return {answer};
        if (!is_same) return {.kind = Reading::was_reset};
        if (!is_good) return {.kind = Reading::bad};
        const auto lost = std::uint32_t(std::uint8_t(data_[0] - count_ - 1));
        count_ = data_[0];
        const std::uint32_t code = big24(&data_[1]);
        frame = Frame{};
        frame.n_channels = 1;
        frame.channel[0] = signed24(code);
        if (code == 0x7FFFFF || code == 0x800000) frame.saturated = 1;
        return {.kind = Reading::frame, .lost = lost};
    }

    Pace pace() const noexcept override { return Pace::counted; }
    ReadyEdge ready_edge() const noexcept override { return ReadyEdge::falling; }  // DRDY
    bool is_noisy() const noexcept override { return true; }
    std::uint64_t conversion_ns() const noexcept override { return 1'000'000'000u / (kRates_Hz[rate_] << (turbo_ ? 1 : 0)); }
    Identity identity() const noexcept override { return {"its registers after a reset read", 0}; }

private:
    // Reads counter and data into data_. `is_good` is true if their CRC is right.
    Answer read_data(Port& port, bool& is_good) noexcept {
        const Answer answer = port.read(kReadData, {data_.data(), std::size_t{crc_ ? 6u : 4u}});
        is_good = !crc_ || crc16({data_.data(), 4}) == big16(&data_[4]);
        return answer;
    }
    Answer read_checked(Port& port, std::uint8_t command, std::uint8_t& value, bool& is_good) const noexcept {
        std::array<std::uint8_t, 3> bytes{};
        const Answer answer = port.read(command, {bytes.data(), std::size_t{crc_ ? 3u : 1u}});
        value = bytes[0];
        is_good = is_good && (!crc_ || crc16({bytes.data(), 1}) == big16(&bytes[1]));
        return answer;
    }

    // A chip after a reset sends data without counter and CRC. If an answer may be of that kind, all registers are
    // read. Otherwise one register is read per value, because the bus has no time to read four: a setting that
    // changed by itself is detected within four values.
    Answer check(Port& port, bool& is_good, bool& is_same) noexcept {
        const bool has_crc = is_good, may_be_reset = !is_good || data_[0] == 0;
        const unsigned next = (last_read_ + 1) % unsigned(set_.size());
        Answer answer = Answer::ok;
        for (unsigned i = 0; i < set_.size() && answer == Answer::ok && is_same; ++i) {
            if (!may_be_reset && i != next && (crc_ || i != kWithCounter)) continue;
            std::uint8_t value = 0;
            bool is_register_good = true;
            answer = read_checked(port, at(kReadRegister, i), value, is_register_good);
            if (answer != Answer::ok) return answer;
            is_good = is_good && is_register_good;
            const bool is_reported = is_register_good || !has_crc;  // otherwise a bit was disturbed during the transfer
            is_same = !is_reported || (i == kWithCounter ? value & ~kReady : value) == set_[i];
        }
        if (is_good) last_read_ = next;
        return answer;
    }

    unsigned rate_;
    bool turbo_, crc_;
    std::array<std::uint8_t, 4> set_{};  // all registers; the last one, the current sources, stays off
    unsigned last_read_ = 0;             // index into set_
    std::array<std::uint8_t, 6> data_{};
    std::uint8_t count_ = 0;  // counter of the conversion that was read last
};

std::unique_ptr<Chip> make(Options& options) { return std::make_unique<Ads122c04>(options); }
const ChipEntry entry{.name = "ads122c04", .min_address = 0x40, .max_address = 0x4F, .make = make};

}  // namespace
}  // namespace tactiled
