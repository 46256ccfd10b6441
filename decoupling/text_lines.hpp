// The lines of a text file in UTF-8, whatever its encoding: plain or gzip; UTF-8, UTF-16 or Latin-1; or the rows of a npy
// file as lines. A line is delivered as soon as its end is there, so that the file may be an endless pipe.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

namespace tactiled {

// A source of bytes. setup
class Bytes {
public:
    virtual ~Bytes() = default;
    // Appends bytes to `buffer`; returns false at the end. setup: throws SetupError where reading fails
    virtual bool read(std::string& buffer) = 0;
};

class TextLines {
public:
    // "-" is standard input. setup: throws SetupError where the file cannot be opened or has another format
    explicit TextLines(const std::string& path);
    TextLines(TextLines&&) noexcept = default;
    TextLines& operator=(TextLines&&) noexcept = default;

    // Reads the next line, without its end. Returns false at the end. setup: throws SetupError where reading fails, the line
    // is longer than 1 MiB, or it has a byte 0
    bool next(std::string& line);

    [[nodiscard]] std::int64_t line() const { return line_; }
    [[nodiscard]] const std::string& name() const { return name_; }
    // Describes what is unusual: "gzip, UTF-16"; "" for plain text in UTF-8.
    [[nodiscard]] std::string about() const;

private:
    bool fill(std::size_t bytes);
    int get();
    void recognise(const std::string& path);

    std::string name_;
    std::unique_ptr<Bytes> bytes_;
    std::string buffer_;
    std::size_t at_ = 0;
    std::int64_t line_ = 0;  // a pipe at 1 kHz passes 2^31 in 25 days
    bool after_return_ = false;
    bool is_gzip_ = false, is_latin_ = false, is_npy_ = false;
    enum class Encoding { utf8, utf16_le, utf16_be } encoding_ = Encoding::utf8;
};

}  // namespace tactiled
