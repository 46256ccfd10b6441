// tactilectl-lab: the verbs for calibrating, simulating and comparing methods. Each verb is one file. Users type
// tactilectl, which starts this program.
#include <malloc.h>

#include "node/ctl/verbs.hpp"

namespace tactiled::ctl {

Run add_calibrate(Command verb), add_capture(Command verb), add_decouple(Command verb), add_identify(Command verb),
    add_play(Command verb), add_simulate(Command verb), add_tradeoff(Command verb);

}  // namespace tactiled::ctl

int main(int, char** argv) {
    using namespace tactiled::ctl;
    // A fit makes matrices of 10 MB, one after the other. The kernel would clear fresh memory for each: 15 % of the time.
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
    static constexpr AddVerb kFunctions[] = {add_calibrate, add_capture,  add_decouple, add_identify,
                                             add_play,      add_simulate, add_tradeoff};
    static_assert(std::size(kFunctions) == std::size(kLaboratoryVerbs));
    std::vector<Verb> list(std::begin(kLaboratoryVerbs), std::end(kLaboratoryVerbs));
    for (std::size_t i = 0; i < list.size(); ++i) list[i].add = kFunctions[i];
    return run_verb(argv, list);
}
