// The structured text of the map as a source file of TIA Portal (SCL). It differs in its shell alone: types and blocks are
// in quotes, have a version and a BEGIN, local variables have a #, the timer is TON_TIME, and an array type has no name.
#include <fmt/format.h>

#include <cctype>
#include <map>
#include <set>
#include <vector>

#include "node/ctl/map_text.hpp"

namespace tactiled::ctl {
namespace {

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// A word, a comment, a run of spaces, or another character.
std::vector<std::string> tokens_of(std::string_view text) {
    std::vector<std::string> tokens;
    while (!text.empty()) {
        std::size_t size = 1;
        if (text.starts_with("(*")) {
            size = text.find("*)") + 2;
        } else if (is_word(text[0])) {
            while (size < text.size() && (is_word(text[size]) || text[size] == '#')) ++size;  // 16#FFFF, T#2s
        } else if (std::isspace(static_cast<unsigned char>(text[0])) != 0) {
            while (size < text.size() && std::isspace(static_cast<unsigned char>(text[size])) != 0) ++size;
        }
        tokens.emplace_back(text.substr(0, size));
        text.remove_prefix(size);
    }
    return tokens;
}

class Rewriter {
public:
    explicit Rewriter(std::string_view text) : tokens_(tokens_of(text)) {}

    std::string run() {
        for (at_ = 0; at_ < tokens_.size(); ++at_) {
            const std::string& token = tokens_[at_];
            if (token == "TYPE")
                type();
            else if (token == "FUNCTION_BLOCK")
                block();
            else if (token == "END_FUNCTION_BLOCK")
                in_body_ = false, out_ += token;
            else if (token == "VAR" || token.starts_with("VAR_"))
                in_variables_ = true, out_ += token;
            else if (token == "END_VAR")
                end_variables();
            else
                out_ += word(token);
        }
        return out_;
    }

private:
    // The next token that is neither space nor comment, from the index `i` on.
    [[nodiscard]] const std::string& after(std::size_t i) const {
        static const std::string kEnd;
        for (; i < tokens_.size(); ++i)
            if (std::isspace(static_cast<unsigned char>(tokens_[i][0])) == 0 && !tokens_[i].starts_with("(*"))
                return tokens_[i];
        return kEnd;
    }
    std::string take() {
        do ++at_;
        while (std::isspace(static_cast<unsigned char>(tokens_[at_][0])) != 0);
        return tokens_[at_];
    }

    void type() {
        const std::string name = take();
        take();  // the colon
        std::size_t i = at_ + 1;
        if (after(i) != "ARRAY") {
            out_ += fmt::format("TYPE \"{}\"\nVERSION : 0.1", name);
            types_.insert(name);
            return;
        }
        std::string definition;
        for (std::string token = take(); token != ";"; ++at_, token = tokens_[at_]) definition += word(token);
        arrays_[name] = definition;
        while (tokens_[at_] != "END_TYPE") ++at_;
        if (at_ + 1 < tokens_.size()) ++at_;  // with the spaces that follow
    }

    void block() {
        const std::string name = take();
        out_ += fmt::format("FUNCTION_BLOCK \"{}\"\n{{ S7_Optimized_Access := 'TRUE' }}\nVERSION : 0.1", name);
        types_.insert(name);
        locals_.clear();
    }

    void end_variables() {
        in_variables_ = false;
        out_ += "END_VAR";
        if (after(at_ + 1).starts_with("VAR")) return;
        out_ += "\n\nBEGIN";
        in_body_ = true;
    }

    std::string word(const std::string& token) {
        if (!is_word(token[0])) {
            if (token == "(") ++depth_;
            if (token == ")") --depth_;
            return token;
        }
        if (in_variables_ && after(at_ + 1) == ":") {
            locals_.insert(token);
            return token;
        }
        if (const auto array = arrays_.find(token); array != arrays_.end()) return array->second;
        if (types_.contains(token)) return fmt::format("\"{}\"", token);
        if (token == "TON") return "TON_TIME";
        const bool is_field = at_ > 0 && tokens_[at_ - 1] == ".";
        const bool is_parameter = depth_ > 0 && after(at_ + 1) == ":" && is_assigned();
        return in_body_ && !is_field && !is_parameter && locals_.contains(token) ? "#" + token : token;
    }
    // True if := follows the token, as after the name of a parameter.
    [[nodiscard]] bool is_assigned() const {
        for (std::size_t i = at_ + 1; i + 1 < tokens_.size(); ++i)
            if (tokens_[i] == ":") return tokens_[i + 1] == "=";
        return false;
    }

    std::vector<std::string> tokens_;
    std::size_t at_ = 0;
    int depth_ = 0;
    bool in_variables_ = false, in_body_ = false;
    std::string out_;
    std::set<std::string> types_, locals_;
    std::map<std::string, std::string> arrays_;
};

}  // namespace

std::string scl_of(std::string_view structured_text) { return Rewriter(structured_text).run(); }

}  // namespace tactiled::ctl
