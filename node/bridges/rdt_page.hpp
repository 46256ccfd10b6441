// The page netftapi2.xml of a Net F/T, from which its clients take counts, units and rate, without I/O.
#pragma once
#include <array>
#include <cstdint>
#include <string>

#include "node/bridges/rdt_packet.hpp"

namespace tactiled::bridges::rdt {

struct Device {
    std::string node, sensor, serial, address;
    Scale scale;
    std::uint32_t zero = 0;         // bit 0..5: components that are sent as 0
    double rate_Hz = 0;             // --rate-Hz; 0: that of the sensor
    bool simulated = false;         // no device measures the values
    std::uint32_t calibration = 0;  // CRC of the configuration and the calibrations
    std::array<float, 6> full_scale{};
    tactiled_sample newest{};  // judged now
};

// A status that is not 0 comes with a value that is not GOOD; a value that is BAD is empty, and must not be read as 0.
std::string netft_xml(const Device& device);

}  // namespace tactiled::bridges::rdt
