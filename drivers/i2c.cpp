// Driver "i2c": chips on one bus, each a device of the link. The chips are in chips/, and their keys in this file.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "drivers/chips/schedule.hpp"
#include "drivers/driver.hpp"
#include "drivers/gpio.hpp"
#include "drivers/i2c_device.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxChips = 32, kMaxSelectLines = 4;

// A chip's data-ready line on a GPIO chip. If the GPIO chip is removed, the chip is polled by the clock alone until
// the link is opened again.
class GpioReady final : public ReadyLine {
public:
    GpioReady(I2cDevice& bus, GpioName name, Chip::ReadyEdge edge)
        : bus_(bus),
          name_(std::move(name)),
          edge_(edge == Chip::ReadyEdge::rising ? GpioEdges::Edge::rising : GpioEdges::Edge::falling) {}

    // Returns "" or the fault. setup
    [[nodiscard]] std::string open() {
        std::string wrong = edges_.open(name_, edge_);
        is_open_ = wrong.empty();
        return wrong;
    }
    void close() noexcept {
        edges_.close();
        is_open_ = false;
    }
    [[nodiscard]] int fd() const noexcept { return edges_.fd(); }

    bool take(std::uint64_t& t_ns) noexcept override {
        if (!is_open_) return false;
        std::uint32_t edges = 0;
        const auto wait = edges_.wait_edge(0, t_ns, edges);
        if (wait == GpioEdges::Wait::disconnected) {
            bus_.forget(fd());
            is_open_ = false;  // the line itself is closed with the link, because closing may allocate
        }
        return wait == GpioEdges::Wait::edge;
    }

private:
    I2cDevice& bus_;
    GpioName name_;
    GpioEdges::Edge edge_;
    GpioEdges edges_;
    bool is_open_ = false;
};

// A switch whose lines carry the electrode's number, lowest bit first.
class GpioSelector final : public Selector {
public:
    explicit GpioSelector(std::vector<GpioName> names) : names_(std::move(names)), lines_(names_.size()) {}

    // Returns "" or the fault. setup
    [[nodiscard]] std::string open() {
        std::string wrong;
        for (std::size_t bit = 0; bit < names_.size() && wrong.empty(); ++bit) wrong = lines_[bit].open(names_[bit], false);
        return wrong;
    }
    void close() noexcept {
        for (auto& line : lines_) line.close();
    }
    bool select(unsigned electrode) noexcept override {
        bool good = true;
        for (std::size_t bit = 0; bit < lines_.size(); ++bit) good &= lines_[bit].set((electrode >> bit & 1u) != 0);
        return good;
    }

private:
    std::vector<GpioName> names_;
    std::vector<GpioOutput> lines_;
};

class I2c final : public Driver {
public:
    explicit I2c(Options& options)
        : path_(options.text("bus")), timeout_ms_(int(options.integer("timeout_ms", {0, 1000}, 0))) {
        auto chips = options.tables("chip", kMaxChips);
        if (chips.empty()) options.problem("chip", "no chip: add [[link.chip]] with device and chip");
        for (Options& chip : chips) add(chip);
    }

    std::string open() override {
        std::string wrong = bus_.open(path_, timeout_ms_);
        for (auto& selector : selectors_)
            if (wrong.empty()) wrong = selector->open();
        if (wrong.empty()) {
            wrong = schedule_.open();
            if (!wrong.empty()) wrong = path_ + ": " + wrong;
        }
        std::vector<int> fds;
        for (auto& line : lines_) {
            if (wrong.empty()) wrong = line->open();
            fds.push_back(line->fd());
        }
        bus_.watch(fds);
        if (!wrong.empty()) close();
        return wrong;
    }
    Status read(Frame& frame, int timeout_ms) noexcept override { return schedule_.read(frame, timeout_ms); }
    bool is_noisy(std::uint16_t device) const override { return noisy_.count(device) != 0; }
    double delay_s(std::uint16_t device, std::size_t channel) const override {
        const auto known = conversions_.find(device);
        if (known == conversions_.end()) return 0;
        const auto& [number, conversion_s] = known->second;
        // From the middle of the channel's conversion to the end of the last one, which contains the temperature.
        return (double(number - std::min(channel, number - 1)) - 0.5) * conversion_s;
    }
    Route route() const noexcept override { return {.path = Route::Path::polled}; }

    void close() noexcept override {
        bus_.close();
        for (auto& line : lines_) line->close();
        for (auto& selector : selectors_) selector->close();
    }

private:
    void add(Options& options) {
        const auto device = std::uint16_t(options.integer("device", {0, 65535}));
        if (!devices_.insert(device).second)
            options.problem("device", fmt::format("device = {} is another chip's of this link", device));
        const std::string name = options.one_of("chip", Chips::names());
        const ChipEntry* const entry = Chips::find(name);
        if (entry == nullptr) return options.accept_other_keys();  // reported
        Place place;
        place.address = std::uint8_t(
            options.integer("address", {double(entry->min_address), double(entry->max_address)}, entry->min_address));
        if (options.has("mux")) {
            Options mux = options.table("mux");
            place.mux = std::uint8_t(mux.integer("address", {kMuxMin, kMuxMax}));
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
        auto made = entry->make(options);
        ReadyLine* ready = nullptr;
        if (options.has("data_ready")) {
            Options line = options.table("data_ready");
            GpioName at{line.text("chip"), line.text("line")};
            if (made->ready_edge() == Chip::ReadyEdge::none || made->pace() == Pace::triggered)
                options.problem("data_ready",
                                fmt::format("{} with these keys does not convert by itself, or has no such line; "
                                            "ad7746 and nau7802 with one channel, and ads122c04 do",
                                            name));
            lines_.push_back(std::make_unique<GpioReady>(bus_, std::move(at), made->ready_edge()));
            ready = lines_.back().get();
        }
        if (made->is_noisy()) noisy_.insert(device);
        conversions_[device] = {made->conversions(), double(made->conversion_ns()) * 1e-9};
        Selector* const selector = read_selector(options, made->electrodes());
        schedule_.add(name, std::move(made), place, device, counts, ready, selector);
    }

    // Returns nullptr if there is no switch.
    Selector* read_selector(Options& options, unsigned electrodes) {
        if (!options.has("select")) {
            if (electrodes != 0)
                options.problem("select",
                                "electrodes needs select = {chip = \"gpiochip0\", lines = [\"5\", \"6\", ...]}, the "
                                "lines that turn the switch");
            return nullptr;
        }
        Options table = options.table("select");
        const std::string chip = table.text("chip");
        std::vector<GpioName> names;
        for (const auto& line : table.texts("lines", {1, kMaxSelectLines})) names.push_back({chip, line});
        if (electrodes == 0)
            options.problem("select", "select is for a chip that has electrodes: ad7746 with electrodes = 2 .. 16");
        else if (electrodes > 1u << names.size())
            options.problem("select", fmt::format("{} lines select one of {}, not of {} electrodes", names.size(),
                                                  1u << names.size(), electrodes));
        selectors_.push_back(std::make_unique<GpioSelector>(std::move(names)));
        return selectors_.back().get();
    }

    std::string path_;
    int timeout_ms_;
    I2cDevice bus_;
    std::vector<std::unique_ptr<GpioReady>> lines_;
    std::vector<std::unique_ptr<GpioSelector>> selectors_;
    Schedule schedule_{bus_};
    std::set<std::uint16_t> devices_, noisy_;
    struct Conversions {
        std::size_t number;  // number of successive conversions per frame
        double each_s;
    };
    std::map<std::uint16_t, Conversions> conversions_;
    std::vector<Place> places_;
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<I2c>(options); }

std::vector<Requirement> requirements(Options& options) { return {{Requirement::Kind::file, options.text("bus")}}; }

const DriverEntry entry{.name = "i2c", .measures = true, .make = make, .requirements = requirements};

}  // namespace
}  // namespace tactiled
