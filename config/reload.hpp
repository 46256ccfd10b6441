// The effect of a changed value when the daemon reads its configuration again (SIGHUP). It follows from the structure that
// holds the value: each structure of settings has kReload.
#pragma once

namespace tactiled {

enum class Reload {
    restart,  // the reload is refused: the daemon must be restarted
    tune,     // takes effect without a lost sample; neither the measured value nor its zero changes
    epoch,    // takes effect without a lost sample; the sensor begins a new epoch without its tare
};

}  // namespace tactiled
