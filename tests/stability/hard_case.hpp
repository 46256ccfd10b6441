// A numerically hard case: the result of the textbook's code, the result of this product's code, the true value, and
// the allowed error. The families of cases are in the *_cases.cpp beside this file.
#pragma once
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled::stability {

// 100 decimal digits: what a reference is computed in, from the very doubles that the code under test gets.
using Real = boost::multiprecision::cpp_bin_float_100;

// Relation of the textbook's code to the product's: the same formula or its usual form in the same precision, or in
// single precision only; or there is no equivalent.
enum class Textbook { same_precision, single, none };

// A number that has to be right. The error is relative to the reference, absolute where that is 0.
struct Value {
    double naive, ours;
    Real reference;
    // Condition number of the problem: relative change of the result a relative change of its input. It is 1 if the
    // inputs are exact and no step of a stable algorithm cancels.
    double kappa = 1;
    // The bound is times * kappa * 2^-52 (+ slack): times counts the roundings on the stable way, each 2^-53 at most.
    double times = 8;
    // Errors that no arithmetic can avoid: the stopping limit of an iteration, the grid of denormal numbers, or of a
    // register.
    double slack = 0;
    Textbook textbook = Textbook::same_precision;
};

// The published values of one component.
struct Published {
    double value;
    tactiled_quality quality;
    std::uint32_t reasons;
};
Published published(const Estimate& estimate, std::size_t component);
Published as_good(double value);  // result of code without a quality

// A result that cannot be computed, or only in part: the program must report that. A finite number that is UNCERTAIN
// with all of `reasons`; where there are none, BAD with NaN.
struct Marked {
    Published naive, ours;
    std::uint32_t reasons = 0;
    // Set if the number must be right anyway: relative error.
    double truth = kNaN, within = 0;
};

struct Result {
    std::string id, what;
    std::string kappa, naive, ours, bound;  // for the table
    // The textbook's code counts as red where its number is outside of the bound; a case that has to be marked or refused is
    // not its fault: it states no quality.
    enum class Naive { none, holds, red_same_precision, red_single, states_no_quality } naive_is;
    bool ours_holds;
};

class Cases {
public:
    // `max_updates`: how far the case of a recursion goes.
    explicit Cases(long max_updates) : updates(max_updates) {}
    void value(const std::string& id, const std::string& what, const Value& value);
    void marked(const std::string& id, const std::string& what, const Marked& marked);
    // A set-up that must be refused, with `because` in what is said; `said` = "" where it was not. `naive`: what the
    // textbook would have computed with it.
    void refused(const std::string& id, const std::string& what, double naive, const std::string& said,
                 const std::string& because);
    [[nodiscard]] const std::vector<Result>& results() const { return results_; }
    const long updates;

private:
    std::vector<Result> results_;
};

void add_table_cases(Cases& cases);
void add_hair_cases(Cases& cases);
void add_capacitive_cases(Cases& cases);
void add_piezo_cases(Cases& cases);
void add_generic_cases(Cases& cases);
void add_fit_cases(Cases& cases);
void add_number_cases(Cases& cases);
void add_simulator_cases(Cases& cases);

// Returns the estimate that the loop would publish for a reading; t_ns does not matter for methods without a memory.
Estimate estimate_of(const Calibration& calibration, const std::vector<double>& channel, std::uint32_t missing = 0,
                     std::uint32_t saturated = 0);
// Returns the message that refuses a calibration, "" if it is accepted.
std::string refusal_of(const Calibration& calibration);

}  // namespace tactiled::stability
