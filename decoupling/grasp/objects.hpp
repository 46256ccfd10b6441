// Finds the taught object that has a given weight, or none.
#pragma once
#include <array>
#include <span>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

struct Recognised {
    std::uint32_t id = 0;    // 0 = not known
    double probability = 0;  // probability of this object, against another taught one and an unknown one
    std::array<char, TACTILED_NAME_SIZE> name{};
};

class Objects {
public:
    void teach(std::span<const Object> objects) noexcept;  // uses the first kMaxObjects with a mass and an id
    [[nodiscard]] Recognised recognise(double mass_kg, double sd_kg) const noexcept;

private:
    struct Known {
        std::uint32_t id = 0;
        double mass_kg = 0, sd_kg = 0;
        std::array<char, TACTILED_NAME_SIZE> name{};
    };
    std::array<Known, Grasp::kMaxObjects> known_{};
    std::size_t n_ = 0;
};

}  // namespace tactiled::grasp
