#include <fmt/format.h>

#include <cstdlib>
#include <sstream>

#include "node/ctl/doctor/doctor.hpp"
#include "node/sandbox.hpp"

namespace tactiled::ctl::doctor {
namespace {

constexpr unsigned kSysNice = 23, kIpcLock = 14;          // bits of CapEff, linux/capability.h
constexpr unsigned long long kEnoughBytes = 64ull << 20;  // a daemon of 16 sensors locks 20 to 30 MB

// Returns the soft limit of `name` in /proc/PID/limits; "unlimited" is the largest number.
std::optional<unsigned long long> limit_of(const Machine& machine, const std::string& process, const std::string& name) {
    for (const auto& line : machine.lines(process + "/limits")) {
        if (!line.starts_with(name)) continue;
        std::istringstream words(line.substr(name.size()));
        std::string soft;
        words >> soft;
        return soft == "unlimited" ? ~0ull : std::strtoull(soft.c_str(), nullptr, 10);
    }
    return std::nullopt;
}

bool has_capability(const Machine& machine, const std::string& process, unsigned bit) {
    for (const auto& line : machine.lines(process + "/status"))
        if (line.starts_with("CapEff:")) return (std::strtoull(line.c_str() + 7, nullptr, 16) >> bit & 1u) != 0;
    return false;
}

// Detects a group of the cpu controller, version 1, without real-time budget, in which SCHED_FIFO fails.
void look_at_group(const Machine& machine, const std::string& process, Findings& found) {
    for (const auto& line : machine.lines(process + "/cgroup")) {
        const auto first = line.find(':'), second = line.find(':', first + 1);
        if (first == line.npos || second == line.npos) continue;
        const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
        if (controllers.find(",cpu,") == controllers.npos) continue;
        const std::string group = line.substr(second + 1);
        for (const char* mount : {"/sys/fs/cgroup/cpu", "/sys/fs/cgroup/cpu,cpuacct"})
            if (machine.number(mount + group + "/cpu.rt_runtime_us") == 0) {
                found.wrong("rt_group", fmt::format("the cpu group {} may have no real time", group),
                            "take CPUQuota=, CPUWeight= and CPUAccounting= out of this unit and its neighbours, or write "
                            "cpu.rt_runtime_us");
                return;
            }
    }
    found.good("rt_group", "no cpu group forbids SCHED_FIFO");
}

// Returns field `n` of /proc/PID/stat, counted as in its manual page; the second field may contain spaces and
// brackets.
long stat_field(const std::string& stat, int n) {
    const auto close = stat.rfind(')');
    if (close == stat.npos) return -1;
    std::istringstream words(stat.substr(close + 1));
    std::string word;
    for (int at = 2; at < n; ++at) words >> word;
    return word.empty() ? -1 : std::strtol(word.c_str(), nullptr, 10);
}

void look_at_threads(const Machine& machine, const std::string& process, const RealtimeSettings& wanted, Findings& found) {
    constexpr int kPriority = 40, kPolicy = 41, kFifo = 1;
    for (const auto& thread : machine.names(process + "/task")) {
        const std::string folder = process + "/task/" + thread;
        if (machine.line(folder + "/comm") != "pipeline") continue;
        const std::string stat = machine.line(folder + "/stat");
        const bool fifo = stat_field(stat, kPolicy) == kFifo && stat_field(stat, kPriority) == wanted.priority;
        found.push_back({"loop", fifo ? Verdict::good : Verdict::wrong,
                         fifo ? fmt::format("the daemon's loop runs as SCHED_FIFO {}", wanted.priority)
                              : std::string("the daemon's loop has ordinary scheduling: RT_DEGRADED"),
                         fifo ? "" : "see priority, memory and rt_group"});
    }
}

constexpr const char* kSystemCalls = "system_calls";
// The kernel's list of filter actions; a kernel without filters does not have this file.
constexpr const char* kActions = "/proc/sys/kernel/seccomp/actions_avail";
constexpr const char* kUnit = "run it as the service: the filter of its unit does not depend on the daemon's own";

// Returns true if "Seccomp:" in /proc/PID/status is 2, so that a filter is in force.
bool is_filtered(const Machine& machine, const std::string& pid) {
    for (const auto& line : machine.lines("/proc/" + pid + "/status"))
        if (line.starts_with("Seccomp:")) return line.find('2') != line.npos;
    return false;
}

}  // namespace

void look_at_rights(const Machine& machine, const std::string& pid, const RealtimeSettings& wanted, Findings& found) {
    const std::string process = "/proc/" + pid;
    const std::string whose = pid == "self" ? "a daemon started from here" : "the daemon";
    const auto priority = limit_of(machine, process, "Max realtime priority");
    if (has_capability(machine, process, kSysNice))
        found.good("priority", fmt::format("{} has CAP_SYS_NICE", whose));
    else if (priority.value_or(0) >= unsigned(wanted.priority))
        found.good("priority", fmt::format("{} may use priorities up to {}", whose, *priority));
    else
        found.wrong(
            "priority",
            fmt::format("{} may use priorities up to {}; [realtime] priority = {}", whose, priority.value_or(0),
                        wanted.priority),
            "LimitRTPRIO=98 in the unit; for a login: \"@tactile - rtprio 98\" in /etc/security/limits.d/tactiled.conf");

    const auto bytes = limit_of(machine, process, "Max locked memory");
    const bool may_lock = has_capability(machine, process, kIpcLock) || bytes.value_or(0) >= kEnoughBytes;
    if (!wanted.lock_memory)
        found.advice("memory", "[realtime] lock_memory = false: a page fault may delay the loop", "lock_memory = true");
    else if (may_lock)
        found.good("memory", fmt::format("{} may lock its memory", whose));
    else
        found.wrong("memory", fmt::format("{} may lock {} kB", whose, bytes.value_or(0) / 1024),
                    "LimitMEMLOCK=infinity in the unit; for a login: \"@tactile - memlock unlimited\" in "
                    "/etc/security/limits.d/tactiled.conf");
    look_at_group(machine, process, found);
    look_at_threads(machine, process, wanted, found);
}

void look_at_sandbox(const Machine& machine, const std::string& pid, Findings& found) {
    const bool runs = pid != "self";
    if (runs && is_filtered(machine, pid))
        found.good(kSystemCalls, "the daemon's system calls are filtered");
    else if (!has_system_call_filter())
        found.advice(kSystemCalls,
                     "this program has no filter of system calls for this processor: the daemon has no sandbox of its own",
                     kUnit);
    else if (machine.line(kActions).find("errno") == std::string::npos)
        found.advice(kSystemCalls, "the kernel has no filters of system calls: the daemon has no sandbox of its own",
                     "a kernel with CONFIG_SECCOMP_FILTER");
    else if (runs)
        found.advice(kSystemCalls, "the daemon runs without its filter of system calls",
                     "its log has the reason, in a line that begins with \"seccomp:\"");
    else
        found.good(kSystemCalls, "this processor and this kernel can filter the daemon's system calls");
}

}  // namespace tactiled::ctl::doctor
