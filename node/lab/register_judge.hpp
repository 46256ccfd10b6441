// Finds how the registers of a Modbus device are to be read as numbers: type, order of words and bytes, first register.
// Pure, no I/O.
//
// Each interpretation predicts the recorded words, and the one that needs the fewest bits to code them explains them best
// (minimum description length: Rissanen, Automatica 14, 1978). All interpretations code the same words, so the difference of
// two sums is the logarithm of the ratio of their likelihoods.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace tactiled::ctl {

// Answers of one device. A row is one answer.
struct RegisterRows {
    std::uint16_t first = 0;  // register of the first word of each row
    std::vector<std::vector<std::uint16_t>> rows;
};

enum class NumberType { int16, uint16, int32, uint32, float32, float64 };
const char* name_of(NumberType type);  // the name in the configuration
std::size_t words_of(NumberType type);

struct Interpretation {
    NumberType type = NumberType::int16;
    bool low_word_first = false, low_byte_first = false;
    std::uint16_t at = 0;  // first register of the first number
    double bits = 0;       // length of the code of all words, including those that belong to no number
    // Every number has a usual magnitude, 1e-4 .. 1e6 or 0, and moves less than its type can.
    bool plausible = true;
    std::vector<std::vector<double>> numbers;  // each channel has one per row

    // Returns the type and its order as text, such as "float32, low_first, at 100".
    [[nodiscard]] std::string text() const;
    // True if driver "modbus" has keys for this interpretation.
    [[nodiscard]] bool is_readable() const { return type != NumberType::float64 && !low_byte_first; }
};

// Returns the interpretations of the `count` registers from `at` on and of the same number of registers one before and one
// after, as far as the rows hold them, the best one first. All numbers of an interpretation have one type. Rows that equal
// the previous one are ignored, because a device that is read faster than it measures repeats all its registers.
// `answers` must have rows of one length that hold the registers.
std::vector<Interpretation> judge_registers(const RegisterRows& answers, std::uint16_t at, std::size_t count);

// True if the first of the ranked interpretations is the only one that explains the words.
bool is_clear(const std::vector<Interpretation>& ranked);

// Returns the indices of the ranked interpretations that explain the words about as well as the first one, and its own.
std::vector<std::size_t> equals(const std::vector<Interpretation>& ranked);

}  // namespace tactiled::ctl
