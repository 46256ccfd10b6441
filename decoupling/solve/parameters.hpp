// The parameters and tables of a calibration that a method reads, checked against the list that the method states. Every
// method reads them in this way, and so does a fit that is told a parameter beforehand.
#pragma once
#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// Ends of a range that are no numbers to the reader: a message says "above 0" instead, or nothing.
inline constexpr double kAboveZero = std::numeric_limits<double>::denorm_min();
inline constexpr double kLargest = std::numeric_limits<double>::max();

struct Parameter {
    const char* name;
    const char* what;        // with the unit, for the error
    double min, max;         // both allowed
    double fallback = kNaN;  // where the calibration does not state it, not checked against the range; NaN: it is needed
};

// A number of rows or columns that follows from the calibration.
inline constexpr std::size_t kAnyNumber = 0, kPerChannel = std::numeric_limits<std::size_t>::max(),
                             kPerComponent = kPerChannel - 1;

struct KnownTable {
    const char* name;
    std::size_t rows, columns;  // kAnyNumber where the method compares by itself
    bool needed = true;
};

using NumberRows = std::vector<std::vector<double>>;

// Names that are no error though a method does not read them.
struct OtherNames {
    std::vector<std::string> parameters, tables;
};

// A calibration as one method reads it. Refers to what it was made of.
class CalibrationData {
public:
    CalibrationData(const Calibration& calibration, std::span<const Parameter> parameters,
                    std::span<const KnownTable> tables = {}) noexcept
        : calibration_(calibration), parameters_(parameters), tables_(tables) {}

    // The first fault of the calibration's parameters and tables: a name that is unknown, a needed one that is missing, a
    // number outside its range, a table of another size; "" where there is none. setup
    [[nodiscard]] std::string fault(const OtherNames& others = {}) const;
    // The ranges of the stated parameters alone: for a fit, to which a parameter may be missing or another method's. setup
    [[nodiscard]] std::string fault_of_ranges() const;

    [[nodiscard]] const Calibration& calibration() const noexcept { return calibration_; }
    // The parameter, else its fallback. `name` is one of the method's list. setup
    [[nodiscard]] double operator[](std::string_view name) const;
    [[nodiscard]] bool has(std::string_view name) const;
    // nullptr where the calibration has none. setup
    [[nodiscard]] const NumberRows* table(std::string_view name) const;
    // Likewise of a size that kAnyNumber left open; where it has another, nullptr, and `fault` says so. setup
    [[nodiscard]] const NumberRows* table(std::string_view name, std::size_t rows, std::size_t columns,
                                          std::string& fault) const;

private:
    [[nodiscard]] std::size_t size_of(std::size_t stated) const noexcept;

    const Calibration& calibration_;
    std::span<const Parameter> parameters_;
    std::span<const KnownTable> tables_;
};

// Two lists, one after the other.
template <typename T, std::size_t N, std::size_t M>
constexpr std::array<T, N + M> joined(const std::array<T, N>& first, const std::array<T, M>& second) {
    std::array<T, N + M> all{};
    for (std::size_t i = 0; i < N; ++i) all[i] = first[i];
    for (std::size_t i = 0; i < M; ++i) all[N + i] = second[i];
    return all;
}

}  // namespace tactiled
