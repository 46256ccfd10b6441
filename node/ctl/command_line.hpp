// For the verbs that define options. App.hpp and not CLI.hpp: with that one the compiler puts all of CLI11's help and
// configuration code into each file, 10 s a file; verb.cpp includes it for all of them.
#pragma once
#include <CLI/App.hpp>
