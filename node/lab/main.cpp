// tactilectl-lab: the verbs for calibrating, simulating and comparing methods. Each verb is one file. Users type
// tactilectl, which starts this program.
#include "node/lab/verbs.hpp"

int main(int argc, char** argv) {
    using namespace tactiled::ctl;
    static constexpr AddVerb kVerbs[] = {add_calibrate, add_decouple, add_play, add_simulate, add_tradeoff};
    static_assert(std::size(kVerbs) == std::size(kLaboratoryVerbs));
    return run_verb(argc, argv, kVerbs);
}
