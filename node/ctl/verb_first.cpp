#include "node/ctl/verb_first.hpp"

#include <algorithm>
#include <iterator>

namespace tactiled::ctl {
namespace {

// Shared options that take the next word, so that a node with the name of a verb is not taken for the verb.
constexpr std::string_view kTakesAWord[] = {"--node",     "--runtime-dir", "--config", "--timeout", "--count",
                                            "--interval", "--in",          "--out",    "--model",   "--method"};
char kHelp[] = "--help";

bool is_option(std::string_view word) { return word.size() > 1 && word.front() == '-'; }

bool takes_a_word(std::string_view option) {
    return std::find(std::begin(kTakesAWord), std::end(kTakesAWord), option) != std::end(kTakesAWord);
}

}  // namespace

std::vector<char*> verb_first(char** argv) {
    std::vector<char*> words;
    for (; argv != nullptr && *argv != nullptr; ++argv) words.push_back(*argv);
    std::size_t verb = 1;  // a program may be started without a name
    while (verb < words.size() && is_option(words[verb])) verb += takes_a_word(words[verb]) ? 2 : 1;
    if (verb > 1 && verb < words.size() && std::string_view(words[1]) != "--version") {
        const auto first = words.begin() + 1, at = words.begin() + std::ptrdiff_t(verb);
        const std::vector<char*> options(first, at);
        words.erase(first, at);
        words.insert(words.end(), options.begin(), options.end());
    }
    if (words.size() > 1 && std::string_view(words[1]) == "help") {
        words.erase(words.begin() + 1);
        words.push_back(kHelp);
    }
    words.push_back(nullptr);
    return words;
}

std::string_view verb_of(const std::vector<char*>& words) {
    return words.size() > 2 && !is_option(words[1]) ? words[1] : std::string_view();
}

}  // namespace tactiled::ctl
