// tactilectl doctor: its findings and the files that it reads. One file in this folder for each subject: machine,
// rights and sandbox, devices, safety.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"

namespace tactiled {
class Driver;
struct Node;
}  // namespace tactiled

namespace tactiled::ctl::doctor {

enum class Verdict {
    good,
    advice,  // the daemon works; the remedy would improve its protection or its timing
    wrong,   // the daemon cannot do what the configuration requires
};

struct Finding {
    std::string check;  // name of the check, never changed
    Verdict verdict;
    std::string says;
    std::string remedy;  // "" if the finding is good
};
struct Findings : std::vector<Finding> {
    void good(const char* check, const std::string& says) { push_back({check, Verdict::good, says, ""}); }
    void advice(const char* check, const std::string& says, const std::string& remedy) {
        push_back({check, Verdict::advice, says, remedy});
    }
    void wrong(const char* check, const std::string& says, const std::string& remedy) {
        push_back({check, Verdict::wrong, says, remedy});
    }
};

// The files of a machine: of this one, or below another folder, for tests.
class Machine {
public:
    explicit Machine(std::string root) : root_(std::move(root)) {}

    [[nodiscard]] std::string path(const std::string& file) const { return root_ + file; }
    [[nodiscard]] bool is_this_one() const { return root_.empty(); }
    // Returns the first line without spaces around it, "" if the file cannot be read.
    [[nodiscard]] std::string line(const std::string& file) const;
    [[nodiscard]] std::vector<std::string> lines(const std::string& file) const;
    [[nodiscard]] std::optional<long> number(const std::string& file) const;
    [[nodiscard]] bool has(const std::string& file) const;
    // Returns the names in a folder, sorted.
    [[nodiscard]] std::vector<std::string> names(const std::string& folder) const;

private:
    std::string root_;
};

// Returns true if `cpu` is in a list such as "0,2-3", which the kernel writes.
bool has_cpu(const std::string& list, int cpu);

// Kernel, clock, processors, power.
void look_at_kernel(const Machine& machine, Findings& found);
void look_at_clock(const Machine& machine, Findings& found);
void look_at_processors(const Machine& machine, const RealtimeSettings& wanted, Findings& found);

// Checks the rights of process `pid` ("self": this process, for a daemon that is started from here), and if it is the
// daemon, its real-time state.
void look_at_rights(const Machine& machine, const std::string& pid, const RealtimeSettings& wanted, Findings& found);

// Checks for a filter of system calls in the daemon `pid`, or for the kernel's support of one ("self": for a daemon
// that is started from here).
void look_at_sandbox(const Machine& machine, const std::string& pid, Findings& found);

// Checks the devices in the configuration, with the rights of `user`.
void look_at_devices(const Machine& machine, Config& config, const std::string& user, Findings& found);
void look_at_readers(const Machine& machine, const Config& config, Findings& found);
void look_at_port(const Machine& machine, const ModbusSettings& settings, bool daemon_runs, Findings& found);

// Reports hazards in the links and sensors of an accepted configuration, each with the line to write; `tactilectl
// check` prints these, too. A finding that is `wrong` makes every sample BAD.
void look_at_safety(const Node& node, Findings& found);
// Reports whether the calibration is compared with the sensor that is mounted.
void look_at_identity(const Node& node, Findings& found);
// Returns the expected standard deviation of weights, a line a mass, without what temperature and motion add; none without
// [grasp].
std::vector<std::string> expected_weights(const Node& node);
// Reports links on which a delay would not be detected, so that old forces would seem new.
void look_at_freshness(const Node& node, Findings& found);

// Returns the delays of a link that the daemon cannot detect, as text for the user; "" if its path bounds them. setup
std::string undetected_delays(const Driver& driver);

}  // namespace tactiled::ctl::doctor
