/* A stand-in for LinuxCNC's hal.h: pins are entries of a file (environment: HAL_FILE), which outlives the component as the
 * shared memory of HAL does. An entry has 48 bytes of name and 8 of value. */
#include <fcntl.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define HAL_NAME_LEN 47
enum { HAL_IN = 16, HAL_OUT = 32, HAL_PINS = 64 };
typedef volatile double hal_float_t;
typedef volatile uint8_t hal_bit_t;
typedef volatile uint32_t hal_u32_t;
struct hal_entry {
    char name[48];
    double value;
};
static struct hal_entry* hal_entries;
static int hal_count;

static int hal_init(const char* name) {
    const int fd = open(getenv("HAL_FILE"), O_RDWR | O_CREAT | O_TRUNC, 0600);
    (void)name;
    if (fd < 0 || ftruncate(fd, sizeof(struct hal_entry) * HAL_PINS) != 0) return -1;
    hal_entries = mmap(NULL, sizeof(struct hal_entry) * HAL_PINS, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    return hal_entries == MAP_FAILED ? -1 : 1;
}
static void* hal_malloc(long size) { return calloc(1, (size_t)size); }
static int hal_ready(int component) { return component < 0; }
static int hal_exit(int component) { return component < 0; }
static void* hal_entry_of(const char* format, va_list words) {
    if (hal_count >= HAL_PINS) return NULL;
    vsnprintf(hal_entries[hal_count].name, sizeof hal_entries[0].name, format, words);
    return &hal_entries[hal_count++].value;
}
#define HAL_PIN_(kind)                                                                                        \
    static int hal_pin_##kind##_newf(int way, hal_##kind##_t** pin, int component, const char* format, ...) { \
        va_list words;                                                                                        \
        (void)way;                                                                                            \
        (void)component;                                                                                      \
        va_start(words, format);                                                                              \
        *pin = hal_entry_of(format, words);                                                                   \
        va_end(words);                                                                                        \
        return *pin == NULL;                                                                                  \
    }
HAL_PIN_(float)
HAL_PIN_(bit)
HAL_PIN_(u32)
