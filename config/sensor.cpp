// [[sensor]]: the channels of a frame, the model that converts them to a force, and the limits of the force.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "config/names.hpp"
#include "config/tables.hpp"

namespace tactiled {
namespace {

constexpr std::array<double, 2> kNoRange = {std::numeric_limits<double>::quiet_NaN(),
                                            std::numeric_limits<double>::quiet_NaN()};
constexpr double kUnset = std::numeric_limits<double>::quiet_NaN();  // cannot be in a file

void check_channels(Options& table, const std::vector<std::string>& channels) {
    const auto wrong = [&](const std::string& why) { table.problem("channels", why); };
    std::size_t used = 0;
    for (auto at = channels.begin(); at != channels.end(); ++at) {
        if (*at == "-") continue;
        ++used;
        if (!valid_channel(*at)) wrong(fmt::format("channels has {}; {}", in_quotes(*at), kValidChannel));
        if (std::find(channels.begin(), at, *at) != at)
            wrong(fmt::format("channels has {} twice; write \"-\" for a channel that is not used", in_quotes(*at)));
    }
    if (!channels.empty() && used == 0) wrong("channels uses none of the frame's channels; \"-\" stands for one not used");
}

}  // namespace

const Fields<SensorSettings>& sensor_fields() {
    using S = SensorSettings;
    static const SensorTuning d;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, name), kRequired, Text::name, "Name of the sensor, unique, as commands and readers refer to it."},
        {TACTILED_KEY(S, link), kRequired, Text::any, "Name of a [[link]]."},
        {TACTILED_KEY(S, device), 0, range(0, 65'535), "", "Number of the device, where the link carries several."},
        {TACTILED_KEY(S, channels), "the channels of the calibration, in its order", Count{1, kMaxChannels},
         "Names of the channels of the frame, in order; \"-\" = not used."},
        {TACTILED_KEY(S, counts_per_unit), 1, range(1e-18, 1e18), "",
         "The raw number of the frame divided by this value is in the unit of the calibration."},
        {TACTILED_KEY(S, saturates_at), Default(d.saturates_at, "only what the driver reports"), range(-1e300, 1e300),
         "raw numbers", "A channel at or beyond one of the two, [lowest, highest], is saturated."},
        {TACTILED_KEY(S, temperature), "", Text::any,
         "The name in `channels` that is the sensor's temperature in degC; \"\" = the link delivers none. A dummy is named "
         "by "
         "the calibration, not here."},
        {TACTILED_KEY(S, temperature_of), "", Text::any,
         "Another [[sensor]] that has a `temperature`, where both are of the same temperature; \"\" = none."},
        {TACTILED_KEY(S, temperature_range_C), Default(kNoRange, "10 K wide for hairs, gauges and pads; else not declared"),
         range(-273.15, 1000), "degC",
         "[lowest, highest] in use. The standard deviation contains what the range can change where the coefficient is "
         "known, by the calibration or by the model, and the calibration cannot take the temperature off. Equal numbers = "
         "constant within temperature_sd_K. A measured temperature outside of the range is UNCERTAIN."},
        {TACTILED_KEY(S, temperature_sd_K), Default(kUnset, "0.5, but 0 where a thermometer or a dummy measures"),
         range(1e-6, 100), "K",
         "Standard deviation with which the temperature is known: of the ends of temperature_range_C, of the remainder that "
         "compensating electronics leave, or of the thermometer. The standard deviation of the force contains its change; "
         "the calibration or the model must know the coefficient."},
        {TACTILED_KEY(S, temperature_difference_K),
         Default(kUnset,
                 "0.5, at most the width of temperature_range_C and temperature_sd_K together; with a dummy as calibrated"),
         range(0, 100), "K",
         "Largest difference of temperature between two channels, or between a channel and the thermometer or dummy. The "
         "standard deviation contains what it can change."},
        {TACTILED_KEY(S, temperature_frozen_after),
         Default(d.temperature_frozen_after, "0, but 100 if the driver knows that noise moves every number"),
         range(0, 1'000'000), "readings",
         "A temperature that repeats one number this often (2 or more) is not used; 0 = it may repeat."},
        {TACTILED_KEY(S, temperature_jump_K), Default(d.temperature_jump_K, "1, but no limit for a dummy"),
         range(0.01, 1000), "K",
         "A temperature that moves farther than this, beyond 0.1 K/s, is not used until it returns, or until a tare."},
        {TACTILED_KEY(S, expect_serial), "", Text::any,
         "Serial of the sensor that is mounted here; a calibration of another one is refused. \"\" = any."},
        {TACTILED_KEY(S, serial_channel), "", Text::any,
         "The name in `channels` that is the number of the device. A frame with another number than the serial of the "
         "calibration is BAD, wrong device. \"\" = the device does not report a number."},
        {TACTILED_KEY(S, model), kRequired, Text::any,
         "Model of the sensor, as in the calibration; decoupling/README.md lists them."},
        {TACTILED_KEY(S, calibration), kRequired, Text::any, "Path of the calibration, seen from the folder of this file."},
        {TACTILED_KEY(S, method), Default("", "the method of the calibration"), Text::any,
         "A method of the model, or \"auto\" = the most accurate one within budget_us."},
        {TACTILED_KEY(S, budget_us), 10, range(0.01, 10'000), "us",
         "Time that 7 of 8 samples may take with method \"auto\". When they take longer, it steps down to a faster method, "
         "and up again after a calm stretch (decoupling/README.md)."},
        {TACTILED_KEY(S, stale_ms), 100, range(1, 10'000), "ms", "Without a frame for longer, the force is BAD."},
        {TACTILED_KEY(S, frozen_after),
         Default(d.frozen_after,
                 "10 times the longest run in the calibration and at least 100, never for a channel that stood still in it; "
                 "without rows at rest 100, and 10 s where the driver does not know that noise moves every number"),
         range(0, 1'000'000), "readings",
         "A channel that repeats one number this often (2 or more) is dead and has no value; 0 = a channel may repeat. A "
         "quiet sensor of few bits, or one that is asked more often than it measures, repeats itself rightly: set many "
         "times what a recording at rest shows (`tactilectl record`)."},
        {TACTILED_KEY(S, delay_ms), Default(d.delay_ms, "the delay of the converter if the driver knows it, else 0"),
         range(0, 10'000), "ms",
         "Time from the middle of a measurement to the arrival of its frame: conversion, filters, transmission. While the "
         "force moves, the standard deviation contains what it can change in that time; the timestamp stays."},
        {TACTILED_KEY(S, rate_Hz), d.rate_Hz, range(0, 1e6), "Hz",
         "Rate at which the device is set to send; 0 = not declared. Another rate is reported as a warning, and the force "
         "stays GOOD."},
        {TACTILED_KEY(S, rate_tolerance), d.rate_tolerance, range(0.01, 1), "",
         "Deviation from rate_Hz, measured over a second, that is accepted, as a fraction of it."},
        {TACTILED_KEY(S, drift_limit_N), d.drift_limit_N, range(0, 1e6), "N",
         "A zero at rest that is farther than this from that of the calibration is reported as maintenance; 0 = no limit."},
        {TACTILED_KEY(S, register_N), 0.01, range(1e-6, 10), "N",
         "One count of FX, FY, FZ, F_TANG, F_MAG and PEAK in the sensor's block of the register map; a power of ten, which "
         "the register SCALE has. A small sensor needs a smaller count: 0.3 N are 30 counts of 0.01 N."},
        {TACTILED_KEY(S, tare_ms), d.tare_ms, range(1, 10'000), "ms",
         "Time over which a tare averages, at least 8 samples. A tare is refused while the force moves."},
        {TACTILED_KEY(S, tare_limit_N),
         Default(d.tare_limit_N, "20 % of full scale, of each component of the force its own"), range(0, 1e6), "N",
         "A tare is refused when the force, as calibrated, is larger than this: the sensor is loaded. 0 = no limit."},
        {TACTILED_KEY(S, accept_unproved_age), d.accept_unproved_age,
         "A stream on a network path that has neither a clock nor a counter may be tared and weighed with, although nothing "
         "shows when it was delayed."},
        {TACTILED_KEY(S, accept_too_quiet), d.accept_too_quiet,
         "The device may have less noise than a quarter of that at rest in its calibration, for instance "
         "because the calibration was recorded beside a running motor. Otherwise its numbers count as scaled by another "
         "range, unit, byte order or firmware (too-quiet)."},
        {TACTILED_KEY(S, undetected_damage_limit), Default(d.undetected_damage_limit, "no limit"), range(0, 1), "",
         "The share of readings of which a damaged channel may be GOOD and wrong by more than 10 % of full scale. The "
         "sensor is UNCERTAIN (not-redundant) if its calibration states more, as the mean over the channels of the worst "
         "kind "
         "of damage, or states nothing: `tactilectl check` prints the number."},
        {TACTILED_KEY(S, zero_after), d.zero_after.c_str(), Choices{"keep", "doubt", "forget"},
         "The zero after the device may have been restarted or exchanged: its counter or clock has not gone on; it has "
         "neither, and its link was lost or it was silent for 1 s + stale_ms; a channel was missing for as long; or the "
         "daemon was restarted after a tare. "
         "\"doubt\": unless the force is the one before, it is UNCERTAIN (zero unknown) until a tare or its removal. "
         "\"keep\": the device always comes back with its zero. "
         "\"forget\": as \"doubt\", whatever the force is, for a device that zeroes itself when it starts."},
        {TACTILED_KEY(S, filter_hz), d.filter_hz, range(0, 10'000), "Hz",
         "Low-pass filter on force and torque (-3 dB at this frequency); 0 = off. Raw values are never filtered."},
        {TACTILED_KEY(S, contact_on_N), d.contact_on_N, range(0.01, 300), "N",
         "Magnitude of the force at which contact begins."},
        {TACTILED_KEY(S, contact_off_N), Default(kUnset, "half of contact_on_N"), range(0, 300), "N",
         "Magnitude of the force below which contact ends; at most contact_on_N."},
        {TACTILED_KEY(S, overload_N), d.overload_N, range(0, 1e6), "N",
         "Magnitude of the force above which OVERLOAD is set; 0 = never."},
        {TACTILED_KEY(S, agrees_with), "", Text::any,
         "Another [[sensor]] that measures the same force in the same frame; \"\" = none. Both are UNCERTAIN where they "
         "differ. One of the two names the other."},
        {TACTILED_KEY(S, agree_N), d.agree_N, range(0, 1e6), "N",
         "Required with agrees_with: by how much the tared forces of the two may differ, as magnitude over the components "
         "that both see."},
        {TACTILED_KEY(S, agree_ms), d.agree_ms, range(1, 60'000), "ms", "Time for which they may differ by more."},
    };
    return fields;
}

SensorSettings read_sensor(Options table, const std::string& folder) {
    SensorSettings s{};
    s.options = table;
    read_fields(sensor_fields(), table, s);
    if (s.name == "all") table.problem("name", "name = \"all\" means every sensor in commands; choose another");
    check_channels(table, s.channels);
    if (const auto [lowest, highest] = s.saturates_at; !(lowest < highest))
        table.problem("saturates_at", fmt::format("saturates_at = [{}, {}] should be [lowest, highest]", lowest, highest));
    if (const auto [lowest, highest] = s.temperature_range_C; !std::isnan(lowest) && !(lowest <= highest))
        table.problem("temperature_range_C",
                      fmt::format("temperature_range_C = [{}, {}] should be [lowest, highest]", lowest, highest));
    if (s.temperature_frozen_after == 1)
        table.problem("temperature_frozen_after",
                      "temperature_frozen_after = 1 is no number of equal readings; 0 = off, else 2 or more");
    const auto check_name = [&](const char* key, const std::string& name) {
        if (!name.empty() && std::find(s.channels.begin(), s.channels.end(), name) == s.channels.end())
            table.problem(key, fmt::format("{} = {} is no name in channels", key, in_quotes(name)));
    };
    check_name("temperature", s.temperature);
    check_name("serial_channel", s.serial_channel);
    if (!s.temperature.empty() && !s.temperature_of.empty())
        table.problem("temperature_of", "temperature and temperature_of are both declared: one of them");
    if (std::abs(std::log10(s.register_N) - std::round(std::log10(s.register_N))) > 1e-9)
        table.problem("register_N", fmt::format("register_N = {} is no power of ten, such as 0.001", s.register_N));
    if (s.frozen_after == 1)
        table.problem("frozen_after", "frozen_after = 1 is no number of equal readings; 0 = off, else 2 or more");
    if (s.agrees_with.empty() && s.agree_N != 0)
        table.problem("agree_N", "agree_N stands beside agrees_with, on one of the two sensors");
    if (!s.agrees_with.empty() && s.agree_N == 0)
        table.problem("agrees_with", "agrees_with needs agree_N: by how many newtons the two may differ");
    s.pair = {-1, s.agree_N, s.agree_ms};
    if (std::isnan(s.contact_off_N)) s.contact_off_N = s.contact_on_N / 2;
    if (s.contact_off_N > s.contact_on_N)
        table.problem("contact_off_N",
                      fmt::format("contact_off_N = {} is above contact_on_N = {}", s.contact_off_N, s.contact_on_N));
    if (!s.calibration.empty())  // an absolute path is unchanged
        s.calibration = (std::filesystem::path(folder) / s.calibration).string();
    return s;
}

SensorSettings default_sensor() {
    Problems of_required_keys;
    SensorSettings sensor = read_sensor(Options::parse_text("", "", of_required_keys), "");
    sensor.options = no_options();
    return sensor;
}

void pair_sensors(std::vector<SensorSettings>& sensors) {
    const std::vector<std::string> names = names_of(sensors);
    for (std::size_t i = 0; i < sensors.size(); ++i) {
        SensorSettings& one = sensors[i];
        if (one.agrees_with.empty()) continue;
        const auto wrong = [&](const std::string& why) {
            one.options.problem("agrees_with", fmt::format("agrees_with = {} {}", in_quotes(one.agrees_with), why));
        };
        const auto at = std::find(names.begin(), names.end(), one.agrees_with);
        if (at == names.end()) {
            const auto near = nearest_name(one.agrees_with, names);
            wrong(near ? fmt::format("is no [[sensor]]; did you mean \"{}\"?", *near) : "is no [[sensor]]");
            continue;
        }
        SensorSettings& other = sensors[std::size_t(at - names.begin())];
        if (&one == &other) {
            wrong("is this sensor itself");
        } else if (one.pair.other >= 0 || other.pair.other >= 0) {
            wrong("is in a pair already: a sensor is compared with one other, and one of the two says so");
        } else {
            one.pair.other = int(at - names.begin());
            other.pair = {int(i), one.pair.agree_N, one.pair.agree_ms};
        }
    }
}

void find_thermometers(std::vector<SensorSettings>& sensors) {
    std::vector<std::string> names;
    for (const auto& sensor : sensors)
        if (!sensor.temperature.empty()) names.push_back(sensor.name);
    for (SensorSettings& one : sensors) {
        if (one.temperature_of.empty()) continue;
        const auto at = std::find_if(sensors.begin(), sensors.end(), [&](const SensorSettings& other) {
            return other.name == one.temperature_of && !other.temperature.empty();
        });
        one.thermometer = at == sensors.end() ? -1 : int(at - sensors.begin());
        if (at != sensors.end()) continue;
        const auto near = nearest_name(one.temperature_of, names);
        one.options.problem("temperature_of", fmt::format("temperature_of = {} is no [[sensor]] with a `temperature`{}",
                                                          in_quotes(one.temperature_of),
                                                          near ? fmt::format("; did you mean \"{}\"?", *near) : ""));
    }
}

void check_shared_frames(std::vector<SensorSettings>& sensors) {
    for (auto later = sensors.begin(); later != sensors.end(); ++later)
        for (auto first = sensors.begin(); first != later; ++first) {
            if (first->link != later->link || first->device != later->device || first->link.empty()) continue;
            if (first->channels.empty() || later->channels.empty()) {
                later->options.problem("link",
                                       fmt::format("link \"{}\", device {} is read by sensor \"{}\", too: give each its own "
                                                   "`device`, or its own `channels` with \"-\" for the other's",
                                                   later->link, later->device, first->name));
                continue;
            }
            const std::size_t n = std::min(first->channels.size(), later->channels.size());
            for (std::size_t i = 0; i < n; ++i)
                if (first->channels[i] != "-" && later->channels[i] != "-") {
                    later->options.problem(
                        "channels",
                        fmt::format("channels[{}] = {} is used by sensor \"{}\", too (as {}): write \"-\" in one of them", i,
                                    in_quotes(later->channels[i]), first->name, in_quotes(first->channels[i])));
                    break;
                }
        }
}

}  // namespace tactiled
