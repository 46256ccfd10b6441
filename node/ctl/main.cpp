// tactilectl: the program for users. Each verb is one file.
#include "node/ctl/verbs.hpp"

int main(int, char** argv) {
    using namespace tactiled::ctl;
    return run_verb(argv, verbs());
}
