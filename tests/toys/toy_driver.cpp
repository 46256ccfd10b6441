// Driver "toy": a driver as an external developer adds one. A test shows that this file and one line in a
// CMakeLists.txt are sufficient. Each frame holds the number of the frame.
#include <time.h>

#include "drivers/driver.hpp"

namespace tactiled {
namespace {

class Toy final : public Driver {
public:
    explicit Toy(Options& options) : device_(options.text("device", "")), first_(options.number("first", {0, 1000}, 0)) {}

    std::string open() override { return ""; }

    Status read(Frame& frame, int) noexcept override {
        timespec now{};
        ::clock_gettime(CLOCK_MONOTONIC, &now);
        frame = Frame{};
        frame.t_ns = std::uint64_t(now.tv_sec) * 1'000'000'000u + std::uint64_t(now.tv_nsec);
        frame.n_channels = 1;
        frame.channel[0] = first_ + counts[TACTILED_LINK_FRAMES]++;
        return Status::frame;
    }

    void close() noexcept override {}

private:
    std::string device_;
    double first_;
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<Toy>(options); }

std::vector<Requirement> requirements(Options& options) {
    if (!options.has("device")) return {};
    return {{Requirement::Kind::file, options.text("device")}};
}

const DriverEntry entry{.name = "toy", .measures = false, .make = make, .requirements = requirements};

}  // namespace
}  // namespace tactiled
