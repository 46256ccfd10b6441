// The table of verbs. Help, completion and the choice of the program are made from it.
//
// The verbs of the laboratory are in a separate program, tactilectl-lab, because they need the libraries for fits, which
// a gripper's computer does not need. Users type tactilectl for all verbs.
#pragma once
#include <vector>

#include "node/ctl/command_line.hpp"

namespace tactiled::ctl {

// In tactilectl they have no function; node/lab/main.cpp has those, in this order.
inline constexpr Verb kLaboratoryVerbs[] = {
    {"calibrate", nullptr, "Fits a calibration to labelled readings and reports its error on rows that it was not fitted to",
     "  tactilectl calibrate --model generic --in labelled.csv --out my_sensor.toml --report fit.html\n"},
    {"capture", nullptr,
     "Records the channels of a link under known loads into a labelled CSV; needs no sensor and no calibration",
     "  tactilectl capture /dev/ttyACM0 --label fz_N=-4.905 --append labelled.csv\n  tactilectl capture usb0 --config "
     "my.toml --reference ft300 --append labelled.csv\n"},
    {"decouple", nullptr, "Turns a file of readings into forces, with the code that the daemon runs", ""},
    {"identify", nullptr,
     "Detects what a serial port or a TCP device sends: format, channels and rate; or, with --registers, how those of a "
     "Modbus device are read: type, word order and first register; prints a [[link]] to paste",
     "  tactilectl identify /dev/ttyACM0 >> my.toml\n  tactilectl identify 192.168.1.1:63350\n  tactilectl identify "
     "192.168.1.1:502 --unit 1 --registers 100..105\n"},
    {"play", nullptr, "Plays a recording as a device behind a pty",
     "  tactilectl play --in signals.csv --pty /tmp/skin --format lines --sequence --loop\n"},
    {"simulate", nullptr, "Simulates the readings of sensors in a scene, with its disturbances", ""},
    {"tradeoff", nullptr,
     "Measures what accuracy costs in time, on this machine: every method of every model, calibrated on simulated sensors "
     "with all effects, over easy, combined, eccentric, dynamic loads and with a damaged channel",
     ""},
};

// Returns the verbs of tactilectl and of the laboratory, in the order of --help.
const std::vector<Verb>& verbs();

}  // namespace tactiled::ctl
