// Driver "i2c": chips on one bus, each a device of the link. What they are is in chips/; here are their keys.
#include <fmt/format.h>

#include <set>

#include "drivers/chips/schedule.hpp"
#include "drivers/driver.hpp"
#include "drivers/i2c_device.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMostChips = 32;

class I2c final : public Driver {
public:
    explicit I2c(Options& options)
        : path_(options.text("bus")), timeout_ms_(int(options.integer("timeout_ms", {0, 1000}, 0))) {
        auto chips = options.tables("chip", kMostChips);
        if (chips.empty()) options.problem("chip", "no chip: add [[link.chip]] with device and chip");
        for (Options& chip : chips) add(chip);
    }

    std::string open() override {
        std::string wrong = bus_.open(path_, timeout_ms_);
        if (wrong.empty()) {
            wrong = schedule_.open();
            if (!wrong.empty()) wrong = path_ + ": " + wrong;
        }
        if (!wrong.empty()) close();
        return wrong;
    }
    Status read(Frame& frame, int timeout_ms) noexcept override { return schedule_.read(frame, timeout_ms); }
    void close() noexcept override { bus_.close(); }

private:
    void add(Options& options) {
        const auto device = std::uint16_t(options.integer("device", {0, 65535}));
        if (!devices_.insert(device).second)
            options.problem("device", fmt::format("device = {} is another chip's of this link", device));
        const std::string name = options.one_of("chip", chip_names());
        const ChipEntry* const entry = find_chip(name);
        if (entry == nullptr) return;  // reported
        Place place;
        place.address = std::uint8_t(
            options.integer("address", {double(entry->least_address), double(entry->most_address)}, entry->least_address));
        if (options.has("mux")) {
            Options mux = options.table("mux");
            place.mux = std::uint8_t(mux.integer("address", {kMuxLeast, kMuxMost}));
            place.channel = std::uint8_t(mux.integer("channel", {0, kMuxChannels - 1}));
        }
        for (const Place& other : places_) {
            const bool apart =
                other.mux != 0 && place.mux != 0 && (other.mux != place.mux || other.channel != place.channel);
            if (other.address == place.address && !apart)
                options.problem("address", fmt::format("another chip of this bus answers at 0x{:02x}, too; put one of "
                                                       "them at another address, or both behind a mux",
                                                       place.address));
        }
        places_.push_back(place);
        schedule_.add(name, entry->make(options), place, device, counts);
    }

    std::string path_;
    int timeout_ms_;
    I2cDevice bus_;
    Schedule schedule_{bus_};
    std::set<std::uint16_t> devices_;
    std::vector<Place> places_;
};

const DriverEntry entry{"i2c", [](Options& options) -> std::unique_ptr<Driver> { return std::make_unique<I2c>(options); }};

}  // namespace
}  // namespace tactiled
