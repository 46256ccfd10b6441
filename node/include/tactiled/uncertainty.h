/* Rules for the uncertainty of what is computed from samples: means, differences, sums, magnitude, direction, slip ratio.
 * For C11 and C++17; needs -lm. node/guide/uncertainty.md derives them.
 *
 * Every function returns NaN if a standard deviation that it needs is not known. A record of a daemon before layout 1.10 has
 * no parts: nothing of its sd averages or cancels, and a sum has no sd. Components: 0..5 = fx fy fz mx my mz, frame S. */
#ifndef TACTILED_UNCERTAINTY_H
#define TACTILED_UNCERTAINTY_H

#include <math.h>

#include "layout.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A computed value and its standard deviation. */
struct tactiled_value {
    double value, sd;
    int is_bound; /* 1: the force is not above 3 sd, so that `value` is a limit that 95 % of the true values stay below */
};

#define TACTILED_SURE 3.0    /* a magnitude above this many sd is an estimate; below, it is a bound */
#define TACTILED_WITHIN 1.96 /* normal errors: 95 % */
/* A ratio over a press above this many sd has an interval wider by at most 1 / 100 than its sd says (Fieller 1954). */
#define TACTILED_DIVISOR 10.0

static inline double tactiled_square_(double x) { return x * x; }
/* The root of a variance, which rounding may have made negative; NaN stays NaN. */
static inline double tactiled_root_(double variance) { return variance < 0 ? 0 : sqrt(variance); }

/* The standard deviation of component c of a sample. */
static inline double tactiled_sd(const struct tactiled_placed* p, unsigned c) {
    return c < 3 ? p->sample.sd_force_N[c] : p->sample.sd_torque_Nm[c - 3];
}

/* The correlation of the errors of components c and d of one sample; 0 if it is not known. */
static inline double tactiled_correlation(const struct tactiled_budget* b, unsigned c, unsigned d) {
    const unsigned low = c < d ? c : d, high = c < d ? d : c;
    const double r = c == d ? 1.0 : (double)b->correlation[low * (9 - low) / 2 + high - 1];
    return r >= -1 && r <= 1 ? r : 0;
}

/* The correlation of the calibration errors of one sensor under two loads; 0 if it is not known. Rational quadratic kernel.
 */
static inline double tactiled_alike(const struct tactiled_budget* a, const struct tactiled_budget* b) {
    double squared = 0;
    unsigned c;
    for (c = 0; c < 6; ++c) squared += tactiled_square_((double)a->load[c] - (double)b->load[c]);
    squared /= (double)a->alike_within * (double)b->alike_within;
    return squared >= 0 && a->alike >= 0 && b->alike >= 0 ? sqrt((double)a->alike * (double)b->alike) / (1 + squared) : 0;
}

/* The covariance of components c and d of one sample, N and Nm: every part but the reference correlates alike. NaN without a
 * budget. */
static inline double tactiled_covariance_(const struct tactiled_budget* b, unsigned c, unsigned d) {
    double products = 0;
    unsigned part;
    for (part = 0; part < TACTILED_PARTS; ++part)
        if (part != TACTILED_OF_REFERENCE) products += (double)b->sd_part[part][c] * (double)b->sd_part[part][d];
    return tactiled_correlation(b, c, d) * products +
           (double)b->sd_part[TACTILED_OF_REFERENCE][c] * (double)b->sd_part[TACTILED_OF_REFERENCE][d];
}
static inline double tactiled_covariance(const struct tactiled_placed* p, unsigned c, unsigned d) {
    const double covariance = c == d ? tactiled_square_(tactiled_sd(p, c)) : tactiled_covariance_(&p->budget, c, d);
    return c != d && isnan(covariance) ? 0 : covariance;
}

/* The sd of the mean of component c over n samples that follow each other under one load, of which `p` is any. Only the
 * noise averages; not if a low pass has already averaged it. */
static inline double tactiled_sd_of_mean(const struct tactiled_placed* p, unsigned c, unsigned n) {
    const double sd = tactiled_sd(p, c), noise = (double)p->budget.sd_part[TACTILED_OF_NOISE][c];
    if (isnan(noise) || n < 2 || (p->sample.state & TACTILED_LOW_PASS) != 0) return sd;
    return tactiled_root_(sd * sd - noise * noise * (1 - 1 / (double)n));
}

/* The sd of component c of `now` minus `earlier`, two samples of one sensor. The zero cancels, except for what it moved
 * since, if no tare, start or other discontinuity lies between them; the calibration and the reference cancel as the loads
 * are alike. Noise, temperature and motion count twice. */
static inline double tactiled_sd_of_difference(const struct tactiled_placed* now, const struct tactiled_placed* earlier,
                                               unsigned c) {
    const float(*const a)[6] = now->budget.sd_part, (*const b)[6] = earlier->budget.sd_part;
    const double sd_a = tactiled_sd(now, c), sd_b = tactiled_sd(earlier, c);
    const int is_one_zero =
        now->sample.epoch == earlier->sample.epoch && now->sample.tare_count == earlier->sample.tare_count;
    double variance = sd_a * sd_a + sd_b * sd_b;
    if (isnan(a[TACTILED_OF_NOISE][c]) || isnan(b[TACTILED_OF_NOISE][c])) return sqrt(variance);
    variance -= 2 * (double)a[TACTILED_OF_REFERENCE][c] * (double)b[TACTILED_OF_REFERENCE][c];
    if (TACTILED_METHOD(now->sample.state) == TACTILED_METHOD(earlier->sample.state))
        variance -= 2 * tactiled_alike(&now->budget, &earlier->budget) * (double)a[TACTILED_OF_CALIBRATION][c] *
                    (double)b[TACTILED_OF_CALIBRATION][c];
    if (is_one_zero) variance -= 2 * tactiled_square_(fmin((double)a[TACTILED_OF_ZERO][c], (double)b[TACTILED_OF_ZERO][c]));
    return tactiled_root_(variance);
}

/* Adds up weight_a[c] weight_b[d] R_cd sd_a[c] sd_b[d], with the correlations R of `budget`. */
static inline double tactiled_product_(const struct tactiled_budget* budget, const double weight_a[6], const float sd_a[6],
                                       const double weight_b[6], const float sd_b[6]) {
    double sum = 0;
    unsigned c, d;
    for (c = 0; c < 6; ++c)
        for (d = 0; weight_a[c] != 0 && d < 6; ++d)
            if (weight_b[d] != 0)
                sum += weight_a[c] * weight_b[d] * (double)sd_a[c] * (double)sd_b[d] * tactiled_correlation(budget, c, d);
    return sum;
}

/* The variance of the sum over n sensors of weight[i][c] times component c of budget[i]. Components with the weight 0 may be
 * unknown. Errors of calibration, temperature and motion are fully alike in sensors of one model, and those of the reference
 * in all: they add up. They count as independent where they would cancel, because nothing shows that two sensors err
 * exactly alike. */
static inline double tactiled_variance_of_sum(const struct tactiled_budget* const* budget, const double (*weight)[6],
                                              unsigned n) {
    static const enum tactiled_part kShared[] = {TACTILED_OF_CALIBRATION, TACTILED_OF_TEMPERATURE, TACTILED_OF_MOTION};
    double variance = 0, reference = 0, references = 0;
    unsigned i, j, c, part;
    for (i = 0; i < n; ++i) {
        double of_reference = 0;
        for (part = 0; part < TACTILED_PARTS; ++part)
            if (part != TACTILED_OF_REFERENCE)
                variance +=
                    tactiled_product_(budget[i], weight[i], budget[i]->sd_part[part], weight[i], budget[i]->sd_part[part]);
        for (c = 0; c < 6; ++c)
            if (weight[i][c] != 0) of_reference += weight[i][c] * (double)budget[i]->sd_part[TACTILED_OF_REFERENCE][c];
        reference += of_reference;
        references += of_reference * of_reference;
        for (j = 0; j < i; ++j) {
            if (budget[i]->model == 0 || budget[i]->model != budget[j]->model) continue;
            for (part = 0; part < sizeof kShared / sizeof kShared[0]; ++part) {
                const double shared = tactiled_product_(budget[i], weight[i], budget[i]->sd_part[kShared[part]], weight[j],
                                                        budget[j]->sd_part[kShared[part]]);
                if (shared > 0) variance += 2 * shared;
            }
        }
    }
    return (variance < 0 ? 0 : variance) + fmax(reference * reference, references);
}

/* The sd of the sum over n sensors of weight[i][c] times component c of sample[i]: {0, 0, 1} for the sum of fz. */
static inline double tactiled_sd_of_sum(const struct tactiled_placed* const* sample, const double (*weight)[6], unsigned n) {
    const struct tactiled_budget* budget[TACTILED_MAX_SENSORS];
    unsigned i;
    if (n > TACTILED_MAX_SENSORS) return (double)NAN;
    for (i = 0; i < n; ++i) {
        if (sample[i]->sample.quality != TACTILED_GOOD && sample[i]->sample.quality != TACTILED_UNCERTAIN)
            return (double)NAN;
        budget[i] = &sample[i]->budget;
    }
    return sqrt(tactiled_variance_of_sum(budget, weight, n));
}

/* A vector of the first measured components of the force: its length, unit vector and covariance C. */
struct tactiled_length_ {
    double length, unit[3], c[3][3];
    double along, trace;  /* u' C u, trace C */
    double both, squared; /* |C u|^2, trace C^2 */
};

static inline struct tactiled_length_ tactiled_length_of_(const struct tactiled_placed* p, unsigned n) {
    struct tactiled_length_ out;
    double squares = 0;
    unsigned c, d, measured = 0;
    memset(&out, 0, sizeof out);
    for (c = 0; c < n; ++c) {
        if (isnan(p->sample.force_S_N[c])) continue;
        ++measured;
        squares += tactiled_square_(out.unit[c] = p->sample.force_S_N[c]);
        for (d = 0; d < n; ++d)
            if (!isnan(p->sample.force_S_N[d])) out.c[c][d] = tactiled_covariance(p, c, d);
    }
    out.length = measured > 0 ? sqrt(squares) : (double)NAN;
    for (c = 0; c < n; ++c) {
        out.unit[c] = out.length > 0 ? out.unit[c] / out.length : 0;
        out.trace += out.c[c][c];
    }
    for (c = 0; c < n; ++c) {
        double product = 0;
        for (d = 0; d < n; ++d) {
            product += out.c[c][d] * out.unit[d];
            out.squared += out.c[c][d] * out.c[c][d];
        }
        out.along += product * out.unit[c];
        out.both += product * product;
    }
    return out;
}

/* The length with its sd, to second order of error / length. */
static inline struct tactiled_value tactiled_value_of_(const struct tactiled_length_* v) {
    const double across = v->trace - v->along, shared = v->both - v->along * v->along;
    const double of_across = v->squared - 2 * v->both + v->along * v->along;
    const double more = of_across / 2 - across * v->along - 2 * shared;
    struct tactiled_value out;
    out.is_bound = !(v->length > TACTILED_SURE * tactiled_root_(v->trace));
    out.value = out.is_bound ? v->length + TACTILED_WITHIN * tactiled_root_(v->trace) : v->length;
    out.sd = out.is_bound ? (double)NAN : tactiled_root_(v->along + more / (v->length * v->length));
    return out;
}

/* The magnitude of the measured components of the force, N. */
static inline struct tactiled_value tactiled_magnitude(const struct tactiled_placed* p) {
    const struct tactiled_length_ v = tactiled_length_of_(p, 3);
    return tactiled_value_of_(&v);
}

/* The direction of the force: a unit vector in S, and the root mean square of the angle between it and the true one, rad, to
 * second order. NaN where the magnitude is a bound. Components that are not measured are 0. */
static inline double tactiled_direction(const struct tactiled_placed* p, double unit_S[3]) {
    const struct tactiled_length_ v = tactiled_length_of_(p, 3);
    const double across = v.trace - v.along, shared = v.both - v.along * v.along;
    const double of_across = v.squared - 2 * v.both + v.along * v.along, squared = v.length * v.length;
    const double more = 3 * (across * v.along + 2 * shared) - (across * across + 2 * of_across) * 2 / 3;
    const int is_bound = tactiled_value_of_(&v).is_bound;
    unsigned c;
    for (c = 0; c < 3; ++c) unit_S[c] = is_bound ? (double)NAN : v.unit[c];
    return is_bound ? (double)NAN : tactiled_root_((across + more / squared) / squared);
}

/* The slip ratio: the tangential force over the press, |(fx, fy)| / -fz. NaN without a press above 10 sd or without fx and
 * fy; a bound where the tangential force is one. */
static inline struct tactiled_value tactiled_slip_ratio(const struct tactiled_placed* p) {
    const struct tactiled_length_ shear = tactiled_length_of_(p, 2);
    const double press = -p->sample.force_S_N[2], sd = tactiled_sd(p, 2);
    struct tactiled_value out = tactiled_value_of_(&shear);
    double slope[3], variance;
    unsigned c, d;
    if (!(press > TACTILED_DIVISOR * sd) || isnan(p->sample.force_S_N[0] + p->sample.force_S_N[1])) {
        out.value = out.sd = (double)NAN;
        out.is_bound = 1;
        return out;
    }
    if (out.is_bound) {
        out.value /= press - TACTILED_WITHIN * sd;
        return out;
    }
    variance = (out.sd * out.sd - shear.along) / (press * press); /* the second order of the shear */
    out.value /= press;
    slope[0] = shear.unit[0] / press;
    slope[1] = shear.unit[1] / press;
    slope[2] = out.value / press; /* d(shear / -fz) / d fz */
    for (c = 0; c < 3; ++c)
        for (d = 0; d < 3; ++d) variance += slope[c] * slope[d] * tactiled_covariance(p, c, d);
    out.sd = tactiled_root_(variance);
    return out;
}

/* The part with the largest share in the variance of the force: enum tactiled_part, or TACTILED_PARTS if none is known. */
static inline unsigned tactiled_largest_part(const struct tactiled_placed* p) {
    unsigned part, c, largest = TACTILED_PARTS;
    double most = 0;
    for (part = 0; part < TACTILED_PARTS; ++part) {
        double squares = 0;
        for (c = 0; c < 3; ++c)
            if (!isnan(p->sample.sd_force_N[c])) squares += tactiled_square_((double)p->budget.sd_part[part][c]);
        if (!(squares > most)) continue;
        most = squares;
        largest = part;
    }
    return largest;
}

#ifdef __cplusplus
}
#endif
#endif
