// Findings about a valid configuration with which a fault would not be detected or a function cannot work.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "config/calibration.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/grasp/grasp.hpp"
#include "decoupling/temperature.hpp"
#include "node/ctl/doctor/doctor.hpp"
#include "node/modbus/encode.hpp"
#include "node/setup.hpp"

namespace tactiled::ctl::doctor {
namespace {

// Below it a count of a register is more than a percent of full scale.
constexpr double kMinCounts = 100;

// Returns the power of ten of which full scale is 1,500 to 15,000 counts: twice as much still fits into a register.
double count_for(double full_N) { return std::clamp(std::pow(10, std::ceil(std::log10(full_N / 15'000))), 1e-6, 10.0); }

// Returns the magnitude of the largest calibrated force; NaN if no component has a full scale.
double full_scale_N(const tactiled_sensor& sensor) {
    double squares = 0;
    bool known = false;
    for (std::size_t c = 0; c < 3; ++c)
        if (const double each = double(sensor.full_scale[c]); std::isfinite(each)) {
            squares += each * each;
            known = true;
        }
    return known ? std::sqrt(squares) : std::nan("");
}

// Returns the number of channels that the link's own key `channels` gives to each frame; 0 if the key is missing or
// not a number. The file is read again: a key of another type is not an error here.
unsigned channels_of_frame(const Config& config, const std::string& link_name) {
    Problems ignored;
    Options root = Options::parse_file(config.path, ignored);
    for (Options& link : root.tables("link")) {
        if (link.text("name", "") != link_name || !link.has("channels")) continue;
        const std::size_t before = ignored.lines().size();
        const auto n = link.integer("channels", {1, double(kMaxChannels)}, 0);
        return ignored.lines().size() == before ? unsigned(n) : 0;
    }
    return 0;
}

void look_at_channels(const Config& config, const SensorSettings& sensor, const tactiled_sensor& entry, Findings& found) {
    const unsigned sent = channels_of_frame(config, sensor.link);
    Problems ignored;
    const bool has_dummy = !load_calibration(sensor.calibration, ignored).temperature.dummy.empty();
    const std::size_t expected = sensor.channels.empty() ? entry.n_channels + (has_dummy ? 1 : 0) : sensor.channels.size();
    if (sent != 0 && sent != expected)
        found.wrong("channels",
                    fmt::format("sensor \"{}\": a frame of link \"{}\" has {} channels, {} has {}: every sample would be "
                                "BAD:wrong-device",
                                sensor.name, sensor.link, sent, sensor.channels.empty() ? "the calibration" : "`channels`",
                                expected),
                    sensor.channels.empty()
                        ? fmt::format("name all {} channels of the frame in order, \"-\" = not used: channels = [...]", sent)
                        : "write one name a channel of the frame, \"-\" = not used");
}

// "a channel that", or of some channels "channel C1 that": those for which no limit of equal readings is known. "" = none.
std::string channels_that_may_freeze(const SensorSettings& s, bool noisy) {
    if (s.frozen_after > 0 || (s.frozen_after < 0 && noisy)) return "";
    Problems ignored;
    const Calibration calibration = load_calibration(s.calibration, ignored);
    const std::vector<int>& readings = calibration.repeats.readings;
    if (s.frozen_after == 0) return "a channel that";
    std::vector<std::string> unknown;
    for (std::size_t k = 0; k < readings.size(); ++k)
        if (readings[k] == 0) unknown.push_back(calibration.channels[k]);
    return unknown.empty() ? "" : fmt::format("channel {}, still in the calibration, that", fmt::join(unknown, " "));
}

// Returns true if the temperature makes the estimate without a load UNCERTAIN where none is measured.
bool is_uncertain_at_rest(const SensorSettings& s, const Calibration& calibration) {
    DecouplerFault fault;
    const auto decoupler = make_decoupler(calibration, s.method == "auto" ? "" : s.method, 0, fault);
    if (decoupler == nullptr || calibration.zero.size() != calibration.channels.size()) return false;
    decoupler->set_temperature(temperature_in_use(s));
    return (decoupler->decouple({.channel = calibration.zero}).reasons & TACTILED_TEMPERATURE) != 0;
}

// Reports what the temperature of a model can do that the calibration does not know, and a thermometer that may stand still.
void look_at_temperature(const SensorSettings& s, const tactiled_sensor& entry, Findings& found) {
    Problems ignored;
    const Calibration calibration = load_calibration(s.calibration, ignored);
    const bool is_declared = std::isfinite(s.temperature_range_C[0]);
    const bool has_none = s.temperature.empty() && s.temperature_of.empty() && calibration.temperature.dummy.empty();
    const auto advise = [&](const std::string& says, const std::string& remedy) {
        found.advice("temperature", fmt::format("sensor \"{}\": {}", s.name, says), remedy);
    };
    if (const TemperatureEffect* const effect = temperature_effect(calibration); effect != nullptr) {
        if (!effect->channel_unit.empty() && effect->channel_unit != calibration.channel_unit) {
            advise(
                fmt::format(
                    "model \"{}\" follows temperature, and its coefficient is known in {}, not in {}: every value is "
                    "UNCERTAIN:temperature",
                    entry.model, effect->channel_unit, calibration.channel_unit),
                "calibrate with temperature_C over at least 2 K, or with channels in " + std::string(effect->channel_unit));
            return;
        }
        const bool is_uncertain = is_uncertain_at_rest(s, calibration);
        const double width_K = is_declared ? s.temperature_range_C[1] - s.temperature_range_C[0] : kRoom_K;
        const double sd_K = std::hypot(width_K, std::isfinite(s.temperature_sd_K) ? s.temperature_sd_K : kUnstated_K);
        if (is_uncertain || !is_declared)
            advise(
                fmt::format("model \"{}\" follows temperature, and the calibration does not know by how much: the standard "
                            "deviation contains {:.3g} K{}",
                            entry.model, sd_K,
                            is_uncertain ? ", which is so much that every value is UNCERTAIN:temperature" : ""),
                fmt::format("temperature_range_C = [20, 24]  # lowest and highest in use; temperature_sd_K = 0.1: how well "
                            "they are known; or calibrate with {}",
                            effect->dummy.empty() ? "temperature_C over at least 2 K"
                                                  : fmt::format("a dummy, column {}", effect->dummy)));
    }
    if (!calibration.temperature.zero_per_K.empty() && has_none)
        advise("the calibration takes temperature off, but the sensor has none",
               "temperature = the name in `channels`, or temperature_of = another sensor");
    if (!s.temperature.empty() && s.temperature_frozen_after <= 0)
        advise("unless the chip's noise moves it, a thermometer that stands still counts as true",
               "temperature_frozen_after = 1000  # many times the repeats of a good one");
}

void look_at_sensor(const Node& node, std::size_t i, Findings& found) {
    const SensorSettings& s = node.config.sensors[i];
    const tactiled_sensor& entry = node.plan.sensors[i];
    const auto advise = [&](const char* check, const std::string& says, const std::string& remedy) {
        found.advice(check, fmt::format("sensor \"{}\": {}", s.name, says), remedy);
    };
    look_at_channels(node.config, s, entry, found);
    if (s.rate_Hz <= 0)
        advise("rate", "no rate is declared: a device that sends too rarely is not detected",
               "rate_Hz = 100  # as the device is set; tactilectl status shows the rate of a good one");
    Problems none;
    const Calibration calibration = load_calibration(s.calibration, none);
    const double period_ms = s.rate_Hz > 0 ? 1e3 / s.rate_Hz : 1e3 * calibration.repeats.interval_s;  // 0: not known
    if (2 * period_ms > s.stale_ms)
        advise(
            "stale",
            fmt::format("its frames are {:.0f} ms apart, and without one for stale_ms = {} there is no value: a late frame "
                        "is an outage",
                        period_ms, s.stale_ms),
            fmt::format("stale_ms = {:.0f}", std::min(10'000.0, std::ceil(3 * period_ms / 100) * 100)));
    const auto link = std::find_if(node.links.begin(), node.links.end(), [&](const auto& l) { return l->name == s.link; });
    const bool noisy =
        link != node.links.end() && (*link)->driver != nullptr && (*link)->driver->is_noisy(std::uint16_t(s.device));
    look_at_temperature(s, entry, found);
    if (const std::string which = channels_that_may_freeze(s, noisy); !which.empty())
        advise("frozen", which + " repeats one number for ever counts as good",
               "frozen_after = 100  # many times the repeats of a recording at rest");
    else if (s.frozen_after < 0 && !noisy && calibration.repeats.readings.empty() && entry.n_taxels == 0)
        advise("frozen", "a channel that repeats one number for 10 s counts as dead: a coarse sensor at rest does so, too",
               "frozen_after = 0  # for a coarse sensor; or frozen_after = 1000, many times the repeats of one at rest");
    const double full_N = full_scale_N(entry);
    if (node.config.modbus.enabled() && full_N / s.register_N < kMinCounts)
        advise(
            "registers",
            fmt::format("its full scale of {:.3g} N is {:.0f} counts of {:g} N in the registers", full_N,
                        full_N / s.register_N, s.register_N),
            fmt::format("register_N = {:g}  # {:.0f} counts; the PLC reads the size of a count from SCALE, or reads floats",
                        count_for(full_N), full_N / count_for(full_N)));
    if (node.config.modbus.enabled() && full_N / s.register_N > modbus::kMaxI16)
        advise("registers",
               fmt::format("its full scale of {:.3g} N is beyond the registers, which end at {:g} N", full_N,
                           modbus::kMaxI16 * s.register_N),
               fmt::format("register_N = {:g}  # the PLC reads the size of a count from SCALE, or reads floats",
                           count_for(full_N)));
    if (s.tare_limit_N == 0 || (s.tare_limit_N < 0 && std::isnan(full_N)))
        advise("tare_limit", "a tare under any load is accepted",
               s.tare_limit_N == 0 ? "leave out tare_limit_N: 20 % of full scale; or a value in N" : "tare_limit_N = 0.5");
    if (s.contact_on_N > full_N)
        advise("contact",
               fmt::format("contact_on_N = {:g} is beyond its full scale of {:.3g} N: contact is never detected",
                           s.contact_on_N, full_N),
               fmt::format("contact_on_N = {:.2g}", full_N / 10));
}

// Reports how large a swing of the hand may be and its crest still looks like a load at rest, where the weight does not
// wait for the longest time after the lift.
void look_at_swings(const GraspSettings& grasp, Findings& found) {
    if (grasp.lift_accelerates_ms >= grasp::Setup{}.lift_accelerates_ms) return;
    const auto up_to = [](double frequency_Hz, double window_ms) {
        const double a_m_s2 = grasp::max_hidden_swing_m_s2(frequency_Hz, window_ms);
        return std::isfinite(a_m_s2) ? fmt::format("up to {:.2g} m/s2", a_m_s2) : "any size";
    };
    const double longer_ms = std::min(1000.0, 2 * grasp.weigh_window_ms);
    found.advice(
        "grasp",
        fmt::format("weigh_window_ms = {:g} with lift_accelerates_ms = {:g}: where the hand swings along gravity from the "
                    "lift on, a crest of {} at 1 Hz, or of {} at 0.5 Hz, looks like a load at rest, and its "
                    "acceleration is weighed as mass",
                    grasp.weigh_window_ms, grasp.lift_accelerates_ms, up_to(1, grasp.weigh_window_ms),
                    up_to(0.5, grasp.weigh_window_ms)),
        fmt::format("if the hand can swing: lift_accelerates_ms = {:g}, or weigh_window_ms = {:g} ({} at 1 Hz), or let "
                    "the robot report its acceleration",
                    grasp::Setup{}.lift_accelerates_ms, longer_ms, up_to(1, longer_ms)));
}

}  // namespace

void look_at_safety(const Node& node, Findings& found) {
    if (node.config.grasp) look_at_swings(*node.config.grasp, found);
    for (const auto& link : node.links)
        if (const std::string advice = link->driver != nullptr ? link->driver->advice() : ""; !advice.empty())
            found.advice("line", fmt::format("link \"{}\": {}", link->name, advice), "");
    for (std::size_t i = 0; i < node.config.sensors.size(); ++i) look_at_sensor(node, i, found);
}

void look_at_identity(const Node& node, Findings& found) {
    for (std::size_t i = 0; i < node.config.sensors.size(); ++i) {
        const SensorSettings& s = node.config.sensors[i];
        const std::string serial = node.plan.sensors[i].serial;
        const auto say = [&](Verdict verdict, const std::string& says, const std::string& remedy) {
            found.push_back({"identity", verdict, fmt::format("sensor \"{}\": {}", s.name, says), remedy});
        };
        if (!s.serial_channel.empty())
            say(Verdict::good, fmt::format("each frame is compared with serial {} of the calibration", serial), "");
        else if (!s.expect_serial.empty())
            say(Verdict::good,
                fmt::format("the calibration is of serial {}, as expected; its device reports none, so that a sensor on "
                            "another port is not noticed",
                            serial),
                "");
        else
            say(Verdict::advice,
                "nothing shows that the calibration is of the sensor that is mounted: its device reports no serial",
                "expect_serial = \"" + (serial.empty() ? "..." : serial) +
                    "\"  # as printed on the sensor; `calibrate --serial` writes it; or serial_channel");
        for (std::size_t j = 0; j < i; ++j)
            if (node.config.sensors[j].calibration == s.calibration)
                say(Verdict::advice,
                    fmt::format("has the calibration of sensor \"{}\": two individual sensors differ",
                                node.config.sensors[j].name),
                    "calibrate each sensor by itself");
    }
}

std::string undetected_delays(const Driver& driver) {
    std::string by = driver.freshness();
    const Route route = driver.route();
    if (by.starts_with("cable if"))  // the port is not there now: it may be no local one
        by = by.substr(by.find("else ") + 5);
    else if (route.path != Route::Path::network || by.starts_with("cable"))
        return "";
    std::string not_seen =
        fmt::format("a delay at the first frame after the start, one that grows by less than {} ppm", route.clock_ppm);
    if (!route.reopening_discards && !by.starts_with("arrival")) not_seen += ", one that begins while the device restarts";
    if (by.starts_with("clock")) not_seen += ", one that begins when the device's clock is set on by as much";
    if (by.starts_with("clock (")) return not_seen;
    if (by.starts_with("arrival")) return not_seen + ", any delay without a silence, old or swapped content";
    if (by.starts_with("clock")) not_seen += "; without the device's time also";
    not_seen +=
        ", old content under a new number, one that grows in the 2 s in which the rate is measured, a device that restarts "
        "in a delay and whose counter begins again within 60 s";
    if (route.reopening_discards)
        not_seen += ", a relay that keeps its delay and drops frames while the link is opened again";
    return not_seen;
}

void look_at_freshness(const Node& node, Findings& found) {
    for (const auto& link : node.links)
        for (const auto& binding : link->bindings) {
            const std::string by = link->driver->freshness();
            const bool unproved = by.starts_with("arrival");
            found.push_back({"freshness", unproved ? Verdict::advice : Verdict::good,
                             fmt::format("sensor \"{}\": age proved by {}", node.config.sensors[binding.sensor].name, by),
                             unproved ? "send the device's time or a counter: time_us = true, or sequence = true "
                                        "(drivers/wire/freshness.md)"
                                      : ""});
        }
}

}  // namespace tactiled::ctl::doctor
