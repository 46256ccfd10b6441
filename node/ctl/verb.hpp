// tactilectl's verbs, one file each: NAME.cpp defines add_NAME(), main.cpp calls them all.
#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <string>

namespace tactiled::ctl {

// Exit status of every verb.
inline constexpr int kGood = 0;
inline constexpr int kUnhealthy = 1;     // unhealthy, or the check failed
inline constexpr int kUsage = 2;         // the words or the files given are wrong
inline constexpr int kNotReachable = 3;  // no daemon of that name

// A verb adds its subcommand and, from the subcommand's callback, sets `run` to what it does; main runs it after parsing.
// What `run` throws (std::exception) is printed as an error, exit status kUsage for SetupError, else kUnhealthy.
using Run = std::function<int()>;

void add_status(CLI::App& app, Run& run);
void add_read(CLI::App& app, Run& run);
void add_tare(CLI::App& app, Run& run);
void add_map(CLI::App& app, Run& run);
void add_check(CLI::App& app, Run& run);
void add_calibrate(CLI::App& app, Run& run);
void add_decouple(CLI::App& app, Run& run);
void add_play(CLI::App& app, Run& run);

}  // namespace tactiled::ctl
