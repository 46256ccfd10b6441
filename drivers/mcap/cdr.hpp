// Common Data Representation, little-endian, as ROS 2 encodes messages. Each number is aligned to its own size,
// counted from the end of the four bytes that name the encoding.
#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace tactiled {

static_assert(std::endian::native == std::endian::little, "written as the machine has it");
inline constexpr std::size_t kCdrHead = 4;

class CdrWriter {
public:
    // Begins a message in `out`, which reuses its memory from one message to the next.
    explicit CdrWriter(std::string& out) : out_(out) { out_.assign("\0\1\0\0", kCdrHead); }

    template <class T>
    requires std::is_arithmetic_v<T>
    void put(T value) {
        out_.append((sizeof value - (out_.size() - kCdrHead) % sizeof value) % sizeof value, '\0');
        out_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    void put(std::string_view text) {
        put(std::uint32_t(text.size() + 1));
        out_.append(text);
        out_ += '\0';
    }
    // A sequence of numbers: how many they are, then the numbers.
    template <class T>
    requires std::is_arithmetic_v<T>
    void put(std::span<const T> numbers) {
        put(std::uint32_t(numbers.size()));
        if (numbers.empty()) return;
        out_.append((sizeof(T) - (out_.size() - kCdrHead) % sizeof(T)) % sizeof(T), '\0');
        out_.append(reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes());
    }

private:
    std::string& out_;
};

class CdrReader {
public:
    explicit CdrReader(std::span<const char> bytes) : bytes_(bytes) {
        failed_ = bytes.size() < kCdrHead || std::memcmp(bytes.data(), "\0\1\0\0", kCdrHead) != 0;
    }

    // Returns the next number; 0 if the message ends before it, and failed() is then true.
    template <class T>
    requires std::is_arithmetic_v<T> T get() {
        const std::size_t at = at_ + (sizeof(T) - (at_ - kCdrHead) % sizeof(T)) % sizeof(T);
        T value{};
        if (failed_ || bytes_.size() < at + sizeof(T)) {
            failed_ = true;
            return value;
        }
        std::memcpy(&value, bytes_.data() + at, sizeof value);
        at_ = at + sizeof value;
        return value;
    }
    // Reads numbers that follow each other.
    template <class T>
    requires std::is_arithmetic_v<T>
    void get(std::span<T> numbers) {
        if (numbers.empty()) return;
        const std::size_t at = at_ + (sizeof(T) - (at_ - kCdrHead) % sizeof(T)) % sizeof(T);
        if (failed_ || bytes_.size() < at + numbers.size_bytes()) {
            failed_ = true;
            return;
        }
        std::memcpy(numbers.data(), bytes_.data() + at, numbers.size_bytes());
        at_ = at + numbers.size_bytes();
    }
    [[nodiscard]] bool failed() const { return failed_; }

private:
    std::span<const char> bytes_;
    std::size_t at_ = kCdrHead;
    bool failed_ = false;
};

}  // namespace tactiled
