// A table of a file with the record of its keys, behind Options. Private to options.cpp, which has the tables, and to
// options_values.cpp, which has the values.
#pragma once
#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/options.hpp"
#include "config/toml.hpp"

namespace tactiled {

// Column number of an entry of Problems that withdraws the errors of the same file, line and text.
inline constexpr std::uint32_t kTakesBack = UINT32_MAX;

struct Options::Node {
    struct Document {
        std::string file;
        Problems* problems = nullptr;
        bool readable = false;  // a file that is not TOML has one error, and none for missing keys
        toml::table root;
    };

    std::shared_ptr<const Document> document;
    const toml::table* table = nullptr;  // nullptr: not in the file, which is treated as empty
    std::uint32_t line = 1;
    std::string label;  // `sensor "left"`, "[node]"; "" is the root
    std::vector<std::string> asked{};
    bool accepts_other_keys = false;
    std::map<std::string, std::vector<std::shared_ptr<Node>>, std::less<>> children{};
    // Errors about keys that the table lacks; finish() withdraws those whose key is present but misspelt.
    mutable std::multimap<std::string, std::string, std::less<>> absent{};

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
        if (document->readable) document->problems->add(document->file, at, labelled(text));
    }
    void problem(std::string_view key, const std::string& text) const {
        if (!peek(key)) absent.emplace(key, text);
        problem(line_of(key), text);
    }
    void missing(std::string_view key) const;
    // Reports a wrong type. `name` is the key, or an entry of its array.
    void wrong_kind(std::string_view name, const toml::node& found, std::string_view wanted) const;

    // Returns the array at `key`; nullptr if it is missing, and with an error if it is not an array or its size is
    // wrong.
    const toml::array* ask_array(std::string_view key, std::string_view wanted, Count count);
    // Returns a float or an integer as a number.
    std::optional<double> number(std::string_view name, const toml::node& found, Range range) const;
    // Returns all numbers of an array; if one is wrong, it is reported and the result is empty.
    std::vector<double> numbers(std::string_view name, const toml::array& array, Range range) const;

    std::shared_ptr<Node> child(const toml::table* child_table, std::uint32_t child_line, std::string child_label) const {
        return std::make_shared<Node>(
            Node{.document = document, .table = child_table, .line = child_line, .label = std::move(child_label)});
    }

    void finish() const;

private:
    [[nodiscard]] std::string labelled(const std::string& text) const { return label.empty() ? text : label + ": " + text; }
    [[nodiscard]] bool is_missing(std::string_view key) const;
    [[nodiscard]] std::optional<std::string> meant_by(std::string_view key) const;
};

}  // namespace tactiled
