// Model "table", method "signs": the decision table of Lee et al. (their table 2), as a direction class 0 .. 17 and
// forces in steps. The row of the table below is Estimate::direction:
//
//      row  load    R1 R3 R5 R7       row  load      R1 R3 R5 R7        row    load        R1 R3 R5 R7
//       1   press    +  +  +  +        6   +x +y      -  -  +  +        10     press +x     -  +  +  +
//       2   +x       -  0  +  0        7   -x +y      +  -  -  +        11     press -x     +  +  -  +
//       3   -x       +  0  -  0        8   -x -y      +  +  -  -        12     press +y     +  -  +  +
//       4   +y       0  -  0  +        9   +x -y      -  +  +  -        13     press -y     +  +  +  -
//       5   -y       0  +  0  -                                         14..17 press and 6..9: the signs of 6..9
//
// The signs cannot distinguish 14..17 from 6..9, but the sum of the gauges can: it is 0 except under a press. Rows
// 10..17 show these signs only if the tangential force is at least 1.79 times the press (the ratio of the authors'
// sensitivities); a smaller one gives ++++. The class is therefore computed from the sums and differences, each
// against its dead band. If the signs contradict, or the sum is near its band, the sample is UNCERTAIN with
// disagreement.
#include <cmath>

#include "decoupling/solve/checked.hpp"
#include "decoupling/solve/consistency.hpp"
#include "decoupling/table/methods.hpp"
#include "decoupling/table/sign_table.hpp"

namespace tactiled {
namespace {

// R1 R3 R5 R7 by row; 14 .. 17 equal 6 .. 9.
constexpr std::array<std::array<int, 4>, 14> kPattern{{{0, 0, 0, 0},
                                                       {1, 1, 1, 1},
                                                       {-1, 0, 1, 0},
                                                       {1, 0, -1, 0},
                                                       {0, -1, 0, 1},
                                                       {0, 1, 0, -1},
                                                       {-1, -1, 1, 1},
                                                       {1, -1, -1, 1},
                                                       {1, 1, -1, -1},
                                                       {-1, 1, 1, -1},
                                                       {-1, 1, 1, 1},
                                                       {1, 1, -1, 1},
                                                       {1, -1, 1, 1},
                                                       {1, 1, 1, -1}}};
// Row for (sign of Fx, sign of Fy) without a press, index 3 (x + 1) + y + 1; and with one.
constexpr std::array<std::uint32_t, 9> kTangential{8, 3, 7, 5, 0, 4, 9, 2, 6};
constexpr std::array<std::uint32_t, 9> kPressed{16, 11, 15, 13, 1, 12, 17, 10, 14};

constexpr double kDefaultBand_per_noise = 5;  // 5 sigma: a false sign once in 30 minutes at 1 kHz
constexpr double kDefaultLevel_N = 0.1;

constexpr std::array<Parameter, 3> kStepParameters{
    {{"dead_band", "reading that counts as 0, channel_unit", kAboveZero, kLargest, 0},
     {"level_normal", "step of fz, N", kAboveZero, kLargest, kDefaultLevel_N},
     {"level_tangential", "step of fx and fy, N", kAboveZero, kLargest, kDefaultLevel_N}}};
constexpr auto kParameters = joined(kLinearParameters, kStepParameters);

int sign_of(double value, double band) { return int(value > band) - int(value < -band); }

class TableSigns final : public CheckedModel {
public:
    TableSigns(const CalibrationData& data, std::uint32_t inner)
        : CheckedModel(data.calibration(), inner, inner),
          normal_per_N_(data["normal_inner"]),
          tangential_per_N_(data["tangential_inner"]),
          noise_(data.has("noise") ? data["noise"] : kDefaultNoise_per_reading * normal_per_N_),
          band_(data.has("dead_band") ? data["dead_band"] : kDefaultBand_per_noise * noise_),
          level_N_{data["level_tangential"], data["level_tangential"], data["level_normal"]} {
        const Calibration& calibration = data.calibration();
        for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
            const int number = table_gauge(calibration.channels[k])->number;
            if (number % 2 == 1) channel_[std::size_t(number / 2)] = k;
        }
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "signs"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        std::array<double, 4> r;  // R1 R3 R5 R7
        for (std::size_t i = 0; i < 4; ++i) r[i] = input.r[channel_[i]];
        const double x = r[2] - r[0], y = r[3] - r[1], sum = (r[0] + r[2]) + (r[1] + r[3]);
        // The noise of a difference is sqrt 2 of a gauge's, that of the sum is twice.
        const double sum_band = 2 * band_;
        const int sx = sign_of(x, std::sqrt(2.0) * band_), sy = sign_of(y, std::sqrt(2.0) * band_),
                  sn = sign_of(sum, sum_band);
        const auto at = std::size_t(3 * (sx + 1) + sy + 1);
        estimate.direction = sn > 0 ? kPressed[at] : sn == 0 ? kTangential[at] : 0;
        if (sn < 0) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;  // a pull: no row of the table

        std::array<int, 4> pattern;
        for (std::size_t i = 0; i < 4; ++i) pattern[i] = sign_of(r[i], band_);
        const bool diagonal_press = estimate.direction >= 14;
        const bool diagonal = diagonal_press || (estimate.direction >= 6 && estimate.direction <= 9);
        if (sn >= 0 && pattern != kPattern[diagonal_press ? estimate.direction - 8 : estimate.direction])
            estimate.reasons |= TACTILED_DISAGREEMENT;
        if (diagonal && std::abs(sum) > sum_band / 2 && std::abs(sum) < 2 * sum_band)
            estimate.reasons |= TACTILED_DISAGREEMENT;

        // Parity: 0 for any force.
        const double reading = std::hypot(std::hypot(r[0], r[1]), std::hypot(r[2], r[3])) / 2;
        estimate.residual = std::abs((r[0] + r[2]) - (r[1] + r[3])) / 2 / std::hypot(noise_, kGainError * reading);
        if (!(estimate.residual <= kDoubtful)) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;

        const std::array<double, 3> force{sx == 0 ? 0 : x / (2 * tangential_per_N_),
                                          sy == 0 ? 0 : y / (2 * tangential_per_N_),
                                          sn == 0 ? 0 : -sum / (4 * normal_per_N_)};
        for (std::size_t c = 0; c < 3; ++c) estimate.wrench_S[c] = level_N_[c] * std::round(force[c] / level_N_[c]) + 0.0;
        for (std::size_t c = 0; c < 3; ++c) {
            // Rounding to a level is an error uniform over one level; a dead band hides as much again.
            const double hidden_N = std::max(level_N_[c], 2 * band_N(c)) / std::sqrt(12.0);
            const double sd = stated_sd(c, estimate.wrench_S);
            if (sd > 0) {
                input.sd_factor[c] = std::hypot(1.0, hidden_N / sd);
            } else if (sd == 0 && seen()[c]) {
                estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
            }
        }
    }

    // Returns the largest force that the dead band hides.
    [[nodiscard]] double band_N(std::size_t c) const noexcept {
        return c < 2 ? std::sqrt(2.0) * band_ / (2 * tangential_per_N_) : 2 * band_ / (4 * normal_per_N_);
    }

    double normal_per_N_, tangential_per_N_, noise_, band_;
    std::array<double, 3> level_N_;
    std::array<std::size_t, 4> channel_{};
};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    fault = fault_of_linear(data);
    return fault.empty() ? std::make_unique<TableSigns>(data, inner_gauges(data.calibration())) : nullptr;
}

// The forces are those of "linear" in steps, and the step width is added to its standard deviation.
const MethodEntry entry{
    .model = "table", .method = "signs", .place = 20, .parameters = kParameters, .make = make, .sd_of = "linear"};

}  // namespace
}  // namespace tactiled
