// Raw values of the taxels -> the force of each in frame S. All loops run over the taxels, one component at a time.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "decoupling/patch/places.hpp"
#include "decoupling/patch/taxel_models.hpp"
#include "drivers/taxels.hpp"
#include "tactiled/layout.h"

namespace tactiled {

// True if a taxel in this state, enum tactiled_taxel_state, has a force of its own.
[[nodiscard]] constexpr bool has_force(std::uint8_t state) noexcept {
    return (state & ~(TACTILED_TAXEL_OUTSIDE | TACTILED_TAXEL_DOUBTED)) == 0;
}

// The forces of n taxels, N: component c is component[c], empty if it is not measured.
struct TaxelForces {
    std::array<std::vector<float>, 3> component;
    std::array<std::vector<float>, 3> sd;  // like component, where taxels have models; 0 without a force of their own
    std::vector<std::uint8_t> state;       // enum tactiled_taxel_state
};

// The force of taxel i in its own frame is gain_i matrix (values - zero_i), with one matrix for all taxels, or gain_i times
// that of its model.
class TaxelLaw {
public:
    // A row of the table `taxel` is fz, or fx, fy, fz: N per channel_unit for each value. setup
    TaxelLaw(const CalibrationData& data, const TaxelPlaces& places, std::string& fault);

    [[nodiscard]] TaxelShape shape() const noexcept { return shape_; }
    // Bits 0..2: the components of a force in frame S that are measured. setup
    [[nodiscard]] std::uint32_t components() const noexcept { return components_; }
    // The raw numbers are this times the calibration's unit. setup
    void set_counts_per_unit(double counts) noexcept;
    [[nodiscard]] TaxelModels& models() noexcept { return models_; }
    [[nodiscard]] const TaxelModels& models() const noexcept { return models_; }
    // A taxel that repeats all its values for so many frames is frozen; 0 = never, -1 = by the calibration. rt: wait-free
    void set_frozen_after(int frames) noexcept {
        frozen_after_ = frames >= 0 ? std::min(unsigned(frames), kMostRepeats) : calibrated_frozen_after_;
    }

    // Raw numbers at or beyond these are saturated. rt: wait-free
    void set_saturates_at(const std::array<double, 2>& limits) noexcept {
        lowest_ = float(limits[0]), highest_ = float(limits[1]);
    }

    // Sets the forces and states of all taxels; the force of one without a value is not a number. `states`: those that each
    // has in any case. Returns true if some taxel has no force of its own, and adds the other reasons of the models.
    // `reading` has shape().size() numbers. rt: wait-free, linear in them
    bool apply(const Reading& reading, std::span<const std::uint8_t> states, TaxelForces& out,
               std::uint32_t& reasons) noexcept;
    void forget() noexcept {
        repeats_.assign(repeats_.size(), 0);
        models_.forget();
    }

private:
    static constexpr unsigned kMostRepeats = 65535;
    [[nodiscard]] bool apply_matrix(std::span<const float> raw, TaxelForces& out) noexcept;
    [[nodiscard]] bool apply_models(const Reading& reading, TaxelForces& out, std::uint32_t& reasons) noexcept;
    [[nodiscard]] bool find_saturated(std::span<const float> raw, TaxelForces& out) const noexcept;
    void count_repeats(std::span<const float> raw) noexcept;
    [[nodiscard]] std::uint8_t why_missing(std::span<const float> raw, std::size_t i) const noexcept;
    void turn(TaxelForces& out) noexcept;

    TaxelShape shape_;
    std::uint32_t components_ = 0;
    const TaxelPlaces& places_;
    std::vector<std::vector<float>> matrix_;  // a row for each component of a taxel's frame; empty: models_
    TaxelModels models_;
    double counts_per_unit_ = 1;
    std::vector<float> zero_, gain_;         // value v of taxel i: v n + i; of taxel i
    std::vector<std::uint8_t> dead_;         // states of the taxels that the calibration lists
    std::array<std::vector<float>, 3> own_;  // forces in the taxels' frames, where these are not S
    std::vector<float> before_;              // raw values of the last frame
    std::vector<std::uint16_t> repeats_;
    unsigned calibrated_frozen_after_, frozen_after_;
    float lowest_ = -std::numeric_limits<float>::infinity(), highest_ = std::numeric_limits<float>::infinity();
    float full_scale_N_;  // limit of a taxel's force along its normal
};

// Parameters and tables of a calibration that TaxelLaw reads.
inline constexpr std::array<Parameter, 2> kLawParameters{
    {{"taxel_full_scale_N", "largest calibrated press on a taxel, N", kAboveZero, kLargest, kLargest},
     {"frozen_after", "frames after which a taxel that repeats its values is dead; 0 = never", 0, 65535, 0}}};
inline constexpr std::array<KnownTable, 4> kLawTables{{{"taxel", kAnyNumber, kPerChannel, false},
                                                       {"zero", kPerChannel, kAnyNumber, false},
                                                       {"gain", 1, kAnyNumber, false},
                                                       {"dead", 1, kAnyNumber, false}}};

}  // namespace tactiled
