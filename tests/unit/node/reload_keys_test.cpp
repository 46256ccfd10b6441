// After a reload of any key that it may change, the samples are those of a restart with that key: for each such key of
// [[sensor]] (config/KEYS.md), a day of ten seconds before the reload, one to settle, and one to compare.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "config/keys.hpp"
#include "node/setup.hpp"
#include "tests/unit/config/folder.hpp"
#include "tests/unit/milliseconds.hpp"
#include "tests/unit/node/unit_calibration.hpp"

namespace tactiled {
namespace {

constexpr std::uint64_t kPeriodNs = 10'526'316, kDayNs = 10'000 * kMs;  // 95 Hz

struct Example {
    std::string other;      // the key with another value
    std::string base = "";  // keys without which it does nothing
};
const std::map<std::string, Example> kExamples = {
    {"saturates_at", {"saturates_at = [-5, 5]"}},
    {"temperature_frozen_after", {"temperature_frozen_after = 20"}},
    {"temperature_jump_K", {"temperature_jump_K = 5"}},
    {"frozen_after", {"frozen_after = 20"}},
    {"delay_ms", {"delay_ms = 50"}},
    {"rate_Hz", {"rate_Hz = 50"}},
    {"rate_tolerance", {"rate_tolerance = 0.01", "rate_Hz = 100"}},
    {"drift_limit_N", {"drift_limit_N = 0.05"}},
    {"tare_ms", {"tare_ms = 500", "accept_unproved_age = true"}},
    {"tare_limit_N", {"tare_limit_N = 0.05", "accept_unproved_age = true"}},
    {"accept_unproved_age", {"accept_unproved_age = true"}},
    {"accept_too_quiet", {"accept_too_quiet = true", "accept_too_quiet = false"}},
    {"undetected_damage_limit", {"undetected_damage_limit = 0.5"}},
    {"zero_after", {"zero_after = \"keep\""}},
    {"filter_hz", {"filter_hz = 2"}},
    {"contact_on_N", {"contact_on_N = 2"}},
    {"contact_off_N", {"contact_off_N = 0.15"}},
    {"overload_N", {"overload_N = 4"}},
    {"agrees_with", {"agrees_with = \"b\"\nagree_N = 0.5"}},
    {"agree_N", {"agrees_with = \"b\"\nagree_N = 5", "agrees_with = \"b\"\nagree_N = 0.5"}},
    {"agree_ms", {"agrees_with = \"b\"\nagree_N = 0.5\nagree_ms = 5000", "agrees_with = \"b\"\nagree_N = 0.5"}},
};
class Network final : public Driver {
public:
    Network() { counts[TACTILED_LINK_OPENED] = 1; }
    std::string open() override { return ""; }
    Status read(Frame&, int) noexcept override { return Status::timeout; }
    void close() noexcept override {}
    Route route() const noexcept override { return {.path = Route::Path::network}; }
};

class Daemon {
public:
    explicit Daemon(const std::string& keys) {
        const bool is_noisy = keys.find("accept_too_quiet") != std::string::npos;  // in the calibration
        std::string calibration = test::unit_calibration();
        calibration.replace(calibration.find("sd = [0.01, 0.01, 0.01]"), 23, "sd = [0.2, 0.2, 0.2]");  // no rest is a load
        (void)folder_.write("unit.toml", calibration + "zero_rate_per_h = [0.0, 0.0, 0.0]\n" +
                                             (is_noisy ? "repeats.readings = [0, 0, 0]\nrepeats.interval_s = 0.01\n"
                                                         "repeats.noise = [1e-3, 1e-3, 1e-3]\n"
                                                       : ""));
        const std::string sensor =
            "link = \"line\"\nmodel = \"generic\"\ncalibration = \"unit.toml\"\n"
            "channels = [\"c1\", \"c2\", \"c3\", \"T\"]\ntemperature = \"T\"\n";
        const std::string link = "[[link]]\nname = \"line\"\ndriver = \"uart\"\ndevice = \"/dev/null\"\nformat = \"cobs\"\n";
        const std::string text = fmt::format("{}[[sensor]]\nname = \"a\"\n{}{}\n[[sensor]]\nname = \"b\"\ndevice = 1\n{}",
                                             link, sensor, keys, sensor);
        node_ = load_node(folder_.write("tactiled.toml", text), problems_);
        EXPECT_TRUE(problems_.empty()) << problems_.lines().front();
    }
    void start(std::uint64_t now_ns) {
        for (Sensor& sensor : node_.sensors) sensor.start(7, now_ns);
        node_.links.front()->age.opened(now_ns, true);
    }
    void reload(const std::string& keys) {
        Daemon fresh(keys);
        for (std::size_t i = 0; i < node_.sensors.size(); ++i) node_.sensors[i].retune(fresh.node_.sensors[i]);
    }
    // The samples of both sensors until `end_ns`, at most.
    std::vector<tactiled_sample> run(std::uint64_t begin_ns, std::uint64_t end_ns) {
        std::vector<tactiled_sample> samples;
        for (std::uint64_t i = (begin_ns + kPeriodNs - 1) / kPeriodNs; i * kPeriodNs < end_ns; ++i) {
            for (const std::uint16_t device : {std::uint16_t(1), std::uint16_t(0)}) {
                Frame frame = at(i, device);
                node_.links.front()->age.judge(frame, driver_);
                samples.push_back(node_.sensors[device].sample(frame, frame.t_ns));
            }
            Sensor &a = node_.sensors[0], &b = node_.sensors[1];
            if (a.agrees_with() == 1) samples.back() = a.compare(b.last());
            const std::uint64_t ns = i * kPeriodNs;
            if (ns > 2 * kDayNs && ns % kDayNs >= 9'000 * kMs && ns % kDayNs < 9'000 * kMs + kPeriodNs && a.can_tare())
                a.begin_tare(ns);
            (void)a.poll_tare(ns);
        }
        return samples;
    }

private:
    // A rest of 0.1 N; a press to 8 N; a channel that stands still; a thermometer that jumps and stands still; a difference
    // between both; a tare; device 0 starts again with a zero of its own.
    static Frame at(std::uint64_t i, std::uint16_t device) {
        Frame f;
        f.t_ns = f.taken_ns = i * kPeriodNs;
        f.device = device;
        f.n_channels = 4;
        const double s = double(f.t_ns % kDayNs) * 1e-9, noise = 1e-6 * double(i % 7);
        const double press = s > 3 && s < 5 ? 8 * (1 - std::abs(s - 4)) : 0.1, apart = s > 8 && s < 8.4 ? 1 : 0;
        f.channel = {s > 5 && s < 6 ? 0.25 : noise, -noise, -press - noise - (device == 1 ? apart : 0),
                     s > 7 && s < 8 ? 23 : 23 + (s > 6 && s < 7 ? 2 : 0) + noise};
        if (device == 0 && f.t_ns > 2 * kDayNs && s > 9.5) f.channel[1] += 0.5;
        f.device_time_us = f.t_ns / 1000 + (device == 0 && f.t_ns > 2 * kDayNs && s > 9.5 ? 0 : kDayNs / 1000);
        return f;
    }
    test::Folder folder_;
    Problems problems_;
    Node node_;
    Network driver_;
};

bool is_same(double a, double b) { return (std::isnan(a) && std::isnan(b)) || std::abs(a - b) <= 1e-9; }

// The first difference, "" if there is none. A restart begins another epoch, another sequence and another peak.
std::string difference(const std::vector<tactiled_sample>& is, const std::vector<tactiled_sample>& should_be) {
    EXPECT_EQ(is.size(), should_be.size());
    for (std::size_t n = 0; n < is.size(); ++n) {
        const tactiled_sample &a = is[n], &b = should_be[n];
        const auto differs = [&](const char* what, double x, double y) {
            return fmt::format("{} of sensor {} at {} s: {} instead of {}", what, n % 2 == 0 ? "b" : "a",
                               double(a.t_ns) * 1e-9, x, y);
        };
        if (a.quality != b.quality) return differs("quality", a.quality, b.quality);
        if (a.reasons != b.reasons) return differs("reasons", a.reasons, b.reasons);
        if (a.state != b.state) return differs("state", a.state, b.state);
        if (a.missing != b.missing || a.saturated != b.saturated) return differs("missing", a.missing, b.missing);
        if (!is_same(double(a.temperature_C), double(b.temperature_C)))
            return differs("temperature", double(a.temperature_C), double(b.temperature_C));
        for (std::size_t i = 0; i < 3; ++i) {
            if (!is_same(a.force_S_N[i], b.force_S_N[i])) return differs("force", a.force_S_N[i], b.force_S_N[i]);
            if (!is_same(a.sd_force_N[i], b.sd_force_N[i])) return differs("sd", a.sd_force_N[i], b.sd_force_N[i]);
        }
    }
    return "";
}

std::vector<tactiled_sample> restarted(const std::string& keys) {
    Daemon daemon(keys);
    daemon.start(kDayNs);
    (void)daemon.run(kDayNs, 2 * kDayNs);
    return daemon.run(2 * kDayNs, 3 * kDayNs);
}

TEST(ReloadKeys, EachKeyThatAReloadMayChangeActsAsAfterARestart) {
    for (const KeyTable& table : key_tables())
        for (const ConfigKey& key : table.keys) {
            if (table.name() != "sensor" || key.reload != Reload::tune) continue;
            ASSERT_EQ(kExamples.count(key.name), 1u) << key.name << " needs an example";
            const Example& example = kExamples.at(key.name);
            const bool replaces = !example.base.empty() && example.other.find(example.base.substr(0, 6)) == 0;
            const std::string both = replaces ? example.other : example.base + "\n" + example.other;
            for (const auto& [before, after] : {std::pair{example.base, both}, {both, example.base}}) {
                Daemon daemon(before);
                daemon.start(0);
                (void)daemon.run(0, kDayNs);
                daemon.reload(after);
                (void)daemon.run(kDayNs, 2 * kDayNs);
                EXPECT_EQ(difference(daemon.run(2 * kDayNs, 3 * kDayNs), restarted(after)), "")
                    << key.name << ", now " << after;
            }
            EXPECT_NE(difference(restarted(example.base), restarted(both)), "")
                << key.name << " changes no sample: another example";
        }
}

}  // namespace
}  // namespace tactiled
