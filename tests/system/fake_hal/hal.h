/* The part of LinuxCNC's HAL that the component uses, as a model: its memory is the file HAL_MEMORY, and HAL_PINS lists the
 * pins as "name offset". Another process reads and sets them there. */
#ifndef HAL_H
#define HAL_H

#include <fcntl.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#define HAL_NAME_LEN 47
typedef volatile double hal_float_t;
typedef volatile unsigned char hal_bit_t;
typedef volatile uint32_t hal_u32_t;
typedef enum { HAL_IN, HAL_OUT } hal_pin_dir_t;

static char* hal_memory;
static long hal_used;

static int hal_init(const char* name) {
    const int fd = open(getenv("HAL_MEMORY"), O_RDWR | O_CREAT, 0600);
    if (name[0] == 0 || fd < 0 || ftruncate(fd, 4096) != 0) return -1;
    hal_memory = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    return hal_memory == MAP_FAILED ? -1 : 1;
}
static void* hal_malloc(long size) {
    hal_used += (size + 7) / 8 * 8;
    return hal_memory + hal_used - (size + 7) / 8 * 8;
}
static int hal_pin(void** pin, const char* format, va_list words) {
    FILE* const list = fopen(getenv("HAL_PINS"), "a");
    if (list == NULL) return -1;
    *pin = hal_malloc(8);
    vfprintf(list, format, words);
    fprintf(list, " %ld\n", (long)((char*)*pin - hal_memory));
    return fclose(list);
}
#define HAL_NEWF(type)                                                                                                 \
    static int hal_pin_##type##_newf(hal_pin_dir_t direction, hal_##type##_t** pin, int component, const char* format, \
                                     ...) {                                                                            \
        va_list words;                                                                                                 \
        int failed;                                                                                                    \
        (void)direction, (void)component;                                                                              \
        va_start(words, format);                                                                                       \
        failed = hal_pin((void**)pin, format, words);                                                                  \
        va_end(words);                                                                                                 \
        return failed;                                                                                                 \
    }
HAL_NEWF(float)
HAL_NEWF(bit)
HAL_NEWF(u32)
static int hal_ready(int component) { return component; }
static int hal_exit(int component) { return component; }

#endif
