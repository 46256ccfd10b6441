// Driver "replay": the frames of one link of a recording (tactilectl record), at the original intervals. Its data are
// declared as simulated, so that they are not taken for a present measurement.
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/message_file.hpp"

namespace tactiled {
namespace {

// bytes in which open() searches for the first frame; read() continues after that
constexpr std::uint64_t kMaxAtOpening = 16u << 20;
constexpr std::uint64_t kMaxACycle = 1u << 20;  // the same limit for one read()
constexpr long kPause_ns = 1'000'000;           // pause after that many bytes, because nothing else makes this thread wait

class Replay final : public Driver {
public:
    explicit Replay(Options& options) {
        // relative to the folder of the configuration; an absolute path is unchanged
        path_ = (std::filesystem::path(options.file()).parent_path() / options.text("file")).string();
        link_ = options.text("link", "");
        speed_ = options.number("speed", {0.001, 1000}, 1);
        again_ = options.one_of("at_end", {"stop", "again"}, "stop") == "again";
    }

    std::string open() override {
        if (ended_ && has_begun_ && !again_) return "the recording has ended; at_end = \"again\" plays it again";
        has_begun_ = has_ahead_ = ended_ = false;
        left_out_ = {};
        if (std::string wrong = file_.open(path_); !wrong.empty()) return wrong;
        ended_ = look_ahead(kMaxAtOpening) == Ahead::end;
        file_.declare_all();
        return choose_link();
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (!has_ahead_ && !ended_) {
            const Ahead found = look_ahead(kMaxACycle);
            count_left_out();
            ended_ = found == Ahead::end;
            if (found == Ahead::later) {
                const timespec pause{0, kPause_ns};
                ::clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, nullptr);
                return Status::timeout;
            }
        }
        if (!has_ahead_) return Status::disconnected;
        const auto due_ns = began_ns_ + std::uint64_t(double(ahead_.t_ns - first_ns_) / speed_);
        const std::uint64_t until_ns = now_ns() + std::uint64_t(timeout_ms) * 1'000'000u;
        const std::uint64_t wake_ns = std::min(due_ns, until_ns);
        const timespec wake{time_t(wake_ns / 1'000'000'000u), long(wake_ns % 1'000'000'000u)};
        while (now_ns() < wake_ns) ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
        if (due_ns > until_ns) return Status::timeout;
        has_ahead_ = false;
        frame = ahead_;
        frame.t_ns = due_ns;
        ++counts[TACTILED_LINK_FRAMES];
        counts[TACTILED_LINK_LOST] += frame.lost;
        return Status::frame;
    }

    void close() noexcept override { file_.close(); }

private:
    enum class Ahead { frame, later, end };

    // Stores the link's next frame in `ahead_`; returns `later` if there is none within `max_bytes`. rt: blocks on
    // the disk; bounded by `max_bytes` and a chunk
    Ahead look_ahead(std::uint64_t max_bytes) {
        const std::uint64_t until = file_.bytes_read() + max_bytes;
        while (const auto message = file_.next(until - std::min(until, file_.bytes_read()))) {
            if (message->channel->schema != mcap::kFrameSchema) continue;
            if (!link_.empty() && link_of(*message->channel) != link_) continue;
            if (!mcap::decode_frame(message->data, ahead_)) {
                ++counts[TACTILED_LINK_BAD_LENGTH];
                continue;
            }
            if (!has_begun_) {
                has_begun_ = true;
                first_ns_ = ahead_.t_ns;
                began_ns_ = now_ns();
            }
            if (ahead_.t_ns < first_ns_) continue;
            has_ahead_ = true;
            return Ahead::frame;
        }
        return file_.at_end() ? Ahead::end : Ahead::later;
    }

    static std::string_view link_of(const mcap::Channel& channel) noexcept {
        for (const auto& [key, value] : channel.metadata)
            if (key == mcap::kLinkKey) return value;
        return "";
    }

    void count_left_out() noexcept {
        const unsigned bad_crc = file_.reader().bad_crc(), unreadable = file_.reader().unreadable() + file_.too_long();
        counts[TACTILED_LINK_BAD_CHECKSUM] += bad_crc - left_out_.bad_crc;
        counts[TACTILED_LINK_BAD_LENGTH] += unreadable - left_out_.unreadable;
        left_out_ = {bad_crc, unreadable};
    }

    // Selects the link to replay. Returns "" or the fault.
    std::string choose_link() {
        std::vector<std::string> links;
        for (const auto& [number, channel] : file_.reader().channels())
            if (const std::string name(link_of(channel));
                channel.schema == mcap::kFrameSchema && std::ranges::find(links, name) == links.end())
                links.push_back(name);
        std::string known;
        for (const auto& name : links) known += (known.empty() ? "" : ", ") + name;
        if (link_.empty() && links.size() > 1) return fmt::format("{}: has several links: link = one of {}", path_, known);
        const bool is_there = std::ranges::find(links, link_) != links.end() || (link_.empty() && !links.empty());
        if (!links.empty() && (!is_there || (ended_ && !has_begun_)))
            return fmt::format("{}: no frames of link \"{}\"; it has {}", path_, link_, known);
        const std::string why = file_.why();
        if (links.empty())
            return fmt::format("{}: {}", path_, why.empty() ? "holds no frames (tactilectl record makes such files)" : why);
        return "";
    }

    std::string path_, link_;  // "": the file has only one link
    double speed_;
    bool again_;
    mcap::MessageFile file_;
    bool has_begun_ = false, has_ahead_ = false, ended_ = false;
    Frame ahead_;
    std::uint64_t first_ns_ = 0, began_ns_ = 0;
    struct {
        unsigned bad_crc = 0, unreadable = 0;
    } left_out_;  // last counts
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<Replay>(options); }
const DriverEntry entry{.name = "replay", .measures = false, .make = make};

}  // namespace
}  // namespace tactiled
