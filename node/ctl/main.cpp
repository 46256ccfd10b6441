// tactilectl: the program for users. Each verb is one file.
#include "node/ctl/command_line.hpp"
#include "node/ctl/laboratory.hpp"
#include "node/ctl/verb_first.hpp"

namespace {

// The verbs of tactilectl-lab, for --help. main() starts that program before these could be parsed.
void list_laboratory(tactiled::ctl::Command program, tactiled::ctl::Run&) {
    using namespace tactiled::ctl;
    for (const LaboratoryVerb& verb : kLaboratoryVerbs)
        add_verb(program, verb.name, verb.help).in_group("Laboratory (package tactiled-lab)");
}

}  // namespace

int main(int, char** argv) {
    using namespace tactiled::ctl;
    std::vector<char*> words = verb_first(argv);
    if (const auto status = start_laboratory(words)) return *status;
    static constexpr AddVerb kVerbs[] = {add_status, add_top,        add_read,   add_record,     add_replay,      add_tare,
                                         add_clear,  add_weigh,      add_teach,  add_tool_fit,   add_grasp_check, add_map,
                                         add_check,  add_completion, add_doctor, list_laboratory};
    return run_verb(int(words.size()) - 1, words.data(), kVerbs);
}
