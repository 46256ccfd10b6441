// Model "patch": an array of taxels. Its estimate is the wrench of all of them, and it keeps the force of each. README.md
// has the calibration.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/patch/contact.hpp"
#include "decoupling/patch/places.hpp"
#include "decoupling/patch/sums.hpp"
#include "decoupling/patch/taxel_law.hpp"

namespace tactiled {

class Patch final : public Decoupler {
public:
    // setup; `fault` is set if the calibration is not suitable
    Patch(const CalibrationData& data, std::string& fault);

    // rt: wait-free, linear in the number of taxels
    Estimate decouple(const Reading& reading) noexcept override;
    void forget() noexcept override { law_.forget(); }
    [[nodiscard]] std::string_view method() const noexcept override { return "linear"; }
    [[nodiscard]] Patch* patch() noexcept override { return this; }

    [[nodiscard]] TaxelShape shape() const noexcept { return law_.shape(); }
    [[nodiscard]] std::uint32_t components() const noexcept { return law_.components(); }
    [[nodiscard]] const TaxelPlaces& places() const noexcept { return places_; }
    // Returns the calibration with the standard deviation of the wrench without a load as its sd, unless it states one.
    // setup
    [[nodiscard]] Calibration with_sd_at_rest(const Calibration& calibration) const;
    // setup
    void set_counts_per_unit(double counts) noexcept { law_.set_counts_per_unit(counts); }
    // Frames after which a taxel that repeats its values is dead; 0 = never, -1 = by the calibration. rt: wait-free
    void set_frozen_after(int frames) noexcept { law_.set_frozen_after(frames); }

    // The zero of each taxel, for their forces and for the contact; the wrench has its zero in the sensor. begin_tare()
    // begins a mean over the following readings, end_tare() takes it. rt: wait-free
    void begin_tare() noexcept { n_tare_ = 0, is_taring_ = true; }
    void end_tare(bool is_taken) noexcept;
    void untare() noexcept;

    // Returns the record of the last reading: struct tactiled_array and what follows it, in record_size() bytes, with this
    // sample. A tare of an earlier run has no zeros of the taxels: their zero is then unknown. rt: wait-free, linear in the
    // number of taxels
    [[nodiscard]] const void* record(const tactiled_sample& sample) noexcept;
    [[nodiscard]] std::uint32_t record_size() const noexcept {
        return tactiled_array_size(law_.shape().taxels, law_.components());
    }

private:
    [[nodiscard]] std::uint32_t find_out(Estimate& estimate) noexcept;
    void put_sums(Estimate& estimate) noexcept;
    void average() noexcept;

    TaxelPlaces places_;
    TaxelLaw law_;
    TaxelNoise noise_;
    Sums sums_;
    Contact contact_;
    std::uint32_t always_ = 0;  // reasons of every sample
    std::array<bool, 6> seen_{};
    std::array<double, 6> full_scale_{}, sd_{}, sd_slope_{};
    TaxelForces forces_, zero_, mean_;
    std::vector<TaxelOut> out_;
    bool is_taring_ = false, has_zero_ = false;  // zero_ is that of the last tare
    unsigned n_tare_ = 0;
    std::vector<std::uint64_t> record_;
};

}  // namespace tactiled
