// One row for a table of shared-memory transports that is not part of this project (its common.hpp: two processes, 256-byte
// messages, each byte checked).
//   cmake -DTACTILED_PEERS=FOLDER ... ; EXTRA=.../shm_peer FOLDER/shm/run.sh
#include "common.hpp"
#include "tests/bench/shm_transport.hpp"

namespace {
struct Tactiled : tactiled::testing::ShmTransport<b::Msg> {
    const char* name() { return "tactiled"; }
    void fini() {}
    void blocking(bool) {}
    bool can_block() { return true; }
    int settle_ns() { return 1000; }
    void extra(const char*) {}
};
}  // namespace

int main() {
    Tactiled t;
    return b::run(t);
}
