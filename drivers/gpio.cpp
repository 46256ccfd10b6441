#include "drivers/gpio.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>

namespace tactiled {
namespace {

const char* remedy(int error) noexcept {
    switch (error) {
        case ENOENT:
        case ENODEV: return " (which there are: gpiodetect, gpioinfo)";
        case EACCES:
        case EPERM: return " (join the group of /dev/gpiochip*, usually gpio)";
        case EBUSY:
            return " (another output of this daemon, another program or a kernel driver has the line; who: gpioinfo)";
        case EINVAL: return " (the chip has no such line, or it cannot do this: gpioinfo)";
        case ENXIO: return " (the line has no interrupt: choose another line)";
        default: return "";
    }
}

}  // namespace

std::optional<unsigned> gpio_offset(const GpioName& name) {
    const bool is_number =
        !name.line.empty() && name.line.size() <= 6 && name.line.find_first_not_of("0123456789") == std::string::npos;
    return is_number ? std::optional(unsigned(std::stoul(name.line))) : std::nullopt;
}

std::string gpio_refusal(const GpioName& name, bool has_chip, int error) {
    const std::string what = has_chip ? fmt::format("GPIO line \"{}\" of chip \"{}\"", name.line, name.chip)
                                      : fmt::format("GPIO chip \"{}\"", name.chip);
    return fmt::format("{}: {}{}", what, std::strerror(error), remedy(error));
}

}  // namespace tactiled
