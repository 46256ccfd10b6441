// Prandtl-Ishlinskii hysteresis: a sum of play operators (Krejci; inverse by Kuhnen 2003, eq. 12 to 15). It is
// rate-independent and stores as many turning points as it has play operators.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>

namespace tactiled {

// y = sum over i of weight[i] * play operator of width threshold[i]; threshold[0] = 0 is the linear part.
struct PlayOperators {
    static constexpr std::size_t kMax = 32;
    std::size_t n = 0;
    std::array<double, kMax> threshold{}, weight{};

    // Returns the fault, "" if there is none: thresholds rise from 0, and the loading curve rises everywhere, that
    // is, the partial sums of the weights are above 0. setup
    static std::string fault_of(std::span<const double> thresholds, std::span<const double> weights) {
        if (thresholds.empty() || thresholds.size() != weights.size() || thresholds.size() > kMax)
            return "hysteresis has 1 .. 32 rows";
        double sum = 0;
        for (std::size_t i = 0; i < thresholds.size(); ++i) {
            if (i == 0 ? thresholds[0] != 0 : !(thresholds[i] > thresholds[i - 1]))
                return "its thresholds do not rise from 0";
            sum += weights[i];
            if (!(sum > 0)) return "the loading curve does not rise everywhere: no inverse";
        }
        return "";
    }

    // Returns the play operators that invert these exactly. setup
    [[nodiscard]] PlayOperators inverse() const {
        PlayOperators other;
        other.n = n;
        double slope = 0;  // slope of the loading curve beyond threshold i
        for (std::size_t i = 0; i < n; ++i) {
            const double before = slope;
            slope += weight[i];
            // Loading curve at threshold i, and the change of the inverse slope there.
            other.threshold[i] = i == 0 ? 0 : other.threshold[i - 1] + before * (threshold[i] - threshold[i - 1]);
            other.weight[i] = i == 0 ? 1 / slope : -weight[i] / (before * slope);
        }
        return other;
    }
};

// State of the play operators of one quantity.
class PlayState {
public:
    // Passes the next value through the play operators; a value that is not finite is not stored. rt: wait-free
    double next(const PlayOperators& operators, double value) noexcept {
        if (!std::isfinite(value)) return value;
        double sum = 0;
        for (std::size_t i = 0; i < operators.n; ++i) {
            state_[i] = std::max(value - operators.threshold[i], std::min(value + operators.threshold[i], state_[i]));
            sum += operators.weight[i] * state_[i];
        }
        if (!settled_ && operators.n > 0) {
            min_ = std::min(min_, value);
            max_ = std::max(max_, value);
            settled_ = max_ - min_ >= 2 * operators.threshold[operators.n - 1];
        }
        return sum;
    }
    // Resets the state to that of a sensor that was never loaded. The state is not settled, because the load in the meantime
    // is unknown. rt: wait-free
    void forget() noexcept {
        *this = {};
        settled_ = false;
    }
    // True if the state is known: always for a sensor that was never loaded; after a forget(), as soon as the input has
    // swung by twice the widest play operator, because the state then no longer depends on the past.
    [[nodiscard]] bool is_settled() const noexcept { return settled_; }

private:
    std::array<double, PlayOperators::kMax> state_{};
    bool settled_ = true;
    double min_ = std::numeric_limits<double>::infinity(), max_ = -min_;
};

}  // namespace tactiled
