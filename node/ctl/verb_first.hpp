// The order of the words on a command line: options may be before or after the verb, and `help` is a verb.
#pragma once
#include <string_view>
#include <vector>

namespace tactiled::ctl {

// Returns the words with the verb first: "--node X read skin" becomes "read skin --node X", "help read" becomes "read
// --help", and "help" becomes "--help". argv[0] is kept, a null pointer ends the list, and values stay with their
// options.
std::vector<char*> verb_first(char** argv);

// Returns the verb in words that verb_first() has ordered; "" if there is none.
std::string_view verb_of(const std::vector<char*>& words);

}  // namespace tactiled::ctl
