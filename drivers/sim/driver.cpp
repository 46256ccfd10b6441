// Driver "sim": a scene in place of hardware. Each sensor of the scene is a device of the link, in the scene's order.
// The channels of a frame are in the sensor's own unit (counts_per_unit = 1). An array has taxels and no channels.
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/sim/arrivals.hpp"
#include "drivers/sim/simulation.hpp"

namespace tactiled {
namespace {

class SimDriver final : public Driver {
public:
    explicit SimDriver(Options& options) {
        const std::string file = options.text("scene");
        path_ = (std::filesystem::path(options.file()).parent_path() / file).string();  // an absolute path is unchanged
        effects_ = options.text("effects", "auto");
        speed_ = options.number("speed", {0.001, 1000}, 1);
        again_ = options.one_of("at_end", {"stop", "again"}, "stop") == "again";
        try {
            scene_ = sim::read_scene(path_);
            for (const sim::Sensor& sensor : scene_.sensors)
                if (sensor.is_array()) shape_ = {std::uint16_t(sensor.taxels()), std::uint16_t(sensor.n())};
            // An array has thousands of channels: the work for them is spread over the samples.
            if (shape_.taxels != 0) block_size_ = 1;
            sim::Simulation{scene_, effects_, block_size_};
        } catch (const SetupError& e) { options.problem("scene", e.what()); }
    }

    std::string open() override {
        if (ended_ && !again_) return "the scene has ended; at_end = \"again\" plays it again";
        simulation_ = std::make_unique<sim::Simulation>(scene_, effects_, block_size_);
        block_.assign(scene_.sensors.size(), nullptr);
        lines_.clear();
        for (const sim::Sensor& sensor : scene_.sensors) lines_.push_back({sim::Arrivals(sensor), 0});
        arrived_ = {};
        sample_ = 0;
        sensor_ = 0;
        began_ns_ = now_ns();
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (simulation_ == nullptr || sample_ >= scene_.samples) {
            ended_ = true;
            return Status::disconnected;
        }
        const std::uint64_t due_ns = began_ns_ + std::uint64_t(double(sample_) / scene_.rate_Hz / speed_ * 1e9);
        const std::uint64_t until_ns = now_ns() + std::uint64_t(timeout_ms) * 1'000'000u;
        const std::uint64_t wake_ns = std::min(due_ns, until_ns);
        const timespec wake{time_t(wake_ns / 1'000'000'000u), long(wake_ns % 1'000'000'000u)};
        while (now_ns() < wake_ns) ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
        if (due_ns > until_ns) return Status::timeout;
        return fill(frame) ? Status::frame : Status::timeout;
    }

    [[nodiscard]] bool has_more() const noexcept override { return sensor_ != 0 || !arrived_.empty(); }

    void close() noexcept override {
        simulation_.reset();
        taxels_ = {};
    }

    [[nodiscard]] TaxelShape taxel_shape() const noexcept override { return shape_; }
    [[nodiscard]] Taxels taxels() const noexcept override { return taxels_; }

    [[nodiscard]] double delay_s(std::uint16_t device, std::size_t channel) const override {
        for (const sim::Sensor& sensor : scene_.sensors)
            if (sensor.device == device && channel < sensor.n()) return scene_.delay_s(sensor)[channel] / speed_;
        return 0;
    }

private:
    struct Line {
        sim::Arrivals arrivals;
        std::uint64_t next;  // number of the next frame in order
    };

    // Fills the next frame of the present sensor. Returns false if this sample has no further frame of that sensor.
    bool fill(Frame& frame) noexcept {
        const std::size_t i = sensor_;
        taxels_ = {};
        if (arrived_.empty()) {
            if (sample_ % block_size_ == 0) block_[i] = &simulation_->advance(i);
            arrived_ = lines_[i].arrivals.take(*block_[i], std::size_t(sample_ - block_[i]->first));
        }
        const bool any = !arrived_.empty();
        const bool in_order = any && take(arrived_.front(), scene_.sensors[i], lines_[i].next, frame);
        if (const sim::TaxelArray* const array = simulation_->array(i); in_order && array != nullptr) {
            frame.n_channels = 0;
            frame.missing = 0;
            taxels_ = {shape_, array->values(std::size_t(sample_ - block_[i]->first))};
        }
        if (any) arrived_ = arrived_.subspan(1);
        if (arrived_.empty() && ++sensor_ == scene_.sensors.size()) {
            sensor_ = 0;
            ++sample_;
        }
        return in_order;
    }

    // Returns false if a frame was sent again or is older than the last one: it is counted and dropped, as in the
    // stream drivers.
    bool take(const sim::SentFrame& sent, const sim::Sensor& sensor, std::uint64_t& next, Frame& frame) noexcept {
        const std::uint64_t number = sent.sample / sensor.every;
        if (number < next) {
            ++counts[TACTILED_LINK_REPEATED];
            return false;
        }
        frame = Frame{};
        frame.t_ns = now_ns();
        frame.device_time_us = std::uint64_t(std::max(0.0, sent.t_s) * 1e6);
        frame.sequence = std::uint32_t(number);
        frame.has_sequence = true;
        frame.device = sensor.device;
        frame.n_channels = std::uint8_t(sensor.n());
        frame.missing = sent.missing;
        frame.lost = std::uint32_t(number - next);
        for (std::size_t k = 0; k < sensor.n(); ++k)
            frame.channel[k] = frame.missing >> k & 1u ? std::numeric_limits<double>::quiet_NaN() : sent.channel[k];
        next = number + 1;
        counts[TACTILED_LINK_LOST] += frame.lost;
        ++counts[TACTILED_LINK_FRAMES];
        return true;
    }

    std::string path_, effects_;
    double speed_;
    bool again_, ended_ = false;
    sim::Scene scene_;
    std::unique_ptr<sim::Simulation> simulation_;
    std::vector<const sim::Block*> block_;
    std::vector<Line> lines_;
    std::span<const sim::SentFrame> arrived_;  // frames of the present sensor that were not read yet
    TaxelShape shape_{};
    Taxels taxels_{};
    std::size_t block_size_ = sim::Block::kSize;
    std::uint64_t sample_ = 0, began_ns_ = 0;
    std::size_t sensor_ = 0;
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<SimDriver>(options); }
const DriverEntry entry{.name = "sim", .measures = false, .make = make};

}  // namespace
}  // namespace tactiled
