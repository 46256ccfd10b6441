// Driver "can": SocketCAN, classic and FD. Messages are received in batches with the kernel's timestamps.
// can_plan.cpp reads what the messages mean; wire/can_sample.cpp converts them. An interface that is down, removed or
// bus-off counts as disconnected.
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/ethtool.h>
#include <linux/net_tstamp.h>
#include <linux/sock_diag.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "drivers/can_batch.hpp"
#include "drivers/can_netlink.hpp"
#include "drivers/can_plan.hpp"
#include "drivers/clock.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/driver.hpp"
#include "drivers/wire/can_sample.hpp"
#include "drivers/wire/clock_fit.hpp"
#include "drivers/wire/isotp.hpp"

namespace tactiled {
namespace {

constexpr int kReceiveBuffer = 1 << 20;  // requested; the kernel grants at most net.core.rmem_max
constexpr std::uint64_t kSilence_ns = 1'000'000'000;
constexpr int kMaxRestart_ms = 800;  // longest restart delay of the kernel that open() waits for

class Can final : public Driver {
public:
    explicit Can(Options& options) : name_(options.text("interface")) {
        if (name_.size() >= IFNAMSIZ)
            options.problem("interface",
                            fmt::format("interface has {} letters; Linux allows {}", name_.size(), IFNAMSIZ - 1));
        hardware_timestamps_ = options.one_of("stamp", {"software", "hardware"}, "software") == "hardware";
        is_direct_ = options.one_of("path", {"direct", "network"}, "direct") == "direct";
        restarts_ = options.one_of("bus_off", {"leave", "restart"}, "leave") == "restart";
        CanPlan plan = read_can_plan(options);
        max_bytes_ = plan.max_bytes;
        for (const std::uint32_t id :
             plan.ids) {  // with the flags in the mask; otherwise an 11-bit id would match a 29-bit id, too
            const bool extended = (id & kCanExtended) != 0;
            filters_.push_back({id, (extended ? CAN_EFF_MASK : CAN_SFF_MASK) | CAN_EFF_FLAG | CAN_RTR_FLAG});
        }
        counts_frames_ =
            std::all_of(plan.devices.begin(), plan.devices.end(), [](const auto& d) { return d.has_sequence(); });
        for (const CanTransport& transport : plan.transports) transports_.push_back({transport, {}});
        samples_ = std::make_unique<CanSamples>(std::move(plan.devices), counts);
    }
    ~Can() override { close(); }

    std::string open() override {
        close();
        fd_.reset(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW));
        overflows_ = 0;  // the count of a new socket begins at 0
        if (fd_ < 0) return fmt::format("no CAN in this kernel ({}): modprobe can_raw", std::strerror(errno));
        std::string why = bind_socket();
        if (const int error = netlink_.open(); why.empty() && error != 0)
            why = fmt::format("no rtnetlink socket: {}", std::strerror(error));
        if (why.empty()) why = check_interface();
        if (!why.empty()) {
            close();
            return why;
        }
        samples_->reset();
        for (auto& transport : transports_) transport.receiver.reset();
        fit_.reset();
        arrival_ = {};
        drained_ns_ = heard_ns_ = now_ns();
        at_ = n_ = 0;
        ready_ = ending_ = false;
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        if (!ready_ && !receive(timeout_ms)) return Status::disconnected;
        if (!ready_) return Status::timeout;
        frame = ahead_;
        ready_ = false;
        advance();
        return Status::frame;
    }

    void close() noexcept override {
        if (fd_ < 0) return;
        count_overflows(fd_);
        netlink_.close();
        fd_.reset();
    }

    bool has_more() const noexcept override { return ready_; }
    bool can_poll() const noexcept override { return true; }

    // A gateway that carries the bus over a network may hold messages back. Its frames have no clock of the device.
    Route route() const noexcept override {
        return {.path = is_direct_ ? Route::Path::direct : Route::Path::network, .device_clock = false};
    }

    std::string freshness() const override {
        if (is_direct_) return Driver::freshness();
        return counts_frames_ ? "sequence (a pause of the device looks like a delay)"
                              : "arrival (a device without a counter: a delay is not seen)";
    }
    std::string advice() const override {
        std::array<char, 64> link{};
        std::array<char, 512> device{};
        std::snprintf(link.data(), link.size(), "/sys/class/net/%s", name_.c_str());
        const ssize_t size = ::readlink(link.data(), device.data(), device.size());
        const std::string_view where(device.data(), std::size_t(std::max<ssize_t>(size, 0)));
        return !is_direct_ || where.find("/virtual/") == where.npos
                   ? ""
                   : fmt::format(
                         "{} is a virtual interface: if a gateway brings its messages over a network, write path = "
                         "\"network\", or a delay goes unseen",
                         name_);
    }

private:
    std::string bind_socket() {
        // looked up at each opening, because an adapter that returns has another index
        index_ = int(::if_nametoindex(name_.c_str()));
        if (index_ == 0)
            return fmt::format("there is no interface {}: plug it in; `ip -br link` lists the interfaces", name_);
        const int on = 1;
        const can_err_mask_t errors = CAN_ERR_MASK;
        const int timestamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_RX_HARDWARE |
                               SOF_TIMESTAMPING_RAW_HARDWARE;
        ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof kReceiveBuffer);
        if (::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, filters_.data(),
                         socklen_t(filters_.size() * sizeof filters_[0])) != 0 ||
            ::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0 ||
            ::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
            ::setsockopt(fd_, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) != 0 ||
            ::setsockopt(fd_, SOL_SOCKET, SO_TIMESTAMPING, &timestamps, sizeof timestamps) != 0)
            return fmt::format("{}: the socket refuses an option: {}", name_, std::strerror(errno));
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = index_;
        if (::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return "";
        return fmt::format("{} cannot be bound to: {}; is it a CAN interface?", name_, std::strerror(errno));
    }

    // Called after the socket is bound: an error frame reports any bus-off after this check.
    std::string check_interface() {
        CanInterface about;
        if (const auto why = ask(about); !why.empty()) return why;
        if (!about.is_can) return fmt::format("{} is no CAN interface", name_);
        if (!about.is_up && !about.has_bitrate)
            return fmt::format(
                "{0} is down and has no bitrate: ip link set {0} up type can bitrate 500000, or what the bus has", name_);
        if (!about.is_up) return fmt::format("{0} is down: ip link set {0} up", name_);
        if (about.is_bus_off)
            if (const auto why = follow_bus_off(about); !why.empty()) return why;
        if (std::exchange(bus_off_, false) && about.restart_ms != 0) ++counts[TACTILED_LINK_RESTARTED];
        if (max_bytes_ > CAN_MAX_DLEN && about.mtu < CANFD_MTU)
            return fmt::format(
                "{0} carries classic messages of 8 bytes only, but one of {1} is configured: ip link set {0} down; "
                "ip link set {0} mtu 72 (vcan), or: ip link set {0} up type can bitrate 500000 dbitrate 2000000 fd on",
                name_, max_bytes_);
        if (hardware_timestamps_ && !has_hardware_timestamps())
            return fmt::format("{} gives no hardware timestamps; use stamp = \"software\"", name_);
        return "";
    }

    std::string ask(CanInterface& about) {
        const int error = netlink_.ask(index_, about);
        return error == 0
                   ? ""
                   : fmt::format("{}: the kernel does not report its state (rtnetlink): {}", name_, std::strerror(error));
    }

    // Returns "" if the kernel has restarted the controller by now.
    std::string follow_bus_off(CanInterface& about) {
        bus_off_ = true;
        if (about.restart_ms != 0) {
            const std::uint64_t until_ns =
                now_ns() + std::uint64_t(std::min(int(about.restart_ms), kMaxRestart_ms)) * 1'000'000u;
            while (about.is_bus_off && now_ns() < until_ns) {
                const timespec wait{0, 5'000'000};
                ::clock_nanosleep(CLOCK_MONOTONIC, 0, &wait, nullptr);
                if (const auto why = ask(about); !why.empty()) return why;
            }
            return about.is_bus_off ? fmt::format(
                                          "{} is bus-off; the kernel restarts it each {} ms: check wiring, termination and "
                                          "bitrate",
                                          name_, about.restart_ms)
                                    : "";
        }
        if (!restarts_)
            return fmt::format(
                "{0} is bus-off: fix wiring, termination or bitrate, then ip link set {0} down; ip link set {0} "
                "up. bus_off = \"restart\" does so by itself",
                name_);
        int error = netlink_.set(index_, false);
        if (error == 0) error = netlink_.set(index_, true);
        if (error == EPERM)
            return fmt::format(
                "{0} is bus-off and may not be restarted by this user: give the daemon CAP_NET_ADMIN, or: ip link "
                "set {0} down; ip link set {0} up",
                name_);
        if (error != 0) return fmt::format("{} is bus-off, and restarting it failed: {}", name_, std::strerror(error));
        bus_off_ = false;
        ++counts[TACTILED_LINK_RESTARTED];
        // Returns an error although the restart succeeded, so that the node waits longer before each of several
        // restarts in a row.
        return fmt::format(
            "{} was bus-off and was set down and up; check wiring, termination and bitrate if it happens again", name_);
    }

    [[nodiscard]] ifreq request() const noexcept {
        ifreq r{};
        std::memcpy(r.ifr_name, name_.c_str(), std::min<std::size_t>(name_.size(), IFNAMSIZ - 1));
        return r;
    }

    [[nodiscard]] bool has_hardware_timestamps() const noexcept {
        ethtool_ts_info info{};
        info.cmd = ETHTOOL_GET_TS_INFO;
        ifreq r = request();
        r.ifr_data = reinterpret_cast<char*>(&info);
        return ::ioctl(fd_, SIOCETHTOOL, &r) == 0 && (info.so_timestamping & SOF_TIMESTAMPING_RAW_HARDWARE) != 0;
    }

    // The socket may have had no room for the error frame of a bus-off. Some drivers leave the carrier on during a
    // bus-off (gs_usb in Linux 6.1 does), so that only rtnetlink shows it. rtnetlink is therefore asked during
    // silence, at most once a second.
    // rt: bounded by the kernel's lock for all of its interfaces
    [[nodiscard]] bool is_bus_off_in_silence(std::uint64_t now) noexcept {
        if (now < heard_ns_ + kSilence_ns) return false;
        heard_ns_ = now;
        CanInterface about;
        return netlink_.ask(index_, about) == 0 && about.is_bus_off;
    }

    // Waits for messages and looks for the next frame in them. Returns false if the device has disconnected and all
    // messages received before are used.
    // rt: blocks on the link, for at most `timeout_ms`
    bool receive(int timeout_ms) noexcept {
        arrival_.seen_empty(drained_ns_);  // not before the last batch is used, because it contains earlier messages
        const std::uint64_t before_ns = now_ns();
        if (!ending_) {
            pollfd waiting{fd_, POLLIN, 0};
            const timespec timeout{timeout_ms / 1000, long(timeout_ms % 1000) * 1'000'000};
            const int ready = ::ppoll(&waiting, 1, &timeout, nullptr);
            if (ready < 0 && errno == EINTR) return true;
            if (ready == 0) {
                drained_ns_ = before_ns;
                return !is_bus_off_in_silence(now_ns());
            }
        }
        const std::uint64_t asked_ns = now_ns();
        const int n = batch_.receive(fd_);
        if (n < 0 && errno == EINTR) return true;
        if (n < 0 && errno == EAGAIN) {
            drained_ns_ = before_ns;
            return !ending_;
        }
        if (n < 0) {  // the interface is down or removed; the socket may still have messages received before
            if (std::exchange(ending_, true)) return false;
            return true;
        }
        at_ = 0;
        n_ = unsigned(n);
        heard_ns_ = asked_ns;
        look_at_clocks();
        if (n_ < CanBatch::kMax) drained_ns_ = asked_ns;
        advance();
        return true;
    }

    void look_at_clocks() noexcept {
        timespec wall{};
        ::clock_gettime(CLOCK_REALTIME, &wall);
        clocks_agree_ = arrival_.look(now_ns(), std::uint64_t(wall.tv_sec) * 1'000'000'000u + std::uint64_t(wall.tv_nsec));
    }

    // Stores the next frame of the batch in `ahead_`. rt: bounded by CanBatch::kMax
    void advance() noexcept {
        while (!ready_) {
            if (samples_->next(ahead_))
                ready_ = true;
            else if (at_ == n_)
                return;
            else
                take(at_++);
        }
    }

    void take(unsigned i) noexcept {
        std::uint32_t overflows = overflows_;
        const CanBatch::Timestamps timestamps = batch_.timestamps(i, overflows);
        counts[TACTILED_LINK_OVERRUN] += overflows - overflows_;
        overflows_ = overflows;
        const canfd_frame& frame = batch_.frame(i);
        if (batch_.max_bytes(i) == 0) {
            ++counts[TACTILED_LINK_BAD_LENGTH];
        } else if ((frame.can_id & CAN_ERR_FLAG) != 0) {
            take_error(frame);
        } else {
            const std::uint64_t software_ns = arrival_.of(timestamps.software_ns);
            const bool fits = hardware_timestamps_ && timestamps.hardware_ns != 0 && clocks_agree_;
            const std::uint64_t t_ns =
                fits ? std::min(fit_.monotonic_ns(timestamps.hardware_ns, software_ns), software_ns) : software_ns;
            take_frame({frame.can_id, {frame.data, frame.len}, t_ns});
        }
    }

    // Takes a message, or one frame of a message that is split into several frames.
    void take_frame(const CanArrival& arrival) noexcept {
        for (auto& [about, receiver] : transports_) {
            if (about.id != arrival.id) continue;
            const IsoTp::Found found = receiver.take(arrival.bytes, arrival.t_ns);
            samples_->lost(arrival.id, receiver.take_lost());
            if (found == IsoTp::Found::bad) ++counts[TACTILED_LINK_BAD_LENGTH];
            if (found == IsoTp::Found::first) answer(about.reply_id, receiver.answer());
            if (found != IsoTp::Found::message) return;
            return samples_->take({arrival.id, receiver.message(), receiver.t_ns()});
        }
        samples_->take(arrival);
    }

    // If the send queue is full, the message times out at the device and is lost. rt: one system call, does not wait
    void answer(std::uint32_t id, const std::array<std::uint8_t, 8>& bytes) noexcept {
        can_frame frame{};
        frame.can_id = id;
        frame.len = std::uint8_t(bytes.size());
        std::copy(bytes.begin(), bytes.end(), frame.data);
        if (::send(fd_, &frame, sizeof frame, MSG_DONTWAIT) != sizeof frame) ++counts[TACTILED_LINK_BUS_ERROR];
    }

    void take_error(const canfd_frame& frame) noexcept {
        const std::uint32_t kinds = frame.can_id & CAN_ERR_MASK;
        if ((kinds & CAN_ERR_CRTL) != 0 && (frame.data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0)
            ++counts[TACTILED_LINK_OVERRUN];  // controllers do not report how many messages were lost
        else if (kinds == CAN_ERR_RESTARTED)
            ++counts[TACTILED_LINK_RESTARTED];
        else
            ++counts[TACTILED_LINK_BUS_ERROR];
        if ((kinds & CAN_ERR_RESTARTED) != 0) bus_off_ = false;
        if ((kinds & CAN_ERR_BUSOFF) != 0) bus_off_ = ending_ = true;
    }

    // Adds the messages that the socket lost after the last message that reported its count. setup
    void count_overflows(int fd) noexcept {
        std::uint32_t memory[SK_MEMINFO_VARS]{};
        socklen_t size = sizeof memory;
        if (::getsockopt(fd, SOL_SOCKET, SO_MEMINFO, memory, &size) != 0 || size <= SK_MEMINFO_DROPS * sizeof memory[0])
            return;
        counts[TACTILED_LINK_OVERRUN] += memory[SK_MEMINFO_DROPS] - overflows_;
        overflows_ = memory[SK_MEMINFO_DROPS];
    }

    std::string name_;
    bool hardware_timestamps_ = false, restarts_ = false;
    bool is_direct_ = true, counts_frames_ = false;
    std::size_t max_bytes_ = 0;
    std::vector<can_filter> filters_;
    struct Transport {
        CanTransport about;
        IsoTp receiver;
    };
    std::vector<Transport> transports_;
    std::unique_ptr<CanSamples> samples_;
    Descriptor fd_;
    int index_ = 0;
    CanNetlink netlink_;
    std::uint64_t heard_ns_ = 0;  // time of the last message, or of the last answer of rtnetlink
    bool bus_off_ = false;        // a bus-off was observed and has not ended yet
    bool ending_ = false;         // disconnected, as soon as the messages received before are used
    CanBatch batch_;
    unsigned at_ = 0, n_ = 0;  // index of the next message in the batch; number of messages
    std::uint32_t overflows_ = 0;
    std::uint64_t drained_ns_ = 0;  // time at which the socket had nothing besides the batch
    ArrivalTime arrival_;
    ClockFit fit_;
    bool clocks_agree_ = true;  // false if the wall clock was set since the last batch
    Frame ahead_;
    bool ready_ = false;
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<Can>(options); }

std::vector<Requirement> requirements(Options& options) {
    const std::string name = options.text("interface");
    return {{Requirement::Kind::network_interface, name, fmt::format("ip link set {} up type can bitrate 1000000", name)}};
}

const DriverEntry entry{.name = "can", .measures = true, .make = make, .requirements = requirements};

}  // namespace
}  // namespace tactiled
