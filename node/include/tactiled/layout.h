/* Defines the shared-memory segment of tactiled, the file tactiled.NAME in the daemon's run-time folder
 * (folder.h), for C11 and C++17. Version 1.10.
 *
 * The file has one header, a directory of sensors, a directory of links, one ring of node records, and one ring
 * of samples for each sensor. Only the daemon writes the file. Readers map it read-only, do not register, and
 * cannot delay the daemon. This header is the only definition of the fields; the functions at its end read a
 * ring. reader.h is for C, reader.hpp for C++.
 *
 * Frame S of a sensor has its origin at the centre of the skin's surface, z out of the skin and x along the
 * connector. Force and torque are those that the environment exerts on the sensor, so a press has force_S_N[2] <
 * 0.
 *
 * Every shared word that changes is 32 bits wide, so that a 32-bit reader never reads half of it. Wider values
 * are inside slots and are guarded by the slot's lock word. The alignment is explicit because an i386 compiler
 * would align a 64-bit member to 4 bytes. A reader accepts any minor version of its own major version: minor
 * versions only append fields, and the header states the sizes.
 *
 * Before each attachment a reader checks that only the daemon's user and root can create or replace the file;
 * folder.h has the rule and the functions. /dev/shm, the folder of the segment in versions without folder.h, does
 * not fulfil the rule: any local user can create a file of this name there while no daemon runs. */
#ifndef TACTILED_LAYOUT_H
#define TACTILED_LAYOUT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
#define TACTILED_ALIGN(n) alignas(n)
#define TACTILED_ASSERT(condition) static_assert(condition, #condition)
extern "C" {
#else
#define TACTILED_ALIGN(n) _Alignas(n)
#define TACTILED_ASSERT(condition) _Static_assert(condition, #condition)
#endif

#define TACTILED_MAGIC "TACTILED" /* 8 bytes, no terminator */
#define TACTILED_BYTE_ORDER 0x01020304u
#define TACTILED_MAJOR 1
#define TACTILED_MINOR 10
#define TACTILED_MAX_SENSORS 16
#define TACTILED_MAX_LINKS 16
#define TACTILED_MAX_CHANNELS 32 /* in a frame */
#define TACTILED_MAX_TAXELS 4096 /* greatest number in an array */
#define TACTILED_MAX_METHODS 8
#define TACTILED_METHODS_SIZE 128
#define TACTILED_NAME_SIZE 32 /* including the terminating zero */

/* Quality of a sample. The value 0 is never good, so that memory that was never written reads as "no value". */
enum tactiled_quality {
    TACTILED_NO_VALUE = 0,
    TACTILED_GOOD = 1,      /* fresh, plausible, calibrated */
    TACTILED_UNCERTAIN = 2, /* has a value with a known weakness; `reasons` says which */
    TACTILED_BAD = 3        /* has no value: the forces are NaN, never the last value */
};

/* Reasons for which a sample is not GOOD, and notes on GOOD samples: bits of tactiled_sample.reasons. */
enum tactiled_reason {
    TACTILED_NO_DATA_YET = 1 << 0,     /* no sample since the daemon started or since a new calibration */
    TACTILED_STALE = 1 << 1,           /* no frame for longer than stale_ms, or a timestamp beyond the reader's clock */
    TACTILED_DISCONNECTED = 1 << 2,    /* the link is closed and being reopened */
    TACTILED_MISSING_CHANNEL = 1 << 3, /* a channel that the model needs is not in the frame */
    TACTILED_SATURATED = 1 << 4,       /* a channel is at its saturation limit */
    TACTILED_DISAGREEMENT = 1 << 5,    /* redundant channels contradict each other */
    TACTILED_OUTSIDE_DOMAIN = 1 << 6,  /* outside the range of the calibration: extrapolated */
    TACTILED_UNCALIBRATED = 1 << 7,    /* no calibration, or a default one */
    TACTILED_NOT_FINITE = 1 << 8,      /* the model's result was not a finite number */
    TACTILED_DAEMON_STOPPED = 1 << 9,  /* the daemon ended, or another took over the name: attach again */
    TACTILED_TARING = 1 << 10,         /* a tare is being measured: the value is valid, but its zero is about to change */
    TACTILED_READER_OVERRUN = 1 << 11, /* this read could not be completed within its limit of retries */
    TACTILED_WRONG_DEVICE = 1 << 12,   /* the frame lacks channels that the sensor declares, or two devices use one number */
    TACTILED_UNKNOWN_UNCERTAINTY = 1 << 13, /* the standard deviation is unknown here: NaN */
    /* Since 1.3: */
    TACTILED_FROZEN = 1 << 14,     /* a channel repeats one number, without noise; that channel has no value */
    TACTILED_STEPPED = 1 << 15,    /* the value has left the motion before, and the next one has not confirmed it yet */
    TACTILED_IDLE_BUS = 1 << 16,   /* all channels read all zeros or all ones: no device answers */
    TACTILED_WRONG_RATE = 1 << 17, /* the measured rate is not the declared rate_Hz; the value is valid and may be GOOD */
    TACTILED_DRIFTED = 1 << 18,    /* the zero at rest has moved by drift_limit_N: tare the sensor; the value may be GOOD */
    /* Since 1.4: */
    TACTILED_SENSORS_DIFFER = 1 << 19, /* the sensor named by agrees_with measures another force: one of them is wrong */
    /* Since 1.5: */
    TACTILED_UNPROVED_AGE = 1 << 20, /* the value may be older than it seems: frames were delayed, or the device paused */
    TACTILED_ARRIVAL_ONLY = 1 << 21, /* no clock and no counter would show a delay; the value may be GOOD */
    TACTILED_ZERO_UNKNOWN = 1 << 22, /* the tare in force was lost, or the calibration needs one: tare it */
    /* Since 1.8: */
    TACTILED_GLITCHES = 1 << 23,  /* more than 1 % of the values of 10 s, and more than 2, were wrong for one sample */
    TACTILED_ZERO_OLD = 1 << 24,  /* the standard deviation of the zero is above 10 % of a component's full scale */
    TACTILED_TOO_QUIET = 1 << 25, /* less noise than in the calibration: another range, unit, order of bytes or firmware */
    /* Since 1.9: */
    TACTILED_NOT_REDUNDANT = 1 << 26, /* a damaged channel stays undetected more often than undetected_damage_limit allows */
    TACTILED_TEMPERATURE = 1 << 27    /* unknown or outside its range: it may move a component by 10 % of full scale */
};

/* ---- verdict ----
 *
 * Every layer adds reasons to a sample; tactiled_verdict() alone derives its quality from them. Commands, the web page,
 * bridges and the register map take the words of a reason from this table. */

/* The uses of a value that a reason still permits, and whether the reason ends the stream. */
enum tactiled_use {
    TACTILED_FOR_ZERO = 1,    /* a tare */
    TACTILED_FOR_COMPARE = 2, /* agrees_with: the value proves something about the other sensor */
    TACTILED_FOR_WEIGHT = 4,  /* its standard deviation counts for a weight */
    TACTILED_OLD = 8          /* there is no value because there is no new frame */
};
#define TACTILED_ZC_ (TACTILED_FOR_ZERO | TACTILED_FOR_COMPARE)

/* X(reason, word, best quality that it allows, number and constant of FAULT in the register map, use, meaning, remedy), most
 * severe first. FAULT 0: no fault. The numbers are those of the register map and never change. */
#define TACTILED_REASON_TABLE(X)                                                                                            \
    X(DAEMON_STOPPED, "stopped", TACTILED_BAD, 1, "DAEMON_STOPPED", TACTILED_OLD, "daemon stopped or hangs",                \
      "see its log; start it again")                                                                                        \
    X(DISCONNECTED, "disconnected", TACTILED_BAD, 2, "DISCONNECTED", TACTILED_OLD,                                          \
      "disconnected: the link is being reopened", "check the cable and the power of the device")                            \
    X(NO_DATA_YET, "no-data-yet", TACTILED_BAD, 3, "NO_DATA_YET", TACTILED_OLD, "no data yet",                              \
      "wait for the first frame; `tactilectl doctor` checks the device")                                                    \
    X(STALE, "stale", TACTILED_BAD, 4, "STALE", TACTILED_OLD, "stale: no new frame in time",                                \
      "check the device; a slow one needs a stale_ms of three of its periods")                                              \
    X(WRONG_DEVICE, "wrong-device", TACTILED_BAD, 5, "WRONG_DEVICE", 0,                                                     \
      "wrong device: its frames have another number of channels or another serial number, or two devices count under its "  \
      "name",                                                                                                               \
      "mount the device of the calibration, or correct `channels`")                                                         \
    X(NOT_FINITE, "not-finite", TACTILED_BAD, 6, "NOT_FINITE", 0, "result is no number",                                    \
      "check the calibration: the method has no result for this reading")                                                   \
    X(IDLE_BUS, "idle-bus", TACTILED_BAD, 17, "IDLE_BUS", 0, "all channels read all zeros or all ones",                     \
      "no device answers: check its power and the wires of the bus")                                                        \
    X(FROZEN, "frozen", TACTILED_UNCERTAIN, 14, "FROZEN", TACTILED_FOR_WEIGHT, "a channel is frozen",                       \
      "the channel repeats one number: replace it, or write frozen_after = 0 in the [[sensor]] of a coarse sensor that "    \
      "rests")                                                                                                              \
    X(MISSING_CHANNEL, "missing-channel", TACTILED_UNCERTAIN, 7, "MISSING_CHANNEL", TACTILED_FOR_WEIGHT, "missing channel", \
      "a channel has no number: check its wire")                                                                            \
    X(UNCALIBRATED, "uncalibrated", TACTILED_UNCERTAIN, 8, "UNCALIBRATED", TACTILED_ZC_ | TACTILED_FOR_WEIGHT,              \
      "uncalibrated", "calibrate this sensor (`tactilectl calibrate`)")                                                     \
    X(SATURATED, "saturated", TACTILED_UNCERTAIN, 9, "SATURATED", TACTILED_FOR_WEIGHT, "saturated channel",                 \
      "reduce the load, or the gain of the converter")                                                                      \
    X(DISAGREEMENT, "disagreement", TACTILED_UNCERTAIN, 10, "DISAGREEMENT", TACTILED_FOR_WEIGHT,                            \
      "channels contradict each other",                                                                                     \
      "check the channels; a load unlike those of the calibration needs a calibration with such loads")                     \
    X(SENSORS_DIFFER, "sensors-differ", TACTILED_UNCERTAIN, 19, "SENSORS_DIFFER", TACTILED_ZC_,                             \
      "differs from the sensor that it should agree with", "tare both sensors, then compare them under a load")             \
    X(UNPROVED_AGE, "unproved-age", TACTILED_UNCERTAIN, 20, "UNPROVED_AGE", 0,                                              \
      "its age is not proved: frames were delayed, or the device paused",                                                   \
      "let the device send its time and answer echo = true, or write path = \"direct\" in its [[link]] for a real cable; "  \
      "over TCP wait for the next opening")                                                                                 \
    X(STEPPED, "stepped", TACTILED_UNCERTAIN, 18, "STEPPED", TACTILED_FOR_ZERO, "a jump that the next value must confirm",  \
      "none for one sample; often: check the wires, the shield and the supply")                                             \
    X(GLITCHES, "glitches", TACTILED_UNCERTAIN, 23, "GLITCHES", TACTILED_ZC_, "single wrong values, more than 1 % of them", \
      "check the wires, the shield and the supply; ask a device no faster than it measures")                                \
    X(OUTSIDE_DOMAIN, "outside-domain", TACTILED_UNCERTAIN, 11, "OUTSIDE_DOMAIN", TACTILED_FOR_ZERO | TACTILED_FOR_WEIGHT,  \
      "outside the calibrated domain", "reduce the load; without a load tare it")                                           \
    X(TEMPERATURE, "temperature", TACTILED_UNCERTAIN, 27, "TEMPERATURE", TACTILED_FOR_ZERO | TACTILED_FOR_WEIGHT,           \
      "temperature: unknown, or outside its range",                                                                         \
      "mount a dummy or a thermometer, calibrate with it, and declare how well it is known (tactilectl check has the "      \
      "line)")                                                                                                              \
    X(TOO_QUIET, "too-quiet", TACTILED_UNCERTAIN, 25, "TOO_QUIET", 0,                                                       \
      "less noise than in its calibration: another range, unit, order of bytes or firmware",                                \
      "restore the settings of the device and restart the daemon, or calibrate it again; if it may be so quiet, write "     \
      "accept_too_quiet = true in its [[sensor]]")                                                                          \
    X(ZERO_UNKNOWN, "zero-unknown", TACTILED_UNCERTAIN, 22, "ZERO_UNKNOWN", TACTILED_FOR_ZERO,                              \
      "zero unknown: its tare was lost, its calibration needs one, or the device may have started again",                   \
      "tare it without a load; if that is refused, restart the device without a load first")                                \
    X(ZERO_OLD, "zero-old", TACTILED_UNCERTAIN, 24, "ZERO_OLD", TACTILED_FOR_ZERO | TACTILED_FOR_WEIGHT,                    \
      "the zero was last known too long ago", "tare it without a load, or let it rest")                                     \
    X(UNKNOWN_UNCERTAINTY, "sd-unknown", TACTILED_UNCERTAIN, 12, "NO_UNCERTAINTY", TACTILED_ZC_ | TACTILED_FOR_WEIGHT,      \
      "uncertainty unknown", "see its other reasons, or calibrate with loads that determine the uncertainty")               \
    X(NOT_REDUNDANT, "not-redundant", TACTILED_UNCERTAIN, 26, "NOT_REDUNDANT", TACTILED_ZC_ | TACTILED_FOR_WEIGHT,          \
      "damage of a channel may be undetected, more often than undetected_damage_limit allows",                              \
      "calibrate it again with more channels, or let a second sensor check it (agrees_with) and raise "                     \
      "undetected_damage_limit")                                                                                            \
    X(READER_OVERRUN, "reader-overrun", TACTILED_BAD, 13, "OVERRUN", 0, "internal: read overrun", "read again")             \
    X(TARING, "taring", TACTILED_GOOD, 0, "", TACTILED_ZC_ | TACTILED_FOR_WEIGHT, "a tare is being measured",               \
      "wait until the tare ends")                                                                                           \
    X(WRONG_RATE, "wrong-rate", TACTILED_GOOD, 0, "", TACTILED_ZC_ | TACTILED_FOR_WEIGHT,                                   \
      "the measured rate is not the declared one", "set the device to rate_Hz, or correct rate_Hz")                         \
    X(DRIFTED, "drifted", TACTILED_GOOD, 0, "", TACTILED_ZC_ | TACTILED_FOR_WEIGHT,                                         \
      "the zero at rest has moved by drift_limit_N", "tare it without a load")                                              \
    X(ARRIVAL_ONLY, "arrival-only", TACTILED_GOOD, 0, "", TACTILED_FOR_COMPARE,                                             \
      "no clock and no counter would show a delay",                                                                         \
      "send a counter or the time with each frame, or write accept_unproved_age = true; until then there is no tare or "    \
      "weight")

/* The reasons, as a mask: those with a use, and those that allow GOOD and UNCERTAIN at most. */
#define TACTILED_BIT_(is, reason) | ((is) ? +TACTILED_##reason : 0)
#define TACTILED_IF_BAD_(reason, word, best, ...) TACTILED_BIT_((best) == TACTILED_BAD, reason)
#define TACTILED_IF_GOOD_(reason, word, best, ...) TACTILED_BIT_((best) == TACTILED_GOOD, reason)
#define TACTILED_IF_ZERO_(reason, word, best, fault, constant, use, ...) \
    TACTILED_BIT_(((use)&TACTILED_FOR_ZERO) != 0, reason)
#define TACTILED_IF_COMPARE_(reason, word, best, fault, constant, use, ...) \
    TACTILED_BIT_(((use)&TACTILED_FOR_COMPARE) != 0, reason)
#define TACTILED_IF_WEIGHT_(reason, word, best, fault, constant, use, ...) \
    TACTILED_BIT_(((use)&TACTILED_FOR_WEIGHT) != 0, reason)
#define TACTILED_IF_OLD_(reason, word, best, fault, constant, use, ...) TACTILED_BIT_(((use)&TACTILED_OLD) != 0, reason)
enum {
    TACTILED_REASONS_OF_BAD = 0 TACTILED_REASON_TABLE(TACTILED_IF_BAD_),
    TACTILED_REASONS_OF_GOOD = 0 TACTILED_REASON_TABLE(TACTILED_IF_GOOD_),
    TACTILED_REASONS_FOR_ZERO = 0 TACTILED_REASON_TABLE(TACTILED_IF_ZERO_),
    TACTILED_REASONS_FOR_COMPARE = 0 TACTILED_REASON_TABLE(TACTILED_IF_COMPARE_),
    TACTILED_REASONS_FOR_WEIGHT = 0 TACTILED_REASON_TABLE(TACTILED_IF_WEIGHT_),
    TACTILED_REASONS_OF_OLD = 0 TACTILED_REASON_TABLE(TACTILED_IF_OLD_)
};

/* Returns the quality of a value with these reasons: the worst that one of them allows, and BAD if there is no value. A
 * reason that is not in the table lowers to UNCERTAIN. */
static inline uint32_t tactiled_verdict(uint32_t reasons, int has_value) {
    if (!has_value || (reasons & (uint32_t)TACTILED_REASONS_OF_BAD) != 0) return TACTILED_BAD;
    return (reasons & ~(uint32_t)TACTILED_REASONS_OF_GOOD) != 0 ? TACTILED_UNCERTAIN : TACTILED_GOOD;
}

/* Proof of the age of a sensor's samples: tactiled_sensor.freshness. Since 1.5. */
enum tactiled_freshness {
    TACTILED_FRESHNESS_UNKNOWN = 0, /* no frame yet */
    TACTILED_BY_REQUEST = 1,        /* each frame answers a request of the daemon */
    TACTILED_BY_CABLE = 2,          /* the buffers and the rate of a local link bound the delay */
    TACTILED_BY_CLOCK = 3,          /* the device's own clock */
    TACTILED_BY_SEQUENCE = 4,       /* the device's counter and its rate; a pause of the device looks like a delay */
    TACTILED_BY_ARRIVAL = 5         /* not proved: a delay shows only as a silence */
};

/* One sample of one sensor, in SI units and in frame S. A component that the sensor cannot measure is NaN, not 0. */
struct tactiled_sample {
    /* number of this sensor's sample, from 0; a gap means that the reader lost samples */
    TACTILED_ALIGN(8) uint64_t sequence;
    /* CLOCK_MONOTONIC when the frame's last byte was read from the kernel. Since 1.5 the time is earlier where
     * the device's clock shows that the frame had been delayed. */
    TACTILED_ALIGN(8) uint64_t t_ns;
    TACTILED_ALIGN(8) uint64_t t_published_ns;
    uint32_t epoch;           /* changes at each discontinuity, not in order: (header's epoch) << 16 | number since */
    uint32_t quality;         /* enum tactiled_quality */
    uint32_t reasons;         /* enum tactiled_reason */
    uint32_t device_sequence; /* the device's counter; 0 if it has none */
    uint32_t missing;         /* bit n: channel n had no value, or was open or shorted if the device can report that */
    uint32_t saturated;       /* bit n: channel n was at its saturation limit */
    uint32_t tare_count;      /* finished tares, 0 = none in force; force = raw_force - zero of the last tare */
    uint32_t lost;            /* frames of this sensor known to be lost since the daemon started */
    TACTILED_ALIGN(8) double force_S_N[3]; /* after tare */
    TACTILED_ALIGN(8) double torque_S_Nm[3];
    TACTILED_ALIGN(8) double sd_force_N[3]; /* one standard deviation */
    TACTILED_ALIGN(8) double sd_torque_Nm[3];
    TACTILED_ALIGN(8) double raw_force_S_N[3]; /* before tare, with the zero of the calibration */
    TACTILED_ALIGN(8) double raw_torque_S_Nm[3];
    TACTILED_ALIGN(8) double cop_S_m[2]; /* centre of pressure; NaN if the press is below 5 sd or a moment is not measured */
    /* residual of the model, in standard deviations of the channels; NaN if the model has none */
    TACTILED_ALIGN(8) double residual;
    TACTILED_ALIGN(8) float rate_Hz; /* measured over about the last second */
    float temperature_C;
    uint32_t state; /* enum tactiled_sensor_state */
    float peak_N;   /* largest magnitude of the known components of force_S_N since the start or the last reset */
};

/* The parts of a standard deviation, X(part, word, cause, remedy). Their squares add up to that of sd_force_N or
 * sd_torque_Nm. uncertainty.h has the rules by which they combine. */
#define TACTILED_PART_TABLE(X)                                                                                   \
    X(NOISE, "noise", "differs from sample to sample", "use the mean of several samples")                        \
    X(CALIBRATION, "calibration", "curve, hysteresis and creep: alike for like loads",                           \
      "calibrate with more loads like those in use")                                                             \
    X(REFERENCE, "reference", "the instrument that measured the labels", "calibrate against a better reference") \
    X(ZERO, "zero", "drift and events since the zero was last known", "tare it without a load")                  \
    X(TEMPERATURE, "temperature", "the part of its effect that is not removed",                                  \
      "calibrate against temperature and add a thermometer or a dummy resistor, or declare a smaller range")     \
    X(MOTION, "motion", "delay and filter while the load changes", "wait until the load rests")
#define TACTILED_ENUM_OF_PART_(part, ...) TACTILED_OF_##part,
#define TACTILED_WORD_OF_PART_(part, word, ...) word,
enum tactiled_part { TACTILED_PART_TABLE(TACTILED_ENUM_OF_PART_) };
#define TACTILED_PARTS 6
TACTILED_ASSERT(TACTILED_OF_MOTION + 1 == TACTILED_PARTS);

/* The parts of the standard deviations of one sample, and the correlations of its errors. Components in the order fx fy fz
 * mx my mz; NaN where the sd is not known. Since 1.10. */
struct tactiled_budget {
    float sd_part[TACTILED_PARTS][6]; /* [part][component], N or Nm; that of the reference has the sign of the component */
    float correlation[15];            /* errors of two components, rows above the diagonal: fx fy, fx fz .. my mz */
    float load[6];                    /* raw component as a part of its full scale; 0 = not measured */
    /* Two loads at the distance d in `load` have calibration errors of the correlation alike / (1 + (d / alike_within)^2).
     */
    float alike, alike_within;
    uint32_t model; /* sensors with the same number err alike under like loads; 0: like no other */
};

/* The record of a sensor's ring: a sample, and what was appended since. Since 1.9; the record of an older daemon ends with
 * the sample, that of 1.9 with cop_sd_m. */
struct tactiled_placed {
    struct tactiled_sample sample;
    float cop_sd_m[2];             /* one standard deviation of cop_S_m; NaN = not known */
    struct tactiled_budget budget; /* since 1.10 */
};

/* State of the force in a sample of any quality: bits of tactiled_sample.state. All bits are 0 in a BAD sample. */
enum tactiled_sensor_state {
    /* the magnitude has exceeded contact_on_N and has not fallen below contact_off_N since */
    TACTILED_CONTACT = 1 << 0,
    TACTILED_OVERLOAD = 1 << 1,     /* the magnitude is above overload_N */
    TACTILED_LOW_PASS = 1 << 2,     /* force and torque are low-pass filtered; the raw values are not */
    TACTILED_STEPPED_DOWN = 1 << 3, /* method "auto": a faster, less accurate method than at the start is in use */
    TACTILED_OVER_BUDGET = 1 << 4   /* method "auto": the fastest method is in use and exceeds budget_us */
};
/* Bits 8..12 of tactiled_sample.state, for method "signs" of model "table": the row of its decision table, 1 ..
 * 17; 0 = none. */
#define TACTILED_DIRECTION(state) (((state) >> 8) & 31u)
/* Bits 16..19, for method "auto": 1 + the index in tactiled_sensor.methods of the method that computed this
 * sample; 0 = not "auto". Bits 20..31: number of steps down and up since the start; 4095 means that many or more. */
#define TACTILED_METHOD(state) (((state) >> 16) & 15u)
#define TACTILED_STEPS(state) ((state) >> 20)

/* tactiled_node.status: the bits of the Modbus register STATUS. */
enum tactiled_status {
    TACTILED_READY = 1 << 0, /* every sensor is GOOD or UNCERTAIN */
    TACTILED_ANY_CONTACT = 1 << 1,
    TACTILED_ANY_TARING = 1 << 8,
    TACTILED_SIMULATED = 1 << 9, /* the configuration declares a link as simulated or replayed */
    TACTILED_ANY_STALE = 1 << 10,
    TACTILED_ANY_UNCALIBRATED = 1 << 11,
    TACTILED_WARNING = 1 << 14,
    TACTILED_FAULT = 1 << 15,
    TACTILED_RT_DEGRADED = 1 << 16 /* real-time priority or locked memory was refused; not in the register */
};

/* tactiled_node.fault, latched: the bits of the Modbus register FAULT. */
enum tactiled_fault {
    TACTILED_FAULT_SENSOR_LOST = 1 << 0,
    TACTILED_FAULT_OVERRANGE = 1 << 1,
    TACTILED_FAULT_OPEN_GAUGE = 1 << 2,
    TACTILED_FAULT_OVERRUN = 1 << 3, /* a ring between a link and the pipeline was full */
    TACTILED_FAULT_CALIBRATION = 1 << 4,
    TACTILED_FAULT_STORAGE = 1 << 6, /* zeros of tares cannot be stored, so tares are refused. Since 1.5 */
    TACTILED_FAULT_BUS = 1 << 7,
    TACTILED_FAULT_INTERNAL = 1 << 8
};

/* tactiled_node.warning: the bits of the Modbus register WARN. */
enum tactiled_warning {
    TACTILED_WARN_DRIFT = 1 << 1,  /* a sensor is TACTILED_DRIFTED: maintenance */
    TACTILED_WARN_LOST = 1 << 2,   /* frames were lost within the last second */
    TACTILED_WARN_TARE = 1 << 4,   /* the last tare was refused, or failed during its measurement. Since 1.4 */
    TACTILED_WARN_BUDGET = 1 << 5, /* a sensor is TACTILED_STEPPED_DOWN or TACTILED_OVER_BUDGET */
    TACTILED_WARN_RATE = 1 << 6,   /* a sensor is TACTILED_WRONG_RATE */
    TACTILED_WARN_RELOAD = 1 << 7, /* the last reload was refused: the previous configuration is in force */
    TACTILED_WARN_JAWS = 1 << 8,   /* a bit of weight_doubts besides TACTILED_DOUBT_MOVES is set. Since 1.6 */
    TACTILED_WARN_HINTS = 1 << 9   /* gravity, acceleration and gripper state of a PLC expired: not known. Since 1.9 */
};

/* Commander: index of tactiled_node.command. Each commander numbers its own commands. */
enum tactiled_commander { TACTILED_FROM_SOCKET = 0, TACTILED_FROM_MODBUS = 1, TACTILED_COMMANDERS = 2 };

/* State of the last command of a commander. */
struct tactiled_command {
    uint32_t acknowledged; /* number of the command */
    uint32_t state;        /* enum tactiled_command_state */
    uint32_t result;       /* enum tactiled_command_result */
};

/* State of the gripper as a whole: tactiled_grasp.state, the register GRIP_STATE. */
enum tactiled_grip_state {
    TACTILED_GRIP_UNKNOWN = 0xFFFF, /* no grasp is configured, or a jaw's sensor has no value */
    TACTILED_GRIP_OPEN = 0,
    TACTILED_GRIP_CONTACT = 1,  /* at least one jaw touches */
    TACTILED_GRIP_GRASPED = 2,  /* every jaw with a sensor presses steadily */
    TACTILED_GRIP_LIFTING = 3,  /* the jaws are taking up the weight of the object */
    TACTILED_GRIP_HOLDING = 4,  /* the jaws carry the weight of the object */
    TACTILED_GRIP_SLIPPING = 5, /* gross slip */
    TACTILED_GRIP_LOST = 6      /* the object was lost without an opening of the jaws; until the next contact */
};

/* Quality of tactiled_grasp.weight_kg: the register WEIGHT_STATE. */
enum tactiled_weight_state {
    TACTILED_WEIGHT_NONE = 0,
    TACTILED_WEIGHT_ESTIMATING = 1, /* a value that still changes, with its standard deviation */
    TACTILED_WEIGHT_STABLE = 2,
    TACTILED_WEIGHT_OVERLOAD = 3,       /* a sensor is saturated or beyond its full scale: no value */
    TACTILED_WEIGHT_NOT_OBSERVABLE = 4, /* gravity points into the skin, or its direction is unknown: no value */
    TACTILED_WEIGHT_TEMPERATURE = 5     /* a sensor is TACTILED_TEMPERATURE: no value. Since 1.9 */
};

/* Reasons for which the weight of a held object is not stable: bits of tactiled_grasp.weight_doubts. Since 1.6. */
enum tactiled_weight_doubt {
    TACTILED_DOUBT_BALANCE = 1 << 0,    /* the press forces do not balance: wrong gain, unreported tilt or acceleration */
    TACTILED_DOUBT_SHARES = 1 << 1,     /* the jaws share the load in an unexpected ratio: wrong gain or direction */
    TACTILED_DOUBT_DEAD_SHEAR = 1 << 2, /* the other jaws took up the load, this jaw did not */
    TACTILED_DOUBT_NEGATIVE = 1 << 3,   /* the mass is negative: wrong direction of gravity or of a jaw */
    TACTILED_DOUBT_CREEPS = 1 << 4,     /* gain or zero of a jaw has changed since the weight was first stable */
    TACTILED_DOUBT_MOVES = 1 << 5,      /* the load moves: swing, acceleration, another load */
    /* a force perpendicular to gravity: unreported tilt, support by a table, rotated jaw */
    TACTILED_DOUBT_ACROSS = 1 << 6,
    TACTILED_DOUBT_LATE = 1 << 7 /* this jaw took up the load later than the others */
};

enum tactiled_slip_state {
    TACTILED_SLIP_UNKNOWN = 0xFFFF, /* the sensor has no value, or does not measure shear */
    TACTILED_SLIP_NONE = 0,
    TACTILED_SLIP_INCIPIENT = 1, /* near the friction limit, or sliding at the edge of the contact */
    TACTILED_SLIP_GROSS = 2
};

/* The grasp as computed from the node's sensors. An unknown value is NaN, never the last value. Without [grasp]
 * in the configuration, `state` is TACTILED_GRIP_UNKNOWN and everything else is "not known". */
struct tactiled_grasp {
    TACTILED_ALIGN(8) uint64_t t_ns;          /* time of the newest sample used, CLOCK_MONOTONIC */
    TACTILED_ALIGN(8) uint64_t t_lift_off_ns; /* time of the last lift-off, 0 = none yet */
    uint32_t state;                           /* enum tactiled_grip_state */
    uint32_t weight_state;                    /* enum tactiled_weight_state */
    uint32_t grasps;                          /* number of grasps: + 1 when GRASPED is entered */
    uint32_t slips;                           /* gross slips of all jaws since the start of the daemon */
    uint32_t slip_mask, slip_latch;           /* bit n = sensor n: gross slip now; gross slip since the last clear */
    uint32_t object_id;                       /* the taught object with this weight, 0 = unknown or no weight */
    /* 1: a known weight has set the scale of the weight since the daemon's start */
    uint32_t scale_shown;
    double weight_kg, weight_sd_kg; /* net, of the object alone */
    /* mean normal force of a jaw; the minimum that holds the object, with the margin */
    float grip_N, recommended_grip_N;
    float friction, friction_sd;               /* coefficient, learnt in this grasp or as configured (then the sd is NaN) */
    float object_probability, reserved_float;  /* probability that it is object_id and not another or an unknown object */
    char object[TACTILED_NAME_SIZE];           /* name of object_id, "" = unknown or no weight */
    uint16_t slip_state[TACTILED_MAX_SENSORS]; /* enum tactiled_slip_state, indexed by sensor of the node */
    uint16_t slip_count[TACTILED_MAX_SENSORS]; /* gross slips of this sensor, wrapping */
    float friction_use[TACTILED_MAX_SENSORS];  /* |shear| / (friction x press); NaN without contact */
    /* Since 1.6; reads as 0 with an older daemon. */
    uint32_t weight_doubts; /* enum tactiled_weight_doubt; 0 where weight_state is TACTILED_WEIGHT_STABLE */
    uint32_t doubtful;      /* bit n = sensor n: the jaws that weight_doubts concerns, as far as the forces show it */
};

/* Makes a grasp "not known", so that an old grasp is not used as a new one. Counters and latched values are kept. */
static inline void tactiled_forget_grasp(struct tactiled_grasp* grasp) {
    const uint32_t nan_bits = 0x7FC00000u;
    float nan_value;
    int i;
    memcpy(&nan_value, &nan_bits, sizeof nan_value);
    grasp->state = TACTILED_GRIP_UNKNOWN;
    grasp->weight_state = TACTILED_WEIGHT_NONE;
    grasp->slip_mask = grasp->object_id = 0;
    grasp->weight_doubts = grasp->doubtful = 0;
    grasp->weight_kg = grasp->weight_sd_kg = (double)nan_value;
    grasp->grip_N = grasp->recommended_grip_N = grasp->friction = grasp->friction_sd = grasp->object_probability = nan_value;
    memset(grasp->object, 0, sizeof grasp->object);
    for (i = 0; i < TACTILED_MAX_SENSORS; ++i) {
        grasp->slip_state[i] = (uint16_t)TACTILED_SLIP_UNKNOWN;
        grasp->friction_use[i] = nan_value;
    }
}

/* Why the wrench of the gripper has no value, or a weakness: bits of tactiled_tool.why. Since 1.7. */
enum tactiled_tool_why {
    TACTILED_TOOL_GRAVITY =
        1 << 0, /* no value: the direction of gravity is not known, and a sensor carries a part of the hand */
    TACTILED_TOOL_SENSOR = 1 << 1,  /* no value: a sensor has none */
    TACTILED_TOOL_TARE = 1 << 2,    /* no value: gravity was not known when a sensor was tared; tare again, or untare */
    TACTILED_TOOL_DOUBTED = 1 << 3, /* uncertain: a sensor's value is */
    TACTILED_TOOL_MOVES = 1 << 4,   /* the hand may accelerate, and nothing reports it: in the standard deviation */
    TACTILED_TOOL_TORQUE = 1 << 5,  /* the torque has a component that a sensor cannot see: NaN */
    TACTILED_TOOL_APART = 1 << 6    /* uncertain: the sensors' samples are further apart in time than 50 ms */
};

/* Returns the quality of a wrench on the gripper with these reasons; an unknown one lowers to UNCERTAIN. */
static inline uint32_t tactiled_tool_verdict(uint32_t why) {
    if ((why & (TACTILED_TOOL_GRAVITY | TACTILED_TOOL_SENSOR | TACTILED_TOOL_TARE)) != 0) return TACTILED_BAD;
    return (why & ~(uint32_t)(TACTILED_TOOL_MOVES | TACTILED_TOOL_TORQUE)) != 0 ? TACTILED_UNCERTAIN : TACTILED_GOOD;
}

/* The force and torque of the world on the gripper, in its frame G (z out of the palm): the forces of all sensors of [tool],
 * turned, less the weight of the part of the hand that each carries, and their sum. Torques are about the origin of G. All
 * NaN where quality is TACTILED_BAD; a component that is not seen is NaN. Without [tool] quality is TACTILED_NO_VALUE.
 * Since 1.7. */
struct tactiled_tool {
    TACTILED_ALIGN(8) uint64_t t_ns; /* time of the oldest sample in the sum */
    TACTILED_ALIGN(8) uint64_t t_newest_ns;
    uint32_t quality; /* enum tactiled_quality, of the sum */
    uint32_t why;     /* enum tactiled_tool_why */
    uint32_t sensors; /* bit n = sensor n: is part of the sum */
    uint32_t bad;     /* bit n = sensor n: has no value, and so the sum has none */
    TACTILED_ALIGN(8) double force_G_N[3];
    TACTILED_ALIGN(8) double torque_G_Nm[3];
    TACTILED_ALIGN(8) double sd_force_N[3];
    TACTILED_ALIGN(8) double sd_torque_Nm[3];
    float gravity_G_m_s2[3];                       /* reported or configured; NaN = not known */
    float mass_kg;                                 /* mass of the hand that is compensated, all sensors */
    uint32_t sensor_quality[TACTILED_MAX_SENSORS]; /* enum tactiled_quality, of the following, by sensor of the node */
    float sensor_force_G_N[TACTILED_MAX_SENSORS][3];
    float sensor_torque_G_Nm[TACTILED_MAX_SENSORS][3];
    float sensor_sd_force_N[TACTILED_MAX_SENSORS][3];
    float sensor_sd_torque_Nm[TACTILED_MAX_SENSORS][3];
};

/* Makes a wrench "not known", so that an old one cannot pass for a new one. */
static inline void tactiled_forget_tool(struct tactiled_tool* tool) {
    const uint64_t nan_bits = 0x7FF8000000000000u;
    double nan_value;
    int i, k;
    memcpy(&nan_value, &nan_bits, sizeof nan_value);
    if (tool->quality != TACTILED_NO_VALUE) tool->quality = TACTILED_BAD;
    for (k = 0; k < 3; ++k) {
        tool->force_G_N[k] = tool->torque_G_Nm[k] = tool->sd_force_N[k] = tool->sd_torque_Nm[k] = nan_value;
        tool->gravity_G_m_s2[k] = (float)nan_value;
        for (i = 0; i < TACTILED_MAX_SENSORS; ++i)
            tool->sensor_force_G_N[i][k] = tool->sensor_torque_G_Nm[i][k] = tool->sensor_sd_force_N[i][k] =
                tool->sensor_sd_torque_Nm[i][k] = (float)nan_value;
    }
    for (i = 0; i < TACTILED_MAX_SENSORS; ++i)
        if (tool->sensor_quality[i] != TACTILED_NO_VALUE) tool->sensor_quality[i] = TACTILED_BAD;
}

/* One published record of the whole node. It says which samples of the sensors belong together. */
struct tactiled_node {
    TACTILED_ALIGN(8) uint64_t sequence;      /* number of the record, from 0 */
    TACTILED_ALIGN(8) uint64_t t_ns;          /* time of publishing, CLOCK_MONOTONIC */
    TACTILED_ALIGN(8) uint64_t cycles;        /* cycles of the pipeline */
    TACTILED_ALIGN(8) uint64_t missed_cycles; /* periods that the pipeline's thread missed */
    uint32_t heartbeat;                       /* + 1 each 100 ms while the pipeline runs and at least one sensor delivers */
    uint32_t status;                          /* enum tactiled_status */
    uint32_t fault;                           /* enum tactiled_fault, latched */
    uint32_t warning;                         /* enum tactiled_warning */
    uint32_t worst_cycle_us;                  /* longest cycle of the last second */
    struct tactiled_command command[TACTILED_COMMANDERS];
    TACTILED_ALIGN(8) uint64_t count[TACTILED_MAX_SENSORS]; /* number of samples of each sensor: the newest is count - 1 */
    struct tactiled_grasp grasp;                            /* since 1.1; reads as 0 with an older daemon */
    struct tactiled_tool tool; /* since 1.7; reads as 0 with an older daemon, and without [tool] */
};
#define TACTILED_NODE_SIZE_1_1 456u /* size of a record that has a grasp */
#define TACTILED_NODE_SIZE_1_6 464u /* size of a record without a tool */

enum tactiled_command_state {
    TACTILED_COMMAND_IDLE = 0,
    TACTILED_COMMAND_RUNNING = 1,
    TACTILED_COMMAND_DONE = 2,
    TACTILED_COMMAND_REJECTED = 3
};

enum tactiled_command_result {
    TACTILED_COMMAND_OK = 0,
    TACTILED_COMMAND_UNKNOWN = 1,
    TACTILED_COMMAND_BAD_MASK = 2,
    TACTILED_COMMAND_BAD_PARAMETER = 3,
    TACTILED_COMMAND_NOT_NOW = 4,
    TACTILED_COMMAND_LOCKED = 5,
    TACTILED_COMMAND_FAILED = 6,
    TACTILED_COMMAND_TIMED_OUT = 7,
    /* Since 1.4, for a tare. If the command is rejected, every zero is unchanged; if it is done, the sensors that
     * were at rest have new zeros. */
    TACTILED_COMMAND_MOVING = 8,     /* the force changed while it was averaged */
    TACTILED_COMMAND_UNDER_LOAD = 9, /* the new zero would differ from the calibration's by more than tare_limit_N */
    /* Since 1.5: */
    TACTILED_COMMAND_NOT_STORED =
        10, /* for a tare: rejected, because its zero cannot be stored; done: a restart will lose it */
    /* Modbus: the first number after a start is accepted and not executed; write another one */
    TACTILED_COMMAND_ADOPTED = 11,
    TACTILED_COMMAND_REPEATED = 12 /* Modbus: that number was used before; this write executed nothing */
};

/* A ring of slots. Slot i begins at offset + i * slot_size with a lock word and four zero bytes, which the record
 * follows. The lock word of record number n (from 0) is 2n + 2 modulo 2^32 when the record is complete, and odd
 * while it is being written or if it was never written. */
struct tactiled_ring {
    uint32_t offset;      /* offset of slot 0 in the file; a multiple of 128 */
    uint32_t slot_size;   /* a multiple of 128 */
    uint32_t slots;       /* a power of two */
    uint32_t record_size; /* bytes of the record that this daemon fills */
    uint32_t head_offset; /* offset of a 32-bit word: number of records published, modulo 2^32; 0 = none yet */
};
#define TACTILED_RECORD_OFFSET 8 /* offset of the record in its slot */

/* Damage of one channel: tactiled_sensor.undetected_kind. Since 1.9. */
enum tactiled_damage {
    TACTILED_DAMAGE_STUCK = 0, /* at an earlier value */
    TACTILED_DAMAGE_HALF_GAIN = 1,
    TACTILED_DAMAGE_DRIFTING = 2,  /* by 30 % of its range */
    TACTILED_DAMAGE_EXCHANGED = 3, /* with another channel */
    TACTILED_DAMAGE_ZERO = 4       /* dead at its zero */
};

/* One sensor of the directory. Name, model, link, ring and stale_ms are constant while the segment exists.
 * `count` changes, and since 1.3 the other fields change when the daemon reloads its configuration: see
 * tactiled_header.reloads. */
struct tactiled_sensor {
    char name[TACTILED_NAME_SIZE];
    char model[TACTILED_NAME_SIZE];
    char method[TACTILED_NAME_SIZE];
    char serial[TACTILED_NAME_SIZE]; /* serial number of the calibrated skin */
    char link[TACTILED_NAME_SIZE];
    struct tactiled_ring ring;
    uint32_t stale_ms; /* a sample that is older than this, or as far in the future, is BAD for every reader */
    uint32_t n_channels;
    uint32_t components; /* bits 0..5: fx fy fz mx my mz are measured */
    float full_scale[6]; /* N and Nm, from the calibration; NaN = unknown */
    /* Since 1.1, so an entry of TACTILED_SENSOR_SIZE_1_0 bytes lacks these fields: call tactiled_methods_of().
     * For method "auto". */
    float budget_us;                       /* time limit of a sample; 0 = the method is not "auto" */
    uint32_t first_method;                 /* index of the method at the start */
    char methods[TACTILED_METHODS_SIZE];   /* names, separated by a space, most accurate first; "" = not "auto" */
    float method_us[TACTILED_MAX_METHODS]; /* 87.5 % quantile of the time of each method, when it was measured */
    /* Standard deviation of each method relative to full scale, at half of it, as the mean of the components. */
    float method_error[TACTILED_MAX_METHODS];
    /* Since 1.3, so an entry of TACTILED_SENSOR_SIZE_1_1 bytes lacks this field: call tactiled_reason_count(). */
    uint32_t count[32]; /* samples with reason bit n since the start, wrapping; changes */
    /* Since 1.5, so an entry of TACTILED_SENSOR_SIZE_1_3 bytes lacks this field: call tactiled_freshness_of(). */
    uint32_t freshness; /* enum tactiled_freshness; changes */
    /* Since 1.8, so an entry of TACTILED_SENSOR_SIZE_1_5 bytes lacks this field: call tactiled_age_bound_us_of(). */
    uint32_t age_bound_us; /* largest possible age of the newest frame, as of the node record; changes */
    /* Since 1.9, so an entry of TACTILED_SENSOR_SIZE_1_8 bytes lacks these fields: call tactiled_array_of(). */
    struct tactiled_ring arrays; /* records are struct tactiled_array and what follows it; no slots: not an array */
    uint32_t n_taxels;
    uint32_t taxel_components;          /* bits 0..2: fx fy fz of a taxel are measured */
    uint32_t taxel_rows, taxel_columns; /* a grid: taxel i is in row i / columns, column i % columns; 0 = a list */
    uint32_t taxel_place_offset;        /* offset of float[n_taxels][6] in the file: place, m, and normal; frame S */
    /* The calibration states for the kind of damage with the largest mean over the channels the share of readings, 0 .. 1,
     * that are GOOD and moved by more than 10 % of full scale. NaN = not known: call tactiled_undetected_of(). */
    float undetected_mean, undetected_worst;      /* over the channels, of the worst channel */
    uint32_t undetected_channel, undetected_kind; /* number of the worst channel in the calibration; enum tactiled_damage */
};
#define TACTILED_SENSOR_SIZE_1_0 216u
#define TACTILED_SENSOR_SIZE_1_1 416u
#define TACTILED_SENSOR_SIZE_1_3 544u
#define TACTILED_SENSOR_SIZE_1_5 548u
#define TACTILED_SENSOR_SIZE_1_8 552u
#define TACTILED_AGE_UNBOUNDED 0xFFFFFFFFu /* tactiled_sensor.age_bound_us: the bound is that or larger, or not known */

/* ---- arrays ----
 *
 * A sensor with taxels publishes its wrench as an ordinary sample, and with each sample an array of the same number
 * in tactiled_sensor.arrays. A record is struct tactiled_array, then float force_S_N[n_taxels][number of components],
 * then uint8_t state[n_taxels]. A force of a taxel that is not measured is NaN; all are where the sample is BAD.
 * Since 1.9. */

/* Why a taxel has no force of its own, or what is wrong with it: bits of its state; 0 = nothing. */
enum tactiled_taxel_state {
    TACTILED_TAXEL_MISSING = 1 << 0,   /* the device sent no number */
    TACTILED_TAXEL_SATURATED = 1 << 1, /* a value is at its limit */
    TACTILED_TAXEL_DEAD = 1 << 2,      /* the calibration lists it */
    TACTILED_TAXEL_FROZEN = 1 << 3,    /* it repeats its numbers */
    TACTILED_TAXEL_OUTSIDE = 1 << 4,   /* it has a force, beyond its calibrated range */
    TACTILED_TAXEL_DOUBTED = 1 << 5    /* it has a force that contradicts those of its neighbours */
};

/* The results of an array. A quantity is NaN where the press does not determine it, and where the sample is BAD. Each sd is
 * one standard deviation from the noise and the gains of the taxels. */
struct tactiled_array {
    struct tactiled_sample sample; /* sample number `sample.sequence` of the sensor; its verdict is that of the array */
    uint32_t n_out;                /* taxels without a force of their own; the sums contain their neighbours' mean */
    uint32_t n_contact;            /* taxels whose press is above the noise of all */
    uint32_t peak_taxel;           /* taxel of the largest press, where peak_N is a number */
    float peak_N, peak_sd_N;       /* its press, along its normal */
    float cop_S_m[3], cop_sd_m[3]; /* centre of pressure */
    float area_m2, area_sd_m2;     /* area of the taxels in contact */
    float axis_rad, axis_sd_rad;   /* direction of a long contact in x y, from x, -pi/2 .. pi/2; NaN for a round one */
    uint32_t reserved;
};

/* Counters of a link, 32 bits each, wrapping: index of tactiled_link.count. */
enum tactiled_link_count {
    TACTILED_LINK_BYTES = 0,
    TACTILED_LINK_FRAMES = 1,       /* valid frames */
    TACTILED_LINK_SKIPPED = 2,      /* bytes that belong to no frame */
    TACTILED_LINK_BAD_CHECKSUM = 3, /* frames with a wrong CRC or checksum */
    TACTILED_LINK_BAD_LENGTH = 4,   /* frames that are too long, too short, or differ from their header */
    TACTILED_LINK_BAD_VALUE = 5,    /* frames that are whole but contain a text that is not a number */
    TACTILED_LINK_LOST = 6,         /* gaps in the device's sequence, in frames */
    TACTILED_LINK_REPEATED = 7,     /* frames with a repeated or older sequence number, which were dropped */
    TACTILED_LINK_RING_FULL = 8,    /* frames that were refused because the pipeline was late */
    TACTILED_LINK_UNBOUND = 9,      /* frames of a device that no sensor uses */
    TACTILED_LINK_OPENED = 10,      /* times the device was opened */
    TACTILED_LINK_OPEN_FAILED = 11,
    TACTILED_LINK_GONE = 12,      /* times the device disappeared while it was open */
    TACTILED_LINK_OVERRUN = 13,   /* losses that the kernel's driver reports */
    TACTILED_LINK_BUS_ERROR = 14, /* CAN error frames; I2C transfers and Modbus requests without a valid answer */
    /* devices that were configured again while the link stayed open: a chip after a reset, a bus-off */
    TACTILED_LINK_RESTARTED = 15,
    TACTILED_LINK_COUNTS = 16
};

enum tactiled_link_state { TACTILED_LINK_CLOSED = 0, TACTILED_LINK_OPEN = 1 };

struct tactiled_link {
    TACTILED_ALIGN(128) char name[TACTILED_NAME_SIZE];
    char driver[TACTILED_NAME_SIZE];
    uint32_t simulated;          /* 1 if the configuration declares the link as simulated */
    struct tactiled_ring frames; /* records are struct tactiled_frame; since 1.2: no slots with an older daemon */
    /* Since 1.9: records are struct tactiled_taxels and what follows it, number n that of frame n; no slots: no array.
     * An older daemon leaves these bytes undefined: use tactiled_segment.taxels of reader.h. */
    struct tactiled_ring taxels;
    TACTILED_ALIGN(128) uint32_t state;   /* enum tactiled_link_state; changes */
    uint32_t count[TACTILED_LINK_COUNTS]; /* changes */
};

/* One frame that a link delivered, before any model: the channels of one device at one instant. It serves
 * recording. Since 1.2. */
struct tactiled_frame {
    TACTILED_ALIGN(8) uint64_t t_ns;           /* CLOCK_MONOTONIC when the last byte was read from the kernel */
    TACTILED_ALIGN(8) uint64_t device_time_us; /* the device's own clock, 0 if it sends none */
    uint32_t sequence;                         /* the device's counter, where has_sequence */
    uint32_t missing;                          /* bit n: channel n has no value; its number is NaN */
    uint32_t saturated;                        /* bit n: channel n is at a saturation limit that the driver knows */
    uint32_t lost;                             /* frames of this device that were lost directly before this one */
    uint16_t device;                           /* number of the device on the link */
    uint8_t n_channels;
    uint8_t has_sequence;
    uint32_t reserved;
    TACTILED_ALIGN(8) double channel[TACTILED_MAX_CHANNELS]; /* raw values; the entries from n_channels on are undefined */
};

/* The raw values of the taxels of a frame, which has no channels then. It serves recording. float value[n_values][n_taxels]
 * follows, in the wiring order of the device; NaN = missing, infinite = saturated. Since 1.9. */
struct tactiled_taxels {
    uint16_t n_taxels, n_values; /* 0: the frame has no taxels */
    uint32_t reserved;
};
/* Bytes of such a record with so many numbers, a multiple of 8. */
static inline uint32_t tactiled_taxels_size(uint32_t n_numbers) {
    return ((uint32_t)sizeof(struct tactiled_taxels) + 4 * n_numbers + 7) & ~7u;
}

enum tactiled_state {
    TACTILED_STARTING = 1,
    TACTILED_RUNNING = 2,
    TACTILED_STOPPED = 3, /* ended cleanly */
    TACTILED_REPLACED = 4 /* found dead by its successor, which has a new file under the same name */
};

/* The one page that readers write: a memfd, sealed against shrinking, which the control socket hands out. Before
 * a reader sleeps in FUTEX_WAIT on the head word of the node ring, it requests its wake-up here. The request
 * expires by itself, so no cleanup is needed when a reader dies. Damage to the page can only cause an additional
 * wake-up, or a missed one until the reader's own time limit. */
struct tactiled_wake {
    uint32_t wanted_until;  /* wake while fewer node records than this were published (modulo 2^32) */
    uint32_t ordered_until; /* the daemon has seen a request up to this number: other readers may rely on it */
};
#define TACTILED_WAKE_RECORDS 256 /* number of records that a request covers; a reader renews it at half of that */

/* The start of the file. All fields except `state`, `calibration_id` and `reloads` are constant while the segment
 * exists. To read fields of a directory entry that belong together, read `reloads`, the entry, and `reloads`
 * again; repeat until both values are equal and even. */
struct tactiled_header {
    char magic[8];
    uint32_t byte_order;
    uint16_t major, minor;
    uint32_t header_size;
    uint32_t total_size;
    uint32_t epoch; /* larger at each start of the daemon under this name */
    uint32_t pid;
    char boot_id[40];
    char name[TACTILED_NAME_SIZE];
    char version[TACTILED_NAME_SIZE];
    char control[108]; /* path of the daemon's control socket, "" = none */
    /* the daemon is dead or hangs if the newest node record is older than this */
    uint32_t watchdog_ms;
    uint32_t n_sensors, sensor_offset, sensor_size; /* directory of struct tactiled_sensor */
    uint32_t n_links, link_offset, link_size;       /* directory of struct tactiled_link */
    uint32_t calibration_id;                        /* CRC-16 of the configuration and the calibrations in force */
    struct tactiled_ring node;
    uint32_t lateness_offset;           /* offset of the pipeline's lateness counters, below; 0 = none (before 1.3) */
    TACTILED_ALIGN(128) uint32_t state; /* enum tactiled_state */
    uint32_t reloads;                   /* + 2 with each reload that changed something; odd while it changes. Since 1.3 */
};

/* Number of 32-bit words that count, wrapping, how late the pipeline woke. Word i counts wake-ups that were late
 * by at least tactiled_lateness_ns(i) and by less than tactiled_lateness_ns(i + 1); the last word has no upper
 * limit. */
#define TACTILED_LATENESS_BUCKETS 176
static inline uint64_t tactiled_lateness_ns(uint32_t bucket) {
    const uint32_t octave = bucket < 16 ? 0 : (bucket - 16) / 8;
    return (bucket < 16 ? (uint64_t)bucket : (uint64_t)(8 + (bucket - 16) % 8) << (octave + 1)) * 128;
}
/* bounds: steps of 128 ns to 2 us, then eight per octave to 1 s */
static inline uint32_t tactiled_lateness_bucket(uint64_t ns) {
    const uint64_t steps = ns / 128;
    uint32_t log2, bucket;
    if (steps < 16) return (uint32_t)steps;
    log2 = 63u - (uint32_t)__builtin_clzll(steps);
    bucket = 16 + (log2 - 4) * 8 + (uint32_t)(steps >> (log2 - 3) & 7);
    return bucket < TACTILED_LATENESS_BUCKETS ? bucket : TACTILED_LATENESS_BUCKETS - 1;
}

TACTILED_ASSERT(sizeof(struct tactiled_sample) == 240);
TACTILED_ASSERT(sizeof(struct tactiled_budget) == 240);
TACTILED_ASSERT(sizeof(struct tactiled_placed) == 488);
TACTILED_ASSERT(sizeof(struct tactiled_grasp) == 256);
TACTILED_ASSERT(sizeof(struct tactiled_tool) == 976);
TACTILED_ASSERT(sizeof(struct tactiled_node) == 1440);
TACTILED_ASSERT(sizeof(struct tactiled_sensor) == 608);
TACTILED_ASSERT(sizeof(struct tactiled_array) == 304);
TACTILED_ASSERT(sizeof(struct tactiled_link) == 256);
TACTILED_ASSERT(sizeof(struct tactiled_frame) == 296);
TACTILED_ASSERT(sizeof(struct tactiled_taxels) == 8);
TACTILED_ASSERT(sizeof(struct tactiled_header) == 512);

/* ---- Reading
 * -------------------------------------------------------------------------------------------------------
 * The words of a slot are copied one by one with relaxed atomic loads, because a plain memcpy would be a data
 * race. Each function returns within a bounded number of steps, even if the writer died in the middle of a write. */

#if defined(__SANITIZE_THREAD__) /* thread sanitizer does not model fences: the loads order themselves */
#define TACTILED_LOAD_WORD __ATOMIC_ACQUIRE
#define TACTILED_READ_FENCE() ((void)0)
#else
#define TACTILED_LOAD_WORD __ATOMIC_RELAXED
#define TACTILED_READ_FENCE() __atomic_thread_fence(__ATOMIC_ACQUIRE)
#endif

/* Number of records published so far, modulo 2^32. */
static inline uint32_t tactiled_ring_head(const void* segment, const struct tactiled_ring* ring) {
    const uint32_t* head = (const uint32_t*)(const void*)((const char*)segment + ring->head_offset);
    return __atomic_load_n(head, __ATOMIC_ACQUIRE);
}

/* Copies record number `number` (modulo 2^32) into `out`, which has `size` bytes, a multiple of 4. Bytes that the
 * daemon does not fill read as 0. Returns 1 if the copy is whole, 0 if the slot has another record or changed
 * during the copy. */
static inline int tactiled_ring_read(const void* segment, const struct tactiled_ring* ring, uint32_t number, void* out,
                                     uint32_t size) {
    const char* slot = (const char*)segment + ring->offset + (uint64_t)(number & (ring->slots - 1)) * ring->slot_size;
    const uint32_t* lock = (const uint32_t*)(const void*)slot;
    const char* record = slot + TACTILED_RECORD_OFFSET;
    const uint32_t known = size < ring->record_size ? size : ring->record_size;
    const uint32_t whole = 2 * number + 2;
    uint32_t i = 0;
    if (__atomic_load_n(lock, __ATOMIC_ACQUIRE) != whole) return 0; /* pairs with the writer's release of the lock */
#if UINTPTR_MAX > 0xFFFFFFFFu /* copies two words at a time; the lock guards both, so halves of a 64-bit word are valid */
    for (; i + 8 <= known; i += 8) {
        const uint64_t words = __atomic_load_n((const uint64_t*)(const void*)(record + i), TACTILED_LOAD_WORD);
        memcpy((char*)out + i, &words, 8);
    }
#endif
    for (; i + 4 <= known; i += 4) {
        const uint32_t word = __atomic_load_n((const uint32_t*)(const void*)(record + i), TACTILED_LOAD_WORD);
        memcpy((char*)out + i, &word, 4);
    }
    memset((char*)out + known, 0, size - known);
    TACTILED_READ_FENCE(); /* pairs with the writer's release fence after it made the lock odd */
    return __atomic_load_n(lock, __ATOMIC_RELAXED) == whole;
}

/* Copies the newest record. Returns 1, or 0 if there is none yet or the writer overwrote the record in each of
 * `kTries` attempts. */
static inline int tactiled_ring_latest(const void* segment, const struct tactiled_ring* ring, void* out, uint32_t size) {
    enum { kTries = 16 };
    int i;
    for (i = 0; i < kTries; ++i) {
        const uint32_t head = tactiled_ring_head(segment, ring);
        if (tactiled_ring_read(segment, ring, head - 1, out, size)) return 1;
    }
    return 0;
}

/* Position of a reader of all records: the number of its next record, and the count of records that it missed. */
struct tactiled_cursor {
    TACTILED_ALIGN(8) uint64_t lost;
    uint32_t next; /* number of the record, modulo 2^32 */
};

/* Sets the cursor to the newest record, or to the oldest record that will not be overwritten soon. */
static inline void tactiled_ring_seek(const void* segment, const struct tactiled_ring* ring, struct tactiled_cursor* cursor,
                                      int oldest) {
    const uint32_t head = tactiled_ring_head(segment, ring);
    const uint32_t kept = ring->slots - 1 - ring->slots / 8; /* the slot of `head` itself may be open for writing already */
    cursor->next = head == 0 ? 0 : oldest == 0 ? head - 1 : head < kept ? 0 : head - kept;
}

/* Copies the record at the cursor and advances the cursor. Returns 1, or 0 if there is none yet. Records that the
 * writer has overwritten are skipped and counted. The function reads the slot and not the head, which saves one
 * cache miss. */
static inline int tactiled_ring_next(const void* segment, const struct tactiled_ring* ring, struct tactiled_cursor* cursor,
                                     void* out, uint32_t size) {
    enum { kTries = 16 };
    int i;
    for (i = 0; i < kTries; ++i) {
        const uint32_t number = cursor->next, whole = 2 * number + 2;
        const char* slot = (const char*)segment + ring->offset + (uint64_t)(number & (ring->slots - 1)) * ring->slot_size;
        const uint32_t lock = __atomic_load_n((const uint32_t*)(const void*)slot, __ATOMIC_RELAXED);
        if (lock == whole && tactiled_ring_read(segment, ring, number, out, size)) {
            cursor->next = number + 1;
            return 1;
        }
        if (lock != whole && (int32_t)(lock - whole) < 0) return 0; /* not written yet */
        tactiled_ring_seek(segment, ring, cursor, 1);               /* the writer has overwritten it */
        /* A processor may show the new slot before the new head, so the cursor must not go back. */
        if ((int32_t)(cursor->next - number) < 0) cursor->next = number;
        cursor->lost += cursor->next - number;
    }
    return 0;
}

/* Gives a sample the quality that its reasons allow. `has_value`: it has a force or a torque. */
static inline void tactiled_put_verdict(struct tactiled_sample* sample, int has_value) {
    sample->quality = tactiled_verdict(sample->reasons, has_value);
}

/* Makes `sample` BAD: its forces become NaN, so that an old value is not used as a new one. */
static inline void tactiled_invalidate(struct tactiled_sample* sample, uint32_t reason) {
    const uint64_t nan_bits = 0x7FF8000000000000u;
    double nan_value;
    int i;
    memcpy(&nan_value, &nan_bits, sizeof nan_value);
    sample->reasons |= reason;
    tactiled_put_verdict(sample, 0);
    for (i = 0; i < 3; ++i) {
        sample->force_S_N[i] = sample->torque_S_Nm[i] = nan_value;
        sample->sd_force_N[i] = sample->sd_torque_Nm[i] = nan_value;
        sample->raw_force_S_N[i] = sample->raw_torque_S_Nm[i] = nan_value;
    }
    sample->cop_S_m[0] = sample->cop_S_m[1] = sample->residual = nan_value;
    sample->state = 0;
}

/* Sets what was appended to a sample to "not known" from byte `from` of the record on, the size of an older one: nothing
 * averages or cancels. 0: all. */
static inline void tactiled_forget_appended(struct tactiled_placed* placed, uint32_t from) {
    const uint32_t nan_bits = 0x7FC00000u;
    const uint32_t begin = (uint32_t)offsetof(struct tactiled_placed, cop_sd_m);
    const uint32_t end = (uint32_t)(offsetof(struct tactiled_placed, budget) + offsetof(struct tactiled_budget, model));
    uint32_t at;
    if (from >= sizeof *placed) return;
    for (at = from < begin ? begin : from; at < end; at += 4) memcpy((char*)placed + at, &nan_bits, 4);
    placed->budget.model = 0;
}

/* Returns 1 if `t_ns` is within `limit_ms` of `now_ns`. A time in the future is as bad as an old one: the
 * reader's clock then differs from the daemon's (a time namespace), so the age of the data is unknown. */
static inline int tactiled_is_fresh(uint64_t t_ns, uint64_t now_ns, uint32_t limit_ms) {
    const uint64_t limit_ns = (uint64_t)limit_ms * 1000000u;
    return now_ns - t_ns + limit_ns <= 2 * limit_ns; /* modulo 2^64: -limit .. limit */
}

/* Bytes of a record of an array, a multiple of 8. */
static inline uint32_t tactiled_array_size(uint32_t n_taxels, uint32_t taxel_components) {
    const uint32_t n = (uint32_t)__builtin_popcount(taxel_components);
    return ((uint32_t)sizeof(struct tactiled_array) + n_taxels * (4 * n + 1) + 7) & ~7u;
}

/* Makes an array BAD, with the forces of its taxels. `n_forces`: n_taxels times the number of components. */
static inline void tactiled_invalidate_array(struct tactiled_array* array, uint32_t n_forces, uint32_t reason) {
    const uint32_t nan_bits = 0x7FC00000u;
    float* const force = (float*)(void*)(array + 1);
    float nan_value;
    uint32_t i;
    memcpy(&nan_value, &nan_bits, sizeof nan_value);
    tactiled_invalidate(&array->sample, reason);
    for (i = 0; i < n_forces; ++i) force[i] = nan_value;
    for (i = 0; i < 3; ++i) array->cop_S_m[i] = array->cop_sd_m[i] = nan_value;
    array->peak_N = array->peak_sd_N = array->area_m2 = array->area_sd_m2 = array->axis_rad = array->axis_sd_rad = nan_value;
    array->n_contact = 0;
}

/* Applies the age check that every reader must make before it uses a sample at `now_ns` (CLOCK_MONOTONIC): makes
 * the sample BAD if it is too old. */
static inline void tactiled_judge(struct tactiled_sample* sample, uint32_t stale_ms, uint64_t now_ns) {
    if (!tactiled_is_fresh(sample->t_ns, now_ns, stale_ms)) tactiled_invalidate(sample, TACTILED_STALE);
}

#ifdef __cplusplus
}
#endif
#endif
