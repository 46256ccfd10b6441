// tactiled, the daemon: reads the configuration, creates the segment, starts the threads, and waits for a signal.
#include <fmt/format.h>
#include <sysexits.h>
#include <systemd/sd-daemon.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cinttypes>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <memory>

#include "node/control.hpp"
#include "node/gpio_outputs.hpp"
#include "node/log.hpp"
#include "node/method_costs.hpp"
#include "node/modbus/server.hpp"
#include "node/progress.hpp"
#include "node/realtime.hpp"
#include "node/reload.hpp"
#include "node/sandbox.hpp"
#include "node/setup.hpp"
#include "node/shm/folder.hpp"
#include "node/threads.hpp"
#include "node/version.hpp"
#include "node/wake_word.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

// Feeds systemd's watchdog (WatchdogSec=) while the pipeline and each link make progress, so that systemd restarts a daemon
// that hangs. Without a watchdog the thread that does not respond is only logged.
class Watchdog {
public:
    explicit Watchdog(Progress& progress) : progress_(progress) {
        if (::sd_watchdog_enabled(0, &timeout_us_) <= 0) timeout_us_ = 0;
        thread_.start("watchdog", 0, -1, [this] { run(); });
    }
    ~Watchdog() {
        stop_.store(true);
        end_.wake();
        thread_.join();
    }
    Watchdog(const Watchdog&) = delete;
    Watchdog& operator=(const Watchdog&) = delete;

private:
    // short compared with WatchdogSec, because the last feeding may be this long after the begin of the hang
    static constexpr std::uint64_t kLookNs = 250'000'000;

    void run() noexcept {
        std::string_view said;
        std::uint64_t stuck_ns = 0;
        for (;;) {
            const std::uint32_t seen = end_.value();
            if (stop_.load()) return;
            const std::uint64_t now_ns = monotonic_ns();
            const std::string_view stuck = progress_.look(now_ns);
            if (stuck.empty() && timeout_us_ != 0) ::sd_notify(0, "WATCHDOG=1");
            if (stuck != said) {
                if (stuck.empty())
                    log_line(LogLevel::warning, "{}: responds again", said);
                else if (timeout_us_ == 0)
                    log_line(LogLevel::error, "{}: does not respond", stuck);
                else
                    log_line(LogLevel::error, "{}: does not respond; systemd restarts the daemon if this lasts {} ms", stuck,
                             timeout_us_ / 1000);
                said = stuck;
                stuck_ns = now_ns;
            }
            // systemd's own timer is up to 250 ms late. It is needed only if this thread hangs, too.
            if (!stuck.empty() && timeout_us_ != 0 && now_ns - stuck_ns > timeout_us_ * 900)
                ::sd_notify(0, "WATCHDOG=trigger");
            (void)end_.sleep(seen, now_ns + kLookNs);
        }
    }

    Progress& progress_;
    std::uint64_t timeout_us_ = 0;  // 0: there is no watchdog
    std::atomic<bool> stop_{false};
    WakeWord end_;
    RtThread thread_;
};

// Blocks the signals in every thread; only the main thread receives them.
sigset_t block_signals() {
    sigset_t set;
    sigemptyset(&set);
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, number);
    ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
    std::signal(SIGPIPE, SIG_IGN);
    return set;
}

// The daemon also runs without the control socket, for example if its folder is missing: values do not need the socket, and
// a PLC can tare without it.
std::unique_ptr<ControlSocket> open_control(Node& node, SegmentWriter& segment, Pipeline& pipeline) {
    try {
        return std::make_unique<ControlSocket>(
            node.plan.control, node.plan.group, node.plan.name, segment, node.config.grasp ? node.config.grasp->objects : "",
            pipeline.commands[TACTILED_FROM_SOCKET], std::filesystem::absolute(node.config.path).string());
    } catch (const std::exception& error) {
        log_line(LogLevel::warning, "{}; tactilectl tare will not work, sleeping readers poll each millisecond",
                 error.what());
        segment.withdraw_control();  // so that clients do not send requests to another program's socket
        return nullptr;
    }
}

void wait_for_end(const sigset_t& signals, Reloader& reloader, Pipeline& pipeline) {
    for (;;) {
        int number = 0;
        if (::sigwait(&signals, &number) != 0) continue;
        if (number != SIGHUP) return;
        ::sd_notifyf(0, "RELOADING=1\nMONOTONIC_USEC=%" PRIu64, monotonic_ns() / 1000);
        reloader.reload(pipeline);
        ::sd_notify(0, "READY=1");
    }
}

int run(Node& node, const sigset_t& signals) {
    const std::string folder = runtime_folder();
    set_runtime_folder(folder);  // the Modbus server and others read the segment by name
    node.plan.control = control_in(folder, node.plan.name, node.plan.control);
    const auto killed = samples_of_killed(node.plan.name);
    SegmentWriter segment(node.plan);
    ZeroStore zeros(zero_files(node.config.node.zeros, node.plan.name), node.zeros);
    zeros.restore(node.sensors, killed);
    Reloader reloader(node, method_costs_folder(), &zeros);
    Pipeline pipeline(node.links, node.sensors, segment, node.simulated ? std::uint32_t(TACTILED_SIMULATED) : 0u, node.grasp,
                      node.tool);
    pipeline.commands.keep_zeros_in(zeros);
    pipeline.clear_faults_after(std::uint64_t(node.config.node.fault_clear_s * 1e9));
    pipeline.start(monotonic_ns());
    {
        const auto control = open_control(node, segment, pipeline);
        Threads threads(node, segment, pipeline);
        for (const auto& refused : threads.start()) log_line(LogLevel::warning, "RT_DEGRADED: {}", refused);
        segment.set_state(TACTILED_RUNNING);
        const Watchdog watchdog(threads.progress());
        std::unique_ptr<ModbusServer> modbus;
        const ModbusSettings& settings = node.config.modbus;
        if (settings.enabled())
            modbus = std::make_unique<ModbusServer>(node.plan.name, settings, pipeline.commands[TACTILED_FROM_MODBUS]);
        std::unique_ptr<GpioOutputs> gpio;
        if (node.config.gpio) gpio = std::make_unique<GpioOutputs>(node.plan.name, *node.config.gpio);
        std::string served = settings.listen.empty() ? settings.enabled() ? "RTU" : "off" : settings.listen;
        if (modbus != nullptr && !modbus->listens_from_the_start()) served += " not served yet: see above";
        log_line(LogLevel::info, "tactiled {}: node \"{}\", {} sensors, segment {}/tactiled.{}, Modbus {}", TACTILED_VERSION,
                 node.plan.name, node.sensors.size(), folder, node.plan.name, served);
        if (const std::string warning = folder_warning(folder, node.plan.name); !warning.empty())
            log_text(LogLevel::warning, warning);
        if (const std::string refused = enter_sandbox(); !refused.empty()) log_text(LogLevel::warning, refused);
        ::sd_notify(0, "READY=1");
        wait_for_end(signals, reloader, pipeline);
        ::sd_notify(0, "STOPPING=1");
    }
    zeros.keep_last(node.sensors);  // the threads have ended, so no sample follows
    pipeline.stop(monotonic_ns());
    log_line(LogLevel::info, "stopped");
    return EX_OK;
}

int start(int argc, char** argv) {
    std::string path = "/etc/tactiled/tactiled.toml";
    bool check = false;
    CLI::App app{"Reads tactile sensors and publishes their forces in shared memory and over Modbus.", "tactiled"};
    app.set_version_flag("--version", version_text());
    app.add_option("--config", path, "configuration file")->capture_default_str();
    app.add_flag("--check", check, "check the configuration and end");
    app.add_option_function<std::string>("--runtime-dir", set_runtime_folder,
                                         "folder of the segment and the control socket; default: TACTILED_RUNTIME_DIR, "
                                         "/run/tactiled, $XDG_RUNTIME_DIR/tactiled");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        const int status = app.exit(error) == 0 ? EX_OK : EX_USAGE;
        return status == EX_OK && !std::cout.flush() ? EX_IOERR : status;
    }
    const sigset_t signals = block_signals();
    Problems problems;
    Node node = load_node(path, problems, check ? "" : method_costs_folder());
    for (const auto& line : problems.lines()) log_text(LogLevel::error, line);
    if (!problems.empty()) return EX_CONFIG;
    return check ? EX_OK : run(node, signals);
}

}  // namespace
}  // namespace tactiled

int main(int argc, char** argv) {
    using namespace tactiled;
    hold_standard_descriptors();
    try {
        return start(argc, argv);
    } catch (const SetupError& error) {
        log_text(LogLevel::error, error.what());
        return EX_UNAVAILABLE;
    } catch (const std::bad_alloc&) {
        log_text(LogLevel::error, "there is no memory");
        return EX_OSERR;
    } catch (const std::exception& error) {
        log_text(LogLevel::error, error.what());
        return EX_SOFTWARE;
    }
}
