// Driver "replay": the frames of one link of a recording (tactilectl record), each as long after the one before as then. Its
// data are declared simulated: nobody shall take them for a measurement of now.
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/reader.hpp"

namespace tactiled {
namespace {

class Replay final : public Driver {
public:
    explicit Replay(Options& options) {
        // seen from the folder of the configuration; an absolute path stays itself
        path_ = (std::filesystem::path(options.file()).parent_path() / options.text("file")).string();
        link_ = options.text("link", "");
        speed_ = options.number("speed", {0.001, 1000}, 1);
        again_ = options.one_of("at_end", {"stop", "again"}, "stop") == "again";
    }

    std::string open() override {
        if (at_ == frames_.size() && at_ != 0 && !again_)
            return "the recording has ended; at_end = \"again\" plays it again";
        if (frames_.empty()) {  // once: later openings only begin again
            std::string wrong = read_file();
            if (wrong.empty()) wrong = find_frames();
            if (!wrong.empty()) return wrong;
        }
        at_ = 0;
        began_ns_ = now_ns();
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (at_ == frames_.size()) return Status::gone;
        if (!mcap::decode_frame(frames_[at_], frame)) {  // looked at in open()
            ++at_;
            ++counts[TACTILED_LINK_BAD_LENGTH];
            return Status::timeout;
        }
        const auto due_ns = began_ns_ + std::uint64_t(double(frame.t_ns - first_ns_) / speed_);
        const std::uint64_t until_ns = now_ns() + std::uint64_t(timeout_ms) * 1'000'000u;
        const std::uint64_t wake_ns = std::min(due_ns, until_ns);
        const timespec wake{time_t(wake_ns / 1'000'000'000u), long(wake_ns % 1'000'000'000u)};
        while (now_ns() < wake_ns) ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
        if (due_ns > until_ns) return Status::timeout;
        ++at_;
        frame.t_ns = due_ns;
        ++counts[TACTILED_LINK_FRAMES];
        counts[TACTILED_LINK_LOST] += frame.lost;
        return Status::frame;
    }

    void close() noexcept override {}

private:
    // Into memory, not mapped: a file that somebody shortens while it is mapped would end the daemon.
    std::string read_file() {
        std::error_code error;
        const auto size = std::filesystem::file_size(path_, error);
        if (error) return fmt::format("{}: {}", path_, error.message());
        if (size > kMostBytes) return fmt::format("{}: has {} bytes; this driver takes {}", path_, size, kMostBytes);
        std::ifstream in(path_, std::ios::binary);
        bytes_.resize(std::size_t(size));
        if (!in.read(bytes_.data(), std::streamsize(size))) return fmt::format("{}: cannot be read", path_);
        return "";
    }

    // Where each frame of the link stands in the file, so that read() only looks. "" or what is wrong.
    std::string find_frames() {
        frames_.clear();
        mcap::Reader reader(bytes_);
        std::vector<std::string> links;  // that the file has
        Frame frame;
        while (const auto message = reader.next()) {
            if (message->channel->schema != mcap::kFrameSchema) continue;
            const auto& about = message->channel->metadata;
            const auto found = about.find(std::string(mcap::kLinkKey));
            const std::string name = found == about.end() ? "" : found->second;
            if (std::find(links.begin(), links.end(), name) == links.end()) links.push_back(name);
            if ((link_.empty() || name == link_) && mcap::decode_frame(message->data, frame)) {
                if (frames_.empty()) first_ns_ = frame.t_ns;
                if (frame.t_ns >= first_ns_) frames_.push_back(message->data);
            }
        }
        std::string known;
        for (const auto& name : links) known += (known.empty() ? "" : ", ") + name;
        if (link_.empty() && links.size() > 1) return fmt::format("{}: has several links: link = one of {}", path_, known);
        if (!frames_.empty()) return "";
        if (!links.empty()) return fmt::format("{}: no frames of link \"{}\"; it has {}", path_, link_, known);
        const std::string why = reader.why();
        return fmt::format("{}: {}", path_, why.empty() ? "holds no frames (tactilectl record makes such files)" : why);
    }

    std::string path_, link_;
    double speed_;
    bool again_;
    static constexpr std::uintmax_t kMostBytes = 1u << 30;  // half an hour of a sensor at 1 kHz; some seconds to read
    std::string bytes_;
    std::vector<std::span<const char>> frames_;
    std::size_t at_ = 0;
    std::uint64_t first_ns_ = 0, began_ns_ = 0;
};

const DriverEntry entry{"replay",
                        [](Options& options) -> std::unique_ptr<Driver> { return std::make_unique<Replay>(options); }};

}  // namespace
}  // namespace tactiled
