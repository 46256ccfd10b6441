// Model "patch": an array of taxels. Its estimate is the wrench of all of them, and it keeps the force of each. README.md
// has the calibration.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "decoupling/correlations.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/patch/contact.hpp"
#include "decoupling/patch/crosstalk.hpp"
#include "decoupling/patch/places.hpp"
#include "decoupling/patch/sums.hpp"
#include "decoupling/patch/taxel_law.hpp"
#include "decoupling/place.hpp"

namespace tactiled {

class Patch final : public Decoupler {
public:
    // setup; `fault` is set if the calibration is not suitable
    Patch(const CalibrationData& data, std::string& fault);

    // rt: wait-free, linear in the number of taxels
    Estimate decouple(const Reading& reading) noexcept override;
    void forget() noexcept override { law_.forget(); }
    void set_temperature(const TemperatureInUse& in_use) noexcept override { law_.models().set_temperature(in_use); }
    [[nodiscard]] std::string_view method() const noexcept override {
        return law_.models().is_empty() ? "linear" : "taxel_models";
    }
    [[nodiscard]] Patch* patch() noexcept override { return this; }

    [[nodiscard]] TaxelShape shape() const noexcept { return law_.shape(); }
    [[nodiscard]] std::uint32_t components() const noexcept { return law_.components(); }
    [[nodiscard]] const TaxelPlaces& places() const noexcept { return places_; }
    // Returns the calibration with the standard deviation of the wrench without a load as its sd, and with the rates and
    // shifts of the zero that the files of the taxels state, unless it states its own. setup
    [[nodiscard]] Calibration with_zero_of_taxels(const Calibration& calibration) const;
    // setup
    void set_counts_per_unit(double counts) noexcept { law_.set_counts_per_unit(counts); }
    // Frames after which a taxel that repeats its values is dead; 0 = never, -1 = by the calibration. rt: wait-free
    void set_frozen_after(int frames) noexcept { law_.set_frozen_after(frames); }

    // Raw numbers at or beyond these are saturated. rt: wait-free
    void set_saturates_at(const std::array<double, 2>& limits) noexcept { law_.set_saturates_at(limits); }

    // The zero of each taxel, for their forces and for the contact; the wrench has its zero in the sensor. begin_tare()
    // begins a mean, add_to_tare() adds the last reading, end_tare() takes the mean or refuses it. A taxel that had no force
    // in one of these readings has none until the next tare. rt: wait-free
    void begin_tare() noexcept;
    void add_to_tare() noexcept;
    PressPlace end_tare(bool is_taken) noexcept;  // returns the place of the last reading
    void untare() noexcept;
    // The wrench has the zero of a tare of an earlier run, and the taxels have none: there is no contact, nothing shows
    // faults of taxels, and the zero is unknown until a tare. rt: wait-free
    void lose_zeros() noexcept { has_lost_zeros_ = true; }

    // Returns the record of the last reading: struct tactiled_array and what follows it, in record_size() bytes, with this
    // sample. rt: wait-free, linear in the number of taxels
    [[nodiscard]] const void* record(const tactiled_sample& sample) noexcept;
    [[nodiscard]] std::uint32_t record_size() const noexcept {
        return tactiled_array_size(law_.shape().taxels, law_.components());
    }

private:
    [[nodiscard]] std::uint32_t find_out(Estimate& estimate) noexcept;
    void put_sums(Estimate& estimate) noexcept;
    [[nodiscard]] std::vector<double> sum_over_taxels(const Calibration& calibration,
                                                      std::vector<double> Calibration::*stated) const;
    [[nodiscard]] PressPlace place() const noexcept;
    void set_zero(const TaxelForces& shown) noexcept;
    void forget_unknown_sd() noexcept;

    TaxelPlaces places_;
    TaxelLaw law_;
    Crosstalk crosstalk_;
    TaxelNoise noise_;
    Sums sums_;
    Contact contact_;
    std::uint32_t always_ = 0;  // reasons of every sample
    std::array<bool, 6> seen_{};
    std::array<double, 6> full_scale_{}, sd_{}, sd_slope_{};
    Correlations correlations_;
    // Forces on the taxels, as they show them with crosstalk, and without a load; the mean of a tare is of those shown.
    TaxelForces forces_, shown_, zero_, zero_shown_, mean_;
    Wrench zero_S_{};  // of zero_
    std::vector<TaxelOut> out_;
    // A taxel had no force in the mean that runs, in the last tare, or in the one before that mean.
    std::vector<std::uint8_t> was_out_, has_no_zero_, had_no_zero_;
    bool has_lost_zeros_ = false, is_new_ = false;  // is_new_: the reading has had no record yet
    unsigned n_tare_ = 0;
    std::vector<std::uint64_t> record_;
};

}  // namespace tactiled
