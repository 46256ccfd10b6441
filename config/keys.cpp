#include "config/keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "config/tables.hpp"

namespace tactiled {
namespace {

template <typename Settings>
KeyTable table(const char* header, const Fields<Settings>& fields, const char* about) {
    return {header, about, Settings::kReload, {fields.begin(), fields.end()}};
}

const KeyTable* find_table(std::string_view name) {
    for (const auto& one : key_tables())
        if (one.name() == name) return &one;
    return nullptr;
}

const char* reload_text(Reload reload) {
    switch (reload) {
        case Reload::restart: return "restart";
        case Reload::tune: return "reload";
        case Reload::epoch: return "reload, new epoch";
    }
    return "";
}

constexpr char kIntroduction[] =
    "# Configuration keys\n\n"
    "Print this page with `tactilectl check --keys`. [tactiled.toml](tactiled.toml) shows every key in a file, and "
    "`tactilectl check FILE` prints all errors of a file.\n\n"
    "A key that is left out has its default. A key that is unknown, has the wrong type or is out of range is an error. "
    "NAME stands for the name of the node. The column Change tells what a changed value needs:\n\n"
    "* restart: the daemon must be restarted. A reload that finds such a change is refused as a whole.\n"
    "* reload: `systemctl reload tactiled` (SIGHUP) puts it in force without losing a sample.\n"
    "* reload, new epoch: the same, and the sensor begins a new epoch without its tare.\n\n"
    "A file that lacks keys which it had may have been cut: the first reload names them and changes nothing, the second "
    "accepts it.\n";

}  // namespace

std::string KeyTable::name() const {
    const std::size_t brackets = header.find_first_not_of('[');
    return header.substr(brackets, header.size() - 2 * brackets);
}

const std::vector<KeyTable>& key_tables() {
    static const std::vector<KeyTable> tables = {
        table("[node]", node_fields(), "The daemon as a whole."),
        table("[realtime]", realtime_fields(), "Priorities, memory and period of the threads."),
        table("[[link]]", link_fields(),
              "One table for each cable, 1 .. 16. The other keys belong to the driver: drivers/README.md."),
        table("[[sensor]]", sensor_fields(),
              "One table for each sensor, 1 .. 16: it turns channels into one force. Further keys belong to the model: "
              "decoupling/README.md."),
        table("[grasp]", grasp_fields(),
              "The grasp: from the forces of the jaws to contact, grip, slip, weight and object. Optional; without it the "
              "registers of the grasp are \"not known\". The frame G of the gripper has z out of the palm, towards the "
              "object; x "
              "and y are free, right-handed."),
        table("[[grasp.jaw]]", jaw_fields(), "One table for each sensor that sits on a jaw, 1 .. 16."),
        table("[tool]", tool_fields(),
              "The wrench on the gripper: the forces of sensors in the gripper's frame G, less the weight of the hand, and "
              "their "
              "sum. Optional."),
        table(
            "[[tool.sensor]]", tool_sensor_fields(),
            "One table for each sensor of the sum, 1 .. 16. Each force is counted once: a wrist and the jaws behind it are "
            "not summed."),
        table("[modbus]", modbus_fields(), "The Modbus server. Its registers: node/modbus/MAP.md."),
        table("[modbus.rtu]", rtu_fields(), "The same server on a serial line."),
        table("[shm]", shm_fields(), "The shared memory."),
        table("[gpio]", gpio_fields(),
              "Lines that tell another machine what the node sees, where there is no PLC. Optional. Each needs a line of "
              "its own."),
    };
    return tables;
}

Reload reload_rule(std::string_view table_name, std::string_view key) {
    const KeyTable* found = find_table(table_name);
    if (found == nullptr) return Reload::restart;
    const auto at = std::find_if(found->keys.begin(), found->keys.end(), [&](const auto& one) { return one.name == key; });
    return at != found->keys.end() ? at->reload : found->others;
}

bool needs_restart(std::string_view table_name) {
    const KeyTable* found = find_table(table_name);
    return found == nullptr ||
           (found->others == Reload::restart && std::all_of(found->keys.begin(), found->keys.end(),
                                                            [](const auto& one) { return one.reload == Reload::restart; }));
}

std::string key_comment(const ConfigKey& key) {
    std::vector<std::string> facts;
    for (const auto& fact : {key.unit, key.range, key.otherwise.empty() ? "required" : "default " + key.otherwise})
        if (!fact.empty()) facts.push_back(fact);
    return fmt::format("{}: {}", fmt::join(facts, ", "), key.help);
}

std::string keys_markdown() {
    std::string page = kIntroduction;
    for (const auto& one : key_tables()) {
        page += fmt::format("\n## {}\n\n{}\n\n", one.header, one.about);
        page += "| Key | Type | Unit | Range | Default | Change | Meaning |\n|---|---|---|---|---|---|---|\n";
        for (const auto& key : one.keys)
            page += fmt::format("| `{}` | {} | {} | {} | {} | {} | {} |\n", key.name, key.type, key.unit, key.range,
                                key.otherwise.empty() ? "required" : key.otherwise, reload_text(key.reload), key.help);
    }
    return page;
}

}  // namespace tactiled
