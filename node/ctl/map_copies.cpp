// The registers that an area copies from others, by their own addresses and names.
#include <fmt/format.h>

#include "node/ctl/map_text.hpp"

namespace tactiled::ctl {

using namespace modbus;

std::vector<CopiedRegister> copied_registers(const Area& area) {
    std::vector<CopiedRegister> all;
    for (const Copy& copy : area.copies)
        for (unsigned i = 0; i < copy.count; ++i) {
            const Area& origin = *area_of(copy.from + i, 1);
            const unsigned offset = copy.from + i - origin.at, every = origin.repeats;
            const unsigned in_block = every != 0 ? offset % every : offset;
            for (const Register& r : origin.registers) {
                // rows of the controls have addresses, those of other areas offsets
                if (r.at != in_block && r.at != copy.from + i) continue;
                const std::string n = every != 0 ? std::to_string(offset / every) : "";
                all.push_back({fmt::format("{}{}.{}", origin.prefix, n, r.name), area.at + copy.at + i, &r, &origin});
                break;
            }
        }
    return all;
}

}  // namespace tactiled::ctl
