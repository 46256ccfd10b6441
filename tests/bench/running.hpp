// A sensor of a daemon without its threads and links: calibration and keys from files, frames from memory, time without
// waiting.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "config/calibration.hpp"
#include "node/sensor.hpp"
#include "node/setup.hpp"
#include "node/zero_store.hpp"

namespace tactiled {

using Numbers = std::vector<double>;

class Running {
public:
    // `keys`: of the [[sensor]].
    Running(const std::filesystem::path& folder, const Calibration& calibration, const std::string& keys)
        : file_(folder / "tactiled.toml"), zeros_of_(folder / "zeros.toml") {
        save_calibration(calibration, folder / "made.toml");
        std::string channels;
        for (const std::string& name : calibration.channels) channels += fmt::format("\"{}\", ", name);
        std::ofstream(file_)
            << "[[link]]\nname = \"line\"\ndriver = \"uart\"\ndevice = \"/dev/null\"\nformat = \"cobs\"\n[[sensor]]\n"
               "name = \"made\"\nlink = \"line\"\nmodel = \"generic\"\ncalibration = \"made.toml\"\nchannels = ["
            << channels << "]\n"
            << keys;
        node_ = load();
        sensor().start(1, 0);
    }
    // Sends a frame, `after_ns` later than the one before.
    tactiled_sample send(const Numbers& numbers, std::uint64_t after_ns) {
        Frame frame;
        frame.n_channels = std::uint8_t(numbers.size());
        std::copy(numbers.begin(), numbers.end(), frame.channel.begin());
        t_ns_ += after_ns;
        frame.t_ns = t_ns_;
        frame.opening = opening_;
        if (has_clock) frame.device_time_us = (t_ns_ - started_ns_) / 1000 + 1;
        frame.has_sequence = has_number;
        frame.sequence_bits = bits;
        frame.sequence = number_++ & ((1u << bits) - 1);
        frame.missing = missing;
        const tactiled_sample s = sensor().sample(frame, t_ns_);
        if (zeros_ != nullptr && sensor().poll_tare(t_ns_) == Tare::done) keep_zero();
        return s;
    }
    void tare() { sensor().begin_tare(t_ns_); }

    // ---- the device: its clock, its number, and the channels without a value ----

    bool has_clock = true, has_number = false;
    std::uint8_t bits = 16;  // width of the number
    std::uint32_t missing = 0;
    void restart_device(std::uint32_t number = 0) {
        started_ns_ = t_ns_;
        number_ = number;
    }
    // It sends nothing for this time, in which its number goes on by `unsent`; the link is closed where it is not connected.
    void wait(std::uint64_t ns, bool is_connected, std::uint32_t unsent = 0) {
        number_ += unsent;
        constexpr std::uint64_t kStep_ns = 10'000'000;
        for (std::uint64_t passed_ns = 0; passed_ns < ns; passed_ns += kStep_ns) {
            t_ns_ += kStep_ns;
            if (sensor().has_discontinuity(is_connected, t_ns_)) (void)sensor().marker(t_ns_);
        }
        if (!is_connected) ++opening_;
    }

    // ---- the daemon, which keeps its zeros in a file ----

    void keep_zeros(const std::map<std::string, tactiled_sample>& killed = {}) {
        zeros_ = std::make_unique<ZeroStore>(ZeroFiles{zeros_of_, zeros_of_}, node_.zeros);
        zeros_->restore(node_.sensors, killed);
    }
    // Ends the daemon, in order or with its last sample alone; start_daemon() begins the next run.
    void end_daemon(bool is_killed) {
        killed_.clear();
        if (is_killed)
            killed_["made"] = sensor().last();
        else
            zeros_->keep_last(node_.sensors);
        zeros_.reset();
    }
    void start_daemon(std::uint64_t after_ns) {
        t_ns_ += after_ns;
        ++opening_;
        node_ = load();
        keep_zeros(killed_);
        sensor().start(2, t_ns_);
    }
    // Exchanges the sensor, like a reload after the change of a key that measures in another way.
    void reload() {
        Node fresh = load();
        zeros_->replace_owner(0, fresh.zeros[0]);
        fresh.sensors[0].succeed(sensor());
        std::swap(sensor(), fresh.sensors[0]);
        (void)sensor().marker(t_ns_);
    }
    [[nodiscard]] const std::string& file_of_zeros() const { return zeros_of_; }

private:
    [[nodiscard]] Sensor& sensor() { return node_.sensors[0]; }
    [[nodiscard]] Node load() const {
        Problems problems;
        Node node = load_node(file_, problems);
        problems.throw_if_any();
        return node;
    }
    void keep_zero() {
        zeros_->add(0, sensor());
        for (const std::uint32_t order = zeros_->commit(); !zeros_->is_done(order);) std::this_thread::yield();
    }

    std::string file_, zeros_of_;
    Node node_;
    std::unique_ptr<ZeroStore> zeros_;
    std::map<std::string, tactiled_sample> killed_;
    std::uint64_t t_ns_ = 0, started_ns_ = 0;
    std::uint32_t number_ = 0, opening_ = 1;
};

}  // namespace tactiled
