// tactilectl's verbs, one file each: NAME.cpp defines add_NAME(), main.cpp calls them all. verb.cpp is the part of this
// header that the laboratory's program (node/lab) links, too.
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
inline constexpr int kUsage = 2;         // the words or the files given are wrong
inline constexpr int kNotReachable = 3;  // no daemon of that name

// A verb adds its subcommand and, from the subcommand's callback, sets `run` to what it does; run_program() runs it after
// parsing. What `run` throws (std::exception) is printed as an error, exit status kUsage for SetupError, else kUnhealthy.
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

// Parses the words into `app`, calls `run`, prints what it throws after the program's name; returns the exit status.
int run_program(CLI::App& app, int argc, char** argv, const Run& run);
// The same for a program of several verbs, of which users know one name, tactilectl. The first word is the verb
// (verb_first.hpp). A word that is no verb is an error that names the nearest one.
int run_verb(int argc, char** argv, std::span<const AddVerb> verbs);

// add_subcommand(), compiled once, in verb.cpp: with it comes most of CLI11. `examples` are command lines, one a line, that
// --help shows before the exit statuses.
CLI::App* add_verb(CLI::App& app, const std::string& name, const std::string& help, const std::string& examples = "");

// A number from `min` to `max`. CLI::Range accepts nan.
CLI::Validator number_in(double min, double max);

// Adds --node NAME, the daemon to talk to.
void add_node_option(CLI::App* verb, std::string& node_name);

// Of the reasons, bit 0 first.
inline constexpr std::array<const char*, 23> kReasonWords{
    "no-data-yet",    "stale",          "disconnected", "missing-channel", "saturated",   "disagreement",
    "outside-domain", "uncalibrated",   "not-finite",   "stopped",         "taring",      "reader-overrun",
    "wrong-device",   "sd-unknown",     "frozen",       "stepped",         "idle-bus",    "wrong-rate",
    "drifted",        "sensors-differ", "unproved-age", "arrival-only",    "zero-unknown"};
// "good", "uncertain", "bad" or "no-value"; with reasons after a colon: "uncertain:saturated". As in forces.csv.
std::string quality_text(std::uint32_t quality, std::uint32_t reasons);

// True if the standard output is a terminal that shows colours, and NO_COLOR is not set.
bool wants_colour();
// `text` in green, yellow or red for GOOD, UNCERTAIN and BAD, where wants_colour().
std::string coloured(std::uint32_t quality, const std::string& text);

// Ends a verb that follows something: set by SIGINT and SIGTERM.
extern volatile std::sig_atomic_t interrupted;

// From now on the first SIGINT or SIGTERM sets `interrupted` and ends the system call that it meets, a write into a full
// pipe too; the second kills.
void catch_interrupt();

}  // namespace tactiled::ctl
