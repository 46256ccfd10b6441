#include "node/ctl/liveness.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

namespace tactiled::ctl {
namespace {

// Returns false for a process that has ended and that its parent has not waited for (state Z).
bool is_a_daemon(std::uint32_t pid) {
    std::ifstream file(fmt::format("/proc/{}/stat", pid));
    std::string text;
    return std::getline(file, text) && text.find("(tactiled) ") != std::string::npos &&
           text.find("(tactiled) Z") == std::string::npos;
}

}  // namespace

Liveness liveness_of(const SegmentView& segment) {
    const tactiled_header& h = segment.header();
    if (!segment.is_current())
        return {"ended", fmt::format("the daemon of node \"{}\" (pid {}) has ended; start it again", h.name, h.pid)};
    tactiled_node node{};
    if (!segment.latest_node(node)) return {};  // it is starting
    const std::uint64_t now_ns = monotonic_ns();
    if (tactiled_is_alive(segment.c(), node.t_ns, now_ns) != 0) return {};
    const double silent_s = now_ns > node.t_ns ? double(now_ns - node.t_ns) / 1e9 : 0;
    if (is_a_daemon(std::uint32_t(h.pid)))
        return {"hangs", fmt::format("the daemon of node \"{}\" (pid {}) has published nothing for {:.1f} s: it hangs or "
                                     "was stopped; its log may have the reason",
                                     h.name, h.pid, silent_s)};
    return {"dead",
            fmt::format("the daemon of node \"{}\" is dead: it published its last data {:.1f} s ago, and there is no "
                        "process {}; start it again",
                        h.name, silent_s, h.pid)};
}

std::string control_fault(const SegmentView& segment) {
    const std::string path = segment.header().control;
    struct stat file {};
    if (::stat(path.c_str(), &file) != 0 || !S_ISSOCK(file.st_mode))
        return fmt::format(
            "there is no control socket{}: tare, clear, weigh and teach do not reach the daemon; its folder must "
            "exist and belong to the daemon's user: [node] control, or --runtime-dir{}",
            path.empty() ? "" : " " + path, path.empty() ? "; the daemon's log names the path and the reason" : "");
    if (::access(path.c_str(), W_OK) != 0)
        return fmt::format("this user may not write to the control socket {}: tare, clear, weigh and teach need its group",
                           path);
    return "";
}

}  // namespace tactiled::ctl
