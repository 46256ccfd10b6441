// All keys of the configuration except those of drivers and models: the rules of a reload, and the pages about them.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "config/fields.hpp"

namespace tactiled {

struct KeyTable {
    std::string header, about;  // "[[grasp.jaw]]"
    Reload others;              // rule of keys that are not in the list: of a driver or a model, or a table below
    std::vector<ConfigKey> keys;

    [[nodiscard]] std::string name() const;  // "grasp.jaw"
};

// Returns the tables in the order of config/tactiled.toml.
const std::vector<KeyTable>& key_tables();

// Returns the effect of a changed `key` of `table`, such as "sensor", on a reload.
Reload reload_rule(std::string_view table, std::string_view key);
// Returns true if no key of the table may change without a restart.
bool needs_restart(std::string_view table);

// Returns the comment of a key in config/tactiled.toml: "ms, 1 .. 10000, default 100: Without a frame for longer, the
// force is BAD."
std::string key_comment(const ConfigKey& key);

// Returns the text of config/KEYS.md.
std::string keys_markdown();

}  // namespace tactiled
