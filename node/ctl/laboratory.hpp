// The verbs of the laboratory. They are in a separate program, tactilectl-lab, because they need the libraries for
// fits, which a gripper's computer does not need. Users type tactilectl for all verbs.
#pragma once
#include <optional>
#include <string_view>
#include <vector>

namespace tactiled::ctl {

struct LaboratoryVerb {
    const char *name, *help;
};
inline constexpr LaboratoryVerb kLaboratoryVerbs[] = {
    {"calibrate", "Fits a calibration to labelled readings and reports its error on rows that it was not fitted to"},
    {"capture", "Records the channels of a link under known loads into a labelled CSV; needs no sensor and no calibration"},
    {"decouple", "Turns a file of readings into forces, with the code that the daemon runs"},
    {"identify", "Detects what a serial port or a TCP device sends: format, channels and rate; prints a [[link]] to paste"},
    {"play", "Plays a recording as a device behind a pty"},
    {"simulate", "Simulates the readings of sensors in a scene, with its disturbances"},
    {"tradeoff",
     "Measures what accuracy costs in time, on this machine: every method of every model, calibrated on simulated sensors "
     "with all effects, over easy, combined, eccentric, dynamic loads and with a damaged channel"},
};

// Returns the help of one verb. It does not compile if the table has no such verb.
consteval const char* laboratory_help(std::string_view name) {
    for (const auto& verb : kLaboratoryVerbs)
        if (name == verb.name) return verb.help;
    throw "no verb of the laboratory";
}

// Replaces this process by tactilectl-lab, from the same folder, if the verb of `words` (verb_first.hpp) is one of
// the laboratory; arguments, environment, open files and signal dispositions are kept. Returns nothing for another
// verb, and the exit status, with the reason printed, if the program cannot be started.
std::optional<int> start_laboratory(const std::vector<char*>& words);

}  // namespace tactiled::ctl
