/* Prints samples of a sensor with the reader whose headers the include path has: tests/data/readers has those of older
 * layouts. The program uses only what all of them have.
 *
 *     print_reader NODE SENSOR COUNT     a line for each sample, as hexadecimal words and the doubles' bits
 *     print_reader NODE SENSOR           the quality and the reasons of the newest one */
#define _GNU_SOURCE
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "reader.h"

static void print_numbers(const double* value, int n) {
    uint64_t bits;
    int i;
    for (i = 0; i < n; ++i) {
        memcpy(&bits, value + i, sizeof bits);
        printf(" %016" PRIx64, bits);
    }
}

int main(int argc, char** argv) {
    struct tactiled_reader reader;
    struct tactiled_sample s;
    int left = argc > 3 ? atoi(argv[3]) : 0;
    if (argc < 3) return 2;
    tactiled_reader_init(&reader, argv[1], argv[2]);
    if (reader.index < 0) {
        fprintf(stderr, "%s\n", reader.segment.why);
        return 3;
    }
    if (argc == 3) {
        tactiled_reader_latest(&reader, &s);
        printf("%" PRIu32 " %" PRIx32 "\n", (uint32_t)s.quality, s.reasons);
        return 0;
    }
    for (; left > 0 && tactiled_reader_wait(&reader, &s, 5000, TACTILED_PREDICT); --left) {
        printf("%" PRIu64 " %" PRIu32 " %" PRIx64 " %" PRIx64 " %" PRIx32 " %" PRIu32 " %" PRIx32, s.sequence, s.device_sequence,
               s.t_ns, s.t_published_ns, s.epoch, (uint32_t)s.quality, s.reasons);
        print_numbers(s.force_S_N, 3);
        print_numbers(s.torque_S_Nm, 3);
        print_numbers(s.sd_force_N, 3);
        print_numbers(s.sd_torque_Nm, 3);
        print_numbers(s.cop_S_m, 2);
        print_numbers(&s.residual, 1);
        printf("\n");
    }
    return left == 0 ? 0 : 1;
}
