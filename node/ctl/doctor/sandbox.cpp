#include "node/sandbox.hpp"

#include "node/ctl/doctor/doctor.hpp"

namespace tactiled::ctl::doctor {
namespace {

constexpr const char* kCheck = "system_calls";
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

void look_at_sandbox(const Machine& machine, const std::string& pid, Findings& found) {
    const bool runs = pid != "self";
    if (runs && is_filtered(machine, pid))
        found.good(kCheck, "the daemon's system calls are filtered");
    else if (!has_system_call_filter())
        found.advice(kCheck,
                     "this program has no filter of system calls for this processor: the daemon has no sandbox of its own",
                     kUnit);
    else if (machine.line(kActions).find("errno") == std::string::npos)
        found.advice(kCheck, "the kernel has no filters of system calls: the daemon has no sandbox of its own",
                     "a kernel with CONFIG_SECCOMP_FILTER");
    else if (runs)
        found.advice(kCheck, "the daemon runs without its filter of system calls",
                     "its log has the reason, in a line that begins with \"seccomp:\"");
    else
        found.good(kCheck, "this processor and this kernel can filter the daemon's system calls");
}

}  // namespace tactiled::ctl::doctor
