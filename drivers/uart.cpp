// Driver "uart": any tty. Bytes go to the decoder of the configured wire format; read() = 0 or an error means that the
// device is gone, and the node opens it again.
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/tty.hpp"
#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "drivers/wire/ft300_frame.hpp"

namespace tactiled {
namespace {

constexpr std::uint64_t kSilentNs = 1'000'000'000;  // 100 frames of the FT 300
constexpr std::uint64_t kStopMs = 20;               // two of its frames: what it was sending has ended

class Uart final : public Driver {
public:
    explicit Uart(Options& options)
        : path_(options.text("device")), baud_(unsigned(options.integer("baud", {50, 12'000'000}, 115'200))) {
        const std::string format_name = options.one_of("format", {"cobs", "lines", "ft300"});
        if (format_name == "ft300") {
            decoder_ = std::make_unique<Ft300Decoder>(std::uint8_t(options.integer("unit", {1, 247}, 9)), counts);
        } else if (format_name == "lines") {
            AsciiFormat format;
            format.channels = unsigned(options.integer("channels", {1, double(kMaxChannels)}));
            format.checksum = options.flag("checksum", false);
            format.sequence = options.flag("sequence", false);
            format.time_us = options.flag("time_us", false);
            decoder_ = std::make_unique<AsciiDecoder>(format, counts);
        } else {
            decoder_ = std::make_unique<CobsDecoder>(counts);
        }
    }
    ~Uart() override { close(); }

    std::string open() override {
        close();
        std::string why;
        fd_ = open_tty(path_, {.baud = baud_, .answers = !decoder_->start_bytes().empty()}, why);
        if (fd_ < 0) return why;
        decoder_->reset();
        asked_ns_ = now_ns();
        asked_again_ = false;
        if (!ask_for_stream(true)) return fmt::format("{}: cannot send: {}", path_, std::strerror(errno));
        if (!tty_overruns(fd_, overruns_at_open_)) overruns_at_open_ = 0;
        overruns_before_ = counts[TACTILED_LINK_OVERRUN];
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (decoder_->next(frame)) return Status::frame;
        if (now_ns() - asked_ns_ > kSilentNs && !decoder_->start_bytes().empty()) {  // it may have lost its supply
            asked_ns_ = now_ns();
            asked_again_ = true;
            if (!ask_for_stream(false)) return Status::gone;
        }
        // Waits once; a chunk that completes no frame ends in `timeout`, so that the caller keeps its turn.
        pollfd waiting{fd_, POLLIN, 0};
        const timespec timeout{timeout_ms / 1000, long(timeout_ms % 1000) * 1'000'000};
        const int ready = ::ppoll(&waiting, 1, &timeout, nullptr);
        if (ready == 0 || (ready < 0 && errno == EINTR)) return Status::timeout;
        if (ready < 0) return Status::gone;
        const ssize_t size = ::read(fd_, bytes_.data(), bytes_.size());
        if (size < 0 && (errno == EINTR || errno == EAGAIN)) return Status::timeout;
        if (size <= 0) return Status::gone;  // 0 on a tty is a hang-up, not an end of file to be read again
        decoder_->push({bytes_.data(), std::size_t(size)}, now_ns());
        if (!decoder_->next(frame)) return Status::timeout;
        asked_ns_ = frame.t_ns;
        if (std::exchange(asked_again_, false)) ++counts[TACTILED_LINK_RESTARTED];
        return Status::frame;
    }

    void close() noexcept override {
        if (fd_ < 0) return;
        (void)send(decoder_->stop_bytes());
        if (std::uint32_t overruns = 0; tty_overruns(fd_, overruns))
            counts[TACTILED_LINK_OVERRUN] = overruns_before_ + (overruns - overruns_at_open_);
        ::close(fd_);
        fd_ = -1;
    }

    bool has_more() const noexcept override { return decoder_->is_ready(); }

private:
    // A device that streams already hears nothing but its stop.
    bool ask_for_stream(bool stop_first) noexcept {
        if (decoder_->start_bytes().empty()) return true;
        if (stop_first) {
            if (!send(decoder_->stop_bytes())) return false;
            const std::uint64_t sent_ms = 10 * 1000 * decoder_->stop_bytes().size() / baud_;
            const timespec pause{0, long(std::min<std::uint64_t>(sent_ms + kStopMs, 900)) * 1'000'000};
            ::clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, nullptr);
        }
        return send(decoder_->start_bytes());
    }

    bool send(std::span<const std::uint8_t> bytes) noexcept {
        return bytes.empty() || ::write(fd_, bytes.data(), bytes.size()) == ssize_t(bytes.size());
    }

    std::string path_;
    unsigned baud_;
    std::unique_ptr<StreamDecoder> decoder_;
    int fd_ = -1;
    std::uint64_t asked_ns_ = 0;  // for the stream, or when it last brought a frame
    bool asked_again_ = false;
    std::uint32_t overruns_at_open_ = 0, overruns_before_ = 0;
    std::array<std::uint8_t, StreamDecoder::kMostBytes> bytes_{};
};

const DriverEntry entry{"uart", [](Options& options) -> std::unique_ptr<Driver> { return std::make_unique<Uart>(options); }};

}  // namespace
}  // namespace tactiled
