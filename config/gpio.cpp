// [gpio]: lines that tell another machine what the node sees.
#include <fmt/format.h>

#include "config/tables.hpp"

namespace tactiled {

std::optional<GpioSettings> read_gpio(Options& root) {
    if (!root.has("gpio")) return std::nullopt;
    Options table = root.table("gpio");
    GpioSettings settings;
    settings.chip = table.text("chip");
    const struct {
        const char* key;
        std::string& line;
    } lines[] = {
        {"fault", settings.fault}, {"grasped", settings.grasped}, {"slip", settings.slip}, {"alive", settings.alive}};
    bool any = false;
    for (const auto& [key, line] : lines) {
        line = table.text(key, "");
        any |= !line.empty();
        for (const auto& [earlier, other] : lines) {
            if (&other == &line) break;
            if (!line.empty() && other == line)
                table.problem(key, fmt::format("{} = {} is the line of {} already", key, in_quotes(line), earlier));
        }
    }
    if (!any) table.problem("fault", "[gpio] names no line: fault, grasped, slip or alive = \"17\", an offset or a name");
    settings.fault_is_low = table.one_of("fault_is", {"low", "high"}, "low") == "low";
    settings.slip_ms = int(table.integer("slip_ms", {10, 10000}, 100));
    if (!settings.grasped.empty() || !settings.slip.empty())
        if (!root.has("grasp"))
            table.problem(settings.grasped.empty() ? "slip" : "grasped",
                          "grasped and slip come from the grasp, and there is no [grasp]");
    return settings;
}

}  // namespace tactiled
