#include "decoupling/fit/damage.hpp"

#include <algorithm>
#include <cmath>

#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kRows = 500;  // the standard error of a share is at most 2.2 %, that of a mean over channels less
constexpr double kDigits = 1e4;     // the file has no more digits than the shares
constexpr double kHarm = 0.1;       // change of a component that counts as wrong, relative to its full scale
constexpr double kDrift = 0.3;      // relative to the channel's range
constexpr std::size_t kStuck = 0, kHalfGain = 1, kDrifting = 2, kExchanged = 3;  // indices of kDamageKinds

Rows some_of(const Rows& rows) {
    Rows some;
    const std::size_t n = std::min(kRows, rows.size());
    for (std::size_t i = 0; i < n; ++i) some.push_back(rows[i * rows.size() / n]);
    return some;
}

// Estimates readings in order, as the loop does.
class Judge {
public:
    explicit Judge(const Calibration& calibration) : calibration_(calibration), decoupler_(make_decoupler(calibration)) {}

    void start() noexcept { decoupler_->forget(); }
    [[nodiscard]] Estimate estimate(const LabelledRow& row, const std::vector<double>& channel) noexcept {
        // The temperature of the rows was taken off before the fit.
        return decoupler_->decouple(
            {.channel = channel,
             .t_ns = row.t_ns,
             .temperature_C = calibration_.temperature.zero_per_K.empty() ? kNaN : calibration_.temperature.reference_C});
    }
    [[nodiscard]] bool has_moved(const Estimate& sound, const Estimate& damaged) const noexcept {
        for (std::size_t i = 0; i < calibration_.components.size(); ++i) {
            const std::size_t c = component_index(calibration_.components[i]);
            if (std::abs(damaged.wrench_S[c] - sound.wrench_S[c]) > kHarm * calibration_.full_scale[i]) return true;
        }
        return false;
    }

private:
    const Calibration& calibration_;
    std::unique_ptr<Decoupler> decoupler_;
};

}  // namespace

std::vector<double> DamagedRows::reading(std::size_t kind, std::size_t i, std::size_t k) {
    std::vector<double> channel = rows_[i]->channel;
    const double zero = calibration_.zero[k];
    if (kind == kStuck) {
        channel[k] = rows_[random_() % std::max<std::size_t>(1, i)]->channel[k];
    } else if (kind == kHalfGain) {
        channel[k] = zero + (channel[k] - zero) / 2;
    } else if (kind == kDrifting) {
        channel[k] +=
            kDrift * (calibration_.channel_most[k] - calibration_.channel_least[k]) * double(i + 1) / double(rows_.size());
    } else if (kind == kExchanged) {
        if (const std::size_t n = channel.size(); n > 1) std::swap(channel[k], channel[(k + 1 + random_() % (n - 1)) % n]);
    } else {
        channel[k] = zero;
    }
    return channel;
}

UndetectedDamage undetected_damage(const Calibration& calibration, const Rows& all) {
    const Rows rows = some_of(all);
    Judge judge(calibration);
    std::vector<Estimate> sound;
    judge.start();
    for (const auto* row : rows) sound.push_back(judge.estimate(*row, row->channel));
    const auto is_good = [](const Estimate& estimate) { return estimate.quality() == TACTILED_GOOD; };
    const auto good = std::count_if(sound.begin(), sound.end(), is_good);
    UndetectedDamage damage;
    if (good == 0) return damage;
    DamagedRows damaged(rows, calibration);
    for (std::size_t kind = 0; kind < kDamageKinds.size(); ++kind)
        for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
            std::size_t wrong = 0;
            judge.start();
            for (std::size_t i = 0; i < rows.size(); ++i) {
                const Estimate off = judge.estimate(*rows[i], damaged.reading(kind, i, k));
                wrong += is_good(sound[i]) && is_good(off) && judge.has_moved(sound[i], off);
            }
            damage.share[kind].push_back(std::round(kDigits * double(wrong) / double(good)) / kDigits);
        }
    return damage;
}

void set_undetected_damage(const Rows& rows, Calibration& calibration) {
    calibration.undetected_damage = undetected_damage(calibration, rows);
    for (Fit& other : calibration.others)
        other.undetected_damage = undetected_damage(calibration.with_method(other.method), rows);
}

}  // namespace tactiled
