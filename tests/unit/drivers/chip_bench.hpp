// Chips of the i2c driver on a model bus, with the common check of all tests: was each value of a frame converted by
// the chip, for that channel, and when?
#pragma once
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/chips/schedule.hpp"
#include "tests/unit/drivers/capacitance_chips.hpp"
#include "tests/unit/drivers/model_bus.hpp"
#include "tests/unit/drivers/voltage_chips.hpp"

namespace tactiled::test {

struct ChipKind {
    std::string name, keys;
    std::uint8_t address;
    std::vector<unsigned> inputs;  // input of each channel of the frame, as numbered by the model
    double counts_per_unit = 1, zero = 0;
    std::unique_ptr<ModelChip> (*make_model)();

    [[nodiscard]] std::int64_t code(const Frame& frame, unsigned channel) const {
        return std::llround(frame.channel[channel] * counts_per_unit + zero);
    }
};

template <class Model>
std::unique_ptr<ModelChip> make_model() {
    return std::make_unique<Model>();
}

inline const std::vector<ChipKind>& chip_kinds() {
    static const std::vector<ChipKind> kinds{
        {"ad7746", "rate_Hz = 91", 0x48, {0}, 0x800000 / 4.096, 0x800000, make_model<ModelAd7746>},
        {"ad7746", "rate_Hz = 91\nchannels = 2", 0x48, {0, 1}, 0x800000 / 4.096, 0x800000, make_model<ModelAd7746>},
        {"nau7802", "rate_Hz = 320", 0x2A, {0}, 1, 0, make_model<ModelNau7802>},
        {"nau7802", "rate_Hz = 80\nchannels = 2", 0x2A, {0, 1}, 1, 0, make_model<ModelNau7802>},
        {"ads1115", "inputs = [\"AIN0\"]", 0x49, {4}, 1, 0, make_model<ModelAds1115>},
        {"ads1115", "inputs = [\"AIN0\", \"AIN1\", \"AIN2-AIN3\"]", 0x49, {4, 5, 3}, 1, 0, make_model<ModelAds1115>},
        {"ads122c04", "rate_Hz = 1000", 0x40, {0}, 1, 0, make_model<ModelAds122c04>},
        {"ads122c04", "rate_Hz = 1000\nturbo = true\ncrc = false", 0x40, {0}, 1, 0, make_model<ModelAds122c04>},
        {"fdc1004", "inputs = [\"CIN1\"]", 0x50, {0}, 1 << 19, 0, make_model<ModelFdc1004>},
        {"fdc1004",
         "inputs = [\"CIN1\", \"CIN2\", \"CIN3\", \"CIN4\"]",
         0x50,
         {0, 1, 2, 3},
         1 << 19,
         0,
         make_model<ModelFdc1004>},
        {"mpr121", "", 0x5A, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, 1, 0, make_model<ModelMpr121>},
        {"ad7746",
         "rate_Hz = 91\nelectrodes = 5",
         0x48,
         {0, 1, 2, 3, 4},
         0x800000 / 4.096,
         0x800000,
         make_model<ModelAd7746>},
    };
    return kinds;
}

// Returns the first kind with that name.
inline const ChipKind& kind_of(std::string_view name) {
    for (const ChipKind& kind : chip_kinds())
        if (kind.name == name) return kind;
    throw std::out_of_range(std::string(name));
}

class ModelSelector final : public Selector {
public:
    ModelSelector(const I2cBus& bus, ModelAd7746& chip) : bus_(bus), chip_(chip) {}
    bool select(unsigned electrode) noexcept override {
        if (!is_disconnected) chip_.select(electrode, bus_.now_ns());
        return !is_disconnected;
    }
    bool is_disconnected = false;

private:
    const I2cBus& bus_;
    ModelAd7746& chip_;
};

class ChipBench {
public:
    explicit ChipBench(double clock_Hz = 400e3) : bus(clock_Hz), schedule(bus) {}

    ModelChip& add(const ChipKind& kind, std::uint16_t device = 0, std::uint8_t mux = 0, std::uint8_t channel = 0,
                   bool has_line = false) {
        Problems problems;
        Options options = Options::parse_text(kind.keys, "test.toml", problems);
        auto chip = Chips::find(kind.name)->make(options);
        options.finish();
        problems.throw_if_any();
        models.push_back(kind.make_model());
        kinds.push_back(&kind);
        bus.wires.put(kind.address, *models.back(), mux, channel);
        if (has_line) {
            line = std::make_unique<ModelLine>(*models.back());
            bus.line = line.get();
        }
        if (chip->electrodes() != 0)
            selectors.push_back(std::make_unique<ModelSelector>(bus, dynamic_cast<ModelAd7746&>(*models.back())));
        Selector* const selector = chip->electrodes() != 0 ? selectors.back().get() : nullptr;
        schedule.add(kind.name, std::move(chip), {kind.address, mux, channel}, device, counts, line.get(), selector);
        return *models.back();
    }

    // Returns the age in ns of the oldest value of a frame; -1 if one was never converted.
    std::int64_t age_ns(const Frame& frame) {
        const ChipKind& kind = *kinds[frame.device];
        if (frame.n_channels != kind.inputs.size()) return -1;
        std::int64_t age = 0;
        for (unsigned k = 0; k < frame.n_channels; ++k) {
            const std::uint64_t at = models[frame.device]->converted_ns(kind.inputs[k], kind.code(frame, k));
            if (at == 0 || (frame.missing >> k & 1) != 0) return -1;
            age = std::max(age, std::int64_t(frame.t_ns - at));
        }
        return age;
    }

    struct Taken {
        Frame frame;
        std::int64_t age_ns;
    };
    // Returns all frames of that time.
    std::vector<Taken> run(double seconds) {
        std::vector<Taken> taken;
        Frame frame;
        const std::uint64_t until_ns = bus.now_ns() + std::uint64_t(seconds * 1e9);
        while (bus.now_ns() < until_ns && status != Status::disconnected) {
            status = schedule.read(frame, 50);
            if (status == Status::frame) taken.push_back({frame, age_ns(frame)});
        }
        return taken;
    }

    std::unique_ptr<ModelLine> line;
    ModelBus bus;
    LinkCounts counts;
    Schedule schedule;
    std::vector<std::unique_ptr<ModelSelector>> selectors;
    std::vector<std::unique_ptr<ModelChip>> models;
    std::vector<const ChipKind*> kinds;
    Status status = Status::timeout;
};

}  // namespace tactiled::test
