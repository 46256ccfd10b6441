// The laboratory's verbs, one file each: NAME.cpp defines add_NAME(), main.cpp calls them all.
#pragma once
#include "node/ctl/command_line.hpp"
#include "node/ctl/laboratory.hpp"

namespace tactiled::ctl {

void add_calibrate(Command program, Run& run);
void add_capture(Command program, Run& run);
void add_decouple(Command program, Run& run);
void add_identify(Command program, Run& run);
void add_play(Command program, Run& run);
void add_simulate(Command program, Run& run);
void add_tradeoff(Command program, Run& run);

}  // namespace tactiled::ctl
