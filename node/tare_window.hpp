// The mean of a tare, and a check that the sensor was at rest: a mean over a motion is not a zero.
#pragma once
#include <array>
#include <cstdint>

#include "decoupling/decoupler.hpp"

namespace tactiled {

class TareWindow {
public:
    // rt: wait-free
    void begin(std::uint64_t now_ns, std::uint64_t length_ns) noexcept;
    [[nodiscard]] std::uint64_t begin_ns() const noexcept { return begin_ns_; }

    // Takes a raw wrench that was measured at `t_ns`, not before begin_ns(). Returns true if it was the last:
    // the time is over, and there are 8 samples. rt: wait-free
    bool add(const Wrench& raw_S, std::uint64_t t_ns) noexcept;

    [[nodiscard]] unsigned samples() const noexcept { return samples_; }
    // NaN for components that the sensor does not measure.
    [[nodiscard]] Wrench mean_S() const noexcept;
    // Returns true if the means of the quarters differ by more than 3 standard deviations `sd` of a sample, as its
    // model states them, and what the samples' own noise explains. A component whose sd is NaN is judged by its noise
    // alone. At least 8 samples were added. rt: wait-free
    [[nodiscard]] bool has_moved(const Wrench& sd) const noexcept;

private:
    // a push and its end within the window change the middle relative to both ends
    static constexpr std::size_t kParts = 4;

    std::uint64_t begin_ns_ = 0, length_ns_ = 0;
    unsigned samples_ = 0;
    std::array<unsigned, kParts> n_{};
    std::array<Wrench, kParts> sum_{};
    Wrench before_{};                        // the last one
    Wrench steps_{}, largest_{}, second_{};  // squared differences of neighbours: their sum and the two largest
};

}  // namespace tactiled
