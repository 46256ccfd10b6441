// Driver "modbus": the master of devices on an RTU line or behind one TCP connection. One request is open at a time, and a
// frame is one whole answer.
//
// libmodbus is not used here. It reads an answer in one blocking call. When that call ends in time for the link's thread,
// the bytes received so far are lost; libmodbus also waits for the length that a foreign message declares. It fails the
// tests Slave.AnAnswerInPiecesIsWaitedForByReadsThatReturnInTime and
// Slave.AServerThatClosesOrSpeaksSomethingElseIsDisconnected.
//
// Late answers. Over TCP a transaction number identifies them. An RTU answer has only unit, function and length. A request
// without a good answer therefore makes its unit doubtful, and a doubtful unit is first asked for a number of registers that
// no other request to it uses: a probe. Four numbers are used in rotation. A slave answers in order, so after an answer of
// that length no older answer can arrive, unless it is older than the last probe of the same length. A length that the slave
// refuses is asked for no more; the refusal of the last one is taken for an answer.
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <utility>
#include <vector>

#include "drivers/clock.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/driver.hpp"
#include "drivers/modbus_device.hpp"
#include "drivers/tcp.hpp"
#include "drivers/tty.hpp"
#include "drivers/wire/modbus_message.hpp"

namespace tactiled {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;
constexpr int kConnectMs = 800;     // open() may block for a second
constexpr unsigned kMissedMax = 3;  // consecutive requests without an answer after which its counter may restart
constexpr std::uint64_t kMaxPauseNs = kSecond;

TtySettings::Parity parity_of(const std::string& name) {
    return name == "even" ? TtySettings::Parity::even : name == "odd" ? TtySettings::Parity::odd : TtySettings::Parity::none;
}

class Modbus final : public Driver {
public:
    explicit Modbus(Options& options) : wire_(options.has("address") ? ModbusWire::tcp : ModbusWire::rtu), answers_(wire_) {
        wire_ == ModbusWire::tcp ? read_connection(options) : read_line(options);
        timeout_ns_ = std::uint64_t(options.integer("timeout_ms", {5, 5000}, 50)) * 1'000'000;
        for (auto& table : options.tables("slave", 16)) add(read_modbus_device(table, wire_), table);
        if (!options.has("slave"))
            options.problem("slave", "there is no [[link.slave]]; add at least one with its registers");
        check_load(options);
    }

    std::string open() override {
        close();
        std::string why;
        fd_.reset(wire_ == ModbusWire::tcp ? open_tcp(address_, where_, kConnectMs, why) : open_tty(where_, tty_, why));
        if (fd_ < 0) return why;
        answers_.reset();
        choose_probes();
        asking_ = nullptr;
        quiet_until_ns_ = 0;
        for (auto& device : devices_) {
            device.due_ns = now_ns();
            device.started = device.missed = 0;
            device.was_set_up = false;
            device.sequence.reset();
            // an earlier user of the line may have sent a request to this unit
            units_[device.is.unit].is_doubted = wire_ == ModbusWire::rtu;
        }
        return "";
    }

    Status read(Frame& frame, int timeout_ms) noexcept override {
        const std::uint64_t until_ns = now_ns() + std::uint64_t(timeout_ms) * 1'000'000;
        for (;;) {
            if (asking_ == nullptr) {
                Device& next = *std::ranges::min_element(devices_, {}, &Device::due_ns);
                const std::uint64_t begins_ns = std::max(next.due_ns, quiet_until_ns_);
                if (!wait(std::min(begins_ns, until_ns), POLLRDHUP)) return Status::disconnected;
                if (now_ns() < begins_ns) return Status::timeout;
                if (!ask(next)) return Status::disconnected;
            }
            if (!wait(std::min(deadline_ns_, until_ns), POLLIN) || !take()) return Status::disconnected;
            const auto found = answers_.next();
            const bool late = now_ns() >= deadline_ns_ || with_suspend_ns() >= too_old_ns_;
            counts[TACTILED_LINK_SKIPPED] += std::exchange(answers_.skipped, 0);
            if (found == ModbusAnswers::Found::broken) {
                ++counts[TACTILED_LINK_BAD_LENGTH];
                return Status::disconnected;  // a new connection begins at the boundary of a message
            }
            if (late)  // complete or not: if this process was stopped (SIGSTOP, suspend), the answer may be of any age
                failed(found == ModbusAnswers::Found::nothing ? answers_.missing() : TACTILED_LINK_BUS_ERROR);
            else if (found != ModbusAnswers::Found::nothing && answered(found, frame))
                return Status::frame;
            if (now_ns() >= until_ns) return Status::timeout;
        }
    }

    Route route() const noexcept override { return {.path = Route::Path::polled}; }
    std::string freshness() const override {
        return "request (each frame answers a request; a gateway must not answer from a cache)";
    }

    void close() noexcept override { fd_.reset(); }

private:
    struct Device {
        ModbusDevice is;
        std::uint64_t period_ns;
        // on the device's own grid, so the period does not drift with the duration of answers
        std::uint64_t due_ns = 0;
        std::size_t started = 0;                         // number of writes of is.start that were confirmed
        bool was_set_up = false, was_restarted = false;  // since open()
        unsigned missed = 0;                             // consecutive requests without a good answer
        SequenceTracker sequence;
    };
    struct Unit {
        bool is_doubted = false;
        std::array<std::uint16_t, 4> probes{};  // numbers of registers that no other request to this unit has
        std::size_t n_probes = 0, probe = 0;    // probes that were not refused; index of the last one
    };
    enum class Asked { probe, start, values };

    void read_connection(Options& options) {
        where_ = options.text("address");
        address_ = tcp_address(where_, 502);
        if (!where_.empty() && !address_.fault.empty())
            options.problem("address", fmt::format("address = {} {}", in_quotes(where_), address_.fault));
        for (const char* key : {"device", "baud", "parity", "rs485"})
            if (options.has(key))
                options.problem(key, fmt::format("{} is of a serial line, address of TCP: one of them", key));
    }

    void read_line(Options& options) {
        where_ = options.text("device");
        tty_.baud = unsigned(options.integer("baud", {300, 4'000'000}, 19200));
        tty_.parity = parity_of(options.one_of("parity", {"none", "odd", "even"}, "even"));
        // a receiver that expects one stop bit takes the second one for a pause
        tty_.two_stop_bits = tty_.parity == TtySettings::Parity::none;
        tty_.rs485 = options.flag("rs485", false);
        tty_.answers = true;
        byte_ns_ = 11 * kSecond / tty_.baud;
        // 3.5 characters; the standard fixes 1.75 ms above 19200 baud (Modbus over serial line 1.02, 2.5.1.1).
        silence_ns_ = tty_.baud > 19200 ? 1'750'000 : 7 * byte_ns_ / 2;
    }

    void add(ModbusDevice device, Options& table) {
        for (const auto& other : devices_)
            if (other.is.device == device.device)
                table.problem(
                    "device",
                    fmt::format("device = {} is another [[link.slave]] already; sensors refer to it by this number",
                                device.device));
        const auto period_ns = std::uint64_t(double(kSecond) / device.rate_Hz);
        devices_.push_back({.is = std::move(device), .period_ns = period_ns, .sequence = {}});
    }

    // Chooses the shortest lengths, because a unit may refuse lengths above that of its values.
    void choose_probes() {
        for (std::size_t unit = 0; unit < units_.size(); ++unit) {
            units_[unit].n_probes = 0;
            units_[unit].probe = units_[unit].probes.size() - 1;  // the first one is next
            for (std::uint16_t registers = 1; units_[unit].n_probes < units_[unit].probes.size(); ++registers)
                if (std::none_of(devices_.begin(), devices_.end(), [&](const Device& device) {
                        return device.is.unit == unit && device.is.set.count == registers;
                    }))
                    units_[unit].probes[units_[unit].n_probes++] = registers;
        }
    }

    // Refuses requests that exceed the capacity of the line: all answers would be late without an obvious reason.
    void check_load(Options& options) {
        if (wire_ == ModbusWire::tcp) return;
        double load = 0;
        for (const auto& device : devices_) {
            const ModbusRequest request{.function = device.is.function, .count = device.is.set.count};
            load +=
                device.is.rate_Hz * 1e-9 * double((8 + modbus_answer_bytes(wire_, request)) * byte_ns_ + 2 * silence_ns_);
        }
        if (load > 1)
            options.problem("baud",
                            fmt::format("the [[link.slave]] ask {:.0f} % of what {} baud can carry: a higher baud, or "
                                        "rate_Hz divided by {:.1f} in all",
                                        100 * load, tty_.baud, std::ceil(10 * load) / 10));
    }

    // Sleeps until `until_ns` or until the device has data. Returns false if the device is disconnected.
    bool wait(std::uint64_t until_ns, short events) noexcept {
        const std::uint64_t now = now_ns();
        const std::uint64_t left_ns = until_ns > now ? until_ns - now : 0;
        const timespec timeout{long(left_ns / kSecond), long(left_ns % kSecond)};
        pollfd waiting{fd_, events, 0};
        const int ready = ::ppoll(&waiting, 1, &timeout, nullptr);
        return ready == 0 || (ready < 0 && errno == EINTR) ||
               (ready > 0 && (waiting.revents & (POLLERR | POLLHUP | POLLNVAL | POLLRDHUP)) == 0);
    }

    // Reads the available bytes, limited by the buffer. Returns false if the device is disconnected.
    bool take() noexcept {
        const auto room = answers_.room();
        const ssize_t size =
            wire_ == ModbusWire::tcp ? ::recv(fd_, room.data(), room.size(), 0) : ::read(fd_, room.data(), room.size());
        if (size < 0) return errno == EAGAIN || errno == EINTR;
        if (size == 0) return false;
        last_byte_ns_ = now_ns();
        answers_.took(std::size_t(size));
        counts[TACTILED_LINK_BYTES] += std::uint32_t(size);
        return true;
    }

    // Returns the device whose `start` writes are due before anything is read from this unit, else nullptr. Several entries
    // may share one unit.
    Device* to_set_up(std::uint8_t unit) noexcept {
        for (Device& device : devices_)
            if (device.is.unit == unit && device.started < device.is.start.size()) return &device;
        return nullptr;
    }

    bool ask(Device& device) noexcept {
        const ModbusDevice& is = device.is;
        Unit& unit = units_[is.unit];
        request_ = {.transaction = ++transaction_, .unit = is.unit, .function = is.function, .at = is.set.at};
        if (unit.is_doubted) {
            asked_ = Asked::probe;
            unit.probe = (unit.probe + 1) % unit.n_probes;
            request_.count = unit.probes[unit.probe];
        } else if ((set_up_ = to_set_up(is.unit)) != nullptr) {
            asked_ = Asked::start;
            const auto& write = set_up_->is.start[set_up_->started];
            request_.function = write.function;
            request_.at = write.at;
            request_.value = write.value;
        } else {
            asked_ = Asked::values;
            request_.count = is.set.count;
        }
        // Bytes since the last answer are noise, or an answer that was too late.
        for (int chunk = 0; wire_ == ModbusWire::rtu && chunk < 4; ++chunk) {
            const std::uint32_t before = counts[TACTILED_LINK_BYTES];
            if (!take()) return false;
            answers_.expect(request_);
            if (counts[TACTILED_LINK_BYTES] == before) break;
        }
        answers_.expect(request_);
        std::array<std::uint8_t, kModbusMaxRequest> bytes;
        const std::size_t size = encode_modbus(wire_, request_, bytes);
        // Computed before send(), because this process may be stopped after send() while the answer arrives.
        const std::uint64_t may_take_ns = timeout_ns_ + (size + modbus_answer_bytes(wire_, request_)) * byte_ns_;
        deadline_ns_ = now_ns() + may_take_ns;
        too_old_ns_ = with_suspend_ns() + may_take_ns;
        const ssize_t sent =
            wire_ == ModbusWire::tcp ? ::send(fd_, bytes.data(), size, MSG_NOSIGNAL) : ::write(fd_, bytes.data(), size);
        if (sent != ssize_t(size)) return false;  // a partial request cannot be withdrawn
        asking_ = &device;
        return true;
    }

    // Returns true if `frame` was filled.
    bool answered(ModbusAnswers::Found found, Frame& frame) noexcept {
        using Found = ModbusAnswers::Found;
        Device& device = *asking_;
        const bool alive = found == Found::good || (found == Found::refused && asked_ == Asked::probe);
        if (!alive) {
            failed(found == Found::wrong_length ? TACTILED_LINK_BAD_LENGTH : TACTILED_LINK_BUS_ERROR);
            return false;
        }
        asking_ = nullptr;
        quiet_until_ns_ = last_byte_ns_ + silence_ns_;
        const bool no_such_length = found == Found::refused && (answers_.exception() == modbus::kIllegalAddress ||
                                                                answers_.exception() == modbus::kIllegalValue);
        if (Unit& unit = units_[device.is.unit]; no_such_length && unit.n_probes > 1)
            unit.probes[unit.probe] = unit.probes[--unit.n_probes];
        else if (asked_ == Asked::probe)
            unit.is_doubted = false;
        if (asked_ == Asked::start && ++set_up_->started == set_up_->is.start.size() &&
            std::exchange(set_up_->was_set_up, true)) {
            ++counts[TACTILED_LINK_RESTARTED];
            set_up_->was_restarted = true;
        }
        if (asked_ != Asked::values) return false;  // the device's values are still due
        device.missed = 0;
        plan(device, 0);
        if (!read_registers(device.is.set, answers_.registers(), device.sequence, counts, frame)) return false;
        frame.t_ns = frame.taken_ns = last_byte_ns_;
        frame.since_ns = deadline_ns_ - timeout_ns_;  // time of the request plus the duration of both messages
        frame.device = device.is.device;
        frame.restarted = std::exchange(device.was_restarted, false);
        ++counts[TACTILED_LINK_FRAMES];
        return true;
    }

    void failed(tactiled_link_count kind) noexcept {
        ++counts[kind];
        Device& device = *std::exchange(asking_, nullptr);
        units_[device.is.unit].is_doubted = wire_ == ModbusWire::rtu;
        quiet_until_ns_ = now_ns() + silence_ns_;
        // The unit may have lost its supply, and with it its settings and counters. A slow poll misses at most one
        // request.
        for (Device& other : devices_)
            if (other.is.unit == device.is.unit) other.started = 0;
        if (++device.missed >= kMissedMax) device.sequence.reset();
        // Doubles the pause each time, so that an absent unit takes little time from the others on its line.
        const unsigned doublings = std::min(device.missed - 1, 10u);
        plan(device, doublings == 0 ? 0 : std::min(device.period_ns << doublings, kMaxPauseNs));
    }

    // Sets the next time on the device's grid that is at least `pause_ns` away.
    void plan(Device& device, std::uint64_t pause_ns) noexcept {
        const std::uint64_t after_ns = now_ns() + pause_ns;
        device.due_ns += device.period_ns * (1 + (std::max(after_ns, device.due_ns) - device.due_ns) / device.period_ns);
    }

    ModbusWire wire_;
    std::string where_;  // path or address
    TtySettings tty_;
    TcpAddress address_;
    std::uint64_t timeout_ns_ = 0, byte_ns_ = 0, silence_ns_ = 0;  // the last two are 0 over TCP
    std::vector<Device> devices_;
    std::array<Unit, 256> units_;

    Descriptor fd_;
    ModbusAnswers answers_;
    ModbusRequest request_;
    Device* asking_ = nullptr;  // device of the open request
    Device* set_up_ = nullptr;  // device whose write is open
    Asked asked_ = Asked::values;
    std::uint16_t transaction_ = 0;
    std::uint64_t deadline_ns_ = 0, quiet_until_ns_ = 0, last_byte_ns_ = 0;
    std::uint64_t too_old_ns_ = 0;  // deadline_ns_ on the clock that continues during suspend
};

std::unique_ptr<Driver> make(Options& options) { return std::make_unique<Modbus>(options); }

std::vector<Requirement> requirements(Options& options) {
    if (!options.has("device")) return {};  // over TCP
    return {{Requirement::Kind::serial_port, options.text("device")}};
}

const DriverEntry entry{.name = "modbus", .measures = true, .make = make, .requirements = requirements};

}  // namespace
}  // namespace tactiled
