// A running scene: for each sensor a line of steps, which are the chosen effects and the linear model between them.
#pragma once
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sim/choose.hpp"
#include "drivers/sim/scene.hpp"
#include "drivers/sim/taxel_array.hpp"

namespace tactiled::sim {

class Simulation {
public:
    // `effects`: as in choose(). `scene` must outlive it. setup: throws SetupError
    Simulation(const Scene& scene, const std::string& effects, std::size_t block_size = Block::kSize);

    // Returns the next samples of a sensor; n = 0 at the scene's end. The same scene, effects and seed give the same
    // bits, for any block size, order of the sensors and machine (IEEE 754 and the same libm). rt: wait-free; no
    // allocation
    const Block& advance(std::size_t sensor) noexcept;

    // The taxels of the last block of a sensor that is an array, else nullptr. The block has the load of all of them, and no
    // channels. rt: wait-free
    [[nodiscard]] const TaxelArray* array(std::size_t sensor) const noexcept { return lines_[sensor].array.get(); }

    [[nodiscard]] const Choice& choice(std::size_t sensor) const { return lines_[sensor].choice; }
    [[nodiscard]] const Scene& scene() const { return scene_; }
    // Enables shares_N(), not of an array: the largest change of a channel by each chosen effect so far, N, in the order of
    // choice().decisions. It costs as much as the effects themselves, so it is off by default.
    void measure_shares(bool on) { measures_shares_ = on; }
    [[nodiscard]] const std::vector<double>& shares_N(std::size_t sensor) const { return lines_[sensor].shares_N; }
    // Restarts the measurement. rt: wait-free
    void reset_shares(std::size_t sensor) noexcept {
        std::fill(lines_[sensor].shares_N.begin(), lines_[sensor].shares_N.end(), 0.0);
    }

    // Enables times_ns(): ns that each chosen effect has taken so far, in the order of choice().decisions, and last
    // the linear model. The clock is read once in each step of a block. Off by default; shares_N are not measured
    // with it.
    void measure_times(bool on) { measures_times_ = on; }
    [[nodiscard]] const std::vector<std::uint64_t>& times_ns(std::size_t sensor) const { return lines_[sensor].times_ns; }

private:
    struct Step {
        std::unique_ptr<Effect> effect;
        Stage stage;
        std::size_t decision;                                          // one beyond the last: the linear model
        std::vector<std::pair<std::uint64_t, std::uint64_t>> rests{};  // samples, first and one beyond the last, in order
        std::size_t next_rest = 0;
    };
    struct Line {
        const Sensor* sensor;
        Extent extent;
        Choice choice;
        std::unique_ptr<TaxelArray> array{};
        std::vector<Step> steps;
        std::vector<double> shares_N;
        std::vector<std::uint64_t> times_ns;
        std::unique_ptr<Block> block;
        std::uint64_t next = 0;
    };
    static bool rests(Step& step, std::uint64_t first) noexcept;
    void apply_and_measure(Line& line) noexcept;
    void apply_and_time(Line& line) noexcept;

    const Scene& scene_;
    std::size_t block_size_;
    std::vector<Line> lines_;
    bool measures_shares_ = false, measures_times_ = false;
};

}  // namespace tactiled::sim
