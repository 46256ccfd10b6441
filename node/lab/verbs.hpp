// The laboratory's verbs, one file each: NAME.cpp defines add_NAME(), main.cpp calls them all.
#pragma once
#include "node/ctl/laboratory.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {

void add_calibrate(CLI::App& app, Run& run);
void add_capture(CLI::App& app, Run& run);
void add_decouple(CLI::App& app, Run& run);
void add_identify(CLI::App& app, Run& run);
void add_play(CLI::App& app, Run& run);
void add_simulate(CLI::App& app, Run& run);
void add_tradeoff(CLI::App& app, Run& run);

}  // namespace tactiled::ctl
