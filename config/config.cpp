#include "config/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <filesystem>
#include <limits>

#include "config/names.hpp"
#include "config/network_address.hpp"
#include "config/tables.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxSensors = 16, kMaxLinks = 16;  // TACTILED_MAX_SENSORS and _LINKS
constexpr std::size_t kLongestSocketPath = 107;          // of sockaddr_un
constexpr double kInf = std::numeric_limits<double>::infinity();

int small_integer(Options& table, std::string_view key, Range range, int fallback) {
    return static_cast<int>(table.integer(key, range, fallback));
}
int small_integer(Options& table, std::string_view key, Range range) { return static_cast<int>(table.integer(key, range)); }

void check_name(Options& table, const std::string& name) {
    if (!valid_name(name)) table.problem("name", fmt::format("name = {}; {}", in_quotes(name), kValidName));
}

NodeSettings read_node(Options table) {
    const std::string name = table.text("name", "gripper");
    check_name(table, name);
    const int watchdog_ms = small_integer(table, "watchdog_ms", {10, 10000}, 250);
    const int stuck_link_ms = small_integer(table, "stuck_link_ms", {0, 600'000}, 10'000);
    const std::string control = table.text("control", fmt::format("/run/tactiled/{}.sock", name));
    if (control.size() > kLongestSocketPath)
        table.problem("control", fmt::format("control has {} bytes; the path of a socket has at most {}", control.size(),
                                             kLongestSocketPath));
    else if (control.empty() || control.front() != '/')  // readers in other folders are told this path
        table.problem("control", fmt::format("control = {} should be a full path, starting with /", in_quotes(control)));
    return {name, watchdog_ms, stuck_link_ms, control};
}

RealtimeSettings read_realtime(Options table) {
    const int priority = small_integer(table, "priority", {1, 98}, 80);
    const int cpu = small_integer(table, "cpu", {-1, 1023}, -1);
    const bool lock_memory = table.flag("lock_memory", true);
    const bool required = table.flag("required", false);
    const int period_us = small_integer(table, "period_us", {50, 100000}, 250);
    return {priority, cpu, lock_memory, required, period_us};
}

RtuSettings read_rtu(Options table) {
    const std::string device = table.text("device", "");
    const int baud = small_integer(table, "baud", {300, 4'000'000}, 19200);
    const std::string parity = table.one_of("parity", {"none", "odd", "even"}, "even");
    const int address = small_integer(table, "address", {1, 247}, 1);
    const int silence_us = small_integer(table, "silence_us", {0, 50'000}, 0);
    const bool rs485 = table.flag("rs485", false);
    return {device, baud, parity, address, silence_us, rs485};
}

std::vector<std::string> read_networks(Options& table, std::string_view key) {
    const std::vector<std::string> networks = table.texts(key);
    for (const auto& network : networks)
        if (const auto fault = fault_of_network(network); !fault.empty())
            table.problem(key, fmt::format("{}: {}", key, fault));
    return networks;
}

ModbusSettings read_modbus(Options table, const std::string& node_name) {
    const std::string listen = table.text("listen", "127.0.0.1:1502");
    const auto allow = read_networks(table, "allow");
    const std::vector<std::string> plc = table.texts("plc");
    for (const auto& address : plc)
        if (!fault_of_network(address + (address.find(':') == std::string::npos ? "/32" : "/128")).empty())
            table.problem("plc",
                          fmt::format("plc has {}; each is one address, such as \"192.168.0.10\"", in_quotes(address)));
    const int max_clients = small_integer(table, "max_clients", {1, 64}, 8);
    const int max_requests_per_s = small_integer(table, "max_requests_per_s", {0, 1'000'000}, 2000);
    const bool commands = table.flag("commands", false);
    const auto command_allow = read_networks(table, "command_allow");
    const bool scratch = table.flag("scratch", false);
    const std::string settings = table.text("settings", fmt::format("/var/lib/tactiled/{}.settings.toml", node_name));
    if (settings.empty() || settings.front() != '/')
        table.problem("settings", fmt::format("settings = {} should be a full path, starting with /", in_quotes(settings)));
    const RtuSettings rtu = read_rtu(table.table("rtu"));
    if (!command_allow.empty() && !commands)
        table.problem("command_allow", "command_allow has no effect without commands = true");
    if (!listen.empty()) {
        const ListenAddress address = check_listen_address(listen);
        if (!address.fault.empty())
            table.problem("listen", address.fault);
        else if (!address.loopback && allow.empty() && plc.empty())
            table.problem(
                "listen",
                fmt::format("listen = {} lets other machines in, and Modbus knows no passwords: name those that may "
                            "connect, for example allow = [\"192.168.0.10/32\"]",
                            in_quotes(listen)));
    }
    return {listen, allow, plc, max_clients, max_requests_per_s, commands, command_allow, scratch, settings, rtu, ""};
}

ShmSettings read_shm(Options table) {
    const std::string group = table.text("group", "");
    if (!group.empty() && !valid_name(group))
        table.problem("group", fmt::format("group = {}; {}", in_quotes(group), kValidName));
    if (!table.has("history")) return {group, 0};
    const int history = small_integer(table, "history", {64, 65536});
    if (const auto slots = static_cast<unsigned>(history); !std::has_single_bit(slots))
        table.problem("history",
                      fmt::format("history = {} is no power of two; the next one is {}", history, std::bit_ceil(slots)));
    return {group, history};
}

LinkSettings read_link(Options table) {
    const std::string name = table.text("name");
    if (!name.empty()) check_name(table, name);
    const std::string driver = table.text("driver");
    return {name, driver, table.optional_flag("simulated"), 0, table};
}

std::vector<std::string> read_channels(Options& table) {
    const std::vector<std::string> channels = table.texts("channels", {1, kMaxChannels});
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
    return channels;
}

struct SaturationLimits {
    double below = -kInf, above = kInf;
};

SaturationLimits read_saturation_limits(Options& table) {
    const auto limits = table.numbers("saturates_at", {-1e300, 1e300}, {2, 2});
    if (limits.empty()) return {};
    if (limits[0] < limits[1]) return {limits[0], limits[1]};
    table.problem("saturates_at", fmt::format("saturates_at = [{}, {}] should be [lowest, highest]", limits[0], limits[1]));
    return {};
}

SensorSettings read_sensor(Options table, const std::filesystem::path& folder) {
    const std::string name = table.text("name");
    if (!name.empty()) check_name(table, name);
    if (name == "all") table.problem("name", "name = \"all\" means every sensor in commands; choose another");
    const std::string link = table.text("link");
    const int device = small_integer(table, "device", {0, 65535}, 0);
    const auto channels = read_channels(table);
    const double counts_per_unit = table.number("counts_per_unit", {1e-18, 1e18}, 1);
    const SaturationLimits limits = read_saturation_limits(table);
    const std::string model = table.text("model");
    const std::string calibration = table.text("calibration");
    const std::string method = table.text("method", "");
    const double budget_us = table.number("budget_us", {0.01, 1e4}, 10);
    const int stale_ms = small_integer(table, "stale_ms", {1, 10000}, 100);
    const int frozen_after = small_integer(table, "frozen_after", {0, 1'000'000}, -1);
    if (frozen_after == 1)
        table.problem("frozen_after", "frozen_after = 1 is no number of equal readings; 0 = off, else 2 or more");
    const double slew_per_s = table.number("slew_limit_per_s", {1e-300, 1e300}, kInf);
    const double rate_Hz = table.number("rate_Hz", {0, 1e6}, 0);
    const double rate_tolerance = table.number("rate_tolerance", {0.01, 1}, 0.2);
    const double drift_limit_N = table.number("drift_limit_N", {0, 1e6}, 0);
    const int tare_ms = small_integer(table, "tare_ms", {1, 10000}, 100);
    const double tare_limit_N = table.number("tare_limit_N", {0, 1e6}, 0);
    const double filter_Hz = table.number("filter_hz", {0, 10000}, 0);
    const double contact_on_N = table.number("contact_on_N", {0.01, 300}, 0.5);
    const double contact_off_N = table.number("contact_off_N", {0, 300}, contact_on_N / 2);
    const double overload_N = table.number("overload_N", {0, 1e6}, 0);
    const std::string agrees_with = table.text("agrees_with", "");
    const double agree_N = table.number("agree_N", {0, 1e6}, 0);
    const int agree_ms = small_integer(table, "agree_ms", {1, 60'000}, 100);
    if (agrees_with.empty() && agree_N != 0)
        table.problem("agree_N", "agree_N stands beside agrees_with, on one of the two sensors");
    if (!agrees_with.empty() && agree_N == 0)
        table.problem("agrees_with", "agrees_with needs agree_N: by how many newtons the two may differ");
    if (contact_off_N > contact_on_N)
        table.problem("contact_off_N",
                      fmt::format("contact_off_N = {} is above contact_on_N = {}", contact_off_N, contact_on_N));
    const std::string beside = calibration.empty() ? "" : (folder / calibration).string();  // an absolute path stays itself
    return {name,           link,          device,       channels,     counts_per_unit,
            limits.below,   limits.above,  model,        beside,       method,
            budget_us,      stale_ms,      frozen_after, slew_per_s,   rate_Hz,
            rate_tolerance, drift_limit_N, tare_ms,      tare_limit_N, filter_Hz,
            contact_on_N,   contact_off_N, overload_N,   agrees_with,  {-1, agree_N, agree_ms},
            table};
}

template <typename Settings>
void check_unique(std::vector<Settings>& all, const char* kind) {
    for (auto later = all.begin(); later != all.end(); ++later)
        for (auto first = all.begin(); first != later; ++first)
            if (first->name == later->name && !first->name.empty()) {
                later->options.problem("name", fmt::format("name = \"{}\" is the name of the [[{}]] at {} already",
                                                           later->name, kind, first->options.where("name")));
                break;
            }
}

void bind_links(std::vector<LinkSettings>& links, std::vector<SensorSettings>& sensors) {
    std::vector<std::string> names;
    for (const auto& link : links)
        if (!link.name.empty()) names.push_back(link.name);
    for (auto& sensor : sensors) {
        if (sensor.link.empty()) continue;  // reported already
        const auto link = std::find_if(links.begin(), links.end(), [&](const auto& l) { return l.name == sensor.link; });
        if (link != links.end()) {
            ++link->sensors;
            continue;
        }
        const auto near = nearest_name(sensor.link, names);
        sensor.options.problem("link", fmt::format("link = {} is no [[link]]; {}", in_quotes(sensor.link),
                                                   near ? fmt::format("did you mean \"{}\"?", *near)
                                                        : fmt::format("known: {}", fmt::join(names, ", "))));
    }
}

// Two sensors that are compared know of each other, whichever of them names the other.
void pair_sensors(std::vector<SensorSettings>& sensors) {
    std::vector<std::string> names;
    for (const auto& sensor : sensors) names.push_back(sensor.name);
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

// Several sensors may read one frame, each its own channels of it.
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
                        fmt::format("channels[{}] = {} is used by sensor \"{}\", too (as {}): write "
                                    "\"-\" in one of them",
                                    i, in_quotes(later->channels[i]), first->name, in_quotes(first->channels[i])));
                    break;
                }
        }
}

}  // namespace

Config load_config(const std::string& path, Problems& problems) {
    Options root = Options::parse_file(path, problems);
    const auto folder = std::filesystem::path(path).parent_path();
    NodeSettings node = read_node(root.table("node"));
    const RealtimeSettings realtime = read_realtime(root.table("realtime"));
    std::vector<LinkSettings> links;
    for (const auto& table : root.tables("link", kMaxLinks)) links.push_back(read_link(table));
    std::vector<SensorSettings> sensors;
    for (const auto& table : root.tables("sensor", kMaxSensors)) sensors.push_back(read_sensor(table, folder));
    ModbusSettings modbus = read_modbus(root.table("modbus"), node.name);
    ShmSettings shm = read_shm(root.table("shm"));

    if (!root.has("link")) root.problem("link", "there is no [[link]]; one at least says where data come from");
    if (!root.has("sensor")) root.problem("sensor", "there is no [[sensor]]; one at least says what the data mean");
    check_unique(links, "link");
    check_unique(sensors, "sensor");
    bind_links(links, sensors);
    check_shared_frames(sensors);
    pair_sensors(sensors);
    auto grasp = read_grasp(root, node.name, sensors, folder.string());
    if (grasp) modbus.objects = grasp->objects;
    auto gpio = read_gpio(root);
    return {path,
            std::move(node),
            realtime,
            std::move(modbus),
            std::move(shm),
            std::move(links),
            std::move(sensors),
            std::move(grasp),
            std::move(gpio),
            std::move(root)};
}

}  // namespace tactiled
