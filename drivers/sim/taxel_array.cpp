#include "drivers/sim/taxel_array.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace tactiled::sim {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool is_in_taxels(const Decision& decision) { return decision.on && in_array(*decision.effect) == InArray::each_taxel; }

}  // namespace

TaxelArray::TaxelArray(const Scene& scene, const Sensor& array, const Extent& extent, const Choice& choice,
                       std::size_t block_size)
    : pressure_(scene.body, array),
      size_(array.taxels() * array.n()),
      per_taxel_(std::size_t(std::count_if(choice.decisions.begin(), choice.decisions.end(), is_in_taxels))),
      part_(array.taxels()),
      parts_(array.taxels() * block_size),
      values_(size_ * block_size),
      area_m2_(block_size),
      on_array_(block_size),
      one_(std::make_unique<Block>()) {
    taxels_.reserve(array.taxels());
    effects_.reserve(array.taxels() * per_taxel_);
    for (std::size_t i = 0; i < array.taxels(); ++i) {
        taxels_.push_back(array.taxel_at(i));
        for (const Decision& decision : choice.decisions) {
            if (!is_in_taxels(decision)) continue;
            const Setting setting = scene.setting(decision.number(), taxels_.back(), extent);
            effects_.push_back(decision.level == Decision::kItself ? decision.effect->make(setting)
                                                                   : decision.levels[decision.level].make(setting));
            if (i == 0 && decision.effect->stage == Stage::material) ++of_material_;
        }
    }
}

// Sets the parts of sample n. They change only with the press and its place.
void TaxelArray::spread(const Block& block, std::size_t n) noexcept {
    const std::array<double, 3> now{-block.load[kFz][n], block.x_m[n], block.y_m[n]};
    if (!is_known_ || now != last_) contact_ = pressure_.spread(now[0], now[1], now[2], part_);
    is_known_ = true;
    last_ = now;
    std::copy(part_.begin(), part_.end(), parts_.begin() + std::ptrdiff_t(n * part_.size()));
    area_m2_[n] = contact_.area_m2;
    on_array_[n] = contact_.is_whole ? 1 : std::accumulate(part_.begin(), part_.end(), 0.0);
}

// Runs the effects of one taxel over the block, of which *one_ has the surroundings.
void TaxelArray::run(std::size_t i, const Block& block) noexcept {
    Block& one = *one_;
    const Sensor& taxel = taxels_[i];
    for (std::size_t k = 0; k < taxel.n(); ++k) std::fill_n(one.channel[k].begin(), one.n, taxel.zero[k]);
    std::unique_ptr<Effect>* const effect = effects_.data() + i * per_taxel_;
    for (std::size_t n = 0; n < one.n; ++n) {
        one.missing[n] = 0;
        const double part = parts_[n * taxels_.size() + i];
        for (std::size_t axis = kFx; axis <= kFz; ++axis)
            one.load[axis][n] = one.drive[axis][n] = block.load[axis][n] * part;
        one.load[kMx][n] = one.load[kMy][n] = one.drive[kMx][n] = one.drive[kMy][n] = 0;
    }
    for (std::size_t e = 0; e < of_material_; ++e) effect[e]->apply(one);
    for (std::size_t k = 0; k < taxel.n(); ++k)
        for (std::size_t axis = 0; axis < kAxes; ++axis)
            if (const double gain = taxel.gain[k][axis]; gain != 0)
                for (std::size_t n = 0; n < one.n; ++n) one.channel[k][n] += gain * one.drive[axis][n];
    for (std::size_t e = of_material_; e < per_taxel_; ++e) effect[e]->apply(one);
    for (std::size_t k = 0; k < taxel.n(); ++k)
        for (std::size_t n = 0; n < one.n; ++n)
            values_[n * size_ + k * taxels_.size() + i] = float((one.missing[n] >> k & 1u) != 0 ? kNaN : one.channel[k][n]);
}

void TaxelArray::apply(Block& block) noexcept {
    Block& one = *one_;
    one.first = block.first;
    one.n = block.n;
    for (std::size_t n = 0; n < block.n; ++n) {
        one.t_s[n] = block.t_s[n];
        one.x_m[n] = one.y_m[n] = 0;
        one.radius_m[n] = taxels_[0].pitch_m / 2;
        one.slide_m[n] = block.slide_m[n];
        one.speed_m_s[n] = block.speed_m_s[n];
        one.ambient_K[n] = block.ambient_K[n];
        one.body_K[n] = block.body_K[n];
        one.acceleration_m_s2[n] = block.acceleration_m_s2[n];
    }
    for (std::size_t n = 0; n < block.n; ++n) spread(block, n);
    for (std::size_t i = 0; i < taxels_.size(); ++i) run(i, block);
    for (std::size_t n = 0; n < block.n; ++n) {
        if (on_array_[n] == 1) continue;
        block.x_m[n] = block.y_m[n] = kNaN;
        for (const Axis axis : {kFx, kFy, kFz}) block.load[axis][n] *= on_array_[n];
        for (const Axis axis : {kMx, kMy}) block.load[axis][n] = kNaN;
    }
}

}  // namespace tactiled::sim
