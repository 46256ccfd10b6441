// The configuration and the calibrations in a recording, so that `replay FILE` needs nothing else.
#pragma once
#include <string>
#include <vector>

#include "drivers/mcap/writer.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// Path of the configuration of the daemon behind `segment`, from its command line; "" where it cannot be read, or where the
// files are not those in force (their checksum is not the segment's calibration_id).
std::string config_of_daemon(const SegmentView& segment);

// Attaches the configuration and each calibration that it names by a relative path.
// setup: throws SetupError where the configuration cannot be read
void attach_config(mcap::Writer& file, const std::string& config, std::uint64_t wall_ns);

// Files of a recording in a folder that goes with this object.
class RecordedConfig {
public:
    // setup: throws SetupError where the recording has no configuration
    explicit RecordedConfig(const std::string& recording);
    ~RecordedConfig();
    RecordedConfig(const RecordedConfig&) = delete;
    RecordedConfig& operator=(const RecordedConfig&) = delete;
    [[nodiscard]] std::string config() const { return folder_ + "/tactiled.toml"; }

private:
    std::string folder_;
};

}  // namespace tactiled::ctl
