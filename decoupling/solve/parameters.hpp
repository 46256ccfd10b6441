// The parameters and tables of a calibration that a method reads, checked against the list that the method states. A
// fit checks its given parameters in the same way.
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

// Ends of a range that a message replaces by "above 0" or omits.
inline constexpr double kAboveZero = std::numeric_limits<double>::denorm_min();
inline constexpr double kLargest = std::numeric_limits<double>::max();

struct Parameter {
    const char* name;
    const char* what;  // with the unit, for the error
    double min, max;   // both allowed
    // value if the calibration does not state it, not checked against the range; NaN: it is required
    double fallback = kNaN;
};

// A number of rows or columns that follows from the calibration.
inline constexpr std::size_t kAnyNumber = 0, kPerChannel = std::numeric_limits<std::size_t>::max(),
                             kPerComponent = kPerChannel - 1;

struct KnownTable {
    const char* name;
    std::size_t rows, columns;  // kAnyNumber if the method checks it
    bool needed = true;
};

using NumberRows = std::vector<std::vector<double>>;

// Names that are not an error although a method does not read them.
struct OtherNames {
    std::vector<std::string> parameters, tables;
};

// A calibration as one method reads it. It refers to its constructor's arguments.
class CalibrationData {
public:
    CalibrationData(const Calibration& calibration, std::span<const Parameter> parameters,
                    std::span<const KnownTable> tables = {}) noexcept
        : calibration_(calibration), parameters_(parameters), tables_(tables) {}

    // Returns the first fault of the calibration's parameters and tables: an unknown name, a missing required one, a
    // number outside its range, a table of another size; "" if there is none. setup
    [[nodiscard]] std::string fault(const OtherNames& others = {}) const;
    // Checks only the ranges of the stated parameters: for a fit, where a parameter may be missing or belong to
    // another method. setup
    [[nodiscard]] std::string fault_of_ranges() const;

    [[nodiscard]] const Calibration& calibration() const noexcept { return calibration_; }
    // Returns the parameter, else its fallback. `name` is in the method's list. setup
    [[nodiscard]] double operator[](std::string_view name) const;
    [[nodiscard]] bool has(std::string_view name) const;
    // Returns nullptr if the calibration has no such table. setup
    [[nodiscard]] const NumberRows* table(std::string_view name) const;
    // Returns a table of a size that kAnyNumber left open; nullptr with `fault` set if it has another size. setup
    [[nodiscard]] const NumberRows* table(std::string_view name, std::size_t rows, std::size_t columns,
                                          std::string& fault) const;

private:
    [[nodiscard]] std::size_t size_of(std::size_t stated) const noexcept;

    const Calibration& calibration_;
    std::span<const Parameter> parameters_;
    std::span<const KnownTable> tables_;
};

template <typename T, std::size_t N, std::size_t M>
constexpr std::array<T, N + M> joined(const std::array<T, N>& first, const std::array<T, M>& second) {
    std::array<T, N + M> all{};
    for (std::size_t i = 0; i < N; ++i) all[i] = first[i];
    for (std::size_t i = 0; i < M; ++i) all[N + i] = second[i];
    return all;
}

}  // namespace tactiled
