#include "node/ctl/command_line.hpp"

#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>  // all of CLI11, here alone

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <system_error>

#include "config/options.hpp"
#include "config/text_file.hpp"
#include "node/ctl/verbs.hpp"
#include "node/version.hpp"
#include "tactiled/reader.h"

namespace tactiled::ctl {
namespace {

constexpr char kExitStatuses[] =
    "Exit status: 0 good, 1 unhealthy or failed, 2 wrong arguments or files, 3 no daemon of that name, or it is dead.";

CLI::Option* checked(CLI::Option* option, CLI::Validator validator) { return option->check(std::move(validator)); }

}  // namespace

Option Option::required() { return Option(option_->required()); }
Option Option::show_default() { return Option(option_->capture_default_str()); }
Option Option::number_in(double min, double max) {
    const std::string range = fmt::format("[{} - {}]", min, max);
    return Option(checked(option_, CLI::Validator(
                                       [=](const std::string& text) {
                                           double value = 0;
                                           const bool is_inside =
                                               CLI::detail::lexical_cast(text, value) && value >= min && value <= max;
                                           return is_inside ? std::string()
                                                            : fmt::format("{} is not a number in {}", text, range);
                                       },
                                       "FLOAT in " + range)));
}
Option Option::integer_in(std::int64_t min, std::int64_t max) { return Option(checked(option_, CLI::Range(min, max))); }
Option Option::positive() { return Option(checked(option_, CLI::PositiveNumber)); }
Option Option::not_negative() { return Option(checked(option_, CLI::NonNegativeNumber)); }
Option Option::one_of(std::vector<std::string> words) { return Option(checked(option_, CLI::IsMember(std::move(words)))); }
Option Option::existing_file() { return Option(checked(option_, CLI::ExistingFile)); }
Option Option::check(std::function<std::string(const std::string& text)> error_of) {
    return Option(option_->check(std::move(error_of)));
}
Option Option::delimiter(char between) { return Option(option_->delimiter(between)); }
Option Option::take_all() { return Option(option_->take_all()); }
Option Option::one_value_each() { return Option(option_->allow_extra_args(false)); }
Option Option::needs(const std::string& other) { return Option(option_->needs(other)); }
Option Option::excludes(const Option& other) { return Option(option_->excludes(other.option_)); }

template <typename T>
Option Command::add_option(const std::string& name, T& variable, const std::string& help) {
    return Option(app_->add_option(name, variable, help));
}
template Option Command::add_option(const std::string&, std::string&, const std::string&);
template Option Command::add_option(const std::string&, double&, const std::string&);
template Option Command::add_option(const std::string&, int&, const std::string&);
template Option Command::add_option(const std::string&, long&, const std::string&);
template Option Command::add_option(const std::string&, unsigned&, const std::string&);
template Option Command::add_option(const std::string&, std::size_t&, const std::string&);
template Option Command::add_option(const std::string&, std::uint16_t&, const std::string&);
template Option Command::add_option(const std::string&, std::optional<double>&, const std::string&);
template Option Command::add_option(const std::string&, std::optional<std::size_t>&, const std::string&);
template Option Command::add_option(const std::string&, std::vector<std::string>&, const std::string&);
Option Command::add_option(const std::string& name, std::function<void(const std::string&)> set, const std::string& help) {
    return Option(app_->add_option_function<std::string>(name, std::move(set), help));
}
Option Command::add_flag(const std::string& name, bool& variable, const std::string& help) {
    return Option(app_->add_flag(name, variable, help));
}
Command Command::add_group_of_which_one_is_needed(const std::string& name) {
    CLI::App* const group = app_->add_option_group(name);
    group->require_option(1);
    return Command(group);
}
void Command::require_verb() { app_->require_subcommand(1); }
void Command::footer(const std::string& text) { app_->footer(text); }
void Command::version(const std::string& text) { app_->set_version_flag("--version", text); }
void Command::callback(std::function<void()> parsed) { app_->callback(std::move(parsed)); }

Program::Program(const std::string& description, const std::string& name)
    : Program(std::make_unique<CLI::App>(description, name)) {}
Program::Program(std::unique_ptr<CLI::App> app) : Command(app.get()), owned_(std::move(app)) {}
Program::~Program() = default;

void refuse_missing(const std::string& option) { throw CLI::RequiredError(option); }
void refuse(const std::string& why) { throw CLI::ValidationError(why); }

Command add_verb(Command program, const std::string& name, const std::string& help, const std::string& examples) {
    const Command verb(program.app().add_subcommand(name, help));
    verb.app().footer(examples.empty() ? kExitStatuses : fmt::format("Examples:\n{}\n{}", examples, kExitStatuses));
    return verb;
}

void add_node_option(Command verb, std::string& node_name) {
    verb.add_option("--node", node_name, "name of the daemon, [node] name")
        .check([](const std::string& name) {
            tactiled_segment unused{};
            return std::string(tactiled_check_name(&unused, "node", name.c_str()) != 0 ? "" : unused.why);
        })
        .show_default();
    // A variable and not a parameter: each reader of this process, and the laboratory's program, uses it.
    verb.add_option(
        "--runtime-dir", [](const std::string& folder) { ::setenv(TACTILED_FOLDER_VARIABLE, folder.c_str(), 1); },
        "folder of the daemon's segment; default: TACTILED_RUNTIME_DIR, /run/tactiled, $XDG_RUNTIME_DIR/tactiled");
}

void add_timeout_option(Command verb, double& timeout_s) {
    verb.add_option("--timeout", timeout_s, "seconds to wait for the daemon's answer").number_in(0.1, 60.0).show_default();
}

namespace {

// Warns if a verb reads a segment in a shared folder.
void warn_of_shared_folder(const CLI::App& app) {
    const char* const given = tactiled_variable(TACTILED_FOLDER_VARIABLE);
    if (given == nullptr || std::strcmp(given, TACTILED_SHARED_FOLDER) != 0) return;
    for (const CLI::App* verb : app.get_subcommands())
        if (verb->get_option_no_throw("--runtime-dir") != nullptr)
            fmt::print(stderr, "{}: warning: {}\n", app.get_name(), TACTILED_SHARED_WARNING);
}

// Returns "; did you mean --seconds?" for the first word that is no option of the verb but resembles one, else "".
std::string meant_option(const CLI::App& app, int argc, char** argv) {
    std::vector<std::string> known;
    for (const CLI::App* verb = &app; verb != nullptr;
         verb = verb->get_subcommands().empty() ? nullptr : verb->get_subcommands().front())
        for (const CLI::Option* option : verb->get_options({}))
            for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    for (int i = 1; i < argc; ++i) {
        const std::string word = std::string(argv[i]).substr(0, std::string_view(argv[i]).find('='));
        if (!word.starts_with("--") || std::find(known.begin(), known.end(), word) != known.end()) continue;
        if (const auto near = nearest_name(word, known))
            return fmt::format("{} is no option here; did you mean {}?", word, *near);
    }
    return "";
}

}  // namespace

int run_program(Command program, int argc, char** argv, const Run& run) {
    std::signal(SIGPIPE, SIG_IGN);
    CLI::App& app = program.app();
    try {
        app.parse(argc, argv);
    } catch (const CLI::ExtrasError& error) {
        const std::string meant = meant_option(app, argc, argv);
        if (meant.empty()) return app.exit(error) == 0 ? kGood : kUsage;
        fmt::print(stderr, "{}: {}\n", app.get_name(), meant);
        return kUsage;
    } catch (const CLI::ParseError& error) { return flush_output(app.get_name(), app.exit(error) == 0 ? kGood : kUsage); }
    warn_of_shared_folder(app);
    int status = kUnhealthy, write_error = 0;
    bool ran = false;
    const auto print = [&](const std::exception& error) { fmt::print(stderr, "{}: {}\n", app.get_name(), error.what()); };
    try {
        status = run();
        ran = true;
    } catch (const CLI::ParseError& error) { return app.exit(error) == 0 ? kGood : kUsage; } catch (const VerbError& error) {
        print(error);
        status = error.status;
        ran = true;
    } catch (const SaveError& error) {  // the command line is correct
        print(error);
    } catch (const SetupError& error) {
        print(error);
        status = kUsage;
    } catch (const std::system_error& error) {
        ran = std::ferror(stdout) != 0;  // fmt::print() throws where it cannot write
        if (ran)
            write_error = error.code().value();
        else
            print(error);
    } catch (const std::exception& error) { print(error); }
    if (interrupted != 0 && std::ferror(stdout) != 0) std::_Exit(status);  // exit() would wait for the full pipe once more
    return ran ? flush_output(app.get_name(), status, write_error) : status;
}

namespace {

// Returns the text of the error if the first word is not a verb of `app`, or if no second word is a verb of one that
// needs it; else "".
std::string why_no_verb(const CLI::App& app, char** words) {
    std::vector<std::string> known;
    for (const CLI::App* verb : app.get_subcommands({}))
        if (!verb->get_name().empty()) known.push_back(verb->get_name());  // a group of options has no name
    if (known.empty()) return "";
    const std::string word = words != nullptr && *words != nullptr ? *words : "";
    if (word.starts_with('-')) return "";
    const std::string help = "tactilectl help lists the verbs";
    if (word.empty()) return app.get_parent() == nullptr ? "no verb is given; " + help : "";
    for (const CLI::App* verb : app.get_subcommands({}))
        if (verb->get_name() == word) return why_no_verb(*verb, words + 1);
    const auto near = nearest_name(word, known);
    return fmt::format("{} is no verb; {}", in_quotes(word),
                       near ? fmt::format("did you mean \"{}\"? {}", *near, help) : help);
}

// The order of the words on a command line: options may be before or after the verb, and `help` is a verb.

// Shared options that take the next word, so that a node with the name of a verb is not taken for the verb.
constexpr std::string_view kTakesAWord[] = {"--node",     "--runtime-dir", "--config", "--timeout", "--count",
                                            "--interval", "--in",          "--out",    "--model",   "--method"};
char kHelp[] = "--help";

bool is_option(std::string_view word) { return word.size() > 1 && word.front() == '-'; }

bool takes_a_word(std::string_view option) {
    return std::find(std::begin(kTakesAWord), std::end(kTakesAWord), option) != std::end(kTakesAWord);
}

// Returns the words with the verb first: "--node X read skin" becomes "read skin --node X", "help read" becomes "read
// --help", and "help" becomes "--help". argv[0] is kept, a null pointer ends the list, and values stay with their
// options.
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

// Returns the verb in words that verb_first() has ordered; "" if there is none.
std::string_view verb_of(const std::vector<char*>& words) {
    return words.size() > 2 && !is_option(words[1]) ? words[1] : std::string_view();
}

// Replaces this process by tactilectl-lab, from the same folder; arguments (`words` of verb_first()), environment,
// open files and signal dispositions are kept. Returns the exit status, with the reason printed, if that program cannot
// be started.
int start_laboratory(const std::vector<char*>& words) {
    const std::string_view word = verb_of(words);
    std::error_code error;
    const auto here = std::filesystem::read_symlink("/proc/self/exe", error);
    if (error) {
        fmt::print(stderr, "tactilectl: {}: /proc/self/exe: {}\n", word, error.message());
        return kUnhealthy;
    }
    const auto program = here.parent_path() / "tactilectl-lab";
    ::execv(program.c_str(), words.data());
    if (errno == ENOENT) {
        fmt::print(stderr, "tactilectl: {} is in the package tactiled-lab, which is not installed: there is no {}\n", word,
                   program.native());
        return kUsage;
    }
    fmt::print(stderr, "tactilectl: {}: {}: {}\n", word, program.native(), std::strerror(errno));
    return kUnhealthy;
}

}  // namespace

int run_verb(char** argv, std::span<const Verb> verbs) {
    std::vector<char*> words = verb_first(argv);
    for (const Verb& verb : verbs)
        if (verb.add == nullptr && verb.name == verb_of(words)) return start_laboratory(words);
    CLI::App app{"Reads, checks and calibrates the tactile sensors of a tactiled daemon.", "tactilectl"};
    app.set_version_flag("--version", version_text());
    app.require_subcommand(1);
    app.footer(fmt::format("tactilectl VERB --help describes a verb.\n{}", kExitStatuses));
    Run run;
    const Command program(&app);
    for (const Verb& verb : verbs) {
        const Command command = add_verb(program, verb.name, verb.help, verb.examples);
        if (verb.add == nullptr)
            command.app().group("Laboratory (package tactiled-lab)");
        else
            command.app().callback([&run, action = verb.add(command)] { run = action; });
    }
    if (const std::string why = why_no_verb(app, words.size() > 1 ? words.data() + 1 : nullptr); !why.empty()) {
        fmt::print(stderr, "tactilectl: {}\n", why);
        return kUsage;
    }
    return run_program(program, int(words.size()) - 1, words.data(), [&] { return run(); });
}

}  // namespace tactiled::ctl
