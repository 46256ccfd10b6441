// libgpiod 2.x, as in Debian 13. At most 256 edges wait, and the oldest are dropped; the line's sequence number
// counts them.
#include <dirent.h>
#include <gpiod.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <vector>

#include "drivers/gpio.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kWaitingMax = 256;

// Opens a chip by path, name or label. Returns nullptr with errno on failure.
gpiod_chip* open_chip(const std::string& wanted) {
    if (wanted.find('/') != std::string::npos) return ::gpiod_chip_open(wanted.c_str());
    std::vector<std::string> names;
    if (DIR* folder = ::opendir("/dev")) {
        while (const dirent* entry = ::readdir(folder))
            if (std::string(entry->d_name).rfind("gpiochip", 0) == 0) names.emplace_back(entry->d_name);
        ::closedir(folder);
    }
    std::sort(names.begin(), names.end());
    int error = ENOENT;
    for (const auto& name : names) {
        gpiod_chip* chip = ::gpiod_chip_open(("/dev/" + name).c_str());
        if (chip == nullptr) {
            error = errno;  // this may have been the chip: EACCES
            continue;
        }
        gpiod_chip_info* info = ::gpiod_chip_get_info(chip);
        const bool found = name == wanted || (info != nullptr && wanted == ::gpiod_chip_info_get_label(info));
        if (info != nullptr) ::gpiod_chip_info_free(info);
        if (found) return chip;
        ::gpiod_chip_close(chip);
    }
    errno = error;
    return nullptr;
}

gpiod_line_value value_of(bool high) { return high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE; }

}  // namespace

struct GpioLine {
    gpiod_line_request* request = nullptr;
    unsigned offset = 0;
    gpiod_edge_event_buffer* buffer = nullptr;  // for the edges of the line
    unsigned long sequence = 0;                 // number of the last edge

    GpioLine() = default;
    GpioLine(const GpioLine&) = delete;
    GpioLine& operator=(const GpioLine&) = delete;
    ~GpioLine() {
        if (request != nullptr) ::gpiod_line_request_release(request);
        if (buffer != nullptr) ::gpiod_edge_event_buffer_free(buffer);
    }
    std::string open(const GpioName& name, gpiod_line_settings* settings) {
        gpiod_chip* const chip = open_chip(name.chip);
        if (chip != nullptr) ask(chip, name, settings);
        const int error = errno;
        if (chip != nullptr) ::gpiod_chip_close(chip);
        return request != nullptr ? "" : gpio_refusal(name, chip != nullptr, error);
    }

private:
    void ask(gpiod_chip* chip, const GpioName& name, gpiod_line_settings* settings) {
        int found = ::gpiod_chip_get_line_offset_from_name(chip, name.line.c_str());
        if (const auto number = gpio_offset(name); found < 0 && number) found = int(*number);
        if (found < 0) return;
        offset = unsigned(found);
        gpiod_line_config* lines = ::gpiod_line_config_new();
        gpiod_request_config* how = ::gpiod_request_config_new();
        if (lines != nullptr && how != nullptr && settings != nullptr &&
            ::gpiod_line_config_add_line_settings(lines, &offset, 1, settings) == 0) {
            ::gpiod_request_config_set_consumer(how, kGpioConsumer);
            ::gpiod_request_config_set_event_buffer_size(how, kWaitingMax);
            request = ::gpiod_chip_request_lines(chip, how, lines);
        }
        const int error = errno;
        if (how != nullptr) ::gpiod_request_config_free(how);
        if (lines != nullptr) ::gpiod_line_config_free(lines);
        errno = error;
    }
};

void GpioRelease::operator()(GpioLine* line) const noexcept { delete line; }

namespace {

// Requests the line with the settings that `choose` sets. Returns "" or the fault.
template <class Choose>
std::string open_line(HeldGpioLine& held, const GpioName& name, Choose choose) {
    held.reset(new GpioLine);
    gpiod_line_settings* settings = ::gpiod_line_settings_new();
    if (settings != nullptr) choose(settings);
    std::string why = held->open(name, settings);
    if (settings != nullptr) ::gpiod_line_settings_free(settings);
    if (!why.empty()) held.reset();
    return why;
}

}  // namespace

std::string GpioEdges::open(const GpioName& name, Edge edge) {
    std::string why = open_line(held_, name, [&](gpiod_line_settings* settings) {
        ::gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_INPUT);
        ::gpiod_line_settings_set_edge_detection(settings,
                                                 edge == Edge::rising ? GPIOD_LINE_EDGE_RISING : GPIOD_LINE_EDGE_FALLING);
        ::gpiod_line_settings_set_event_clock(settings, GPIOD_LINE_CLOCK_MONOTONIC);
    });
    if (why.empty()) held_->buffer = ::gpiod_edge_event_buffer_new(kWaitingMax);
    return why;
}

GpioEdges::Wait GpioEdges::wait_edge(int timeout_ms, std::uint64_t& t_ns, std::uint32_t& edges) noexcept {
    edges = 0;
    pollfd waiting{::gpiod_line_request_get_fd(held_->request), POLLIN, 0};
    const timespec timeout{timeout_ms / 1000, long(timeout_ms % 1000) * 1'000'000};
    const int ready = ::ppoll(&waiting, 1, &timeout, nullptr);
    if (ready == 0 || (ready < 0 && errno == EINTR)) return Wait::timeout;
    if (ready < 0 || (waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) return Wait::disconnected;
    const int n = ::gpiod_line_request_read_edge_events(held_->request, held_->buffer, kWaitingMax);
    if (n <= 0) return Wait::disconnected;
    gpiod_edge_event* last = ::gpiod_edge_event_buffer_get_event(held_->buffer, static_cast<unsigned long>(n - 1));
    t_ns = ::gpiod_edge_event_get_timestamp_ns(last);
    const unsigned long sequence = ::gpiod_edge_event_get_line_seqno(last);
    edges = std::uint32_t(sequence - held_->sequence);  // includes edges that the kernel dropped
    held_->sequence = sequence;
    return Wait::edge;
}

int GpioEdges::fd() const noexcept { return held_ != nullptr ? ::gpiod_line_request_get_fd(held_->request) : -1; }

int GpioEdges::level() const noexcept {
    const gpiod_line_value value = ::gpiod_line_request_get_value(held_->request, held_->offset);
    return value == GPIOD_LINE_VALUE_ERROR ? -1 : value == GPIOD_LINE_VALUE_ACTIVE ? 1 : 0;
}

std::string GpioOutput::open(const GpioName& name, bool high) {
    return open_line(held_, name, [&](gpiod_line_settings* settings) {
        ::gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_OUTPUT);
        ::gpiod_line_settings_set_output_value(settings, value_of(high));
    });
}

bool GpioOutput::set(bool high) noexcept {
    return ::gpiod_line_request_set_value(held_->request, held_->offset, value_of(high)) == 0;
}

}  // namespace tactiled
