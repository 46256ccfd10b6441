#include "decoupling/grasp/objects.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled::grasp {
namespace {

constexpr double kUnknownBeyond = 3;  // in sd: an object is farther from its own kind in one of 370 grasps
constexpr double kMinTaught = 0.01;   // part of the mass: least sd of objects with one name

double density(double off, double sd) noexcept { return std::exp(-0.5 * off * off / (sd * sd)) / sd; }

}  // namespace

void Objects::teach(std::span<const Object> objects) noexcept {
    n_ = 0;
    for (const Object& o : objects) {
        if (n_ == known_.size()) return;
        if (o.id == 0 || !(o.mass_kg > 0) || !std::isfinite(o.mass_kg) || !(o.sd_kg >= 0) || !std::isfinite(o.sd_kg))
            continue;
        Known& k = known_[n_++];
        k = {o.id, o.mass_kg, o.sd_kg, {}};
        std::copy_n(o.name.begin(), std::min(o.name.size(), k.name.size() - 1), k.name.begin());
    }
}

Recognised Objects::recognise(double mass_kg, double sd_kg) const noexcept {
    if (!(sd_kg > 0) || !std::isfinite(sd_kg) || !std::isfinite(mass_kg)) return {};
    const Known* likeliest = nullptr;
    double max = 0, sum = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        const double sd = std::hypot(sd_kg, known_[i].sd_kg), d = density(mass_kg - known_[i].mass_kg, sd);
        sum += d;
        if (d > max) likeliest = &known_[i], max = d;
    }
    if (likeliest == nullptr) return {};
    // The gripper may hold any object. At every weight, an unknown object has the likelihood of the taught one at
    // kUnknownBeyond of its sd. The measurement's sd is not used here, because a less certain weight would make an object
    // more certain.
    const double taught_sd = std::max(likeliest->sd_kg, kMinTaught * likeliest->mass_kg);
    const double unknown = density(kUnknownBeyond * taught_sd, taught_sd);
    if (max < unknown) return {};
    return {likeliest->id, max / (sum + unknown), likeliest->name};
}

}  // namespace tactiled::grasp
