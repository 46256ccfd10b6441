// Driver "udp": arrays of taxels in datagrams, one message of wire/array_frame.md in each. Only the device's clock shows how
// long a datagram was on its way: opening a socket proves nothing, and a silent device is no end of the link. An ICMP
// message is no end either: it answers a request, while the device may still send.
#include <fmt/format.h>
#include <linux/sock_diag.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

#include "drivers/clock.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/driver.hpp"
#include "drivers/sliced_wait.hpp"
#include "drivers/tcp.hpp"
#include "drivers/udp_batch.hpp"
#include "drivers/wire/array_frame.hpp"
#include "drivers/wire/clock_fit.hpp"
#include "drivers/wire/echo_requests.hpp"

namespace tactiled {
namespace {

constexpr unsigned kDefaultPort = 5000;

// Frames of 100 ms at 1 kHz. The kernel doubles the number for its own share of each datagram, and grants at most
// net.core.rmem_max, whose default holds 1.5 ms of the largest array.
constexpr std::size_t kBufferedFrames = 100, kMinBuffer = 212'992;
std::size_t buffer_bytes(TaxelShape shape) noexcept {
    return std::max(kMinBuffer, kBufferedFrames * (kArrayHeader + shape.size() * sizeof(float)));
}

unsigned port_of(const sockaddr_storage& address) noexcept {
    return ::ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                                                 : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

bool is_same(const sockaddr_storage& a, const sockaddr_storage& b) noexcept {
    if (a.ss_family != b.ss_family || port_of(a) != port_of(b)) return false;
    if (a.ss_family == AF_INET)
        return reinterpret_cast<const sockaddr_in&>(a).sin_addr.s_addr ==
               reinterpret_cast<const sockaddr_in&>(b).sin_addr.s_addr;
    return std::memcmp(&reinterpret_cast<const sockaddr_in6&>(a).sin6_addr,
                       &reinterpret_cast<const sockaddr_in6&>(b).sin6_addr, sizeof(in6_addr)) == 0;
}

// Makes frames of the datagrams of one device.
class Inbox {
public:
    // setup
    Inbox(TaxelShape shape, const sockaddr_storage& device, LinkCounts& counts)
        : device_(device), counts_(counts), batch_(max_array_bytes(shape)), assembler_(shape, counts) {}

    // The socket was opened, and is empty. rt: wait-free
    void reset() noexcept {
        at_ = n_ = 0;
        overflows_ = 0;  // the count of a new socket begins at 0
        ready_ = was_set_ = false;
        arrival_ = {};
        empty_ns_ = now_ns();
        assembler_.reset();
    }

    // Receives datagrams; all earlier ones must have been used. Returns the result of recvmmsg. rt: one system call
    int receive(int fd) noexcept {
        const std::uint64_t asked_ns = now_ns();
        at_ = n_ = 0;
        const int n = batch_.receive(fd);
        if (n < 0) {
            if (errno == EAGAIN) empty_ns_ = asked_ns;
            return n;
        }
        arrival_.seen_empty(empty_ns_);
        timespec wall{};
        ::clock_gettime(CLOCK_REALTIME, &wall);
        read_ns_ = now_ns();
        // A timestamp of a clock that was set is wrong until the socket was empty.
        was_set_ = !arrival_.look(read_ns_, std::uint64_t(wall.tv_sec) * 1'000'000'000u + std::uint64_t(wall.tv_nsec)) ||
                   (was_set_ && !was_drained_);
        n_ = unsigned(n);
        was_drained_ = !is_full();
        if (was_drained_) empty_ns_ = asked_ns;
        return n;
    }
    [[nodiscard]] bool is_full() const noexcept { return n_ == UdpBatch::kMax; }

    // True if next() will return a frame. rt: bounded by UdpBatch::kMax datagrams
    [[nodiscard]] bool is_ready() noexcept {
        while (!ready_ && at_ < n_) ready_ = take(at_++);
        return ready_;
    }
    [[nodiscard]] bool next(Frame& frame) noexcept {
        if (!is_ready()) return false;
        frame = ahead_;
        ready_ = false;
        return true;
    }
    // Returns the time before which the rest of an open frame is not expected; 0: no frame is open. rt: wait-free
    [[nodiscard]] std::uint64_t rest_ns() const noexcept {
        const std::uint64_t since_ns = assembler_.open_since_ns();
        return since_ns == 0 ? 0 : since_ns + spread_ns_ * 3 / 4;
    }
    // Drops the datagrams of the last receive(). rt: bounded by UdpBatch::kMax datagrams
    void drop() noexcept {
        for (; at_ < n_; ++at_) {
            counts_[TACTILED_LINK_BYTES] += std::uint32_t(batch_.datagram(at_).size());
            skip(at_);
        }
    }

    // Adds the datagrams that the socket lost after the last one that reported its count. rt: one system call
    void count_overflows(int fd) noexcept {
        std::uint32_t memory[SK_MEMINFO_VARS]{};
        socklen_t size = sizeof memory;
        if (::getsockopt(fd, SOL_SOCKET, SO_MEMINFO, memory, &size) != 0 || size <= SK_MEMINFO_DROPS * sizeof memory[0])
            return;
        counts_[TACTILED_LINK_OVERRUN] += memory[SK_MEMINFO_DROPS] - overflows_;
        overflows_ = memory[SK_MEMINFO_DROPS];
    }

    [[nodiscard]] StreamDecoder::Echo take_echo() noexcept { return assembler_.take_echo(); }
    [[nodiscard]] Taxels taxels() const noexcept { return assembler_.taxels(); }

private:
    bool skip(unsigned i) noexcept {
        counts_[TACTILED_LINK_SKIPPED] += std::uint32_t(batch_.datagram(i).size());
        return false;
    }

    // Takes a datagram. Returns true if it completed a frame.
    bool take(unsigned i) noexcept {
        const auto message = batch_.datagram(i);
        std::uint32_t overflows = overflows_;
        const std::uint64_t timestamp_ns = batch_.timestamp_ns(i, overflows);
        counts_[TACTILED_LINK_OVERRUN] += overflows - overflows_;
        overflows_ = overflows;
        counts_[TACTILED_LINK_BYTES] += std::uint32_t(message.size());
        if (!is_same(batch_.from(i), device_)) return skip(i);
        if (batch_.is_cut(i)) {
            ++counts_[TACTILED_LINK_BAD_LENGTH];
            return skip(i);
        }
        const std::uint64_t t_ns = arrival_.of(was_set_ ? 0 : timestamp_ns);
        const auto taken = assembler_.take(message, {.since_ns = t_ns, .first_ns = t_ns, .t_ns = t_ns}, ahead_);
        if (taken == ArrayAssembler::Taken::refused) {
            ++counts_[assembler_.fault()];
            return skip(i);
        }
        if (taken != ArrayAssembler::Taken::frame) return false;
        ++counts_[TACTILED_LINK_FRAMES];
        spread_ns_ = std::min(ahead_.slice_ns, spread_ns_ + spread_ns_ / 16 + 1000);
        ahead_.t_ns = t_ns;
        ahead_.taken_ns = read_ns_;
        const std::uint64_t waited_ns = read_ns_ - std::min(t_ns, read_ns_);
        const bool is_ordinary = waited_ns <= SlicedWait::kOrdinaryNs;
        if (ahead_.since_ns == 0 && !is_ordinary) ahead_.since_ns = t_ns;
        if (ahead_.since_ns != 0 && is_ordinary) ahead_.slice_ns += waited_ns;
        return true;
    }

    sockaddr_storage device_;
    LinkCounts& counts_;
    UdpBatch batch_;
    unsigned at_ = 0, n_ = 0;  // index of the next datagram in the batch; number of datagrams
    std::uint32_t overflows_ = 0;
    ArrayAssembler assembler_;
    ArrivalTime arrival_;
    bool was_set_ = false;        // the wall clock, since the datagrams of this batch may have arrived
    bool was_drained_ = true;     // by the last batch
    std::uint64_t empty_ns_ = 0;  // time at which the socket had nothing besides the batch
    std::uint64_t read_ns_ = 0;   // time of the last batch
    // Time between the first and the last piece of a frame: the smallest one, which grows by a sixteenth with each frame, so
    // that a frame that was held up delays no later one.
    std::uint64_t spread_ns_ = 0;
    Frame ahead_;
    bool ready_ = false;
};

class Udp final : public Driver {
public:
    explicit Udp(Options& options) : name_(options.text("address")), address_(tcp_address(name_, kDefaultPort)) {
        if (!name_.empty() && !address_.fault.empty())
            options.problem("address", fmt::format("address = {} {}", in_quotes(name_), address_.fault));
        const bool is_right = address_.fault.empty();
        listen_ = unsigned(options.integer("listen", {1, 65535}, is_right ? port_of(address_.bytes) : kDefaultPort));
        shape_ = read_taxel_shape(options, true);
        clock_ppm_ = double(options.integer("clock_ppm", {1, 20'000}, 200));
        is_direct_ = options.one_of("path", {"direct", "network"}, "network") == "direct";
        echo_ = options.flag("echo", false);
        if (shape_.taxels != 0) inbox_ = std::make_unique<Inbox>(shape_, address_.bytes, counts);
    }
    ~Udp() override { close(); }

    std::string open() override {
        close();
        fd_.reset(::socket(address_.bytes.ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
        if (fd_ < 0) return fmt::format("{}: no UDP socket: {}", name_, std::strerror(errno));
        const int on = 1, size = int(buffer_bytes(shape_));
        ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
        if (::setsockopt(fd_, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) != 0 ||
            ::setsockopt(fd_, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0)
            return fmt::format("{}: the socket refuses an option: {}", name_, std::strerror(errno));
        const std::uint64_t looks_ns = with_suspend_ns();
        inbox_->reset();
        if (const int error = bind_socket(); error != 0) {
            close();
            return fmt::format("UDP port {}: {}{}", listen_, std::strerror(error),
                               error == EADDRINUSE ? " (each [[link]] needs a port of its own, key listen; ss -lunp shows "
                                                     "which program has it)"
                               : error == EACCES   ? " (ports below 1024 need rights; choose another one, key listen)"
                                                   : "");
        }
        wait_.open();
        wait_.seen_empty(looks_ns);
        frame_ns_ = now_ns();
        requests_.open();
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (take(frame)) return Status::frame;
        ask_for_echo();
        if (timeout_ms != 0) leave_rest_together();
        // After a full batch more datagrams are probably there.
        const int ready = wait_.wait(fd_, inbox_->is_full() ? 0 : timeout_ms, [this] { ask_for_echo(); });
        if (ready == 0) return Status::timeout;
        if (ready < 0) return errno == EINTR ? Status::timeout : Status::disconnected;
        const std::uint64_t reads_ns = with_suspend_ns();
        if (inbox_->receive(fd_) < 0) {
            if (errno == EAGAIN) wait_.seen_empty(reads_ns);
            return errno == EAGAIN || errno == EINTR ? Status::timeout : Status::disconnected;
        }
        wait_.heard(now_ns());
        if (wait_.waited_ns() > SlicedWait::kAwayNs) {  // the process or the machine has stopped
            inbox_->drop();
            return Status::disconnected;
        }
        if (!inbox_->is_full()) wait_.seen_empty(reads_ns);
        return take(frame) ? Status::frame : Status::timeout;
    }

    void close() noexcept override {
        if (fd_ < 0) return;
        inbox_->count_overflows(fd_);
        fd_.reset();
    }

    bool has_more() const noexcept override { return inbox_->is_ready(); }
    bool can_poll() const noexcept override { return true; }
    TaxelShape taxel_shape() const noexcept override { return shape_; }
    Taxels taxels() const noexcept override { return inbox_->taxels(); }

    Route route() const noexcept override {
        return {.path = is_direct_ ? Route::Path::direct : Route::Path::network,
                .device_clock = true,
                .has_echo = echo_,
                .clock_ppm = clock_ppm_};
    }
    std::string freshness() const override {
        if (is_direct_) return "cable (declared by path = \"direct\")";
        return "clock if its pieces carry the device's time, else sequence (a pause of the device looks like a delay)";
    }
    std::string proof_advice() const override {
        return echo_ ? "the device answers no echo, or its pieces carry no time"
                     : "let the device send its time and answer echo = true";
    }

private:
    [[nodiscard]] bool take(Frame& frame) noexcept {
        const bool is_frame = inbox_->next(frame);
        requests_.answer(inbox_->take_echo());
        if (!is_frame) return false;
        // An answer may have overtaken this frame, and only the device's time shows that.
        if (frame.device_time_us != 0) requests_.prove(frame);
        frame_ns_ = frame.t_ns;
        return true;
    }

    // A wake-up for each piece costs more than its contents, so the thread sleeps while most of the rest of a frame comes.
    void leave_rest_together() const noexcept {
        constexpr std::uint64_t kWorthNs = 5'000;  // less than a wake-up costs
        constexpr std::uint64_t kMaxNs = SlicedWait::kSliceMs * 1'000'000;
        const std::uint64_t now = now_ns(), until_ns = std::min(inbox_->rest_ns(), now + kMaxNs);
        if (until_ns < now + kWorthNs) return;
        const timespec until{time_t(until_ns / 1'000'000'000), long(until_ns % 1'000'000'000)};
        ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
    }

    // Asks the device for its time when that is due. A request that cannot be sent is lost.
    void ask_for_echo() noexcept {
        if (!echo_) return;
        const auto line = requests_.request(now_ns(), frame_ns_);
        if (line.empty()) return;
        (void)::sendto(fd_, line.data(), line.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                       reinterpret_cast<const sockaddr*>(&address_.bytes), address_.size);
    }

    // Returns 0, or an error number.
    int bind_socket() noexcept {
        sockaddr_storage local{};
        local.ss_family = address_.bytes.ss_family;
        (local.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(local).sin6_port
                                     : reinterpret_cast<sockaddr_in&>(local).sin_port) = ::htons(std::uint16_t(listen_));
        return ::bind(fd_, reinterpret_cast<const sockaddr*>(&local), address_.size) == 0 ? 0 : errno;
    }

    std::string name_;
    TcpAddress address_;
    unsigned listen_ = 0;
    TaxelShape shape_;
    double clock_ppm_ = 0;
    bool is_direct_ = false, echo_ = false;
    std::unique_ptr<Inbox> inbox_;
    Descriptor fd_;
    SlicedWait wait_;
    EchoRequests requests_;
    std::uint64_t frame_ns_ = 0;  // time of the opening or of the last frame
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<Udp>(options); }

std::vector<Requirement> requirements(Options& options) {
    return {{.kind = Requirement::Kind::socket_buffer,
             .name = "net.core.rmem_max",
             .bytes = buffer_bytes(read_taxel_shape(options, true))}};
}

const DriverEntry entry{.name = "udp", .measures = true, .make = make, .requirements = requirements};

}  // namespace
}  // namespace tactiled
