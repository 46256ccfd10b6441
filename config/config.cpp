// [node], [realtime], [[link]], [shm], and the references between the tables.
#include "config/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>

#include "config/tables.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kLongestSocketPath = 107;  // limit of sockaddr_un

NodeSettings read_node(Options table) {
    NodeSettings node{};
    read_fields(node_fields(), table, node, node.name);
    if (node.control.size() > kLongestSocketPath)
        table.problem("control", fmt::format("control has {} bytes; the path of a socket has at most {}",
                                             node.control.size(), kLongestSocketPath));
    return node;
}

RealtimeSettings read_realtime(Options table) {
    RealtimeSettings realtime{};
    read_fields(realtime_fields(), table, realtime);
    return realtime;
}

ShmSettings read_shm(Options table) {
    ShmSettings shm{};
    read_fields(shm_fields(), table, shm);
    const auto check = [&](const char* key, unsigned slots) {
        if (slots != 0 && !std::has_single_bit(slots))
            table.problem(key,
                          fmt::format("{} = {} is no power of two; the next one is {}", key, slots, std::bit_ceil(slots)));
    };
    check("history", unsigned(shm.history));
    check("array_history", unsigned(shm.array_history));
    return shm;
}

LinkSettings read_link(Options table) {
    LinkSettings link{};
    link.options = table;
    read_fields(link_fields(), table, link);
    return link;
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
    std::vector<std::string> names = names_of(links);
    std::erase(names, "");
    for (auto& sensor : sensors) {
        if (sensor.link.empty()) continue;  // the error is reported already
        const auto link = std::find_if(links.begin(), links.end(), [&](const auto& l) { return l.name == sensor.link; });
        if (link != links.end()) {
            ++link->sensors;
            continue;
        }
        sensor.options.problem("link", is_no("link", sensor.link, "link", names));
    }
}

}  // namespace

std::string is_no(const char* key, const std::string& name, const char* table, const std::vector<std::string>& names) {
    const auto near = nearest_name(name, names);
    return fmt::format("{} = {} is no [[{}]]; {}", key, in_quotes(name), table,
                       near ? fmt::format("did you mean \"{}\"?", *near) : fmt::format("known: {}", fmt::join(names, ", ")));
}

Options no_options() {
    static Problems none;
    return Options::parse_text("", "", none);
}

const Fields<NodeSettings>& node_fields() {
    using S = NodeSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, name), "gripper", Text::name,
         "Name of the daemon. The segment is tactiled.NAME in its run-time folder, and `tactilectl --node` takes this "
         "name."},
        {TACTILED_KEY(S, watchdog_ms), 250, range(10, 10'000), "ms",
         "Readers consider the daemon dead when it has published nothing for this time."},
        {TACTILED_KEY(S, stuck_link_ms), 10'000, range(0, 600'000), "ms",
         "A link whose thread has not returned from its device for this time counts as hung, and systemd restarts the "
         "daemon with all its links. With 0 it is never restarted for that reason, and the other links go on without this "
         "one."},
        {TACTILED_KEY(S, control), "/run/tactiled/NAME.sock", Text::full_path,
         "Path of the socket for commands, at most 107 bytes. In another run-time folder than /run/tactiled the default is "
         "NAME.sock there."},
        {TACTILED_KEY(S, zeros),
         Default("", "NAME.zeros.toml in $STATE_DIRECTORY, else in /var/lib/tactiled, else in ~/.local/state/tactiled"),
         Text::full_path,
         "File in which the zeros of tares are kept over a restart. Tares are refused while it cannot be written."},
        {TACTILED_KEY(S, fault_clear_s), 0, range(0, 86'400), "s",
         "A latched fault clears itself when its cause has been absent for this time; 0 = never. For a PLC without write "
         "access."},
    };
    return fields;
}

const Fields<RealtimeSettings>& realtime_fields() {
    using S = RealtimeSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, priority), 80, range(1, 98), "",
         "SCHED_FIFO priority of the pipeline. The threads of the links run two below."},
        {TACTILED_KEY(S, cpu), Default(-1, "-1 = any"), range(-1, 1023), "", "The processor that the threads are bound to."},
        {TACTILED_KEY(S, lock_memory), true, "Keeps all memory in RAM, so that no page fault delays the loop."},
        {TACTILED_KEY(S, required), false,
         "If true, the daemon ends when the priority or the memory lock is refused. If false, it runs with RT_DEGRADED."},
        {TACTILED_KEY(S, period_us), 10'000, range(50, 100'000), "us",
         "Longest time between two cycles of the pipeline while a sensor delivers. Frames, commands and time limits do not "
         "wait."},
    };
    return fields;
}

const Fields<LinkSettings>& link_fields() {
    using S = LinkSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, name), kRequired, Text::name, "Name of the link, unique, as the sensors refer to it."},
        {TACTILED_KEY(S, driver), kRequired, Text::any, "Driver of the link; drivers/README.md lists them and their keys."},
        {TACTILED_KEY(S, simulated), "true where the driver never measures, else false",
         "If true, the data are simulated or replayed, and every reader sees that."},
    };
    return fields;
}

const Fields<ShmSettings>& shm_fields() {
    using S = ShmSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, group), "", Text::name, "Unix group that may read and command; \"\" = the group of the daemon."},
        {TACTILED_KEY(S, history), Default(0, "the largest up to 1024 that fits into 2 MB"), range(64, 65'536), "",
         "Samples kept for each sensor, a power of two."},
        {TACTILED_KEY(S, array_history), 128, range(8, 1024), "",
         "Arrays kept for each sensor with taxels, with their raw numbers; a power of two. 1,024 taxels of three need 27 kB "
         "each."},
    };
    return fields;
}

Config load_config(const std::string& path, Problems& problems) {
    Config config{};
    config.path = path;
    Options& root = config.root = Options::parse_file(path, problems);
    const std::string folder = std::filesystem::path(path).parent_path().string();
    config.node = read_node(root.table("node"));
    config.realtime = read_realtime(root.table("realtime"));
    for (const auto& table : root.tables("link", kMaxLinks)) config.links.push_back(read_link(table));
    for (const auto& table : root.tables("sensor", kMaxSensors)) config.sensors.push_back(read_sensor(table, folder));
    config.modbus = read_modbus(root.table("modbus"), config.node.name);
    config.shm = read_shm(root.table("shm"));

    if (!root.has("link")) root.problem("link", "there is no [[link]]; add at least one, the source of the data");
    if (!root.has("sensor")) root.problem("sensor", "there is no [[sensor]]; add at least one, the meaning of the data");
    check_unique(config.links, "link");
    check_unique(config.sensors, "sensor");
    bind_links(config.links, config.sensors);
    check_shared_frames(config.sensors);
    pair_sensors(config.sensors);
    find_thermometers(config.sensors);
    config.grasp = read_grasp(root, config.node.name, config.sensors, folder);
    for (std::size_t i = 0; i < config.sensors.size(); ++i)
        config.modbus.force_scales[i] = int(std::lround(std::log10(config.sensors[i].register_N)));
    if (config.grasp) config.modbus.objects = config.grasp->objects;
    config.tool = read_tool(root, config.sensors, config.grasp);
    config.gpio = read_gpio(root);
    check_written_files(config);
    return config;
}

}  // namespace tactiled
