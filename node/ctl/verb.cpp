#include "node/ctl/verb.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>
#include <CLI/CLI.hpp>  // all of CLI11, once: see command_line.hpp

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <system_error>

#include "config/options.hpp"
#include "config/text_file.hpp"
#include "node/version.hpp"
#include "tactiled/reader.h"

namespace tactiled::ctl {

volatile std::sig_atomic_t interrupted = 0;

void catch_interrupt() {
    struct sigaction action {};
    action.sa_handler = [](int) { interrupted = 1; };
    action.sa_flags = int(SA_RESETHAND);  // without SA_RESTART, which std::signal() sets
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
}

namespace {
constexpr char kExitStatuses[] =
    "Exit status: 0 good, 1 unhealthy or failed, 2 wrong arguments or files, 3 no daemon of that name, or it is dead.";
}

CLI::App* add_verb(CLI::App& app, const std::string& name, const std::string& help, const std::string& examples) {
    CLI::App* const verb = app.add_subcommand(name, help);
    verb->footer(examples.empty() ? kExitStatuses : fmt::format("Examples:\n{}\n{}", examples, kExitStatuses));
    return verb;
}

bool wants_colour() {
    const auto variable = [](const char* name) {
        const char* const value = std::getenv(name);
        return std::string(value != nullptr ? value : "");
    };
    const std::string terminal = variable("TERM");
    return ::isatty(STDOUT_FILENO) != 0 && variable("NO_COLOR").empty() && !terminal.empty() && terminal != "dumb";
}

std::string coloured(std::uint32_t quality, const std::string& text) {
    if (!wants_colour() || text.empty()) return text;
    const char* const code = quality == TACTILED_GOOD ? "32" : quality == TACTILED_UNCERTAIN ? "33" : "31";
    return fmt::format("\x1b[{}m{}\x1b[0m", code, text);
}

CLI::Validator number_in(double min, double max) {
    const std::string range = fmt::format("[{} - {}]", min, max);
    return CLI::Validator(
        [=](const std::string& text) {
            double value = 0;
            const bool is_inside = CLI::detail::lexical_cast(text, value) && value >= min && value <= max;
            return is_inside ? std::string() : fmt::format("{} is not a number in {}", text, range);
        },
        "FLOAT in " + range);
}

void add_node_option(CLI::App* verb, std::string& node_name) {
    verb->add_option("--node", node_name, "name of the daemon, [node] name")
        ->check([](const std::string& name) {
            tactiled_segment unused{};
            return std::string(tactiled_check_name(&unused, "node", name.c_str()) != 0 ? "" : unused.why);
        })
        ->capture_default_str();
    // A variable and not a parameter: each reader of this process, and the laboratory's program, uses it.
    verb->add_option_function<std::string>(
        "--runtime-dir", [](const std::string& folder) { ::setenv(TACTILED_FOLDER_VARIABLE, folder.c_str(), 1); },
        "folder of the daemon's segment; default: TACTILED_RUNTIME_DIR, /run/tactiled, $XDG_RUNTIME_DIR/tactiled");
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

// Makes a verb fail if a write to the standard output failed. A pipe without a reader, as after `head`, needs no
// message. `known_error`: errno of the failed write, 0 if none is known.
int flush_output(const std::string& program, int status, int known_error = 0) {
    errno = 0;
    const bool written = std::cout.flush().good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    if (written) return status;
    const int error = errno != 0 ? errno : known_error;  // 0: the write failed earlier
    pollfd output{STDOUT_FILENO, POLLOUT, 0};
    if (::poll(&output, 1, 0) != 1 || (output.revents & POLLERR) == 0)
        fmt::print(stderr, "{}: standard output: {}\n", program, error != 0 ? std::strerror(error) : "a write failed");
    return status == kGood ? kUnhealthy : status;
}

}  // namespace

std::string quality_text(std::uint32_t quality, std::uint32_t reasons) {
    static constexpr const char* kQuality[] = {"no-value", "good", "uncertain", "bad"};
    std::string text = quality < std::size(kQuality) ? kQuality[quality] : "unknown";
    char separator = ':';
    for (std::size_t bit = 0; bit < kReasonWords.size(); ++bit)
        if ((reasons >> bit & 1u) != 0) {
            text += separator;
            text += kReasonWords[bit];
            separator = ',';
        }
    return text;
}

namespace {

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

int run_program(CLI::App& app, int argc, char** argv, const Run& run) {
    std::signal(SIGPIPE, SIG_IGN);
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

}  // namespace

int run_verb(int argc, char** argv, std::span<const AddVerb> verbs) {
    CLI::App app{"Reads, checks and calibrates the tactile sensors of a tactiled daemon.", "tactilectl"};
    app.set_version_flag("--version", version_text());
    app.require_subcommand(1);
    app.footer(fmt::format("tactilectl VERB --help describes a verb.\n{}", kExitStatuses));
    Run run;
    for (const AddVerb add : verbs) add(app, run);
    if (const std::string why = why_no_verb(app, argc > 0 ? argv + 1 : nullptr); !why.empty()) {
        fmt::print(stderr, "tactilectl: {}\n", why);
        return kUsage;
    }
    return run_program(app, argc, argv, run);
}

}  // namespace tactiled::ctl
