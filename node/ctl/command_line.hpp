// The options of a program or verb. CLI11 is compiled once, in command_line.cpp: in each of the files that define options it
// takes 4 s of a processor.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "node/ctl/verb.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace tactiled::ctl {

// A handle on an option of CLI11, valid while its program is. Each function returns the handle.
// setup: throws CLI::Error for a mistake of the programmer, such as two options of one name.
class Option {
public:
    explicit Option(CLI::Option* option) : option_(option) {}
    Option required();
    Option show_default();                     // the variable's present value, in --help
    Option number_in(double min, double max);  // not nan, which CLI::Range accepts
    Option integer_in(std::int64_t min, std::int64_t max);
    Option positive();
    Option not_negative();
    Option one_of(std::vector<std::string> words);
    Option existing_file();
    Option check(std::function<std::string(const std::string& text)> error_of);  // "": the text is right
    Option delimiter(char between);
    Option take_all();        // each value if the option is given several times
    Option one_value_each();  // the next word is no further value
    Option needs(const std::string& other);
    Option excludes(const Option& other);

private:
    CLI::Option* option_;
};

// A handle on a program, a verb or a group of options, valid while the program is.
class Command {
public:
    explicit Command(CLI::App* app) : app_(app) {}
    // The option sets `variable`, which outlives the parsing. T: std::string, double, int, long, unsigned, std::size_t,
    // std::uint16_t, std::optional<double>, std::optional<std::size_t>,
    // or std::vector<std::string>.
    template <typename T>
    Option add_option(const std::string& name, T& variable, const std::string& help);
    Option add_option(const std::string& name, std::function<void(const std::string& text)> set, const std::string& help);
    Option add_flag(const std::string& name, bool& variable, const std::string& help);
    Command add_group_of_which_one_is_needed(const std::string& name);
    void require_verb();
    void footer(const std::string& text);
    void version(const std::string& text);
    void callback(std::function<void()> parsed);
    [[nodiscard]] CLI::App& app() const { return *app_; }

private:
    CLI::App* app_;
};

// A program without verbs.
class Program : public Command {
public:
    Program(const std::string& description, const std::string& name);
    ~Program();
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;

private:
    explicit Program(std::unique_ptr<CLI::App> app);
    std::unique_ptr<CLI::App> owned_;
};

// For callbacks: the command line is wrong. They throw what run_program() prints, with exit status kUsage.
[[noreturn]] void refuse_missing(const std::string& option);
[[noreturn]] void refuse(const std::string& why);

// Adds a verb whose --help shows `examples`, command lines, one per line, before the exit statuses.
Command add_verb(Command program, const std::string& name, const std::string& help, const std::string& examples = "");

// Adds --node NAME, which selects the daemon, and --runtime-dir.
void add_node_option(Command verb, std::string& node_name);
// Adds --timeout, for the daemon's answer.
void add_timeout_option(Command verb, double& timeout_s);

// Parses the arguments, calls `run`, prints its exceptions after the program's name, and returns the exit status.
int run_program(Command program, int argc, char** argv, const Run& run);
// A row of the table of verbs (verbs.hpp). `examples`: command lines, one per line, for --help.
using AddVerb = Run (*)(Command verb);  // adds the options, and returns the action
struct Verb {
    const char* name;
    AddVerb add;  // nullptr: a verb of another program, which is only listed
    const char *help, *examples;
};
// Does the same for a program of several verbs that users call tactilectl, with options before or after the verb. A verb
// without a function is run by the other program. For an unknown verb the error names the most similar one.
int run_verb(char** argv, std::span<const Verb> verbs);

}  // namespace tactiled::ctl
