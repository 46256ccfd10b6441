// A library to preload under qemu-user, whose version 7.2 does not know TCGETS2 and TCSETS2: they become TCGETS and TCSETS,
// and the rate that a terminal was given is kept here, one for each terminal of this process.
#include <asm/termbits.h>
#include <dlfcn.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>

static struct { dev_t terminal; unsigned rate; } rates[64];

// Returns the place that keeps the rate of the terminal, 38,400 at first.
static unsigned* rate_of(int fd) {
    struct stat file;
    unsigned i = 0;
    if (fstat(fd, &file) != 0) return &rates[63].rate;
    while (i < 63 && rates[i].terminal != 0 && rates[i].terminal != file.st_rdev) ++i;
    if (rates[i].terminal == 0) rates[i].rate = 38400;
    rates[i].terminal = file.st_rdev;
    return &rates[i].rate;
}

int ioctl(int fd, unsigned long request, ...) {
    static int (*next)(int, unsigned long, ...);
    struct termios old;
    struct termios2* given;
    va_list list;
    int result;
    va_start(list, request);
    given = va_arg(list, struct termios2*);
    va_end(list);
    if (!next) next = (int (*)(int, unsigned long, ...))dlsym(RTLD_NEXT, "ioctl");
    if (request == TCGETS2) {
        result = next(fd, TCGETS, &old);
        if (result != 0) return result;
        memcpy(given, &old, sizeof old);
        given->c_cflag = (given->c_cflag & ~(unsigned)CBAUD) | BOTHER;
        given->c_ispeed = given->c_ospeed = *rate_of(fd);
        return 0;
    }
    if (request == TCSETS2) {
        memcpy(&old, given, sizeof old);
        old.c_cflag = (old.c_cflag & ~(unsigned)(CBAUD | CIBAUD)) | B38400;
        result = next(fd, TCSETS, &old);
        if (result == 0) *rate_of(fd) = given->c_ospeed;
        return result;
    }
    return next(fd, request, given);
}
