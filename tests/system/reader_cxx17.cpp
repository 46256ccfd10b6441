// A reader in C++17 with the public headers only: prints the press of a sensor as it arrives.
//   reader_cxx17 NODE SENSOR SECONDS
#include <cstdio>
#include <cstdlib>

#include "tactiled/reader.hpp"

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    tactiled::Reader reader(argv[1], argv[2]);
    const auto until = tactiled::monotonic_ns() + std::uint64_t(std::atof(argv[3]) * 1e9);
    unsigned long good = 0, other = 0;
    for (tactiled_sample s; tactiled::monotonic_ns() < until;) {
        if (!reader.next(s)) {
            ::usleep(200);
            continue;
        }
        if (s.quality == TACTILED_GOOD && ++good % 100 == 1) std::printf("press %.3f N\n", -s.force_S_N[2]);
        if (s.quality != TACTILED_GOOD) ++other;
    }
    std::printf("good %lu other %lu lost %llu\n", good, other, static_cast<unsigned long long>(reader.lost()));
    return good > 0 ? 0 : 1;
}
