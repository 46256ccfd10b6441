// [gpio]: output lines that show the node's state to another machine.
#include <fmt/format.h>

#include "config/tables.hpp"

namespace tactiled {

const Fields<GpioSettings>& gpio_fields() {
    using S = GpioSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, chip), kRequired, Text::any, "Label, name or path of the chip, as gpiodetect prints them."},
        {TACTILED_KEY(S, fault), Default("", "none"), Text::any,
         "Line, an offset or a name as gpioinfo prints them. It means a fault unless every sensor has a value and no fault "
         "is latched, and also when the daemon ends."},
        {TACTILED_KEY(S, grasped), Default("", "none"), Text::any,
         "Line that is high while something is grasped; needs [grasp]."},
        {TACTILED_KEY(S, slip), Default("", "none"), Text::any,
         "Line that is high during a slip, for slip_ms at least; needs [grasp]."},
        {TACTILED_KEY(S, alive), Default("", "none"), Text::any,
         "Line that changes each 100 ms while the loop runs and a sensor delivers. Watch it: a daemon that was killed "
         "cannot report a fault, and most chips keep the last level."},
        {TACTILED_KEY(S, fault_is), "low", Choices{"low", "high"},
         "Level of the line `fault` that means a fault. A cut wire with a pull-down is low, too."},
        {TACTILED_KEY(S, slip_ms), 100, range(10, 10'000), "ms", "Time for which a slip is shown at least."},
    };
    return fields;
}

std::optional<GpioSettings> read_gpio(Options& root) {
    Options table = root.table("gpio");  // marks the table as known even if the file does not have it
    if (!root.has("gpio")) return std::nullopt;
    GpioSettings settings{};
    read_fields(gpio_fields(), table, settings);
    const struct {
        const char* key;
        const std::string& line;
    } lines[] = {
        {"fault", settings.fault}, {"grasped", settings.grasped}, {"slip", settings.slip}, {"alive", settings.alive}};
    bool any = false;
    for (const auto& [key, line] : lines) {
        any |= !line.empty();
        for (const auto& [earlier, other] : lines) {
            if (&other == &line) break;
            if (!line.empty() && other == line)
                table.problem(key, fmt::format("{} = {} is the line of {} already", key, in_quotes(line), earlier));
        }
    }
    if (!any) table.problem("fault", "[gpio] names no line: fault, grasped, slip or alive = \"17\", an offset or a name");
    if (!settings.grasped.empty() || !settings.slip.empty())
        if (!root.has("grasp"))
            table.problem(settings.grasped.empty() ? "slip" : "grasped",
                          "grasped and slip come from the grasp, and there is no [grasp]");
    return settings;
}

}  // namespace tactiled
