#include "decoupling/patch/patch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "decoupling/method.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr std::array<Parameter, 1> kNoiseParameters{{{"gain_sd", "sd of a taxel's own gain, relative", 0, 10, 0}}};
constexpr std::array<KnownTable, 2> kNoiseTables{{{"taxel_sd", 1, kAnyNumber, false}, {"gain_sd", 1, kAnyNumber, false}}};
constexpr auto kParameters = joined(
    joined(joined(kPlaceParameters, kLawParameters), joined(kNoiseParameters, kDoubtParameters)), kCrosstalkParameters);
constexpr auto kTables = joined(joined(kPlaceTables, kLawTables), kNoiseTables);

// A GOOD press may be off by a tenth at most, and what the neighbours do not show may be as large as what they do.
constexpr double kUnsureShare = 0.05;

TaxelNoise noise_of(const CalibrationData& data, std::size_t n, const TaxelModels& models, std::string& fault) {
    if (!models.is_empty()) return {models.sd_at_rest(), std::vector<float>(n, models.gain_sd())};
    TaxelNoise noise;
    noise.gain.assign(n, float(data["gain_sd"]));
    if (const NumberRows* const of_each = data.table("gain_sd")) {
        const std::vector<double>& sd = of_each->front();
        if (data.calibration().parameters.count("gain_sd") != 0)
            fault = "gain_sd is a parameter and a table; keep one of them";
        else if (sd.size() != n || !std::ranges::all_of(sd, [](double x) { return x >= 0; }))
            fault = fmt::format("table gain_sd has {} numbers for {} taxels, or a negative one", sd.size(), n);
        else
            noise.gain.assign(sd.begin(), sd.end());
    }
    const NumberRows* const table = data.table("taxel_sd");
    if (table == nullptr) return noise;
    const std::vector<double>& sd = table->front();
    if (sd.size() != 1 && sd.size() != 3) {
        fault = fmt::format("table taxel_sd has {} numbers; it needs 1 (fz) or 3 (fx, fy, fz)", sd.size());
        return noise;
    }
    for (std::size_t c = 3 - sd.size(); c < 3; ++c) noise.sd[c] = float(sd[c + sd.size() - 3]);
    return noise;
}

TaxelForces forces_of(std::size_t n, std::uint32_t components, bool with_sd) {
    TaxelForces forces;
    forces.state.assign(n, 0);
    for (std::size_t c = 0; c < 3; ++c) {
        if ((components >> c & 1u) != 0) forces.component[c].assign(n, 0);
        if (with_sd) forces.sd[c].assign(n, 0);
    }
    return forces;
}

// The components of the wrench that forces of these components determine.
bool is_determined(std::uint32_t of_taxel, std::size_t c) { return of_taxel == 7 || (c >= 2 && c <= 4); }

std::string fault_of_patch(const Calibration& calibration, std::uint32_t components) {
    for (const auto& name : calibration.components)
        if (!is_determined(components, component_index(name)))
            return fmt::format("components has \"{}\", but the taxels measure fz alone: fz, mx, my are possible", name);
    if (calibration.monitor.limit > 0 || !calibration.sd_unloading.empty() || !calibration.temperature.zero_per_K.empty() ||
        !calibration.matrix.empty() || !calibration.repeats.noise.empty())
        return "an array has no matrix, monitor, repeats, sd_unloading or temperature";
    return "";
}

}  // namespace

Patch::Patch(const CalibrationData& data, std::string& fault)
    : places_(places_of(data, fault)),
      law_(data, places_, fault),
      crosstalk_(places_, data["crosstalk"]),
      noise_(noise_of(data, places_.n, law_.models(), fault)),
      sums_(places_, noise_, law_.models().is_common()),
      contact_(places_, noise_.times(crosstalk_.noise_gain()), data["narrowest_contact_mm"] * 1e-3) {
    const Calibration& calibration = data.calibration();
    if (fault.empty()) fault = fault_of_crosstalk(places_, data["crosstalk"]);
    if (fault.empty()) fault = fault_of_narrowest(places_, data["narrowest_contact_mm"] * 1e-3);
    if (fault.empty()) fault = fault_of_patch(calibration, law_.components());
    if (!fault.empty()) return;
    forces_ = shown_ = zero_ = zero_shown_ = mean_ = forces_of(places_.n, law_.components(), !law_.models().is_empty());
    was_out_.assign(places_.n, 0);
    has_no_zero_.assign(places_.n, 0);
    had_no_zero_.assign(places_.n, 0);
    out_.reserve(places_.n);
    record_.assign(record_size() / sizeof(std::uint64_t), 0);
    correlations_ = correlations_of(calibration);
    if (calibration.nominal) always_ |= TACTILED_UNCALIBRATED;
    if (law_.models().is_empty() && data.table("taxel_sd") == nullptr) always_ |= TACTILED_UNKNOWN_UNCERTAINTY;
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        seen_[c] = true;
        full_scale_[c] = calibration.full_scale.empty() ? kLargest : (1 + kDomainMargin) * calibration.full_scale[i];
        if (!calibration.sd.empty()) sd_[c] = calibration.sd[i];
        if (!calibration.sd_slope.empty()) sd_slope_[c] = calibration.sd_slope[i];
    }
}

Calibration Patch::with_zero_of_taxels(const Calibration& calibration) const {
    Calibration result = calibration;
    if (result.sd.empty())
        for (const auto& name : calibration.components)
            result.sd.push_back(std::sqrt(sums_.variance_at_rest()[component_index(name)]));
    if (calibration.taxels.empty()) return result;
    if (result.zero_rate_per_h.empty()) result.zero_rate_per_h = sum_over_taxels(calibration, &Calibration::zero_rate_per_h);
    if (result.zero_shift.empty()) result.zero_shift = sum_over_taxels(calibration, &Calibration::zero_shift);
    return result;
}

// The sum of what the files of the taxels state for their components, at most; empty if none states it.
std::vector<double> Patch::sum_over_taxels(const Calibration& calibration, std::vector<double> Calibration::*stated) const {
    Wrench sum{};
    bool any = false;
    for (std::size_t i = 0; i < places_.n; ++i) {
        const Calibration& taxel = calibration.taxels[calibration.taxels.size() == 1 ? 0 : i];
        std::array<double, 3> of_force{};
        for (std::size_t k = 0; k < (taxel.*stated).size(); ++k)
            if (const std::size_t c = component_index(taxel.components[k]); c < 3)
                of_force[c] = (taxel.*stated)[k], any = true;
        const std::array<double, 3> r{double(places_.x[i]), double(places_.y[i]), double(places_.z[i])};
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t a = (c + 1) % 3, b = (c + 2) % 3;
            sum[c] += of_force[c];
            sum[3 + c] += std::abs(r[a]) * of_force[b] + std::abs(r[b]) * of_force[a];
        }
    }
    std::vector<double> result;
    for (const auto& name : calibration.components)
        if (any) result.push_back(sum[component_index(name)]);
    return result;
}

Estimate Patch::decouple(const Reading& reading) noexcept {
    Estimate estimate;
    auto& array = *reinterpret_cast<tactiled_array*>(record_.data());
    if (reading.taxels.shape != law_.shape()) {
        estimate.reasons = TACTILED_WRONG_DEVICE;
        return estimate;
    }
    is_new_ = true;
    array.n_out = 0;
    estimate.reasons = always_;
    out_.clear();
    if (law_.apply(reading, has_no_zero_, forces_, estimate.reasons)) array.n_out = find_out(estimate);
    if (2 * std::size_t(array.n_out) > places_.n) return estimate;
    if (crosstalk_.is_any()) {
        shown_.component = forces_.component;  // no allocation: their sizes are equal
        crosstalk_.remove(forces_);
    }
    if (has_lost_zeros_) {
        contact_.forget(array);
        estimate.reasons |= TACTILED_ZERO_UNKNOWN;
    } else {
        contact_.find(forces_, zero_, out_, array);
    }
    put_sums(estimate);
    if ((estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) != 0) forget_unknown_sd();
    const PressPlace at = place();
    estimate.cop_S_m = at.cop_S_m;
    estimate.cop_sd_m = at.sd_m;
    return estimate;
}

// Lists the taxels without a force and predicts them. Returns their number. A frame of which more than half are out has no
// value.
std::uint32_t Patch::find_out(Estimate& estimate) noexcept {
    std::uint32_t states = 0;
    for (std::size_t i = 0; i < places_.n; ++i) {
        if (has_force(forces_.state[i])) continue;
        states |= forces_.state[i];
        out_.push_back({.taxel = std::uint16_t(i)});
    }
    if (2 * out_.size() > places_.n) {
        estimate.reasons |= TACTILED_MISSING_CHANNEL;
        return std::uint32_t(out_.size());
    }
    predict(places_, noise_, zero_shown_, forces_, out_);
    const bool is_supported = std::ranges::all_of(out_, &TaxelOut::is_supported);
    if ((states & TACTILED_TAXEL_SATURATED) != 0) estimate.reasons |= TACTILED_SATURATED | TACTILED_UNKNOWN_UNCERTAINTY;
    if (!is_supported) estimate.reasons |= TACTILED_MISSING_CHANNEL | TACTILED_UNKNOWN_UNCERTAINTY;
    if (!is_supported && (states & TACTILED_TAXEL_FROZEN) != 0) estimate.reasons |= TACTILED_FROZEN;
    return std::uint32_t(out_.size());
}

void Patch::put_sums(Estimate& estimate) noexcept {
    sums_.add(forces_, out_);
    const bool is_known = (estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) == 0;
    Wrench variance = sums_.variance();
    for (std::size_t c = 0; c < 2; ++c) variance[3 + c] += contact_.within()[c];
    for (std::size_t c = 0; c < 6; ++c) {
        const double error =
            std::max(contact_.doubt()[c], std::abs(contact_.doubted_share() * (sums_.wrench()[c] - zero_S_[c])));
        variance[c] += error * error;  // the share, for the components across the press
    }
    if (contact_.doubted_share() > kUnsureShare) estimate.reasons |= TACTILED_DISAGREEMENT;
    if (contact_.predicted_share() > kUnsureShare) estimate.reasons |= TACTILED_MISSING_CHANNEL;
    bool is_finite = true;
    for (std::size_t c = 0; c < 6; ++c) {
        if (!seen_[c]) continue;
        const double w = sums_.wrench()[c], common = sd_slope_[c] * w;
        is_finite = is_finite && std::isfinite(w) && std::isfinite(variance[c]);
        estimate.wrench_S[c] = w;
        if (is_known) estimate.sd[c] = std::sqrt(variance[c] + sd_[c] * sd_[c] + common * common);
        if (std::abs(w) > full_scale_[c]) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
    }
    std::uint8_t states = 0;
    for (const std::uint8_t state : forces_.state) states |= state;
    if ((states & TACTILED_TAXEL_OUTSIDE) != 0) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
    estimate.correlations = &correlations_;
    estimate.has_value = is_finite;
    if (is_finite) return;
    estimate.reasons |= TACTILED_NOT_FINITE;
    estimate.wrench_S = estimate.sd = kUnseen;
}

void Patch::forget_unknown_sd() noexcept {
    constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
    auto& array = *reinterpret_cast<tactiled_array*>(record_.data());
    array.peak_sd_N = array.area_sd_m2 = array.axis_sd_rad = kNone;
    std::fill_n(array.cop_sd_m, 3, kNone);
}

void Patch::begin_tare() noexcept {
    n_tare_ = 0;
    std::ranges::copy(has_no_zero_, had_no_zero_.begin());
    std::ranges::fill(was_out_, std::uint8_t(0));
    std::ranges::fill(has_no_zero_, std::uint8_t(0));
}

void Patch::add_to_tare() noexcept {
    const auto& shown = crosstalk_.is_any() ? shown_.component : forces_.component;
    const float weight = 1 / float(++n_tare_);
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t i = 0; i < mean_.component[c].size(); ++i) {
            float& mean = mean_.component[c][i];
            mean = n_tare_ == 1 ? shown[c][i] : mean + weight * (shown[c][i] - mean);
        }
    for (const TaxelOut& one : out_) was_out_[one.taxel] = TACTILED_TAXEL_MISSING;
}

PressPlace Patch::end_tare(bool is_taken) noexcept {
    std::swap(has_no_zero_, is_taken ? was_out_ : had_no_zero_);
    if (is_taken) {
        set_zero(mean_);
        contact_.find(forces_, zero_, out_, *reinterpret_cast<tactiled_array*>(record_.data()));
    }
    return place();
}

void Patch::untare() noexcept {
    for (auto& component : mean_.component) std::ranges::fill(component, 0.f);
    set_zero(mean_);
    std::ranges::fill(has_no_zero_, std::uint8_t(0));
}

// `shown`: what the taxels show without a load.
void Patch::set_zero(const TaxelForces& shown) noexcept {
    has_lost_zeros_ = false;
    zero_.component = zero_shown_.component = shown.component;
    crosstalk_.remove(zero_);
    sums_.add(zero_, {});
    zero_S_ = sums_.wrench();
}

PressPlace Patch::place() const noexcept {
    const auto& array = *reinterpret_cast<const tactiled_array*>(record_.data());
    return {{double(array.cop_S_m[0]), double(array.cop_S_m[1])}, {double(array.cop_sd_m[0]), double(array.cop_sd_m[1])}};
}

const void* Patch::record(const tactiled_sample& sample) noexcept {
    auto& array = *reinterpret_cast<tactiled_array*>(record_.data());
    array.sample = sample;
    tactiled_put_verdict(&array.sample, sample.quality != TACTILED_BAD);
    const std::size_t n = places_.n, n_components = std::size_t(std::popcount(law_.components()));
    auto* const force = reinterpret_cast<float*>(&array + 1);
    auto* const state = reinterpret_cast<std::uint8_t*>(force + n * n_components);
    if (!std::exchange(is_new_, false)) {  // there was no reading: the link is lost, or the frame is of another device
        array.n_out = 0;
        std::fill_n(state, n, std::uint8_t(0));
        tactiled_invalidate_array(&array, std::uint32_t(n * n_components), sample.reasons);
        return record_.data();
    }
    std::copy_n(forces_.state.data(), n, state);
    if (sample.quality == TACTILED_BAD) {
        tactiled_invalidate_array(&array, std::uint32_t(n * n_components), sample.reasons);
        return record_.data();
    }
    std::size_t k = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        if (forces_.component[c].empty()) continue;
        const float *const f = forces_.component[c].data(), *const zero = zero_.component[c].data();
        if (n_components == 1)
            for (std::size_t i = 0; i < n; ++i) force[i] = f[i] - zero[i];
        else
            for (std::size_t i = 0; i < n; ++i) force[3 * i + k] = f[i] - zero[i];
        ++k;
    }
    for (const TaxelOut& one : out_)
        for (k = 0; k < n_components; ++k) force[one.taxel * n_components + k] = std::numeric_limits<float>::quiet_NaN();
    return record_.data();
}

namespace {

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    auto patch = std::make_unique<Patch>(data, fault);
    return fault.empty() ? std::move(patch) : nullptr;
}

const MethodEntry linear{
    .model = "patch", .method = "linear", .place = 10, .parameters = kParameters, .tables = kTables, .make = make};
const MethodEntry taxel_models{
    .model = "patch", .method = "taxel_models", .place = 20, .parameters = kParameters, .tables = kTables, .make = make};

}  // namespace
}  // namespace tactiled
