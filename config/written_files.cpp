// Checks that the files that a daemon writes are not other files of its configuration; otherwise a command could
// overwrite the configuration or a calibration.
#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "config/tables.hpp"

namespace tactiled {
namespace {

struct NamedFile {
    std::string path;
    std::string role;
    const char *table, *key;  // nullptr: the daemon only reads the file
};

// Returns true for the same name, after links and ".." are resolved, or for two names of one file.
bool is_same(const std::string& a, const std::string& b) {
    std::error_code error;
    const auto resolved = [&](const std::string& path) {
        const auto found = std::filesystem::weakly_canonical(path, error);
        return error || found.empty() ? std::filesystem::path(path).lexically_normal() : found;
    };
    return resolved(a) == resolved(b) || std::filesystem::equivalent(a, b, error);
}

}  // namespace

void check_written_files(Config& config) {
    std::vector<NamedFile> files;
    const auto reads = [&](const std::string& path, const std::string& role) {
        files.push_back({path, role, nullptr, nullptr});
    };
    const auto writes = [&](const std::string& path, const char* table, const char* key) {
        files.push_back({path, fmt::format("[{}] {}", table, key), table, key});
    };
    reads(config.path, "this configuration");
    for (const auto& sensor : config.sensors)
        reads(sensor.calibration, "the calibration of sensor " + in_quotes(sensor.name));
    writes(config.node.control, "node", "control");
    writes(config.node.zeros, "node", "zeros");
    writes(config.modbus.settings, "modbus", "settings");
    if (config.grasp) writes(config.grasp->objects, "grasp", "objects");
    for (auto later = files.begin(); later != files.end(); ++later)
        for (auto first = files.begin(); first != later; ++first)
            if (later->key != nullptr && !later->path.empty() && !first->path.empty() && is_same(first->path, later->path)) {
                config.root.table(later->table)
                    .problem(later->key,
                             fmt::format("{} = {} is the file of {}, too; the daemon writes it: give each its own",
                                         later->key, in_quotes(later->path), first->role));
                break;
            }
}

}  // namespace tactiled
