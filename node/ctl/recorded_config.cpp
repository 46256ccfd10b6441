#include "node/ctl/recorded_config.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "config/options.hpp"
#include "config/text_file.hpp"
#include "drivers/mcap/reader.hpp"
#include "node/setup.hpp"

namespace tactiled::ctl {
namespace {

namespace fs = std::filesystem;

constexpr char kName[] = "tactiled.toml";
constexpr char kDefault[] = "/etc/tactiled/tactiled.toml";
constexpr std::size_t kMaxBytes = std::size_t{16} << 20;  // of a calibration, and of a recording's beginning

std::string content_of(const std::string& path) {
    Problems problems;
    const auto text = read_text_file(path, kMaxBytes, problems);
    problems.throw_if_any();
    return *text;
}

// A path that stays within the folder that it is appended to.
bool stays_inside(const fs::path& path) {
    return !path.empty() && path.is_relative() && std::find(path.begin(), path.end(), "..") == path.end();
}

std::vector<std::string> words_of(const std::string& process) {
    std::ifstream in(process + "/cmdline", std::ios::binary);
    std::vector<std::string> words;
    for (std::string word; std::getline(in, word, '\0');) words.push_back(word);
    return words;
}

}  // namespace

std::string config_of_daemon(const SegmentView& segment) {
    const std::string process = fmt::format("/proc/{}", segment.header().pid);
    const auto words = words_of(process);
    if (words.empty()) return "";
    std::string path = kDefault;
    const std::string option = "--config";
    for (std::size_t i = 1; i < words.size(); ++i) {
        if (words[i] == option && i + 1 < words.size()) path = words[i + 1];
        if (words[i].starts_with(option + "=")) path = words[i].substr(option.size() + 1);
    }
    std::error_code error;
    if (fs::path(path).is_relative()) path = (fs::read_symlink(process + "/cwd", error) / path).string();
    if (error || !fs::exists(path, error)) return "";
    Problems problems;
    const Node node = load_node(path, problems);
    return problems.empty() && node.plan.calibration_id == segment.calibration_id() ? path : "";
}

void attach_config(mcap::Writer& file, const std::string& config, std::uint64_t wall_ns) {
    const std::string text = content_of(config);
    file.attach(kName, "application/toml", text, wall_ns);
    Problems problems;
    Options root = Options::parse_text(text, config, problems);
    std::vector<std::string> done;
    for (Options& sensor : root.tables("sensor")) {
        const std::string path = sensor.text("calibration", "");
        if (!stays_inside(path) || path == kName || std::find(done.begin(), done.end(), path) != done.end()) continue;
        const fs::path whole = fs::path(config).parent_path() / path;
        std::error_code error;
        if (!fs::exists(whole, error)) continue;
        file.attach(path, "application/toml", content_of(whole.string()), wall_ns);
        done.push_back(path);
    }
}

RecordedConfig::RecordedConfig(const std::string& recording) {
    std::ifstream in(recording, std::ios::binary);
    if (!in) throw SetupError(recording + ": cannot be read");
    std::string bytes(kMaxBytes, '\0');
    in.read(bytes.data(), std::streamsize(bytes.size()));
    bytes.resize(std::size_t(in.gcount()));
    mcap::Reader reader(bytes);
    (void)reader.next();  // attachments stand before the first message
    const auto& all = reader.attachments();
    if (std::none_of(all.begin(), all.end(), [](const auto& a) { return a.name == kName; }))
        throw SetupError(fmt::format("{}: has no configuration; name one with --config", recording));
    std::string name = (fs::temp_directory_path() / "tactiled-replay-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw SetupError(name + ": cannot be made");
    folder_ = name;
    for (const auto& attachment : all) {
        if (!stays_inside(attachment.name)) continue;
        const fs::path path = fs::path(folder_) / attachment.name;
        fs::create_directories(path.parent_path());
        std::ofstream(path, std::ios::binary) << attachment.data;
    }
}

RecordedConfig::~RecordedConfig() {
    std::error_code ignored;
    if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

}  // namespace tactiled::ctl
