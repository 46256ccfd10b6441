// The way of a good reading through CheckedModel, which nearly all readings take: one comparison for all channels, one for
// all components, two numbers at a time. All others: checked.cpp.
#pragma once
#include <cassert>

#include "decoupling/solve/checked.hpp"
#include "decoupling/solve/pairs.hpp"

namespace tactiled {

template <typename Solve>
inline Estimate CheckedModel::checked(const Reading& reading, Solve solve) noexcept {
    Estimate estimate;
    if (reading.channel.size() != n_) [[unlikely]] {
        forget();
        estimate.reasons = TACTILED_WRONG_DEVICE;
        return estimate;
    }
    alignas(16) double r[kMaxChannels];
    Input input{.r = {r, n_}, .usable = used_, .outside = false, .t_ns = reading.t_ns};
    if (!(n_ == 8 ? is_plain<8>(reading, r) : is_plain<0>(reading, r))) [[unlikely]] {
        const Looked looked = look_at_each(reading, r);
        estimate.reasons = looked.reasons;
        if (looked.bad) {
            forget();
            return estimate;
        }
        input.usable = looked.usable;
        input.outside = looked.outside;
    }
    solve(input, estimate);
    // The third pair is my mz: most sensors have none of the two.
    if (has_third_) {
        finish<3>(input.outside, input.sd_factor.data(), estimate);
    } else {
        store(estimate.wrench_S.data() + 4, both(kNaN));
        finish<2>(input.outside, input.sd_factor.data(), estimate);
    }
    if (estimate.quality == TACTILED_BAD) [[unlikely]]
        forget();
    return estimate;
}

// False where a channel is not plain. `r` is set in any case, with 0 up to 8. `kChannels`: so many (even), 0 = any number.
template <std::size_t kChannels>
inline bool CheckedModel::is_plain(const Reading& reading, double* r) const noexcept {
    const double* channel = reading.channel.data();
    const ChannelPair* pair = channels_;
    PairMask plain = kTrue;
    const auto look = [&](Pair value) {
        store(r, value - pair->zero);
        plain = both_true(plain, between(pair->min, value, pair->max));
        channel += 2, r += 2, ++pair;
    };
    static_assert(kChannels % 2 == 0 && kChannels <= 8);
    if constexpr (kChannels != 0) {
#pragma GCC unroll 4
        for (std::size_t k = 0; k < kChannels; k += 2) look(load(channel));
#pragma GCC unroll 4
        for (std::size_t k = kChannels; k < 8; k += 2, r += 2) store(r, both(0));
    } else {
        const double* const end = channel + n_;
#pragma GCC unroll 4
        for (std::size_t k = 0; k < 8; k += 2) store(r + k, both(0));
        while (channel + 1 < end) look(load(channel));
        if (channel < end) look(Pair{*channel, 0});  // 0, 0 .. 0 stand beside the last
    }
    return hold(plain) && ((reading.missing | reading.saturated) & all_) == 0;
}

template <std::size_t kPairs>
inline Estimate CheckedModel::finished(const Pair (&wrench)[kPairs], const double* sd_factor,
                                       double residual) const noexcept {
    assert(kPairs == 3 || !has_third_);
    Estimate estimate;
    estimate.residual = residual;
#pragma GCC unroll 3
    for (std::size_t i = 0; i < kPairs; ++i) store(estimate.wrench_S.data() + 2 * i, wrench[i]);
    finish<kPairs>(false, sd_factor, estimate);
    return estimate;
}

// Quality, reasons and deviations of what solve() found.
template <std::size_t kPairs>
inline void CheckedModel::finish(bool outside, const double* sd_factor, Estimate& estimate) const noexcept {
    double* const wrench = estimate.wrench_S.data();
    Pair seen[kPairs];
    PairMask plain = kTrue;
#pragma GCC unroll 3
    for (std::size_t i = 0; i < kPairs; ++i) {
        seen[i] = only(load(wrench + 2 * i), components_[i].seen);  // else 0
        plain = both_true(plain, up_to(magnitude(seen[i]), components_[i].max));
    }
    if (!hold(plain)) [[unlikely]] {
        std::array<double, 6> copy;
        std::copy_n(sd_factor, 6, copy.begin());
        return finish_hard(outside, copy.data(), estimate);
    }
#pragma GCC unroll 3
    for (std::size_t i = 0; i < kPairs; ++i) store(wrench + 2 * i, with(seen[i], components_[i].unseen_nan));
    estimate.reasons |= always_ | (outside ? std::uint32_t(TACTILED_OUTSIDE_DOMAIN) : 0u);
    estimate.quality = estimate.reasons == 0 ? TACTILED_GOOD : TACTILED_UNCERTAIN;
    if ((estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) != 0) return;
#pragma GCC unroll 3
    for (std::size_t i = 0; i < kPairs; ++i) {
        const auto& of = components_[i];
        const Pair sloped = of.slope * seen[i];
        const Pair sd = load(sd_factor + 2 * i) * root(of.sd_squared + sloped * sloped);
        store(estimate.sd.data() + 2 * i, with(sd, of.unseen_nan));
    }
}

}  // namespace tactiled
