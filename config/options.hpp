// Typed look-ups with ranges in one table of a TOML file. Every error names file, line, key and the right value; all
// of them are collected, so that a user corrects a file only once. A key that was not read is an error, too.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace tactiled {

// Thrown by set-up, caught in main: exit status 78 (EX_CONFIG), do not restart. Never thrown once the loop runs.
struct SetupError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// The errors found so far, "file:line: table: what is right", in the order of the file's lines.
class Problems {
public:
    // Adds an error. `line` 0 is the file as a whole, `column` 0 the line as a whole.
    void add(const std::string& file, std::uint32_t line, const std::string& text, std::uint32_t column = 0);
    [[nodiscard]] bool empty() const { return list_.empty(); }
    [[nodiscard]] std::vector<std::string> lines() const;  // sorted by file and line, each once
    // setup: throws SetupError with all lines if there are any
    void throw_if_any() const;

private:
    struct Problem {
        std::string file;
        std::uint32_t line, column;
        std::string text;
    };
    std::vector<Problem> list_;
};

struct Range {
    double min, max;  // both allowed
};

struct Count {  // number of entries of an array
    std::size_t min = 0, max = SIZE_MAX;
};

// Returns the name of `known` with the smallest edit distance to `name`, if it is near enough to be meant.
std::optional<std::string> nearest_name(std::string_view name, const std::vector<std::string>& known);

// Returns a message for a name that is not in `known`: `is unknown; did you mean "cobs"? known: "cobs", "lines"`.
std::string is_unknown(std::string_view name, const std::vector<std::string>& known);

// Returns `text` in quotes for a message: control characters are escaped, so that a file cannot control the terminal;
// a long text is cut.
std::string in_quotes(std::string_view text);

// One table. Copies share the same table and the same record of which keys were read.
class Options {
public:
    // Parses a file. A file that cannot be read, is larger than `max_bytes` or is not TOML adds to `problems` and
    // gives an empty table. `problems` must outlive the Options. setup: never throws for bad input
    static Options parse_file(const std::string& path, Problems& problems, std::size_t max_bytes = 1u << 20);
    static Options parse_text(std::string_view text, const std::string& name, Problems& problems);

    // Look-ups. Without a fallback the key is required. After an error the fallback, an empty value, or the lower end
    // of the range is returned, so that the caller continues and finds the next error.
    std::string text(std::string_view key);
    std::string text(std::string_view key, std::string_view fallback);
    double number(std::string_view key, Range range);
    double number(std::string_view key, Range range, double fallback);
    std::int64_t integer(std::string_view key, Range range);
    std::int64_t integer(std::string_view key, Range range, std::int64_t fallback);
    bool flag(std::string_view key, bool fallback);
    std::optional<bool> optional_flag(std::string_view key);  // nullopt if the key is missing or has an error
    std::string one_of(std::string_view key, const std::vector<std::string>& allowed);
    std::string one_of(std::string_view key, const std::vector<std::string>& allowed, std::string_view fallback);
    // Arrays are optional: the result is empty if the array is missing or wrong.
    std::vector<std::string> texts(std::string_view key, Count count = {});
    std::vector<double> numbers(std::string_view key, Range range, Count count = {});
    std::vector<std::vector<double>> rows(std::string_view key);  // an array of arrays of numbers

    // The file whose path `key` names, relative to the folder of this file: its path and its bytes. Required;
    // nullopt, with an error, if it cannot be read or is larger.
    struct TextFile {
        std::string path, text;
    };
    std::optional<TextFile> text_file(std::string_view key, std::size_t max_bytes);

    [[nodiscard]] bool has(std::string_view key) const;
    [[nodiscard]] bool holds_text(std::string_view key) const;  // does not count as reading the key
    [[nodiscard]] std::vector<std::string> keys() const;        // all keys of the table; does not count as reading them
    // Returns the keys whose values differ, in order; a table counts as one key.
    [[nodiscard]] std::vector<std::string> differing_keys(const Options& other) const;
    // Returns the keys and tables of `before` that are missing here, also within tables: `sensor "left": filter_hz`.
    [[nodiscard]] std::vector<std::string> lost_keys(const Options& before) const;
    Options table(std::string_view key);  // optional: missing is an empty table
    // Returns [[key]]; optional. More than `max` is an error, and further ones are neither returned nor checked.
    std::vector<Options> tables(std::string_view key, std::size_t max = 256);

    // Adds an error at the line of `key` (or of the table if the key is missing).
    void problem(std::string_view key, const std::string& text);
    [[nodiscard]] std::string where(std::string_view key) const;  // "file:line"
    [[nodiscard]] const std::string& file() const;

    // Accepts the other keys of this table, which depend on a value that is wrong, so that finish() cannot judge
    // them.
    void accept_other_keys();

    // Adds an error for each key that was not read, with the most similar one that was. Call it when all is read.
    // Tables returned by table() and tables() are checked, too.
    void finish();

private:
    struct Node;
    explicit Options(std::shared_ptr<Node> node);
    std::shared_ptr<Node> node_;
};

}  // namespace tactiled
