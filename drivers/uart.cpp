// Drivers "uart": any tty, and "tcp": a device that streams over a connection. Bytes go to the decoder of the configured
// serial format (wire/stream_format.hpp). read() = 0 or an error means that the device is disconnected; the node then opens
// it again.
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/clock.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/driver.hpp"
#include "drivers/sliced_wait.hpp"
#include "drivers/tcp.hpp"
#include "drivers/tty.hpp"
#include "drivers/wire/echo_requests.hpp"
#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

constexpr int kConnectMs = 800;                     // open() may block for a second
constexpr std::uint64_t kSilentNs = 1'000'000'000;  // the request for a stream is repeated after this silence
constexpr std::uint64_t kStopMs = 20;  // two frames of a device at 100 Hz: a frame that was being sent has ended

class Stream final : public Driver {
public:
    Stream(Options& options, bool network) : network_(network), path_(options.text(network ? "address" : "device")) {
        if (network) {
            address_ = tcp_address(path_, 1000);
            if (!path_.empty() && !address_.fault.empty())
                options.problem("address", fmt::format("address = {} {}", in_quotes(path_), address_.fault));
        } else {
            baud_ = unsigned(options.integer("baud", {50, 12'000'000}, 115'200));
        }
        declared_path_ = options.one_of("path", {"direct", "network"}, "");
        clock_ppm_ = double(options.integer("clock_ppm", {1, 20'000}, 200));
        const auto exists_here = [&](const StreamFormat& format) { return network ? format.on_tcp : format.on_tty; };
        const std::string name = options.one_of("format", StreamFormats::names(exists_here));
        if (const StreamFormat* const format = StreamFormats::find(name, exists_here))
            decoder_ = format->make(options, counts);
        else
            options.accept_other_keys();
        echo_ = options.flag("echo", false);
        if (echo_ && decoder_ != nullptr && !decoder_->has_echo())
            options.problem("echo", "echo = true needs a format with answers: format = \"lines\", or \"cobs\" with taxels");
    }
    ~Stream() override { close(); }

    std::string open() override {
        assert(decoder_ != nullptr);
        close();
        std::string why;
        wait_.seen_empty(with_suspend_ns());
        fd_.reset(network_ ? open_tcp(address_, path_, kConnectMs, why)
                           : open_tty(path_, {.baud = baud_, .answers = echo_ || !decoder_->start_bytes().empty()}, why));
        if (fd_ < 0) return why;
        decoder_->reset();
        is_direct_ = declared_path_.empty() ? !network_ && is_local_tty(path_) : declared_path_ == "direct";
        wait_.open();
        asked_ns_ = now_ns();
        asked_again_ = streamed_ = false;
        requests_.open();
        if (!ask_for_stream(!network_)) return fmt::format("{}: cannot send: {}", path_, std::strerror(errno));
        hung_up_at_open_ = std::exchange(hung_up_, false);
        if (!tty_overruns(fd_, overruns_at_open_)) overruns_at_open_ = 0;
        overruns_before_ = counts[TACTILED_LINK_OVERRUN];
        // Waiting bytes arrived at an unknown time since the link was connected or flushed, because this thread may not have
        // been scheduled in the meantime.
        const std::uint64_t looks_ns = with_suspend_ns();
        if (waiting_bytes() == 0) wait_.seen_empty(looks_ns);
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (take(frame)) return Status::frame;
        ask_for_echo();
        if (now_ns() - asked_ns_ > kSilentNs && !decoder_->start_bytes().empty()) {  // the device may have lost its supply
            asked_ns_ = now_ns();
            asked_again_ = streamed_;
            if (!ask_for_stream(false)) return Status::disconnected;
        }
        // Waits once; a chunk that completes no frame ends in `timeout`, so that the caller keeps its cycle.
        const int ready = wait_.wait(fd_, timeout_ms, [this] { ask_for_echo(); });
        if (ready == 0) return Status::timeout;
        if (ready < 0 && errno == EINTR) return Status::timeout;
        if (ready < 0) return hang_up();
        const std::uint64_t reads_ns = with_suspend_ns();
        const ssize_t size = ::read(fd_, bytes_.data(), bytes_.size());
        if (size < 0 && errno == EAGAIN) wait_.seen_empty(reads_ns);
        if (size < 0 && (errno == EINTR || errno == EAGAIN)) return Status::timeout;
        if (size <= 0) return hang_up();  // 0 on a tty is a hang-up and not an end of file
        const std::uint64_t t_ns = now_ns(), waited_ns = wait_.waited_ns();
        wait_.heard(t_ns);
        if (waited_ns > SlicedWait::kAwayNs) return too_old(std::size_t(size));
        since_ns_ = waited_ns > SlicedWait::kOrdinaryNs ? t_ns - waited_ns : 0;
        // a read from a full tty returns one byte less
        if (std::size_t(size) + 1 < bytes_.size()) wait_.seen_empty(reads_ns);
        decoder_->push({bytes_.data(), std::size_t(size)}, t_ns, t_ns - waited_ns);
        if (!take(frame)) return Status::timeout;
        streamed_ = true;
        if (std::exchange(asked_again_, false)) ++counts[TACTILED_LINK_RESTARTED];
        return Status::frame;
    }

    void close() noexcept override {
        if (fd_ < 0) return;
        (void)tell(decoder_->stop_bytes());
        interrupt();
    }

    void interrupt() noexcept override {
        if (fd_ < 0) return;
        if (std::uint32_t overruns = 0; tty_overruns(fd_, overruns))
            counts[TACTILED_LINK_OVERRUN] = overruns_before_ + (overruns - overruns_at_open_);
        fd_.reset();
    }

    bool has_more() const noexcept override { return decoder_->is_ready(); }
    bool can_poll() const noexcept override { return true; }
    TaxelShape taxel_shape() const noexcept override { return decoder_ == nullptr ? TaxelShape{} : decoder_->taxel_shape(); }
    Taxels taxels() const noexcept override { return decoder_->taxels(); }

    std::string freshness() const override {
        const std::string by_frames = decoder_ == nullptr ? "" : decoder_->freshness();
        if (declared_path_ == "direct" || (declared_path_.empty() && !network_ && is_local_tty(path_)))
            return "cable (a local port, whose buffers and rate bound the delay)";
        if (declared_path_.empty() && !network_ && ::access(path_.c_str(), F_OK) != 0)
            return "cable if the port is one of this machine (it is not there now), else " + by_frames;
        return by_frames;
    }
    std::string advice() const override { return decoder_ == nullptr ? "" : decoder_->advice(); }
    std::string proof_advice() const override {
        const bool has_echo = decoder_ != nullptr && decoder_->has_echo();
        return std::string(echo_      ? "the device answers no echo"
                           : has_echo ? "let the device answer echo = true"
                                      : "let the device send lines, and answer echo = true") +
               (network_ ? "" : ", or write path = \"direct\" if this is a cable");
    }

    // A connection ends at the device or at its serial server, which discards the data in between. The program behind
    // a pseudo terminal does not notice that it was opened again.
    Route route() const noexcept override {
        return {.path = is_direct_ ? Route::Path::direct : Route::Path::network,
                .device_clock = true,
                .reopening_discards = network_ && !is_direct_,
                .has_echo = echo_,
                .clock_ppm = clock_ppm_,
                .is_new = !network_ && hung_up_at_open_,
                .is_assumed = declared_path_.empty()};
    }

private:
    [[nodiscard]] bool take(Frame& frame) noexcept {
        const bool is_frame = decoder_->next(frame);
        requests_.answer(decoder_->take_echo());  // in order: the decoder has read no answer after this frame
        if (!is_frame) return false;
        if (frame.since_ns == 0) {
            frame.since_ns = since_ns_;
            frame.slice_ns = wait_.slice_ns();
        } else {  // its bytes came in several reads
            frame.slice_ns += std::max(wait_.slice_ns(), SlicedWait::kOrdinaryNs);
        }
        requests_.prove(frame);
        asked_ns_ = frame.t_ns;
        return true;
    }

    // Asks the device for its time when that is due. A device that never reads fills the buffers on the way to it; then the
    // request is lost, and frames still come.
    void ask_for_echo() noexcept {
        if (echo_) (void)tell(requests_.request(now_ns(), asked_ns_));
    }

    Status hang_up() noexcept {
        hung_up_ = true;
        return Status::disconnected;
    }

    // A device that already streams reacts only to its stop bytes. `stop_first`: a tty, at opening.
    bool ask_for_stream(bool stop_first) noexcept {
        if (decoder_->start_bytes().empty()) return true;
        if (stop_first) {
            if (!tell(decoder_->stop_bytes())) return false;
            const std::uint64_t sent_ms = 10 * 1000 * decoder_->stop_bytes().size() / baud_;
            const timespec pause{0, long(std::min<std::uint64_t>(sent_ms + kStopMs, 900)) * 1'000'000};
            ::clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, nullptr);
            wait_.seen_empty(with_suspend_ns());
            if (!flush_tty(fd_)) return false;  // discards the bytes sent until it stopped
        }
        return tell(decoder_->start_bytes());
    }

    // Called after this thread or the whole process was stopped. Further bytes of that age may wait in uncounted buffers
    // (the lower buffers of a tty, the other end of a connection whose window was closed), so old and new bytes can only be
    // separated by a new opening.
    Status too_old(std::size_t size) noexcept {
        const std::uint32_t lost = std::uint32_t(size) + waiting_bytes();
        counts[TACTILED_LINK_BYTES] += lost;
        counts[TACTILED_LINK_SKIPPED] += lost;
        decoder_->reset();
        return Status::disconnected;
    }

    std::uint32_t waiting_bytes() const noexcept {
        int size = 0;
        return ::ioctl(fd_, FIONREAD, &size) == 0 ? std::uint32_t(size) : 0;
    }

    bool tell(std::span<const std::uint8_t> bytes) noexcept {
        if (bytes.empty()) return true;
        return ssize_t(bytes.size()) ==
               (network_ ? ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) : ::write(fd_, bytes.data(), bytes.size()));
    }

    bool network_;
    std::string path_;  // or address
    TcpAddress address_;
    unsigned baud_ = 0;
    std::string declared_path_;  // "": as the kernel reports
    double clock_ppm_ = 0;
    bool is_direct_ = false;
    bool hung_up_ = false, hung_up_at_open_ = false;  // the other end has closed the port
    bool echo_ = false;
    EchoRequests requests_;
    // nullptr if the configuration has an error: the node then does not open the link
    std::unique_ptr<StreamDecoder> decoder_;
    Descriptor fd_;
    SlicedWait wait_;
    std::uint64_t since_ns_ = 0;                   // of the bytes in the decoder, see Frame
    std::uint64_t asked_ns_ = 0;                   // time of the request for the stream, or of its last frame
    bool asked_again_ = false, streamed_ = false;  // since open(); a device that is only late was not restarted
    std::uint32_t overruns_at_open_ = 0, overruns_before_ = 0;
    std::array<std::uint8_t, StreamDecoder::kMaxBytes> bytes_{};
};

std::unique_ptr<Driver> make_uart(Options& options) { return std::make_unique<Stream>(options, false); }
std::unique_ptr<Driver> make_tcp(Options& options) { return std::make_unique<Stream>(options, true); }

std::vector<Requirement> serial_port(Options& options) { return {{Requirement::Kind::serial_port, options.text("device")}}; }

const DriverEntry uart{.name = "uart", .measures = true, .make = make_uart, .requirements = serial_port};
const DriverEntry tcp{.name = "tcp", .measures = true, .make = make_tcp};

}  // namespace
}  // namespace tactiled
