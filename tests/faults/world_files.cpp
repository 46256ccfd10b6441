// The configuration of the world's daemon, its calibrations, and their changes during a run.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "clock.hpp"
#include "world.hpp"

namespace tactiled::faults {
namespace {

// The files of this process.
const std::string& folder() {
    static const std::string made = fmt::format("/tmp/world-{}", ::getpid());
    std::filesystem::create_directory(made);
    return made;
}

// Writes a calibration of `gain` newtons per count; a jaw's zero is its own offset.
void write_calibration(const std::string& name, double gain, unsigned sensor) {
    const auto zero = [&](unsigned k) { return is_jaw(sensor) ? place_of(sensor, k) : 0; };
    std::ofstream(folder() + "/" + name) << fmt::format(
        "format = 1\nmodel = \"generic\"\nmethod = \"matrix\"\nchannels = [\"a\", \"b\", \"c\"]\n"
        "channel_unit = \"counts\"\nzero = [{}.0, {}.0, {}.0]\ncomponents = [\"fx\", \"fy\", \"fz\"]\n"
        "matrix = [[{}, 0.0, 0.0], [0.0, {}, 0.0], [0.0, 0.0, {}]]\nsd = [0.07, 0.07, 0.07]\n"
        "full_scale = [500.0, 500.0, 500.0]\n",
        zero(0), zero(1), zero(2), gain, gain, gain);
}

}  // namespace

// Links 0 (binary) and 1 (text) have one sensor each, which are compared; link 2 (binary) has two, the jaws of a
// gripper.
std::string World::write_configuration() const {
    std::string text =
        fmt::format("[node]\nname = \"{}\"\n[modbus]\nlisten = \"\"\nsettings = \"{}/settings.toml\"\n", name_, folder());
    for (unsigned link = 0; link < kLinks; ++link)
        text += fmt::format(
            "[[link]]\nname = \"l{}\"\ndriver = \"uart\"\ndevice = \"/dev/none\"\n{}", link,
            link == 1 ? "format = \"lines\"\nchannels = 3\nsequence = true\nchecksum = true\n" : "format = \"cobs\"\n");
    for (unsigned i = 0; i < kSensors; ++i) {
        const bool second = i == kRecalibrated && knobs_.second_calibration;
        const std::string file = fmt::format("unit{}{}.toml", i, second ? "b" : "");
        write_calibration(file, i == kRecalibrated ? knobs_.gain_N() : kN_per_count, i);
        text += fmt::format(
            "[[sensor]]\nname = \"s{}\"\nlink = \"l{}\"\ndevice = {}\nmodel = \"generic\"\ncalibration = \"{}\"\n"
            "stale_ms = {}\nfrozen_after = {}\nrate_Hz = 250\nsaturates_at = [-8388608, 8388607]\n",
            i, World::link_of(i), i == 3 ? 1 : 0, file, kStaleMs, kFrozenAfter);
        if (i == 0) text += fmt::format("agrees_with = \"s1\"\nagree_N = 45\nagree_ms = {}\n", kAgreeMs);
        if (i == 1) text += fmt::format("filter_hz = {}\n", knobs_.filter_Hz);
        if (is_jaw(i)) text += fmt::format("tare_ms = {}\ntare_limit_N = {}\n", knobs_.tare_ms, kTareLimit_N);
    }
    text += fmt::format(
        "[grasp]\ngravity_G_m_s2 = [0, 0, 9.81]\nlift_accelerates_ms = 50\nweigh_window_ms = 50\n"
        "objects = \"{}/objects.toml\"\n",
        folder());
    for (const unsigned jaw : {2u, 3u})
        text += fmt::format("[[grasp.jaw]]\nsensor = \"s{}\"\nx_S_in_G = [0, 0, 1]\nz_S_in_G = [{}, 0, 0]\n", jaw,
                            jaw == 2 ? 1 : -1);
    if (plant_ != nullptr && !plant_->configuration[0].empty())
        for (std::size_t at = 0; (at = text.find(plant_->configuration[0], at)) != text.npos;
             at += plant_->configuration[1].size())
            text.replace(at, plant_->configuration[0].size(), plant_->configuration[1]);
    const std::string path = folder() + "/tactiled.toml";
    std::ofstream(path) << text;
    return path;
}

void World::retune() {
    knobs_.filter_Hz = 65 - knobs_.filter_Hz;  // 25, 40
    knobs_.tare_ms = 81 - knobs_.tare_ms;      // 40, 41
    write_configuration();
    reload();
}

void World::recalibrate() {
    knobs_.second_calibration = !knobs_.second_calibration;
    write_configuration();
    if (!is_running()) return;
    witness_->expect_gain(kRecalibrated, knobs_.gain_N(), devices());
    reload();
    witness_->settle_gain(kRecalibrated, in_force_ == knobs_, devices());
}

void World::reload_broken() {
    std::ofstream(write_configuration()) << "[[sensor]]\n";
    reload();
    refused_ = true;
    write_configuration();
}

// Sends SIGHUP. While the daemon waits for its loop the world continues. Its log is not shown.
void World::reload() {
    if (!is_running()) return;
    const std::uint32_t before = seen_.header().reloads;
    reported_from_ns_ = UINT64_MAX;
    const int standard_error = ::dup(STDERR_FILENO), nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    ::dup2(nowhere, STDERR_FILENO);
    while_asleep = [this](std::uint64_t until_ns) { run_ms((until_ns - world_ns + kMs - 1) / kMs); };
    reloader_->reload(*pipeline_);
    while_asleep = nullptr;
    ::dup2(standard_error, STDERR_FILENO);
    ::close(standard_error);
    ::close(nowhere);
    if (seen_.header().reloads != before) in_force_ = knobs_;
    refused_ = in_force_ != knobs_;
    reported_from_ns_ = std::max(world_ns, stalled_until_ns_) + kReportMs * kMs;
}

}  // namespace tactiled::faults
