// libgpiod 1.x, as in Debian 12. It uses the kernel's first interface: at most 16 edges wait, and newer ones are
// dropped.
#include <gpiod.h>
#include <poll.h>

#include <cerrno>

#include "drivers/gpio.hpp"

namespace tactiled {
namespace {

constexpr std::uint32_t kWaitingMax = 16;  // limit of the kernel

}  // namespace

struct GpioLine {
    gpiod_chip* chip = nullptr;
    gpiod_line* line = nullptr;

    GpioLine() = default;
    GpioLine(const GpioLine&) = delete;
    GpioLine& operator=(const GpioLine&) = delete;
    ~GpioLine() {
        if (chip != nullptr) ::gpiod_chip_close(chip);  // releases its lines
    }
    std::string open(const GpioName& name) {
        chip = ::gpiod_chip_open_lookup(name.chip.c_str());
        if (chip == nullptr) return gpio_refusal(name, false, errno);
        line = ::gpiod_chip_find_line(chip, name.line.c_str());
        if (const auto offset = gpio_offset(name); line == nullptr && offset) line = ::gpiod_chip_get_line(chip, *offset);
        return line != nullptr ? "" : gpio_refusal(name, true, errno);
    }
};

void GpioRelease::operator()(GpioLine* line) const noexcept { delete line; }

namespace {

// Opens the line and calls `request(line)`, which returns 0 on success. Returns "" or the fault.
template <class Request>
std::string open_line(HeldGpioLine& held, const GpioName& name, Request request) {
    held.reset(new GpioLine);
    std::string why = held->open(name);
    if (why.empty() && request(held->line) != 0) why = gpio_refusal(name, true, errno);
    if (!why.empty()) held.reset();
    return why;
}

}  // namespace

std::string GpioEdges::open(const GpioName& name, Edge edge) {
    const auto request =
        edge == Edge::rising ? ::gpiod_line_request_rising_edge_events : ::gpiod_line_request_falling_edge_events;
    return open_line(held_, name, [&](gpiod_line* line) { return request(line, kGpioConsumer); });
}

GpioEdges::Wait GpioEdges::wait_edge(int timeout_ms, std::uint64_t& t_ns, std::uint32_t& edges) noexcept {
    edges = 0;
    timespec timeout{timeout_ms / 1000, long(timeout_ms % 1000) * 1'000'000};
    while (edges < kWaitingMax) {
        pollfd waiting{::gpiod_line_event_get_fd(held_->line), POLLIN, 0};
        const int ready = ::ppoll(&waiting, 1, &timeout, nullptr);
        if (ready == 0 || (ready < 0 && errno == EINTR)) break;
        if (ready < 0 || (waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) return Wait::disconnected;
        gpiod_line_event event;
        if (::gpiod_line_event_read(held_->line, &event) != 0) return Wait::disconnected;
        t_ns = std::uint64_t(event.ts.tv_sec) * 1'000'000'000u + std::uint64_t(event.ts.tv_nsec);
        ++edges;
        timeout = {};  // further edges only if they have occurred already
    }
    if (edges == kWaitingMax) t_ns = 0;  // newer ones may have been dropped
    return edges != 0 ? Wait::edge : Wait::timeout;
}

int GpioEdges::fd() const noexcept { return held_ != nullptr ? ::gpiod_line_event_get_fd(held_->line) : -1; }

int GpioEdges::level() const noexcept { return ::gpiod_line_get_value(held_->line); }

std::string GpioOutput::open(const GpioName& name, bool high) {
    return open_line(held_, name,
                     [&](gpiod_line* line) { return ::gpiod_line_request_output(line, kGpioConsumer, high ? 1 : 0); });
}

bool GpioOutput::set(bool high) noexcept { return ::gpiod_line_set_value(held_->line, high ? 1 : 0) == 0; }

}  // namespace tactiled
