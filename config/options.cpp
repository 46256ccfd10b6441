// Tables of a TOML file, with a record of the keys that were read and an error for each other key.
#include "config/options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "config/options_node.hpp"
#include "config/text_file.hpp"

namespace tactiled {
namespace {

// The destructor of a table recurses: with at most 16 nested values the depth of a malicious file stays below 5,000
// tables, some MiB.
constexpr std::ptrdiff_t kMaxDotsALine = 512;
constexpr std::size_t kMaxUnknownKeys = 20;  // reported for one table

// Keys of earlier versions, and what replaces them.
constexpr std::pair<std::string_view, std::string_view> kRemoved[] = {
    {"slew_limit_per_s", "jumps are found without a limit: delete the line"},
    {"tare_after_restart", "write zero_after = \"doubt\" for \"restore\", or zero_after = \"forget\""}};

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

// Returns nullopt if the file could not be read or is not TOML; the reason is reported.
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

namespace {

// The name of an element of an array of tables; [[link.device]] has a number.
std::string label_of(const toml::table& element) {
    const std::string number = std::to_string(element["device"].value_or(std::int64_t(0)));
    return element["name"].value_or(element["sensor"].value_or(number));
}

void add_lost(const toml::table& now, const toml::table& before, const std::string& where, std::vector<std::string>& lost) {
    for (const auto& [key, was] : before) {
        const toml::node* const is = now.get(key.str());
        const std::string name = where + std::string(key.str());
        if (is == nullptr) {
            lost.push_back(name);
        } else if (is->is_table() && was.is_table()) {
            add_lost(*is->as_table(), *was.as_table(), name + ".", lost);
        } else if (is->is_array_of_tables() && was.is_array_of_tables()) {
            for (const toml::node& element : *was.as_array()) {
                const std::string label = label_of(*element.as_table());
                const auto same = [&](const toml::node& other) { return label_of(*other.as_table()) == label; };
                const toml::array& here = *is->as_array();
                const auto found = std::find_if(here.begin(), here.end(), same);
                const std::string where_it_was = fmt::format("{} {}", name, in_quotes(label));
                if (found == here.end())
                    lost.push_back(where_it_was);
                else
                    add_lost(*found->as_table(), *element.as_table(), where_it_was + ": ", lost);
            }
        }
    }
}

}  // namespace

std::vector<std::string> Options::lost_keys(const Options& before) const {
    std::vector<std::string> lost;
    if (node_->table != nullptr && before.node_->table != nullptr) add_lost(*node_->table, *before.node_->table, "", lost);
    return lost;
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

// Returns the known key that is most similar to a misspelt `key`, preferably one that the table lacks.
std::optional<std::string> Options::Node::meant_by(std::string_view key) const {
    std::vector<std::string> not_there;
    for (const auto& known : asked)
        if (!peek(known)) not_there.push_back(known);
    const auto near = nearest_name(key, not_there);
    return near ? near : nearest_name(key, asked);
}

// Returns true if the key is a misspelt one whose absence was reported.
bool Options::Node::is_missing(std::string_view key) const {
    const auto near = meant_by(key);
    return near && absent.contains(*near);
}

void Options::Node::finish() const {
    std::vector<std::pair<std::uint32_t, std::string>> unknown;
    if (table)
        for (const auto& [key, value] : *table)
            if (std::find(asked.begin(), asked.end(), key.str()) == asked.end() &&
                (!accepts_other_keys || is_missing(key.str())))
                unknown.emplace_back(key.source().begin.line, key.str());
    std::sort(unknown.begin(), unknown.end());
    for (std::size_t i = 0; i < std::min(unknown.size(), kMaxUnknownKeys); ++i) {
        const std::uint32_t at = unknown[i].first;
        const std::string& key = unknown[i].second;
        const toml::node& value = *peek(key);
        const std::string what = value.is_table()             ? fmt::format("unknown table [{}]", key)
                                 : value.is_array_of_tables() ? fmt::format("unknown table [[{}]]", key)
                                                              : fmt::format("unknown key {}", in_quotes(key));
        const auto removed =
            std::find_if(std::begin(kRemoved), std::end(kRemoved), [&](const auto& r) { return r.first == key; });
        if (removed != std::end(kRemoved)) {
            problem(at, fmt::format("{} was removed; {}", in_quotes(key), removed->second));
            continue;
        }
        const auto near = meant_by(key);
        if (near) {
            // The misspelling is reported, so the errors about the missing key are withdrawn.
            const auto [first, last] = absent.equal_range(*near);
            for (auto error = first; error != last; ++error)
                document->problems->add(document->file, line, labelled(error->second), kTakesBack);
        }
        problem(at, what + (near            ? fmt::format("; did you mean \"{}\"?", *near)
                            : asked.empty() ? ""
                                            : fmt::format("; known: {}", fmt::join(asked, ", "))));
    }
    if (unknown.size() > kMaxUnknownKeys)
        problem(unknown[kMaxUnknownKeys].first, fmt::format("and {} more unknown keys", unknown.size() - kMaxUnknownKeys));
    for (const auto& [key, nodes] : children)
        for (const auto& node : nodes) node->finish();
}

}  // namespace tactiled
