// tactilectl completion bash|zsh: the script that completes verbs, options, sensors and files.
#include <fmt/format.h>

#include <memory>

#include "node/ctl/command_line.hpp"
#include "node/ctl/verbs.hpp"

namespace tactiled::ctl {
namespace {

// The verbs are written into the script. Options come from the verb's own help and sensors from the running daemon, so that
// neither list can be an old one.
constexpr char kBash[] = R"(# Completion of tactilectl. bash: source <(tactilectl completion bash)
_tactilectl() {
    local word=${COMP_WORDS[COMP_CWORD]} verb=${COMP_WORDS[1]} words=
    if [ "$COMP_CWORD" = 1 ]; then
        words='@VERBS@ help'
    elif [[ $word == -* ]]; then
        words=$("${COMP_WORDS[0]}" "$verb" --help 2>/dev/null | grep -oE -- '^ +(-[a-z],)?--[a-z][a-z-]*' | grep -oE -- '--[a-z-]+')
    elif [ "$COMP_CWORD" = 2 ]; then
        case $verb in
        help) words='@VERBS@' ;;
        completion) words='bash zsh' ;;
        weigh) words='start stop zero forget known' ;;
        read | tare) words=$("${COMP_WORDS[0]}" status 2>/dev/null | sed -n 's/^age of \([^:]*\):.*/\1/p')
            [ "$verb" = tare ] && words="$words all" ;;
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}
complete -o bashdefault -o default -F _tactilectl tactilectl
)";

constexpr char kZsh[] =
    "# zsh: source <(tactilectl completion zsh)\nautoload -U +X compinit && compinit\n"
    "autoload -U +X bashcompinit && bashcompinit\n";

std::string script(const std::string& shell) {
    std::string text = kBash, names;
    for (const Verb& verb : verbs()) names += (names.empty() ? "" : " ") + std::string(verb.name);
    const std::string mark = "@VERBS@";
    for (std::size_t at = text.find(mark); at != text.npos; at = text.find(mark, at)) text.replace(at, mark.size(), names);
    return shell == "zsh" ? kZsh + text : text;
}

}  // namespace

Run add_completion(Command verb) {
    auto shell = std::make_shared<std::string>();
    verb.add_option("shell", *shell, "bash or zsh").required().one_of({"bash", "zsh"});
    return [shell] {
        fmt::print("{}", script(*shell));
        return kGood;
    };
}

}  // namespace tactiled::ctl
