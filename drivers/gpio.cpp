#include "drivers/gpio.hpp"

#include <cerrno>

namespace tactiled {

const char* gpio_remedy(int error) noexcept {
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

}  // namespace tactiled
