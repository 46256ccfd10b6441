// Every chip of the i2c driver. The first byte chooses the chip and one of two worlds.
// A model chip that is reset between any two transfers, disturbed, unplugged, delayed, and whose transfers fail, before or
// after it took them. Oracle: each value of each frame is one that the model converted for that channel, and no conversion
// is given twice. A bus that answers whatever the fuzzer says. Oracle: no crash, no endless loop; each channel is finite or
// marked missing.
#include "tests/fuzz/input.hpp"
#include "tests/unit/drivers/chip_bench.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::test;
using fuzz::check;
using fuzz::Input;

class AnyBus final : public I2cBus {
public:
    explicit AnyBus(Input& input) : input_(input) {}
    Answer transfer(std::uint8_t, std::span<const std::uint8_t>, std::span<std::uint8_t> in) noexcept override {
        now_ += 100'000;
        const unsigned how = input_.byte();
        for (std::uint8_t& byte : in) byte = how < 128 ? std::uint8_t(how * 37) : input_.byte();
        return how > 250 ? Answer::absent : how > 245 ? Answer::failed : how == 245 ? Answer::timeout : Answer::ok;
    }
    std::uint64_t now_ns() const noexcept override { return now_; }
    void wait_until(std::uint64_t t_ns) noexcept override { now_ = std::max(now_, t_ns); }

private:
    Input& input_;
    std::uint64_t now_ = 1;
};

void any_answers(const ChipKind& kind, Input& input) {
    AnyBus bus(input);
    Problems problems;
    Options options = Options::parse_text(kind.keys, "fuzz.toml", problems);
    LinkCounts counts;
    Schedule schedule(bus);
    schedule.add(kind.name, Chips::find(kind.name)->make(options), {kind.address, 0x70, 3}, 0, counts);
    Frame frame;
    if (!schedule.open().empty()) return;
    while (!input.is_empty()) {
        const std::uint64_t before_ns = bus.now_ns();
        const Status status = schedule.read(frame, 50);
        check(bus.now_ns() > before_ns || status != Status::timeout);
        if (status == Status::disconnected && !schedule.open().empty()) return;
        if (status != Status::frame) continue;
        for (unsigned k = 0; k < frame.n_channels; ++k)
            check(std::isfinite(frame.channel[k]) != ((frame.missing >> k & 1) != 0));
    }
}

void any_fate(const ChipKind& kind, Input& input) {
    ChipBench bench;
    ModelChip& model = bench.add(kind, 0, 0x70, 3);
    bench.bus.accident = [&] { model.reset(); };
    bool is_open = bench.schedule.open().empty();
    std::uint64_t converted_ns = 0;
    while (!input.is_empty()) {
        const unsigned what = input.byte();
        switch (what % 8) {
            case 0: bench.bus.n_until_accident = 1 + input.byte() % 32; break;
            case 1: model.disturb(what / 8, input.byte()); break;
            case 2: model.is_dead = !model.is_dead; break;
            case 3:
                bench.bus.n_failing = input.byte() % 8;
                bench.bus.fails_after = (what & 8) != 0;
                bench.bus.failing_with = (what & 16) != 0   ? Answer::absent
                                         : (what & 32) != 0 ? Answer::timeout
                                                            : Answer::failed;
                break;
            case 4: bench.bus.wires.reset_muxes(); break;
            case 5: model.period_scale = 0.9 + what / 8 * 0.2 / 31; break;
            case 6: bench.bus.wait_until(bench.bus.now_ns() + (std::uint64_t{1} << what / 8)); break;
            case 7: break;
        }
        for (unsigned n = what / 8 % 4; is_open && n > 0; --n) {
            Frame frame;
            const Status status = bench.schedule.read(frame, 20);
            if (status == Status::disconnected) is_open = false;
            if (status != Status::frame) continue;
            const std::int64_t age_ns = bench.age_ns(frame);
            check(age_ns >= 0);
            const std::uint64_t at_ns = frame.t_ns - std::uint64_t(age_ns);
            // MPR121 has no sign of a new conversion: after a reset of its clock's rate it may be read twice.
            check(at_ns > converted_ns || kind.name == "mpr121");
            converted_ns = at_ns;
        }
        if (!is_open) is_open = bench.schedule.open().empty();
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 2 || size > 4096) return 0;
    Input input(data + 1, size - 1);
    const ChipKind& kind = chip_kinds()[data[0] / 2 % chip_kinds().size()];
    if ((data[0] & 1) != 0)
        any_answers(kind, input);
    else
        any_fate(kind, input);
    return 0;
}
