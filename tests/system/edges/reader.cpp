// Prints what the reader in C++ says now, 50 times a second: quality, fz, time of the sample in s.   reader NODE SENSOR
#include <unistd.h>

#include <cstdio>
#include <tactiled/reader.hpp>

int main(int argc, char** argv) {
    if (argc != 3) return 2;
    tactiled::Reader reader(argv[1], argv[2]);
    for (;;) {
        const tactiled_sample s = reader.latest();
        std::printf("%u %.9g %.6f\n", s.quality, s.force_S_N[2], double(s.t_ns) / 1e9);
        std::fflush(stdout);
        ::usleep(20000);
    }
}
