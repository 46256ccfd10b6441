// A sensor of a daemon without its threads and links: calibration and keys from files, frames from memory, time without
// waiting.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "node/sensor.hpp"
#include "node/setup.hpp"

namespace tactiled {

using Numbers = std::vector<double>;

// The device has a clock; restart_device() sets it to 0.
class Running {
public:
    // `keys`: of the [[sensor]].
    Running(const std::filesystem::path& folder, const Calibration& calibration, const std::string& keys) {
        save_calibration(calibration, folder / "made.toml");
        std::string channels;
        for (const std::string& name : calibration.channels) channels += fmt::format("\"{}\", ", name);
        std::ofstream(folder / "tactiled.toml")
            << "[[link]]\nname = \"line\"\ndriver = \"uart\"\ndevice = \"/dev/null\"\nformat = \"cobs\"\n[[sensor]]\n"
               "name = \"made\"\nlink = \"line\"\nmodel = \"generic\"\ncalibration = \"made.toml\"\nchannels = ["
            << channels << "]\n"
            << keys;
        Problems problems;
        node_ = load_node(folder / "tactiled.toml", problems);
        problems.throw_if_any();
        node_.sensors[0].start(1, 0);
    }
    // Sends a frame, `after_ns` later than the one before.
    tactiled_sample send(const Numbers& numbers, std::uint64_t after_ns) {
        Frame frame;
        frame.n_channels = std::uint8_t(numbers.size());
        std::copy(numbers.begin(), numbers.end(), frame.channel.begin());
        t_ns_ += after_ns;
        frame.t_ns = t_ns_;
        frame.device_time_us = (t_ns_ - started_ns_) / 1000 + 1;
        return node_.sensors[0].sample(frame, t_ns_);
    }
    void tare() { node_.sensors[0].begin_tare(t_ns_); }
    void restart_device() { started_ns_ = t_ns_; }

private:
    Node node_;
    std::uint64_t t_ns_ = 0, started_ns_ = 0;
};

}  // namespace tactiled
