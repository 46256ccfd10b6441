#include "node/method_costs.hpp"

#include <elf.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <link.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "config/text_file.hpp"
#include "node/log.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxBytes = 16384;

// Returns the lines of /proc/cpuinfo that name the first CPU's kind (x86: model name; ARM: implementer, part ...),
// without its clock.
std::string cpu_model() {
    std::ifstream file("/proc/cpuinfo");
    std::string model;
    for (std::string line; std::getline(file, line) && !line.empty();)
        for (const char* key : {"model name", "stepping", "microcode", "CPU implementer", "CPU variant", "CPU part"})
            if (line.starts_with(key)) model += line.substr(std::min(line.size(), line.find(':') + 1));
    std::erase_if(model, [](char c) { return c < ' ' || c > '~' || c == '"' || c == '\\'; });
    return model;
}

// Returns the linker's hash of this program.
std::string build_id() {
    std::string id;
    const auto look = [](dl_phdr_info* program, std::size_t, void* out) {
        for (int i = 0; i < program->dlpi_phnum; ++i) {
            const auto& part = program->dlpi_phdr[i];
            if (part.p_type != PT_NOTE) continue;
            const auto* at = reinterpret_cast<const char*>(program->dlpi_addr + part.p_vaddr);
            for (const char* const end = at + part.p_memsz; at + sizeof(ElfW(Nhdr)) <= end;) {
                ElfW(Nhdr) note;
                std::memcpy(&note, at, sizeof note);
                const auto padded = [](std::size_t size) { return (size + 3) / 4 * 4; };
                const auto* const hash = reinterpret_cast<const unsigned char*>(at + sizeof note + padded(note.n_namesz));
                if (note.n_type == NT_GNU_BUILD_ID)
                    for (std::size_t k = 0; k < note.n_descsz; ++k)
                        *static_cast<std::string*>(out) += fmt::format("{:02x}", hash[k]);
                at += sizeof note + padded(note.n_namesz) + padded(note.n_descsz);
            }
        }
        return 1;  // the first object is the program itself
    };
    ::dl_iterate_phdr(look, &id);
    return id;
}

}  // namespace

std::string method_costs_folder() {
    const auto variable = [](const char* name) {
        const char* value = std::getenv(name);
        return std::string(value != nullptr ? value : "");
    };
    if (const std::string state = variable("STATE_DIRECTORY"); !state.empty()) return state.substr(0, state.find(':'));
    if (const std::string cache = variable("XDG_CACHE_HOME"); !cache.empty()) return cache + "/tactiled";
    if (const std::string home = variable("HOME"); !home.empty()) return home + "/.cache/tactiled";
    return "";
}

MethodCostFile::MethodCostFile(const std::string& folder, const std::string& node, const std::string& sensor,
                               const Calibration& calibration)
    : folder_(folder),
      path_(fmt::format("{}/{}.{}.costs.toml", folder, node, sensor)),
      key_(fmt::format("{}; build {}; calibration {:04x}", cpu_model(), build_id(), calibration.crc)) {}

std::vector<MethodCost> MethodCostFile::load() const {
    std::error_code none;
    if (folder_.empty() || !std::filesystem::exists(path_, none)) return {};
    Problems problems;
    std::vector<MethodCost> costs;
    if (const auto text = read_text_file(path_, kMaxBytes, problems)) {
        Options file = Options::parse_text(*text, path_, problems);
        const std::string key = file.text("of");
        const auto methods = file.texts("methods");
        const auto us = file.numbers("us", {1e-3, 1e9});
        file.finish();
        if (problems.empty() && key != key_) return {};
        if (methods.size() != us.size()) file.problem("us", "as many numbers as methods are needed");
        for (std::size_t i = 0; problems.empty() && i < methods.size(); ++i) costs.push_back({methods[i], us[i]});
    }
    if (!problems.empty()) log_line(LogLevel::warning, "{}; the methods are measured again", problems.lines().front());
    return costs;
}

void MethodCostFile::save(const std::vector<MethodCost>& costs) const {
    if (folder_.empty()) return;
    std::vector<std::string> methods, us;
    for (const auto& each : costs) {
        methods.push_back('"' + each.method + '"');
        us.push_back(fmt::format("{:#}", each.us));
    }
    try {
        std::filesystem::create_directories(folder_);
        replace_file(path_,
                     fmt::format("# What a sample of each method takes here, us. Measured again where it is missing.\n"
                                 "of = \"{}\"\nmethods = [{}]\nus = [{}]\n",
                                 key_, fmt::join(methods, ", "), fmt::join(us, ", ")));
    } catch (const std::exception& error) {
        log_line(LogLevel::warning, "{}; the next start measures the methods again", error.what());
    }
}

}  // namespace tactiled
