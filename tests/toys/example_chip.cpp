// DEMO16: an imaginary converter. Register 0: settings (bit 7: a conversion is ready, cleared by reading register 1; bits 0
// .. 1: rate). Registers 1 and 2: the code, high byte first. Register 0xFF: its identity, 0xD1.
#include <array>

#include "drivers/chips/chip.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kSettings = 0, kCode = 1, kIdentity = 0xFF, kReady = 0x80, kIsDemo16 = 0xD1, kRunning = 0x40;
constexpr unsigned kRates_Hz[] = {10, 50, 100, 200};

class Demo16 final : public Chip {
public:
    explicit Demo16(Options& options) : rate_(choice(options, "rate_Hz", {10, 50, 100, 200}, 100)) {}

    Progress set_up(Port& port, unsigned) noexcept override {
        std::array<std::uint8_t, 1> found{};
        Answer answer = port.read(kIdentity, found);
        if (answer == Answer::ok && found[0] != kIsDemo16) return {.kind = Progress::wrong, .found = found[0]};
        if (answer == Answer::ok) answer = port.write({kSettings, settings()});
        return {answer, Progress::done};
    }

    Reading read(Port& port, Frame& frame) noexcept override {
        std::array<std::uint8_t, 1> state{};
        std::array<std::uint8_t, 2> data{};
        Answer answer = port.read(kSettings, state);
        if (answer != Answer::ok) return {answer};
        if ((state[0] & ~kReady) != settings()) return {.kind = Reading::was_reset};  // it has lost its supply
        if ((state[0] & kReady) == 0) return {};
        answer = port.read(kCode, data);
        if (answer != Answer::ok) return {answer};
        const auto code = std::int16_t(big16(data.data()));
        frame = Frame{};
        frame.n_channels = 1;
        frame.channel[0] = code;
        if (code == INT16_MAX || code == INT16_MIN) frame.saturated = 1;
        return {.kind = Reading::frame};
    }

    Pace pace() const noexcept override { return Pace::continuous; }
    std::uint64_t conversion_ns() const noexcept override { return 1'000'000'000u / kRates_Hz[rate_]; }
    Identity identity() const noexcept override { return {"its register 0xFF reads", kIsDemo16}; }

private:
    [[nodiscard]] std::uint8_t settings() const noexcept { return std::uint8_t(kRunning | rate_); }

    unsigned rate_;
};

std::unique_ptr<Chip> make(Options& options) { return std::make_unique<Demo16>(options); }
const ChipEntry entry{.name = "demo16", .min_address = 0x1A, .max_address = 0x1B, .make = make};

}  // namespace
}  // namespace tactiled
