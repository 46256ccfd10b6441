// Driver "uart": any tty. Bytes go to the decoder of the configured wire format; read() = 0 or an error means that the
// device is gone, and the node opens it again.
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/tty.hpp"
#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"

namespace tactiled {
namespace {

class Uart final : public Driver {
public:
    explicit Uart(Options& options)
        : path_(options.text("device")), baud_(unsigned(options.integer("baud", {50, 12'000'000}, 115'200))) {
        if (options.one_of("format", {"cobs", "lines"}) == "lines") {
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
        fd_ = open_tty(path_, {.baud = baud_}, why);
        if (fd_ < 0) return why;
        decoder_->reset();
        if (!tty_overruns(fd_, overruns_at_open_)) overruns_at_open_ = 0;
        overruns_before_ = counts[TACTILED_LINK_OVERRUN];
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (decoder_->next(frame)) return Status::frame;
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
        return decoder_->next(frame) ? Status::frame : Status::timeout;
    }

    void close() noexcept override {
        if (fd_ < 0) return;
        if (std::uint32_t overruns = 0; tty_overruns(fd_, overruns))
            counts[TACTILED_LINK_OVERRUN] = overruns_before_ + (overruns - overruns_at_open_);
        ::close(fd_);
        fd_ = -1;
    }

    bool has_more() const noexcept override { return decoder_->is_ready(); }

private:
    std::string path_;
    unsigned baud_;
    std::unique_ptr<StreamDecoder> decoder_;
    int fd_ = -1;
    std::uint32_t overruns_at_open_ = 0, overruns_before_ = 0;
    std::array<std::uint8_t, StreamDecoder::kMostBytes> bytes_{};
};

const DriverEntry entry{"uart", [](Options& options) -> std::unique_ptr<Driver> { return std::make_unique<Uart>(options); }};

}  // namespace
}  // namespace tactiled
