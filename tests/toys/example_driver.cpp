// Driver "ramp": a link without hardware that counts up, one frame each `period_ms`.
#include <time.h>

#include "drivers/driver.hpp"

namespace tactiled {
namespace {

class Ramp final : public Driver {
public:
    explicit Ramp(Options& options) : period_ms_(int(options.integer("period_ms", {1, 1000}, 10))) {}

    std::string open() override { return ""; }  // "": it is open; otherwise the error and its remedy

    Status read(Frame& frame, int timeout_ms) noexcept override {
        const int wait_ms = period_ms_ < timeout_ms ? period_ms_ : timeout_ms;  // never longer than `timeout_ms`
        const timespec wait{wait_ms / 1000, wait_ms % 1000 * 1'000'000L};
        ::clock_nanosleep(CLOCK_MONOTONIC, 0, &wait, nullptr);
        timespec now{};
        ::clock_gettime(CLOCK_MONOTONIC, &now);
        frame = Frame{};
        frame.t_ns = std::uint64_t(now.tv_sec) * 1'000'000'000u + std::uint64_t(now.tv_nsec);
        frame.n_channels = 1;
        frame.channel[0] = value_++;
        ++counts[TACTILED_LINK_FRAMES];
        return Status::frame;
    }

    void close() noexcept override {}

private:
    int period_ms_;
    double value_ = 0;
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<Ramp>(options); }

// measures = false: the numbers are invented, so that they are published as simulated.
const DriverEntry entry{.name = "ramp", .measures = false, .make = make};

}  // namespace
}  // namespace tactiled
