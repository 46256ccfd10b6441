// Crosstalk of taxels: each shows the part c of the force on each of its neighbours, m = (I + c A) f.
//
// Gauss-Seidel iteration, f_i = m_i - c sum f_neighbours, is exact for any f: the matrix is dominated by its diagonal, as 4
// c < 1, and each sweep reduces the error to (4 c)^2 of it or less in a grid (Young, Iterative Solution of Large Linear
// Systems, 1971, consistently ordered matrices). The sweeps leave less than 1 / 1000 of the crosstalk.
#pragma once
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
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

    // The rms of a row of the inverse, the factor of the noise, at the taxel in the middle, where it is the largest. setup
    [[nodiscard]] float noise_gain() {
        if (sweeps_ == 0 || places_.n == 0) return 1;
        const auto mean = [](const std::vector<float>& x) { return std::reduce(x.begin(), x.end()) / float(x.size()); };
        const float x = mean(places_.x), y = mean(places_.y), z = mean(places_.z);
        std::size_t middle = 0;
        const auto distance = [&](std::size_t i) {
            return std::hypot(std::hypot(places_.x[i] - x, places_.y[i] - y), places_.z[i] - z);
        };
        for (std::size_t i = 0; i < places_.n; ++i)
            if (distance(i) < distance(middle)) middle = i;
        TaxelForces forces;
        forces.component[2].assign(places_.n, 0);
        forces.component[2][middle] = 1;
        remove(forces);
        float squares = 0;
        for (const float f : forces.component[2]) squares += f * f;
        return std::sqrt(squares);
    }

    [[nodiscard]] bool is_any() const noexcept { return sweeps_ > 0; }
    // Replaces the forces that the taxels show, all finite, by those on them. rt: wait-free
    void remove(TaxelForces& forces) noexcept {
        for (auto& force : forces.component) {
            if (force.empty() || !is_any()) continue;
            shown_ = force;  // no allocation: their sizes are equal
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

// Returns what is wrong with the parameter, or "": A has to be symmetric. setup
inline std::string fault_of_crosstalk(const TaxelPlaces& places, double part) {
    for (std::size_t i = 0; i < places.n && part > 0; ++i)
        for (std::size_t k = 0; k < places.neighbours[i].n; ++k) {
            const TaxelPlaces::Neighbours& of = places.neighbours[places.neighbours[i].of[k]];
            if (std::find(of.of.begin(), of.of.begin() + of.n, std::uint16_t(i)) == of.of.begin() + of.n)
                return "crosstalk needs taxels with at most four neighbours at the same distance";
        }
    return "";
}

}  // namespace tactiled
