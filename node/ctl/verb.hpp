// The verbs of tactilectl, one file each: NAME.cpp defines add_NAME(), and main.cpp calls them all. verb.cpp is the
// part of this header that the laboratory's program (node/lab) links, too.
#pragma once
#include <array>
#include <csignal>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace CLI {
class App;
class Validator;
}  // namespace CLI

namespace tactiled::ctl {

// Exit status of every verb.
inline constexpr int kGood = 0;
inline constexpr int kUnhealthy = 1;     // unhealthy, or the check failed
inline constexpr int kUsage = 2;         // the arguments or the files are wrong
inline constexpr int kNotReachable = 3;  // no daemon of that name

// A verb adds its subcommand and, in the subcommand's callback, sets `run` to its action; run_program() calls it
// after parsing. An exception of `run` (std::exception) is printed as an error, with exit status kUsage for
// SetupError, else kUnhealthy.
using Run = std::function<int()>;
using AddVerb = void (*)(CLI::App& app, Run& run);

void add_status(CLI::App& app, Run& run);
void add_top(CLI::App& app, Run& run);
void add_read(CLI::App& app, Run& run);
void add_record(CLI::App& app, Run& run);
void add_replay(CLI::App& app, Run& run);
void add_tare(CLI::App& app, Run& run);
void add_clear(CLI::App& app, Run& run);
void add_weigh(CLI::App& app, Run& run);
void add_teach(CLI::App& app, Run& run);
void add_tool_fit(CLI::App& app, Run& run);
void add_grasp_check(CLI::App& app, Run& run);
void add_map(CLI::App& app, Run& run);
void add_completion(CLI::App& app, Run& run);
void add_doctor(CLI::App& app, Run& run);
void add_check(CLI::App& app, Run& run);

// ---- shared by several verbs ----

// Parses the arguments into `app`, calls `run`, prints its exceptions after the program's name, and returns the exit
// status.
int run_program(CLI::App& app, int argc, char** argv, const Run& run);
// Does the same for a program of several verbs that users call tactilectl. The first word is the verb
// (verb_first.hpp). For an unknown verb the error names the most similar one.
int run_verb(int argc, char** argv, std::span<const AddVerb> verbs);

// add_subcommand(), compiled only in verb.cpp, because it needs most of CLI11. `examples` are command lines, one per
// line, that --help shows before the exit statuses.
CLI::App* add_verb(CLI::App& app, const std::string& name, const std::string& help, const std::string& examples = "");

// Accepts a number from `min` to `max`. CLI::Range accepts nan.
CLI::Validator number_in(double min, double max);

// Adds --node NAME, which selects the daemon.
void add_node_option(CLI::App* verb, std::string& node_name);

// Words of the reasons, from bit 0 on.
inline constexpr std::array<const char*, 23> kReasonWords{
    "no-data-yet",    "stale",          "disconnected", "missing-channel", "saturated",   "disagreement",
    "outside-domain", "uncalibrated",   "not-finite",   "stopped",         "taring",      "reader-overrun",
    "wrong-device",   "sd-unknown",     "frozen",       "stepped",         "idle-bus",    "wrong-rate",
    "drifted",        "sensors-differ", "unproved-age", "arrival-only",    "zero-unknown"};
// Returns "good", "uncertain", "bad" or "no-value"; with reasons after a colon: "uncertain:saturated", as in
// forces.csv.
std::string quality_text(std::uint32_t quality, std::uint32_t reasons);

// True if the standard output is a terminal that shows colours, and NO_COLOR is not set.
bool wants_colour();
// Returns `text` in green, yellow or red for GOOD, UNCERTAIN and BAD, if wants_colour().
std::string coloured(std::uint32_t quality, const std::string& text);

// Ends a verb that runs continuously: set by SIGINT and SIGTERM.
extern volatile std::sig_atomic_t interrupted;

// After this call the first SIGINT or SIGTERM sets `interrupted` and ends the present system call, also a write into
// a full pipe; the second one kills the process.
void catch_interrupt();

}  // namespace tactiled::ctl
