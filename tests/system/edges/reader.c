/* Prints what the reader in C says now, 50 times a second: quality, fz, time of the sample in s.   reader NODE SENSOR */
#define _GNU_SOURCE
#include <stdio.h>
#include <tactiled/reader.h>

int main(int argc, char** argv) {
    struct tactiled_reader reader;
    struct tactiled_sample s;
    if (argc != 3) return 2;
    tactiled_reader_init(&reader, argv[1], argv[2]);
    for (;;) {
        tactiled_reader_latest(&reader, &s);
        printf("%u %.9g %.6f\n", s.quality, s.force_S_N[2], (double)s.t_ns / 1e9);
        fflush(stdout);
        usleep(20000);
    }
}
