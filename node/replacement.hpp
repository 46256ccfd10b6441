// The sensors and the grasp that a reload of the configuration exchanges. They are created and destroyed outside of the
// loop.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "node/grasping.hpp"
#include "node/sensor.hpp"
#include "tactiled/layout.h"

namespace tactiled {

struct Replacement {
    struct Part {
        std::uint32_t index;  // index of the sensor
        bool measures_alike;  // the running sensor stays and only takes over the settings of `sensor`
        std::unique_ptr<Sensor> sensor;
        tactiled_sensor entry;  // entry of the directory
    };
    std::vector<Part> sensors;
    std::unique_ptr<Grasping> grasping;  // nullptr: the running one stays
    std::uint32_t calibration_id = 0;
};

}  // namespace tactiled
