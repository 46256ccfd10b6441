// The load on a sensor while its channels are captured: typed by a user, or measured by a reference.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// fx fy fz in N, mx my mz in Nm, frame S: exerted on the sensor, so a press has fz < 0. NaN: unknown.
using Load = std::array<double, 6>;

// Parses "fz_N=-5" or several of these, separated by blanks or commas. setup: throws SetupError where a word is not
// of that form
Load parse_load(const std::vector<std::string>& words);
std::string load_text(const Load& load);

// A source that measures the load while the channels are read.
class Reference {
public:
    virtual ~Reference() = default;
    // Takes the data that have arrived; called between frames. Never blocks.
    virtual void poll() = 0;
    // Returns the load at `t_ns`; nullopt if the reference was BAD then, or measured nothing within 50 ms of it.
    [[nodiscard]] virtual std::optional<Load> at(std::uint64_t t_ns) const = 0;
};

// Returns forces of a sensor of a running daemon, interpolated between two of its samples.
// setup: throws SetupError where the daemon or the sensor is not there
std::unique_ptr<Reference> reference_sensor(const std::string& node, const std::string& sensor);
// Returns a scale that sends lines such as "ST,+ 123.4 g" in g, kg or N; a load of m gives fz = -m * 9.80665 m/s^2.
// setup: throws SetupError where the port cannot be opened
std::unique_ptr<Reference> reference_scale(const std::string& device, unsigned baud);

// Returns the number with its unit in a line of a scale, in N; nullopt if there is none.
std::optional<double> scale_line_N(const std::string& line);

}  // namespace tactiled::ctl
