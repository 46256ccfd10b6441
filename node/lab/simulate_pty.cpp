// A scene as devices behind ptys, at the scene's pace: the data that the simulator's sensors would send, in either
// wire format.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "drivers/sim/arrivals.hpp"
#include "node/ctl/verb.hpp"
#include "node/lab/simulate.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kClockOffset_us = 1e6;  // 0 would mean that the device has no clock

void check(const sim::Scene& scene, const std::vector<std::string>& ptys, const Wire& wire) {
    const std::size_t sensors = scene.sensors.size();
    const auto carries_several = [](const StreamFormat& format) {
        return format.encode != nullptr && format.max_devices > 1;
    };
    const auto for_all = [&] { return fmt::format("{}", fmt::join(StreamFormats::names(carries_several), " or ")); };
    const StreamFormat& format = wire.format();
    if (ptys.size() == 1 && sensors > 1) {
        if (format.max_devices == 1)
            throw SetupError(
                fmt::format("--pty: {} sensors; frames of format {} do not name their sensor: give {} times --pty, or "
                            "--format {}",
                            sensors, format.name, sensors, for_all()));
        if (sensors > format.max_devices)
            throw SetupError(fmt::format("--pty: {} sensors; a link carries at most {} devices: give {} times --pty",
                                         sensors, format.max_devices, sensors));
    } else if (ptys.size() != sensors) {
        throw SetupError(
            fmt::format("--pty: given {} times for {} sensors: one for each, in the scene's order, or, with "
                        "--format {}, one for all",
                        ptys.size(), sensors, for_all()));
    }
}

// The frames of one sensor as they arrive: a dropped frame is a gap in the counter, which follows the samples.
struct Device {
    Port* port;
    sim::Arrivals arrivals;

    // The device's clock follows the host's clock and not the scene's.
    static std::uint64_t time_us(double t_s, double speed) {
        return std::uint64_t(std::max(0.0, t_s) / speed * 1e6 + kClockOffset_us);
    }

    static Frame frame(const sim::Sensor& sensor, const sim::SentFrame& sent, bool shares_port, double speed) {
        Frame frame;
        frame.sequence = std::uint32_t(sent.sample / sensor.every);
        frame.device_time_us = time_us(sent.t_s, speed);
        frame.device = shares_port ? sensor.device : std::uint16_t(0);
        frame.n_channels = std::uint8_t(sensor.n());
        for (std::size_t k = 0; k < sensor.n(); ++k)
            frame.channel[k] = (sent.missing >> k & 1u) != 0 ? std::numeric_limits<double>::quiet_NaN() : sent.channel[k];
        return frame;
    }
};

}  // namespace

int play_scene(const sim::Scene& scene, const std::string& effects, const std::vector<std::string>& ptys, const Wire& wire,
               double speed) {
    check(scene, ptys, wire);
    catch_interrupt();
    sim::Simulation simulation(scene, effects);
    const std::size_t sensors = scene.sensors.size();
    std::vector<std::unique_ptr<Port>> ports;
    for (const auto& pty : ptys) ports.push_back(std::make_unique<Port>(pty));
    for (const auto& port : ports) wait_for_reader(*port);
    std::vector<Device> devices;
    for (std::size_t i = 0; i < sensors; ++i)
        devices.push_back({ports[std::min(i, ports.size() - 1)].get(), sim::Arrivals(scene.sensors[i])});

    std::uint64_t sent = 0, dropped = 0;
    std::vector<const sim::Block*> block(sensors);
    const std::uint64_t began_ns = monotonic_ns();
    for (std::uint64_t done = 0; done < scene.samples && interrupted == 0; done += block[0]->n) {
        for (std::size_t i = 0; i < sensors; ++i) block[i] = &simulation.advance(i);
        for (std::size_t n = 0; n < block[0]->n && interrupted == 0; ++n) {
            const std::uint64_t sample = done + n;
            const std::uint64_t due_ns = began_ns + std::uint64_t(double(sample) / scene.rate_Hz / speed * 1e9);
            wire.answer_until(due_ns, ports);
            for (std::size_t i = 0; i < sensors && interrupted == 0; ++i) {
                devices[i].port->set_clock(Device::time_us(block[i]->t_s[n], speed), due_ns);
                for (const sim::SentFrame& frame : devices[i].arrivals.take(*block[i], n))
                    ++(wire.send(*devices[i].port, Device::frame(scene.sensors[i], frame, ports.size() < sensors, speed))
                           ? sent
                           : dropped);
            }
        }
    }
    let_reader_finish();
    fmt::print(stderr, "simulate: {} frames sent, {} dropped because no program read them\n", sent, dropped);
    return kGood;
}

}  // namespace tactiled::ctl
