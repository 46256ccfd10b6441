// tactilectl doctor: what it finds, and where it looks. One file of this folder each: machine,
// rights, sandbox, devices, safety.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"

namespace tactiled {
struct Node;
}

namespace tactiled::ctl::doctor {

enum class Verdict {
    good,
    advice,  // the daemon works; a change would protect it or its deadlines better
    wrong,   // the daemon cannot do what the configuration asks of it
};

struct Finding {
    std::string check;  // name of the check, never changed
    Verdict verdict;
    std::string says;
    std::string remedy;  // "" where it is good
};
using Findings = std::vector<Finding>;

// The files of a machine: this one's, or those below another folder, as tests have them.
class Machine {
public:
    explicit Machine(std::string root) : root_(std::move(root)) {}

    [[nodiscard]] std::string path(const std::string& file) const { return root_ + file; }
    [[nodiscard]] bool is_this_one() const { return root_.empty(); }
    // The first line without spaces around it, "" where the file cannot be read.
    [[nodiscard]] std::string line(const std::string& file) const;
    [[nodiscard]] std::vector<std::string> lines(const std::string& file) const;
    [[nodiscard]] std::optional<long> number(const std::string& file) const;
    [[nodiscard]] bool has(const std::string& file) const;
    // Names in a folder, sorted.
    [[nodiscard]] std::vector<std::string> names(const std::string& folder) const;

private:
    std::string root_;
};

// "0,2-3" as the kernel writes it: whether `cpu` is in it.
bool has_cpu(const std::string& list, int cpu);

// Kernel, clock, processors, power.
void look_at_kernel(const Machine& machine, Findings& found);
void look_at_clock(const Machine& machine, Findings& found);
void look_at_processors(const Machine& machine, const RealtimeSettings& wanted, Findings& found);

// What process `pid` may do ("self": this one, for a daemon that is started from here), and, where it is the daemon, does.
void look_at_rights(const Machine& machine, const std::string& pid, const RealtimeSettings& wanted, Findings& found);

// Finds a filter of system calls in the daemon `pid`, or the means for one ("self": for a daemon that is started from here).
void look_at_sandbox(const Machine& machine, const std::string& pid, Findings& found);

// What the configuration names, seen by `user`.
void look_at_devices(const Machine& machine, Config& config, const std::string& user, Findings& found);
void look_at_readers(const Machine& machine, const Config& config, Findings& found);
void look_at_port(const Machine& machine, const ModbusSettings& settings, bool daemon_runs, Findings& found);

// Finds what the links and sensors of an accepted configuration leave unguarded, each with the line to write; `tactilectl
// check` prints these, too. A finding that is `wrong` makes every sample BAD.
void look_at_safety(const Node& node, Findings& found);
// A delay that nothing shows makes old forces look new.
// Whose calibration it is, and what nothing can show.
void look_at_identity(const Node& node, Findings& found);
void look_at_freshness(const Node& node, Findings& found);

}  // namespace tactiled::ctl::doctor
