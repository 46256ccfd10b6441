#include <fmt/format.h>
#include <sys/timex.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>

#include "node/ctl/doctor/doctor.hpp"

namespace tactiled::ctl::doctor {
namespace {

constexpr long kDeepSleepUs = 100;  // a tenth of a period at 1 kHz

std::string trimmed(const std::string& text) {
    const auto from = text.find_first_not_of(" \t\r\n");
    return from == text.npos ? "" : text.substr(from, text.find_last_not_of(" \t\r\n") - from + 1);
}

}  // namespace

std::vector<std::string> Machine::lines(const std::string& file) const {
    std::ifstream in(path(file));
    std::vector<std::string> all;
    for (std::string one; std::getline(in, one);) all.push_back(one);
    return all;
}

std::string Machine::line(const std::string& file) const {
    std::ifstream in(path(file));
    std::string first;
    std::getline(in, first);
    return trimmed(first);
}

std::optional<long> Machine::number(const std::string& file) const {
    const std::string text = line(file);
    long value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

bool Machine::has(const std::string& file) const {
    std::error_code none;
    return std::filesystem::exists(path(file), none);
}

std::vector<std::string> Machine::names(const std::string& folder) const {
    std::vector<std::string> all;
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(path(folder), none))
        all.push_back(entry.path().filename().string());
    std::sort(all.begin(), all.end());
    return all;
}

bool has_cpu(const std::string& list, int cpu) {
    for (std::size_t at = 0; at < list.size();) {
        const std::size_t end = std::min(list.find(',', at), list.size());
        int first = -1;
        const auto dash = std::from_chars(list.data() + at, list.data() + end, first).ptr;
        int last = first;
        if (dash != list.data() + end && *dash == '-') std::from_chars(dash + 1, list.data() + end, last);
        if (first >= 0 && first <= cpu && cpu <= last) return true;
        at = end + 1;
    }
    return false;
}

void look_at_kernel(const Machine& machine, Findings& found) {
    const std::string release = machine.line("/proc/sys/kernel/osrelease");
    if (machine.line("/sys/kernel/realtime") == "1")
        found.good("kernel", fmt::format("{}, PREEMPT_RT", release));
    else
        found.advice("kernel", fmt::format("{}, not PREEMPT_RT: its own work may delay a thread by ms", release),
                     "install linux-image-rt-amd64 (or -arm64) where a late sample matters");

    const auto runtime_us = machine.number("/proc/sys/kernel/sched_rt_runtime_us");
    if (runtime_us == 0)
        found.wrong("rt_throttling", "kernel.sched_rt_runtime_us = 0: no real-time thread runs at all",
                    "sysctl -w kernel.sched_rt_runtime_us=950000");
    else if (runtime_us == -1)
        found.advice("rt_throttling",
                     "kernel.sched_rt_runtime_us = -1: a real-time thread that never sleeps blocks the machine",
                     "sysctl -w kernel.sched_rt_runtime_us=950000");
    else if (runtime_us)
        found.good("rt_throttling", fmt::format("real-time threads may have {} us of each {}", *runtime_us,
                                                machine.line("/proc/sys/kernel/sched_rt_period_us")));
}

void look_at_clock(const Machine& machine, Findings& found) {
    const std::string source = machine.line("/sys/devices/system/clocksource/clocksource0/current_clocksource");
    const bool in_user_space =
        source == "tsc" || source == "arch_sys_counter" || source == "kvm-clock" || source.starts_with("hyperv_clocksource");
    if (in_user_space)
        found.good("clocksource", fmt::format("{}: read without a system call", source));
    else if (!source.empty())
        found.wrong(
            "clocksource", fmt::format("{}: each reading of the clock is a system call", source),
            "see dmesg for why the kernel left tsc; on x86 clocksource=tsc tsc=reliable where the hardware is sound");

    // Only displayed times need the wall clock: timestamps, ages and timers use CLOCK_MONOTONIC.
    timex state{};
    const bool synced = machine.has("/run/systemd/timesync/synchronized") ||
                        (machine.is_this_one() && ::adjtimex(&state) != -1 && (state.status & STA_UNSYNC) == 0);
    if (synced)
        found.good("time", "the wall clock is synchronised");
    else
        found.advice("time", "the wall clock is not synchronised: recordings may carry a wrong date",
                     "install chrony or systemd-timesyncd");
}

void look_at_processors(const Machine& machine, const RealtimeSettings& wanted, Findings& found) {
    const std::string cpus = "/sys/devices/system/cpu/";
    std::string slow;
    long deepest_us = 0;
    for (const auto& cpu : machine.names(cpus)) {
        const std::string governor = machine.line(cpus + cpu + "/cpufreq/scaling_governor");
        if (!governor.empty() && governor != "performance") slow = fmt::format("{}: {}", cpu, governor);
        for (const auto& state : machine.names(cpus + cpu + "/cpuidle"))
            if (machine.number(cpus + cpu + "/cpuidle/" + state + "/disable").value_or(0) == 0)
                deepest_us = std::max(deepest_us, machine.number(cpus + cpu + "/cpuidle/" + state + "/latency").value_or(0));
    }
    if (slow.empty())
        found.good("governor", "no governor lowers the clock");
    else
        found.advice("governor", fmt::format("{}: the clock is raised only under load", slow),
                     "cpupower frequency-set -g performance");
    if (deepest_us > kDeepSleepUs)
        found.advice("idle", fmt::format("an idle processor may need {} us to wake", deepest_us),
                     "hold /dev/cpu_dma_latency open with 0, or boot with processor.max_cstate=1 (costs power)");
    else
        found.good("idle", fmt::format("an idle processor wakes within {} us", deepest_us));

    if (wanted.cpu < 0) return;
    const auto of = [&](const std::string& file) { return has_cpu(machine.line(cpus + file), wanted.cpu); };
    if (!of("online")) {
        found.wrong("cpu",
                    fmt::format("[realtime] cpu = {}: this machine has {}", wanted.cpu, machine.line(cpus + "online")),
                    "choose one of these, or -1");
        return;
    }
    std::string missing;
    if (!of("isolated")) missing += fmt::format(" isolcpus={}", wanted.cpu);
    if (!of("nohz_full")) missing += fmt::format(" nohz_full={0} rcu_nocbs={0}", wanted.cpu);
    if (missing.empty())
        found.good("cpu", fmt::format("CPU {} is kept free of other programs and of ticks", wanted.cpu));
    else
        found.advice("cpu", fmt::format("CPU {} is shared with other programs, interrupts and ticks", wanted.cpu),
                     fmt::format("boot with{} irqaffinity=<the others>", missing));
}

}  // namespace tactiled::ctl::doctor
