/* A HAL component of LinuxCNC that shows one sensor of a tactiled daemon as pins. An example of the reader in C.
 *
 *     cc -O2 -DULAPI -I/usr/include/linuxcnc -o tactiled_hal tactiled_hal.c -llinuxcnchal
 *     loadusr -W ./tactiled_hal gripper left        in a .hal file: node, sensor
 *
 * tactiled.left.valid is TRUE only while the value is good; with accept-uncertain = TRUE also while it is uncertain, which
 * the pin `uncertain` shows. Wire `valid` into the chain that stops the machine. While it is FALSE the forces are NaN, never
 * the last value. If this program is killed or stands still, the pins keep what they have: `heartbeat` then no longer
 * changes, which the component watchdog of LinuxCNC detects. This is no safety function.
 * Forces and torques are what the world exerts on the sensor, frame S: z out of the skin, so a press has fz < 0. */
#include <hal.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <tactiled/reader.h>

struct pins {
    hal_float_t* axis[6];        /* fx fy fz in N, mx my mz in Nm */
    hal_float_t* sd[3];          /* one standard uncertainty of fx fy fz, N */
    hal_float_t* age_s;          /* age of the newest sample, also while it is not valid */
    hal_bit_t* valid;            /* the forces may be used */
    hal_bit_t* good;             /* quality GOOD */
    hal_bit_t* uncertain;        /* the value has a weakness, which `reasons` names; it is valid on request alone */
    hal_bit_t* heartbeat;        /* changes each 50 ms: seen by a thread of 1 ms, and twice within a watchdog's 0.1 s */
    hal_bit_t* contact;          /* the magnitude has passed contact_on_N */
    hal_u32_t* reasons;          /* enum tactiled_reason */
    hal_u32_t* sequence;         /* counts the sensor's samples */
    hal_bit_t* simulated;        /* a link of the node is simulated or replayed: no device measures the forces */
    hal_bit_t* accept_uncertain; /* in: uncertain values are valid, too */
};

static volatile sig_atomic_t ended;
static void on_signal(int number) {
    (void)number;
    ended = 1;
}

static int make_pins(struct pins* p, int component, const char* sensor) {
    static const char* const axes[6] = {"fx", "fy", "fz", "mx", "my", "mz"};
    int i, failed = 0;
    for (i = 0; i < 6; ++i) failed |= hal_pin_float_newf(HAL_OUT, &p->axis[i], component, "tactiled.%s.%s", sensor, axes[i]);
    for (i = 0; i < 3; ++i)
        failed |= hal_pin_float_newf(HAL_OUT, &p->sd[i], component, "tactiled.%s.sd-%s", sensor, axes[i]);
    failed |= hal_pin_float_newf(HAL_OUT, &p->age_s, component, "tactiled.%s.age-s", sensor);
    failed |= hal_pin_bit_newf(HAL_OUT, &p->valid, component, "tactiled.%s.valid", sensor);
    failed |= hal_pin_bit_newf(HAL_OUT, &p->good, component, "tactiled.%s.good", sensor);
    failed |= hal_pin_bit_newf(HAL_OUT, &p->uncertain, component, "tactiled.%s.uncertain", sensor);
    failed |= hal_pin_bit_newf(HAL_OUT, &p->heartbeat, component, "tactiled.%s.heartbeat", sensor);
    failed |= hal_pin_bit_newf(HAL_OUT, &p->contact, component, "tactiled.%s.contact", sensor);
    failed |= hal_pin_u32_newf(HAL_OUT, &p->reasons, component, "tactiled.%s.reasons", sensor);
    failed |= hal_pin_u32_newf(HAL_OUT, &p->sequence, component, "tactiled.%s.sequence", sensor);
    failed |= hal_pin_bit_newf(HAL_OUT, &p->simulated, component, "tactiled.%s.simulated", sensor);
    failed |= hal_pin_bit_newf(HAL_IN, &p->accept_uncertain, component, "tactiled.%s.accept-uncertain", sensor);
    return failed == 0;
}

static int is_simulated(const struct tactiled_reader* reader) {
    struct tactiled_node node;
    return reader->index >= 0 && tactiled_latest_node(&reader->segment, &node, tactiled_now_ns()) &&
           (node.status & TACTILED_SIMULATED) != 0;
}

/* `valid` becomes FALSE before the forces become NaN, and TRUE after they have a value; `uncertain` becomes TRUE before
 * them, and FALSE after them. Each pair of fences keeps that order for a realtime thread that reads the pins meanwhile. */
static void show(const struct pins* p, const struct tactiled_sample* s, int simulated) {
    const int uncertain = s->quality == TACTILED_UNCERTAIN;
    const int valid = s->quality == TACTILED_GOOD || (uncertain && *p->accept_uncertain);
    int i;
    if (!valid) *p->valid = 0;
    if (uncertain) *p->uncertain = 1;
    if (simulated) *p->simulated = 1;
    __atomic_thread_fence(__ATOMIC_RELEASE);
    for (i = 0; i < 3; ++i) {
        *p->axis[i] = valid ? s->force_S_N[i] : (double)NAN;
        *p->axis[3 + i] = valid ? s->torque_S_Nm[i] : (double)NAN;
        *p->sd[i] = valid ? s->sd_force_N[i] : (double)NAN;
    }
    *p->age_s = s->t_ns == 0 ? (double)NAN : (double)(tactiled_now_ns() - s->t_ns) / 1e9;
    __atomic_thread_fence(__ATOMIC_RELEASE);
    *p->good = s->quality == TACTILED_GOOD;
    *p->uncertain = uncertain;
    *p->simulated = simulated;
    *p->contact = valid && (s->state & TACTILED_CONTACT) != 0;
    *p->reasons = s->reasons;
    *p->sequence = (uint32_t)s->sequence;
    __atomic_thread_fence(__ATOMIC_RELEASE);
    if (valid) *p->valid = 1;
    *p->heartbeat = tactiled_now_ns() / 50000000u % 2;
}

int main(int argc, char** argv) {
    struct tactiled_reader reader;
    struct tactiled_sample sample;
    struct pins* pins;
    char name[HAL_NAME_LEN + 1];
    int component;
    if (argc != 3) {
        fprintf(stderr, "usage: loadusr -W tactiled_hal NODE SENSOR\n");
        return 2;
    }
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    snprintf(name, sizeof name, "tactiled-%s", argv[2]);
    component = hal_init(name);
    if (component < 0) return 1;
    pins = (struct pins*)hal_malloc(sizeof *pins);
    if (pins == NULL || !make_pins(pins, component, argv[2])) {
        fprintf(stderr, "tactiled_hal: the pins of \"%s\" could not be made\n", argv[2]);
        hal_exit(component);
        return 1;
    }
    *pins->accept_uncertain = 0;
    /* A daemon that is not there yet, or starts again, is waited for. */
    tactiled_reader_init(&reader, argv[1], argv[2]);
    tactiled_reader_latest(&reader, &sample);
    show(pins, &sample, is_simulated(&reader));
    hal_ready(component);
    while (!ended) {
        /* At each sample, and each 10 ms without one: then the newest is judged again, and is not valid once it is too old.
         */
        if (!tactiled_reader_wait(&reader, &sample, 10, TACTILED_BLOCK)) tactiled_reader_latest(&reader, &sample);
        show(pins, &sample, is_simulated(&reader));
    }
    hal_exit(component);
    tactiled_reader_detach(&reader);
    return 0;
}
