#include "decoupling/patch/taxel_models.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "decoupling/patch/taxel_law.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

// These leave a taxel without a value of its own.
constexpr std::uint32_t kOut = TACTILED_MISSING_CHANNEL | TACTILED_SATURATED;

std::uint8_t state_of(const Estimate& e, const Reading& reading) {
    if (e.has_value && (e.reasons & kOut) == 0)
        return std::uint8_t((e.reasons & TACTILED_OUTSIDE_DOMAIN) != 0 ? TACTILED_TAXEL_OUTSIDE : 0);
    return reading.missing == 0 && reading.saturated != 0 ? TACTILED_TAXEL_SATURATED : TACTILED_TAXEL_MISSING;
}

}  // namespace

TaxelModels::TaxelModels(const Calibration& array, std::size_t n, std::string& fault) {
    const std::vector<Calibration>& taxels = array.taxels;
    if (!fault.empty() || taxels.empty()) return;
    if (taxels.size() != 1 && taxels.size() != n)
        fault =
            fmt::format("taxel_calibration has {} files for {} taxels; it needs one for all, or one each", taxels.size(), n);
    is_common_ = taxels.size() == 1;
    for (std::size_t i = 0; i < n && fault.empty(); ++i) fault = add(array, taxels[is_common_ ? 0 : i]);
}

std::string TaxelModels::add(const Calibration& array, const Calibration& taxel) {
    const auto sees = [&](const char* name) { return std::ranges::find(taxel.components, name) != taxel.components.end(); };
    if (taxel.channels != array.channels || taxel.channel_unit != array.channel_unit)
        return fmt::format("{} has the channels {} in {}, the array {} in {}", taxel.path, fmt::join(taxel.channels, " "),
                           taxel.channel_unit, fmt::join(array.channels, " "), array.channel_unit);
    if (!sees("fz")) return fmt::format("{} has no component fz", taxel.path);
    DecouplerFault fault;
    auto model = make_decoupler(taxel, "", 0, fault);
    if (model == nullptr) return fault.text;
    if (model->patch() != nullptr) return fmt::format("{} is the calibration of an array itself", taxel.path);
    models_.push_back(std::move(model));
    zero_.insert(zero_.end(), taxel.zero.begin(), taxel.zero.end());
    sees_shear_ = sees_shear_ && sees("fx") && sees("fy");
    for (std::size_t k = 0; k < taxel.components.size(); ++k) {
        const std::size_t c = component_index(taxel.components[k]);
        if (c < 3 && !taxel.sd.empty()) sd_at_rest_[c] = std::max(sd_at_rest_[c], float(taxel.sd[k]));
        if (c == 2 && !taxel.sd_slope.empty()) gain_sd_ = std::max(gain_sd_, float(taxel.sd_slope[k]));
    }
    return "";
}

void TaxelModels::put_zeros(std::vector<float>& zero) const {
    const std::size_t n = models_.size(), values = zero_.size() / n;
    for (std::size_t v = 0; v < values; ++v)
        for (std::size_t i = 0; i < n; ++i) zero.push_back(float(zero_[i * values + v]));
}

void TaxelModels::set_temperature(const TemperatureInUse& in_use) noexcept {
    for (auto& model : models_) model->set_temperature(in_use);
}

void TaxelModels::forget() noexcept {
    for (auto& model : models_) model->forget();
}

std::uint32_t TaxelModels::apply(const Reading& reading, std::span<const float> zero, double counts_per_unit,
                                 std::array<std::vector<float>, 3>& force, TaxelForces& out) noexcept {
    const std::size_t n = reading.taxels.shape.taxels, values = reading.taxels.shape.values;
    std::uint32_t reasons = 0;
    std::array<double, kMaxTaxelValues> channel{};
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t c = 0; c < 3; ++c) {
            if (!force[c].empty()) force[c][i] = c < 2 && !sees_shear_ ? 0 : std::numeric_limits<float>::quiet_NaN();
            out.sd[c][i] = 0;
        }
        if (!has_force(out.state[i])) continue;
        Reading of_taxel = reading;
        of_taxel.taxels = {};
        of_taxel.channel = {channel.data(), values};
        for (std::size_t v = 0; v < values; ++v) {
            const float raw = reading.taxels.value[v * n + i];
            channel[v] = std::isfinite(raw) ? double(raw - zero[v * n + i]) / counts_per_unit + zero_[i * values + v] : kNaN;
            if (std::isnan(raw)) of_taxel.missing |= 1u << v;
            if (std::isinf(raw)) of_taxel.saturated |= 1u << v;
        }
        const Estimate e = models_[i]->decouple(of_taxel);
        out.state[i] |= state_of(e, of_taxel);
        if (!has_force(out.state[i])) continue;
        reasons |= e.reasons & ~std::uint32_t(TACTILED_OUTSIDE_DOMAIN);
        for (std::size_t c = sees_shear_ ? 0 : 2; c < 3; ++c) {
            force[c][i] = float(e.wrench_S[c]);
            if (std::isfinite(e.sd[c])) out.sd[c][i] = float(e.sd[c]);  // an unknown one is a reason
        }
    }
    return reasons;
}

}  // namespace tactiled
