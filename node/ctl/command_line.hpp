// For the verbs that define options. It includes App.hpp and not CLI.hpp, because CLI.hpp compiles all of CLI11's
// help and configuration code into each file, 10 s per file; verb.cpp includes it for all of them.
#pragma once
#include <CLI/App.hpp>
