// tactilectl-lab: the verbs for calibrating, simulating and comparing methods. Each verb is one file. Users type
// tactilectl, which starts this program.
#include "node/ctl/verb_first.hpp"
#include "node/lab/verbs.hpp"

int main(int, char** argv) {
    using namespace tactiled::ctl;
    static constexpr AddVerb kVerbs[] = {add_calibrate, add_capture,  add_decouple, add_identify,
                                         add_play,      add_simulate, add_tradeoff};
    static_assert(std::size(kVerbs) == std::size(kLaboratoryVerbs));
    std::vector<char*> words = verb_first(argv);
    return run_verb(int(words.size()) - 1, words.data(), kVerbs);
}
