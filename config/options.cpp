#include "config/options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "config/text_file.hpp"
#include "config/toml.hpp"

namespace tactiled {
namespace {

// The destructor of a table recurses: with at most 16 nested values the depth of a malicious file stays below 5,000
// tables, some MiB.
constexpr std::ptrdiff_t kMaxDotsALine = 512;
constexpr std::size_t kMaxUnknownKeys = 20;          // reported for one table
constexpr double kExactIntegers = 9007199254740992;  // 2^53: a float up to this value represents one integer only

std::string kind_of(const toml::node& node) {
    switch (node.type()) {
        case toml::node_type::string: return "a string";
        case toml::node_type::integer: return "an integer";
        case toml::node_type::floating_point: return "a number";
        case toml::node_type::boolean: return "a boolean";
        case toml::node_type::date: return "a date";
        case toml::node_type::time: return "a time";
        case toml::node_type::date_time: return "a date with time";
        case toml::node_type::array: return "an array";
        case toml::node_type::table: return "a table";
        case toml::node_type::none: break;
    }
    return "nothing";
}

// Returns " = 5" if the value is short enough to be printed, else "".
std::string value_of(const toml::node& node) {
    if (const auto* text = node.as_string()) return " = " + in_quotes(text->get());
    if (const auto* integer = node.as_integer()) return fmt::format(" = {}", integer->get());
    if (const auto* number = node.as_floating_point()) return fmt::format(" = {}", number->get());
    if (const auto* flag = node.as_boolean()) return flag->get() ? " = true" : " = false";
    return "";
}

// Returns the reason why the text of a file is unfit for the parser, as line and message.
std::optional<std::pair<std::uint32_t, std::string>> unfit(std::string_view text) {
    std::uint32_t line = 1;
    for (std::size_t start = 0; start < text.size(); ++line) {
        const std::size_t end = std::min(text.find('\n', start), text.size());
        const auto one = text.substr(start, end - start);
        if (one.find('\0') != one.npos) return {{line, "holds a zero byte: not a text file; save it as UTF-8 text"}};
        if (std::count(one.begin(), one.end(), '.') > kMaxDotsALine)
            return {{line, fmt::format("more than {} dots in one line; break the line", kMaxDotsALine)}};
        start = end + 1;
    }
    return std::nullopt;
}

// Returns nothing if the text is not from a file, or not TOML; the reason is reported.
std::optional<toml::table> parse(std::string_view text, const std::string& name, Problems& problems) {
    if (const auto why = unfit(text)) {
        problems.add(name, why->first, why->second);
        return std::nullopt;
    }
    try {
        return toml::parse(text);  // without a name, which would need memory
    } catch (const toml::parse_error& error) {
        const std::string description = in_quotes(error.description());
        problems.add(name, error.source().begin.line, description.substr(1, description.size() - 2),
                     error.source().begin.column);
        return std::nullopt;
    }
}

}  // namespace

struct Options::Node {
    struct Document {
        std::string file;
        Problems* problems = nullptr;
        bool readable = false;  // a file that is not TOML has one error, not one for each missing key as well
        toml::table root;
    };

    std::shared_ptr<const Document> document;
    const toml::table* table = nullptr;  // nullptr: not in the file, which is treated as empty
    std::uint32_t line = 1;
    std::string label;  // `sensor "left"`, "[node]"; "" is the root
    std::vector<std::string> asked{};
    bool accepts_other_keys = false;
    std::map<std::string, std::vector<std::shared_ptr<Node>>, std::less<>> children{};

    [[nodiscard]] const toml::node* peek(std::string_view key) const { return table ? table->get(key) : nullptr; }

    const toml::node* ask(std::string_view key) {
        if (std::find(asked.begin(), asked.end(), key) == asked.end()) asked.emplace_back(key);
        return peek(key);
    }

    [[nodiscard]] std::uint32_t line_of(const toml::node& found) const {
        return found.source().begin.line != 0 ? found.source().begin.line : line;
    }
    [[nodiscard]] std::uint32_t line_of(std::string_view key) const {
        const toml::node* found = peek(key);
        return found ? line_of(*found) : line;
    }

    void problem(std::uint32_t at, const std::string& text) const {
        if (document->readable) document->problems->add(document->file, at, label.empty() ? text : label + ": " + text);
    }
    void problem(std::string_view key, const std::string& text) const { problem(line_of(key), text); }
    void missing(std::string_view key) const { problem(key, fmt::format("key \"{}\" is missing", key)); }
    // Reports a wrong type. `name` is the key, or an entry of its array.
    void wrong_kind(std::string_view name, const toml::node& found, std::string_view wanted) const {
        problem(line_of(found), fmt::format("{}{} is {}, should be {}", name, value_of(found), kind_of(found), wanted));
    }

    // Returns the array at `key`; nullptr if it is missing, and with an error if it is not an array or its size is
    // wrong.
    const toml::array* ask_array(std::string_view key, std::string_view wanted, Count count) {
        const toml::node* found = ask(key);
        if (!found) return nullptr;
        const auto* array = found->as_array();
        if (!array)
            wrong_kind(key, *found, wanted);
        else if (array->size() >= count.min && array->size() <= count.max)
            return array;
        else if (count.min == count.max)
            problem(key, fmt::format("{} has {} entries, should have {}", key, array->size(), count.min));
        else
            problem(key, fmt::format("{} has {} entries, should have {} .. {}", key, array->size(), count.min, count.max));
        return nullptr;
    }

    // Returns a float or an integer as a number.
    std::optional<double> number(std::string_view name, const toml::node& found, Range range) const {
        const auto value = found.is_number() ? found.value<double>() : std::nullopt;
        if (!value)
            wrong_kind(name, found, "a number");
        else if (!std::isfinite(*value))
            problem(line_of(found), fmt::format("{} = {} is not a finite number", name, *value));
        else if (!(*value >= range.min && *value <= range.max))
            problem(line_of(found), fmt::format("{} = {} is outside {} .. {}", name, *value, range.min, range.max));
        else
            return value;
        return std::nullopt;
    }

    // Returns all numbers of an array; if one is wrong, it is reported and the result is empty.
    std::vector<double> numbers(std::string_view name, const toml::array& array, Range range) const {
        std::vector<double> all;
        for (std::size_t i = 0; i < array.size(); ++i) {
            const auto value = number(fmt::format("{}[{}]", name, i), array[i], range);
            if (!value) return {};
            all.push_back(*value);
        }
        return all;
    }

    std::shared_ptr<Node> child(const toml::table* child_table, std::uint32_t child_line, std::string child_label) const {
        return std::make_shared<Node>(
            Node{.document = document, .table = child_table, .line = child_line, .label = std::move(child_label)});
    }

    void finish() const;
};

Options::Options(std::shared_ptr<Node> node) : node_(std::move(node)) {}

Options Options::parse_file(const std::string& path, Problems& problems, std::size_t max_bytes) {
    if (const auto text = read_text_file(path, max_bytes, problems)) return parse_text(*text, path, problems);
    auto document = std::make_shared<Node::Document>();
    document->file = path;
    return Options(std::make_shared<Node>(Node{.document = document, .label = ""}));
}

Options Options::parse_text(std::string_view text, const std::string& name, Problems& problems) {
    auto document = std::make_shared<Node::Document>();
    document->file = name;
    document->problems = &problems;
    if (auto root = parse(text, name, problems)) {
        document->readable = true;
        document->root = std::move(*root);
    }
    const toml::table* root = &document->root;
    return Options(std::make_shared<Node>(Node{.document = document, .table = root, .label = ""}));
}

std::string Options::text(std::string_view key) {
    const toml::node* found = node_->ask(key);
    if (!found)
        node_->missing(key);
    else if (const auto* value = found->as_string(); !value)
        node_->wrong_kind(key, *found, "a string");
    else if (value->get().empty())
        node_->problem(key, fmt::format("{} is empty", key));
    else
        return value->get();
    return "";
}

std::string Options::text(std::string_view key, std::string_view fallback) {
    const toml::node* found = node_->ask(key);
    if (!found) return std::string(fallback);
    if (const auto* value = found->as_string()) return value->get();
    node_->wrong_kind(key, *found, "a string");
    return std::string(fallback);
}

double Options::number(std::string_view key, Range range) {
    const toml::node* found = node_->ask(key);
    if (!found) node_->missing(key);
    return found ? node_->number(key, *found, range).value_or(range.min) : range.min;
}

double Options::number(std::string_view key, Range range, double fallback) {
    const toml::node* found = node_->ask(key);
    return found ? node_->number(key, *found, range).value_or(fallback) : fallback;
}

std::int64_t Options::integer(std::string_view key, Range range) {
    if (!node_->ask(key)) node_->missing(key);
    return integer(key, range, static_cast<std::int64_t>(range.min));
}

std::int64_t Options::integer(std::string_view key, Range range, std::int64_t fallback) {
    const toml::node* found = node_->ask(key);
    if (!found) return fallback;
    const auto* integer = found->as_integer();
    const auto* number = found->as_floating_point();
    if (!integer && !(number && std::trunc(number->get()) == number->get() && std::abs(number->get()) <= kExactIntegers)) {
        node_->wrong_kind(key, *found, "an integer");
        return fallback;
    }
    const std::int64_t value = integer ? integer->get() : static_cast<std::int64_t>(number->get());
    const auto rounded = static_cast<double>(value);
    if (rounded >= range.min && rounded <= range.max) return value;
    node_->problem(key, fmt::format("{} = {} is outside {} .. {}", key, value, range.min, range.max));
    return fallback;
}

bool Options::flag(std::string_view key, bool fallback) { return optional_flag(key).value_or(fallback); }

std::optional<bool> Options::optional_flag(std::string_view key) {
    const toml::node* found = node_->ask(key);
    if (!found) return std::nullopt;
    if (const auto* value = found->as_boolean()) return value->get();
    node_->wrong_kind(key, *found, "true or false");
    return std::nullopt;
}

std::string Options::one_of(std::string_view key, const std::vector<std::string>& allowed) {
    if (!node_->ask(key)) node_->missing(key);
    return one_of(key, allowed, "");
}

std::string Options::one_of(std::string_view key, const std::vector<std::string>& allowed, std::string_view fallback) {
    const toml::node* found = node_->ask(key);
    if (!found) return std::string(fallback);
    const auto* value = found->as_string();
    if (!value) {
        node_->wrong_kind(key, *found, fmt::format("one of \"{}\"", fmt::join(allowed, "\", \"")));
        return std::string(fallback);
    }
    if (std::find(allowed.begin(), allowed.end(), value->get()) != allowed.end()) return value->get();
    node_->problem(key, fmt::format("{} = {} {}", key, in_quotes(value->get()), is_unknown(value->get(), allowed)));
    return std::string(fallback);
}

std::vector<std::string> Options::texts(std::string_view key, Count count) {
    std::vector<std::string> all;
    const toml::array* array = node_->ask_array(key, "an array of strings", count);
    for (std::size_t i = 0; array && i < array->size(); ++i) {
        const auto* value = (*array)[i].as_string();
        if (!value) {
            node_->wrong_kind(fmt::format("{}[{}]", key, i), (*array)[i], "a string");
            return {};
        }
        all.push_back(value->get());
    }
    return all;
}

std::vector<double> Options::numbers(std::string_view key, Range range, Count count) {
    const toml::array* array = node_->ask_array(key, "an array of numbers", count);
    return array ? node_->numbers(key, *array, range) : std::vector<double>{};
}

std::vector<std::vector<double>> Options::rows(std::string_view key) {
    constexpr Range kFinite{-1e300, 1e300};
    std::vector<std::vector<double>> all;
    const toml::array* array = node_->ask_array(key, "an array of arrays of numbers", {});
    for (std::size_t i = 0; array && i < array->size(); ++i) {
        const auto* row = (*array)[i].as_array();
        if (!row) {
            node_->wrong_kind(fmt::format("{}[{}]", key, i), (*array)[i], "an array of numbers");
            return {};
        }
        all.push_back(node_->numbers(fmt::format("{}[{}]", key, i), *row, kFinite));
        if (all.back().empty() && !row->empty()) return {};
    }
    return all;
}

std::optional<Options::TextFile> Options::text_file(std::string_view key, std::size_t max_bytes) {
    const std::string name = text(key);
    if (name.empty()) return std::nullopt;
    const std::string path = (std::filesystem::path(file()).parent_path() / name).string();  // an absolute path is unchanged
    Problems found;
    auto bytes = read_text_file(path, max_bytes, found);
    for (const auto& line : found.lines()) problem(key, line);
    if (!bytes) return std::nullopt;
    return TextFile{path, std::move(*bytes)};
}

bool Options::has(std::string_view key) const { return node_->peek(key) != nullptr; }

bool Options::holds_text(std::string_view key) const {
    const toml::node* const found = node_->peek(key);
    return found != nullptr && found->is_string();
}

std::vector<std::string> Options::keys() const {
    std::vector<std::string> all;
    if (node_->table)
        for (const auto& entry : *node_->table) all.emplace_back(entry.first.str());
    return all;
}

std::vector<std::string> Options::differing_keys(const Options& other) const {
    std::vector<std::string> all = keys(), differing;
    for (auto& key : other.keys())
        if (!has(key)) all.push_back(std::move(key));
    for (auto& key : all) {
        const toml::node *here = node_->peek(key), *there = other.node_->peek(key);
        const bool same = here && there && here->visit([&](const auto& one) {
            using Kind = std::decay_t<decltype(one)>;
            const auto* another = there->as<Kind>();
            return another != nullptr && one == *another;
        });
        if (!same) differing.push_back(std::move(key));
    }
    return differing;
}

Options Options::table(std::string_view key) {
    const toml::node* found = node_->ask(key);
    auto& known = node_->children[std::string(key)];
    if (!known.empty()) return Options(known.front());
    if (found && !found->is_table()) {
        if (found->is_array_of_tables())
            node_->problem(key, fmt::format("[[{0}]] can be there but once: write [{0}]", key));
        else
            node_->wrong_kind(key, *found, fmt::format("the table [{}]", key));
    }
    known.push_back(
        node_->child(found ? found->as_table() : nullptr, node_->line_of(key),
                     node_->label.empty() ? fmt::format("[{}]", key) : fmt::format("{} [{}]", node_->label, key)));
    return Options(known.front());
}

std::vector<Options> Options::tables(std::string_view key, std::size_t max) {
    const toml::node* found = node_->ask(key);
    auto& known = node_->children[std::string(key)];
    const toml::array* array = found ? found->as_array() : nullptr;
    const bool of_tables = found && found->is_array_of_tables();
    if (found && found->is_table())
        node_->problem(key, fmt::format("[{0}] can be there more than once: write [[{0}]]", key));
    else if (found && !of_tables)
        node_->wrong_kind(key, *found, fmt::format("tables [[{}]]", key));
    if (of_tables && array->size() > max)
        node_->problem((*array)[max].source().begin.line,
                       fmt::format("this is [[{}]] number {}; at most {} are possible", key, max + 1, max));
    for (std::size_t i = known.size(); of_tables && i < std::min(array->size(), max); ++i) {
        const toml::table* one = (*array)[i].as_table();
        const auto name = (*one)["name"].value<std::string_view>();
        const std::string label = name ? fmt::format("{} {}", key, in_quotes(*name)) : fmt::format("[[{}]]", key);
        known.push_back(node_->child(one, one->source().begin.line, label));
    }
    std::vector<Options> all;
    for (const auto& node : known) all.push_back(Options(node));
    return all;
}

void Options::problem(std::string_view key, const std::string& text) { node_->problem(key, text); }

std::string Options::where(std::string_view key) const {
    return fmt::format("{}:{}", node_->document->file, node_->line_of(key));
}

const std::string& Options::file() const { return node_->document->file; }

void Options::accept_other_keys() { node_->accepts_other_keys = true; }

void Options::finish() { node_->finish(); }

void Options::Node::finish() const {
    std::vector<std::pair<std::uint32_t, std::string>> unknown;
    if (table && !accepts_other_keys)
        for (const auto& [key, value] : *table)
            if (std::find(asked.begin(), asked.end(), key.str()) == asked.end())
                unknown.emplace_back(key.source().begin.line, key.str());
    std::sort(unknown.begin(), unknown.end());
    for (std::size_t i = 0; i < std::min(unknown.size(), kMaxUnknownKeys); ++i) {
        const auto& [at, key] = unknown[i];
        const toml::node& value = *peek(key);
        const std::string what = value.is_table()             ? fmt::format("unknown table [{}]", key)
                                 : value.is_array_of_tables() ? fmt::format("unknown table [[{}]]", key)
                                                              : fmt::format("unknown key {}", in_quotes(key));
        const auto near = nearest_name(key, asked);
        problem(at, what + (near ? fmt::format("; did you mean \"{}\"?", *near)
                                 : fmt::format("; known: {}", fmt::join(asked, ", "))));
    }
    if (unknown.size() > kMaxUnknownKeys)
        problem(unknown[kMaxUnknownKeys].first, fmt::format("and {} more unknown keys", unknown.size() - kMaxUnknownKeys));
    for (const auto& [key, nodes] : children)
        for (const auto& node : nodes) node->finish();
}

}  // namespace tactiled
