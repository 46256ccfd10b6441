#include "decoupling/npy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "config/options.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxItems = 1u << 16;               // columns: an array of 4,096 taxels with labels has fewer
constexpr std::size_t kMaxHeader_bytes = 64 * kMaxItems;  // the name and type of a column have fewer than 64 bytes

// One column: where its value lies in a row, and its type.
struct Field {
    std::string name;  // "" = the array has no names
    char kind;         // f i u b S U M
    bool is_swapped;   // big-endian
    std::size_t size, at;
};

struct Array {
    std::vector<Field> fields;
    std::size_t rows = 0, row_bytes = 0;
    bool is_fortran = false, has_names = false;
};

// Reads the literals of the header, a dictionary in the syntax of Python.
class Header {
public:
    Header(std::string_view text, const std::string& name) : text_(text), name_(name) {}

    Array read() {
        Array array;
        std::vector<std::size_t> shape;
        expect('{');
        while (!accept('}')) {
            const std::string key = word();
            expect(':');
            if (key == "descr")
                descr(array);
            else if (key == "fortran_order")
                array.is_fortran = bare() == "True";
            else if (key == "shape")
                shape = tuple();
            else
                refuse("has an unknown key in its header");
            accept(',');
        }
        if (array.fields.empty()) refuse("has no type");
        if (array.has_names ? shape.size() != 1 : shape.size() != 2)
            refuse(
                fmt::format("has {} dimensions; an array of numbers needs 2 (rows, columns), one with names 1: "
                            "numpy.save('labelled.npy', a.reshape(len(a), -1))",
                            shape.size()));
        array.rows = shape[0];
        if (!array.has_names) spread(array, shape[1]);
        return array;
    }

private:
    [[noreturn]] void refuse(const std::string& text) const {
        throw SetupError(fmt::format("{}: the npy file {}", name_, text));
    }
    void skip() {
        while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
    }
    bool accept(char c) {
        skip();
        if (at_ >= text_.size() || text_[at_] != c) return false;
        ++at_;
        return true;
    }
    void expect(char c) {
        if (!accept(c)) refuse("has a damaged header");
    }
    std::string word() {
        skip();
        const char quote = at_ < text_.size() ? text_[at_] : 0;
        const std::size_t end = quote == '\'' || quote == '"' ? text_.find(quote, at_ + 1) : text_.npos;
        if (end == text_.npos) refuse("has a damaged header");
        const std::string result(text_.substr(at_ + 1, end - at_ - 1));
        at_ = end + 1;
        return result;
    }
    std::string bare() {
        skip();
        const std::size_t begin = at_;
        while (at_ < text_.size() && std::isalnum(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
        return std::string(text_.substr(begin, at_ - begin));
    }
    std::vector<std::size_t> tuple() {
        std::vector<std::size_t> result;
        expect('(');
        while (!accept(')')) {
            const std::string digits = bare();
            std::size_t value = 0;
            const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
            if (error != std::errc() || end != digits.data() + digits.size() || result.size() > 8)
                refuse("has a damaged header");
            result.push_back(value);
            accept(',');
        }
        return result;
    }
    void descr(Array& array) {
        if (!accept('[')) {
            add(array, "", word(), 1);
            return;
        }
        array.has_names = true;
        while (!accept(']')) {
            expect('(');
            const std::string name = word();
            expect(',');
            const std::string type = word();
            std::size_t items = 1;
            if (accept(',') && !accept(')')) {
                for (const std::size_t n : tuple()) items = std::min(items * n, kMaxItems + 1);
                expect(')');
                if (items > kMaxItems) refuse("has too many columns");
                add(array, name, type, items, true);
            } else {
                if (text_[at_ - 1] != ')') expect(')');
                add(array, name, type, 1);
            }
            accept(',');
        }
    }
    void add(Array& array, const std::string& name, const std::string& type, std::size_t items, bool is_numbered = false) {
        Field field{.name = name, .kind = 0, .is_swapped = false, .size = 0, .at = 0};
        if (type.size() < 3 || std::string_view("<>|=").find(type[0]) == std::string_view::npos)
            refuse(fmt::format("has the type {}, which is no number", in_quotes(type)));
        field.kind = type[1];
        field.is_swapped = type[0] == '>';
        const auto result = std::from_chars(type.data() + 2, type.data() + type.size(), field.size);
        const bool known = result.ec == std::errc() && field.size > 0 && field.size < 4096 &&
                           (field.kind == 'f'   ? field.size == 4 || field.size == 8
                            : field.kind == 'S' ? true
                            : field.kind == 'U' ? true
                            : field.kind == 'b' ? field.size == 1
                            : field.kind == 'M' ? field.size == 8
                                                : (field.kind == 'i' || field.kind == 'u') && field.size <= 8 &&
                                                      std::has_single_bit(field.size));
        if (!known)
            refuse(
                fmt::format("has the type {}; store float64: numpy.save('labelled.npy', a.astype('f8'))", in_quotes(type)));
        if (field.kind == 'U') field.size *= 4;
        for (std::size_t i = 0; i < items; ++i) {
            field.name = is_numbered ? fmt::format("{}_{}", name, i) : name;
            field.at = array.row_bytes;
            array.row_bytes += field.size;
            array.fields.push_back(field);
        }
        if (array.fields.size() > kMaxItems) refuse("has too many columns");
    }
    // The columns of a 2-D array.
    void spread(Array& array, std::size_t columns) {
        if (columns == 0 || columns > kMaxItems) refuse(fmt::format("has {} columns", columns));
        Field field = array.fields[0];
        array.fields.clear();
        for (std::size_t k = 0; k < columns; ++k) {
            field.at = array.is_fortran ? k * array.rows * field.size : k * field.size;
            array.fields.push_back(field);
        }
        array.row_bytes = columns * field.size;
    }

    std::string_view text_;
    const std::string& name_;
    std::size_t at_ = 0;
};

std::string quoted(std::string_view text) {
    std::string result = "\"";
    for (const char c : text) result += c == '"' ? "\"\"" : std::string(1, c == '\n' || c == '\r' || c == 0 ? ' ' : c);
    return result + '"';
}

class NpyText : public Bytes {
public:
    NpyText(std::unique_ptr<Bytes> packed, std::string first, const std::string& name) : data_(std::move(first)) {
        // An array of a few rows may be followed by any number of bytes, which are not read.
        const auto cut = [&] { throw SetupError(name + ": the npy file is cut off; copy it again"); };
        const auto need = [&](std::size_t bytes) {
            while (data_.size() < bytes)
                if (!packed->read(data_)) cut();
        };
        const auto byte = [&](std::size_t i) { return std::size_t(static_cast<unsigned char>(data_[i])); };
        need(12);
        const bool is_long = data_[6] >= 2;
        const std::size_t begin = is_long ? 12 : 10;
        const std::size_t length = byte(8) | byte(9) << 8 | (is_long ? byte(10) << 16 | byte(11) << 24 : 0);
        if (length > kMaxHeader_bytes) throw SetupError(name + ": the npy file has a damaged header");
        at_ = begin + length;
        need(at_);
        array_ = Header(std::string_view(data_).substr(begin, length), name).read();
        if (array_.rows > (std::numeric_limits<std::size_t>::max() - at_) / array_.row_bytes) cut();
        need(at_ + array_.rows * array_.row_bytes);
    }
    bool read(std::string& buffer) override {
        std::string line;
        if (array_.has_names && !std::exchange(names_written_, true)) {
            for (const Field& field : array_.fields) line += (line.empty() ? "" : ",") + quoted(field.name);
            buffer += line + '\n';
            return true;
        }
        if (row_ == array_.rows) return false;
        bool is_first = true;
        for (const Field& field : array_.fields) {
            if (!std::exchange(is_first, false)) line += ',';
            line += cell(field);
        }
        buffer += line + '\n';
        ++row_;
        return true;
    }

private:
    template <class T>
    [[nodiscard]] T value(const char* at, bool is_swapped) const {
        char bytes[sizeof(T)];
        std::memcpy(bytes, at, sizeof(T));
        if (is_swapped) std::reverse(bytes, bytes + sizeof(T));
        T result;
        std::memcpy(&result, bytes, sizeof(T));
        return result;
    }
    [[nodiscard]] std::string number(const char* at, const Field& field) const {
        const auto as = [&]<class T>(T) { return fmt::format("{}", value<T>(at, field.is_swapped)); };
        if (field.kind == 'f') {
            const double x =
                field.size == 4 ? double(value<float>(at, field.is_swapped)) : value<double>(at, field.is_swapped);
            return std::isnan(x) ? "" : fmt::format("{}", x);
        }
        const bool is_signed = field.kind == 'i' || field.kind == 'M';
        if (field.kind == 'M' && value<std::int64_t>(at, field.is_swapped) == std::numeric_limits<std::int64_t>::min())
            return "";  // NaT
        switch (field.size) {
            case 1: return is_signed ? fmt::format("{}", int(*at)) : fmt::format("{}", int(static_cast<unsigned char>(*at)));
            case 2: return is_signed ? as(std::int16_t{}) : as(std::uint16_t{});
            case 4: return is_signed ? as(std::int32_t{}) : as(std::uint32_t{});
            default: return is_signed ? as(std::int64_t{}) : as(std::uint64_t{});
        }
    }
    [[nodiscard]] std::string cell(const Field& field) const {
        const char* const at = data_.data() + at_ + field.at + row_ * (array_.is_fortran ? field.size : array_.row_bytes);
        if (field.kind != 'S' && field.kind != 'U') return number(at, field);
        std::string text;
        for (std::size_t i = 0; i < field.size; i += field.kind == 'U' ? 4 : 1) {
            const std::uint32_t c = field.kind == 'U' ? value<std::uint32_t>(at + i, field.is_swapped)
                                                      : std::uint32_t(static_cast<unsigned char>(at[i]));
            if (c == 0) break;
            text += c < 0x80 || field.kind == 'S' ? char(c) : '?';
        }
        return quoted(text);
    }

    std::string data_;
    Array array_;
    std::size_t at_ = 0, row_ = 0;
    bool names_written_ = false;
};

}  // namespace

std::unique_ptr<Bytes> npy_as_text(std::unique_ptr<Bytes> packed, std::string first, const std::string& name) {
    return std::make_unique<NpyText>(std::move(packed), std::move(first), name);
}

}  // namespace tactiled
