#include "drivers/chips/schedule.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tactiled {
namespace {
constexpr std::uint64_t kMs = 1'000'000;
constexpr std::uint64_t kMaxOpenNs = 500 * kMs;  // a driver may block for a second, and one further transfer may hang
}  // namespace

void Schedule::add(std::string name, std::unique_ptr<Chip> chip, Place place, std::uint16_t device, LinkCounts& counts,
                   ReadyLine* ready, Selector* selector) {
    if (place.mux != 0) muxes_.add(place.mux);
    stations_.emplace_back(std::move(name), std::move(chip), Port(bus_, muxes_, place, counts, selector), device, counts,
                           ready);
}

Station& Schedule::first_due() noexcept { return *std::ranges::min_element(stations_, {}, &Station::due_ns); }

void Schedule::wait_until(std::uint64_t t_ns) noexcept {
    bus_.wait_until(t_ns);
    for (Station& station : stations_) station.look();
}

std::string Schedule::open() {
    muxes_.forget();
    for (Station& station : stations_) station.start();
    const std::uint64_t until_ns = bus_.now_ns() + kMaxOpenNs;
    for (Station& station : stations_) {
        while (!station.is_settled() && bus_.now_ns() < until_ns) {
            while (bus_.now_ns() < station.due_ns()) wait_until(station.due_ns());
            Frame unused;
            switch (station.step(unused)) {
                case Station::Outcome::hangs:
                    return "the bus hangs, a transfer to " + station.place() +
                           " was never answered: SDA or SCL is held low, or the adapter has stopped; switch chips and "
                           "adapter off and on";
                case Station::Outcome::disconnected: return "the adapter is disconnected; plug it in again";
                default: break;
            }
        }
        if (station.is_wrong()) return station.complaint();
    }
    if (std::none_of(stations_.begin(), stations_.end(), [](const Station& s) { return s.answers(); }))
        return stations_.front().complaint() + (stations_.size() > 1 ? ", nor does any other chip" : "");
    return "";
}

Status Schedule::read(Frame& frame, int timeout_ms) noexcept {
    const std::uint64_t until_ns = bus_.now_ns() + std::uint64_t(timeout_ms) * kMs;
    do {
        wait_until(std::min(first_due().due_ns(), until_ns));
        Station& station = first_due();
        if (bus_.now_ns() < station.due_ns()) continue;
        switch (station.step(frame)) {
            case Station::Outcome::frame: return Status::frame;
            case Station::Outcome::nothing: break;
            case Station::Outcome::hangs:
            case Station::Outcome::disconnected: return Status::disconnected;
        }
    } while (bus_.now_ns() < until_ns);
    return Status::timeout;
}

}  // namespace tactiled
