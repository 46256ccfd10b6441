#include "decoupling/patch/taxel_law.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "decoupling/solve/domain.hpp"
#include "tactiled/layout.h"

namespace tactiled {
namespace {

// out += weight (raw - zero) over all taxels. rt: wait-free
void add(float weight, const float* raw, const float* zero, std::size_t n, float* out) noexcept {
    for (std::size_t i = 0; i < n; ++i) out[i] += weight * (raw[i] - zero[i]);
}

std::string fault_of_sizes(const CalibrationData& data, std::size_t n) {
    const NumberRows* const taxel = data.table("taxel");
    const std::size_t values = data.calibration().channels.size(), rows = taxel != nullptr ? taxel->size() : 1;
    if ((taxel != nullptr) == !data.calibration().taxel_files.empty())
        return "it needs table taxel, the force of each value, or taxel_calibration = [\"a file\"], the model of a taxel";
    if (taxel == nullptr && (data.has("gain_sd") || data.table("taxel_sd") != nullptr))
        return "gain_sd and table taxel_sd belong to table taxel: the files of taxel_calibration state the sd of their "
               "taxels";
    if (values > kMaxTaxelValues) return fmt::format("{} channels; a taxel has at most {}", values, kMaxTaxelValues);
    if (rows != 1 && rows != 3) return fmt::format("table taxel has {} rows; it needs 1 (fz) or 3 (fx, fy, fz)", rows);
    for (const char* const name : {"zero", "gain"})
        if (const NumberRows* table = data.table(name); table != nullptr && table->front().size() != n)
            return fmt::format("table {} has {} numbers in a row for {} taxels", name, table->front().size(), n);
    if (const NumberRows* list = data.table("dead"))
        for (const double i : list->front())
            if (!(i >= 0 && i < double(n)) || i != std::floor(i))
                return fmt::format("table dead has {}; a taxel is 0 .. {}", i, n - 1);
    return "";
}

// Returns a number that is not finite if a force is not finite: several sums side by side. rt: wait-free
float zero_or_nan(const float* force, std::size_t n) noexcept {
    constexpr std::size_t kLanes = 16;
    float lane[kLanes]{};
    std::size_t i = 0;
    for (; i + kLanes <= n; i += kLanes)
        for (std::size_t k = 0; k < kLanes; ++k) lane[k] += 0 * force[i + k];
    for (std::size_t k = 0; i < n; ++i, ++k) lane[k] += 0 * force[i];
    float sum = 0;
    for (const float part : lane) sum += part;
    return sum;
}

// rt: wait-free
float largest_magnitude(const float* force, std::size_t n) noexcept {
    float largest = 0;
    for (std::size_t i = 0; i < n; ++i) largest = std::abs(force[i]) > largest ? std::abs(force[i]) : largest;
    return largest;
}

}  // namespace

TaxelLaw::TaxelLaw(const CalibrationData& data, const TaxelPlaces& places, std::string& fault)
    : places_(places),
      models_(data.calibration(), places.n, fault),
      calibrated_frozen_after_(unsigned(data["frozen_after"])),
      frozen_after_(calibrated_frozen_after_),
      full_scale_N_(float((1 + kDomainMargin) * data["taxel_full_scale_N"])) {
    const Calibration& calibration = data.calibration();
    const std::size_t n = places.n, values = calibration.channels.size();
    if (fault.empty()) fault = fault_of_sizes(data, n);
    if (!fault.empty()) return;
    shape_ = {std::uint16_t(n), std::uint16_t(values)};
    if (const NumberRows* rows = data.table("taxel"))
        for (const auto& row : *rows) matrix_.emplace_back(row.begin(), row.end());
    const bool has_shear = matrix_.empty() ? models_.sees_shear() : matrix_.size() == 3;
    components_ = has_shear || !places.is_flat() ? 7 : 4;
    const NumberRows* const zeros = data.table("zero");
    if (zeros == nullptr && !models_.is_empty()) models_.put_zeros(zero_);
    for (std::size_t v = 0; zero_.size() < shape_.size(); ++v) {
        if (zeros != nullptr)
            zero_.insert(zero_.end(), (*zeros)[v].begin(), (*zeros)[v].end());
        else
            zero_.insert(zero_.end(), n, float(calibration.zero[v]));
    }
    gain_.assign(n, 1);
    if (const NumberRows* gains = data.table("gain")) gain_.assign(gains->front().begin(), gains->front().end());
    dead_.assign(n, 0);
    if (const NumberRows* list = data.table("dead"))
        for (const double i : list->front()) dead_[std::size_t(i)] = TACTILED_TAXEL_DEAD;
    if (!places.is_flat())
        for (auto& component : own_) component.assign(n, 0);
    before_.assign(shape_.size(), std::numeric_limits<float>::quiet_NaN());
    repeats_.assign(n, 0);
}

void TaxelLaw::set_counts_per_unit(double counts) noexcept {
    for (auto& row : matrix_)
        for (float& weight : row) weight = float(double(weight) / counts);
    for (float& zero : zero_) zero = float(double(zero) * counts);
    counts_per_unit_ = counts;
}

bool TaxelLaw::apply_matrix(std::span<const float> raw, TaxelForces& out) noexcept {
    const std::size_t n = shape_.taxels, first = matrix_.size() == 1 ? 2 : 0;
    auto& force = places_.is_flat() ? out.component : own_;
    float sum = 0;  // is not a number where a force is not one
    for (std::size_t c = 0; c < matrix_.size(); ++c) {
        float* const f = force[first + c].data();
        std::fill_n(f, n, 0.f);
        for (std::size_t v = 0; v < shape_.values; ++v) add(matrix_[c][v], &raw[v * n], &zero_[v * n], n, f);
        const float* const gain = gain_.data();
        for (std::size_t i = 0; i < n; ++i) f[i] *= gain[i];
        sum += zero_or_nan(f, n);
    }
    if (std::isfinite(sum)) return false;
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t c = 0; c < matrix_.size(); ++c)
            if (!std::isfinite(force[first + c][i])) out.state[i] |= why_missing(raw, i);
    return true;
}

bool TaxelLaw::apply_models(const Reading& reading, TaxelForces& out, std::uint32_t& reasons) noexcept {
    auto& force = places_.is_flat() ? out.component : own_;
    reasons |= models_.apply(reading, zero_, counts_per_unit_, force, out);
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t i = 0; i < force[c].size(); ++i) force[c][i] *= gain_[i], out.sd[c][i] *= gain_[i];
    return !std::ranges::all_of(out.state, has_force);
}

bool TaxelLaw::apply(const Reading& reading, std::span<const std::uint8_t> states, TaxelForces& out,
                     std::uint32_t& reasons) noexcept {
    const std::size_t n = shape_.taxels;
    const std::span<const float> raw = reading.taxels.value;
    auto& force = places_.is_flat() ? out.component : own_;
    std::uint8_t stated = 0;
    for (std::size_t i = 0; i < n; ++i) stated |= out.state[i] = dead_[i] | states[i];
    bool any_out = stated != 0;
    if (models_.is_empty() ? apply_matrix(raw, out) : apply_models(reading, out, reasons)) any_out = true;
    if (find_saturated(raw, out)) any_out = true;
    if (frozen_after_ > 0) {
        count_repeats(raw);
        for (std::size_t i = 0; i < n; ++i) {
            if (repeats_[i] < frozen_after_) continue;
            out.state[i] |= TACTILED_TAXEL_FROZEN;
            any_out = true;
        }
    }
    const bool any_outside = !(largest_magnitude(force[2].data(), n) <= full_scale_N_);
    for (std::size_t i = 0; any_outside && i < n; ++i)
        if (has_force(out.state[i]) && std::abs(force[2][i]) > full_scale_N_) out.state[i] |= TACTILED_TAXEL_OUTSIDE;
    if (!places_.is_flat()) turn(out);
    for (std::size_t i = 0; any_out && i < n; ++i)
        if (!has_force(out.state[i]))
            for (std::size_t c = 0; c < 3; ++c) {
                if (!out.component[c].empty()) out.component[c][i] = std::numeric_limits<float>::quiet_NaN();
                if (!out.sd[c].empty()) out.sd[c][i] = 0;
            }
    return any_out;
}

bool TaxelLaw::find_saturated(std::span<const float> raw, TaxelForces& out) const noexcept {
    if (std::isinf(lowest_) && std::isinf(highest_)) return false;
    bool any = false;
    for (std::size_t v = 0; v < shape_.values; ++v)
        for (std::size_t i = 0; i < shape_.taxels; ++i) {
            const float value = raw[v * shape_.taxels + i];
            if (value > lowest_ && value < highest_) continue;
            out.state[i] |= std::uint8_t(std::isnan(value) ? TACTILED_TAXEL_MISSING : TACTILED_TAXEL_SATURATED);
            any = true;
        }
    return any;
}

std::uint8_t TaxelLaw::why_missing(std::span<const float> raw, std::size_t i) const noexcept {
    std::uint8_t why = TACTILED_TAXEL_SATURATED;
    for (std::size_t v = 0; v < shape_.values; ++v)
        if (std::isnan(raw[v * shape_.taxels + i])) why = TACTILED_TAXEL_MISSING;
    return why;
}

void TaxelLaw::count_repeats(std::span<const float> raw) noexcept {
    const std::size_t n = shape_.taxels;
    for (std::size_t i = 0; i < n; ++i) {
        bool same = true;
        for (std::size_t v = 0; v < shape_.values; ++v) same = same && raw[v * n + i] == before_[v * n + i];
        repeats_[i] = same ? std::uint16_t(std::min(repeats_[i] + 1u, kMostRepeats)) : std::uint16_t(0);
    }
    std::copy(raw.begin(), raw.end(), before_.begin());
}

void TaxelLaw::turn(TaxelForces& out) noexcept {
    for (std::size_t i = 0; i < shape_.taxels; ++i) {
        std::array<float, 3> variance{};
        for (std::size_t c = 0; c < 3; ++c) {
            float sum = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                const float a = places_.axes[i][k][c];
                sum += a * own_[k][i];
                if (!models_.is_empty()) variance[c] += a * a * out.sd[k][i] * out.sd[k][i];
            }
            out.component[c][i] = sum;
        }
        for (std::size_t c = 0; !models_.is_empty() && c < 3; ++c) out.sd[c][i] = std::sqrt(variance[c]);
    }
}

}  // namespace tactiled
