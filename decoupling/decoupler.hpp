// A model turns the channels of a sensor into the force and torque that the world exerts on it. It never fails: it
// returns an estimate with its standard deviation and quality, and the reader decides.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.hpp"
#include "config/options.hpp"
#include "tactiled/layout.h"

namespace tactiled {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The channels of one sensor at one instant, in the order of Calibration::channels and in its unit.
struct Reading {
    std::span<const double> channel;  // NaN where missing
    std::uint32_t missing = 0;        // bit n: channel n
    std::uint32_t saturated = 0;      // bit n: channel n
    std::uint64_t t_ns = 0;           // CLOCK_MONOTONIC, of the frame; for models that remember (piezo, hysteresis)
};

// Six components: fx fy fz (N), mx my mz (Nm), frame S. NaN = this sensor cannot see it, or BAD.
using Wrench = std::array<double, 6>;
inline constexpr Wrench kUnseen{kNaN, kNaN, kNaN, kNaN, kNaN, kNaN};

struct Estimate {
    Wrench wrench_S = kUnseen;
    Wrench sd = kUnseen;  // one standard deviation
    tactiled_quality quality = TACTILED_BAD;
    std::uint32_t reasons = 0;                  // enum tactiled_reason
    double residual = kNaN;                     // of the model, in standard deviations of the channels
    std::array<double, 2> cop_S_m{kNaN, kNaN};  // where on the surface the force acts, for methods that find it
    std::uint32_t direction = 0;                // method "signs": row of the decision table, 0 = none or not this method
};

class Decoupler {
public:
    virtual ~Decoupler() = default;

    // For any bits in `reading`, a finite wrench with a true quality, or BAD with NaN.
    // rt: wait-free
    [[nodiscard]] virtual Estimate decouple(const Reading& reading) noexcept = 0;

    // Readings were missed, or one came of which nothing can be said: what was remembered no longer holds. rt: wait-free
    virtual void forget() noexcept {}

    [[nodiscard]] virtual std::string_view method() const noexcept = 0;
};

// One model; an entry object at the foot of its own file links itself into the list (as DriverEntry).
struct DecouplerEntry {
    std::string_view name;             // as in `model = "table"`
    std::vector<std::string> methods;  // the first is the default
    // Reads the model's own keys of a [[sensor]] table and prepares everything that decouple() needs; errors go to the
    // options' Problems. setup
    std::unique_ptr<Decoupler> (*make)(const Calibration& calibration, const std::string& method, Options& options);
    const DecouplerEntry* next;

    DecouplerEntry(std::string_view name_, std::vector<std::string> methods_,
                   std::unique_ptr<Decoupler> (*make_)(const Calibration&, const std::string&, Options&));
};

const DecouplerEntry* find_decoupler(std::string_view name) noexcept;
std::vector<std::string> decoupler_names();

// The decoupler of a calibration. `method`: "" = the one that it was fitted for; "auto" = auto_method.hpp, within
// `budget_us` a sample. Another method than those that were fitted has no standard deviation. nullptr where that cannot be;
// errors go to the options' Problems. setup
std::unique_ptr<Decoupler> make_decoupler(const Calibration& calibration, const std::string& method, double budget_us,
                                          Options& options);

}  // namespace tactiled
