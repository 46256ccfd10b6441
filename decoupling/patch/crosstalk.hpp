// Crosstalk of taxels: each shows the part c of the force on each of its neighbours, m = (I + c A) f.
//
// Gauss-Seidel iteration, f_i = m_i - c sum f_neighbours, is exact for any f: the matrix is dominated by its diagonal, as 4
// c < 1, and each sweep reduces the error to (4 c)^2 of it or less in a grid (Young, Iterative Solution of Large Linear
// Systems, 1971, consistently ordered matrices). The sweeps leave less than 1 / 1000 of the crosstalk.
#pragma once
#include <cmath>
#include <vector>

#include "decoupling/patch/taxel_law.hpp"

namespace tactiled {

inline constexpr std::array<Parameter, 1> kCrosstalkParameters{
    {{"crosstalk", "part of a taxel's force that each neighbour shows as well", 0, 0.2, 0}}};

class Crosstalk {
public:
    // setup
    Crosstalk(const TaxelPlaces& places, double part)
        : places_(places),
          part_(float(part)),
          sweeps_(part > 0 ? int(std::ceil(std::log(1e-3) / std::log(16 * part * part))) : 0) {
        if (part > 0) shown_.assign(places.n, 0);
    }

    // Replaces the forces that the taxels show, all finite, by those on them. rt: wait-free
    void remove(TaxelForces& forces) noexcept {
        for (auto& force : forces.component) {
            if (force.empty() || sweeps_ == 0) continue;
            shown_ = force;  // of one size: no allocation
            for (int sweep = 0; sweep < sweeps_; ++sweep)
                for (std::size_t i = 0; i < places_.n; ++i) {
                    const TaxelPlaces::Neighbours& beside = places_.neighbours[i];
                    float others = 0;
                    for (std::size_t k = 0; k < beside.n; ++k) others += force[beside.of[k]];
                    force[i] = shown_[i] - part_ * others;
                }
        }
    }

private:
    const TaxelPlaces& places_;
    float part_;
    int sweeps_;
    std::vector<float> shown_;
};

}  // namespace tactiled
