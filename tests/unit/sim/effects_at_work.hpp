// Runs chosen effects on loads that a test specifies, sample by sample, without a motion.
#pragma once
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

struct Moment {
    std::array<double, kAxes> load{};  // N, Nm
    double x_m = 0, y_m = 0, radius_m = 1e-3, ambient_K = 0, body_K = 0;
};

struct Reading {
    std::array<double, kAxes> drive{};
    std::array<double, kMaxSensorChannels> channel{};
};

inline Moment press(double N) { return {.load = {0, 0, -N, 0, 0}}; }

class AtWork {
public:
    // `keys` are added to the sensor's table, `rest` after it: [body], [effects.NAME]. `effects` in the order of the
    // chain.
    AtWork(const std::string& model, std::vector<std::string> effects, const std::string& keys = "",
           const std::string& rest = "", double rate_Hz = 1000, int seed = 1) {
        const std::string text = "format = 1\ntitle = \"t\"\nseed = " + std::to_string(seed) +
                                 "\nrate_Hz = " + std::to_string(rate_Hz) + "\n[[sensor]]\nname = \"s\"\nmodel = \"" +
                                 model + "\"\n" + keys + "\n[[motion]]\ndo = \"press\"\nto_N = 1\nin_s = 1000\n" + rest;
        Problems problems;
        scene_ = read_scene(Options::parse_text(text, "scene.toml", problems), problems);
        extent_ = scene_.motion.extent(sensor());
        for (const auto& name : effects) {
            std::size_t i = 0;
            while (i < chain().size() && chain()[i]->name != name) ++i;
            EXPECT_LT(i, chain().size()) << name;
            effects_.push_back(chain()[i]->make(scene_.setting(i, sensor(), extent_)));
            stages_.push_back(chain()[i]->stage);
        }
    }
    AtWork(const AtWork&) = delete;
    AtWork& operator=(const AtWork&) = delete;

    [[nodiscard]] const Sensor& sensor() const { return scene_.sensors[0]; }

    Reading operator()(const Moment& moment) { return run({moment})[0]; }

    std::vector<Reading> run(const std::vector<Moment>& moments) {
        std::vector<Reading> readings;
        Block b{};
        for (std::size_t at = 0; at < moments.size(); at += b.n) {
            b.first = next_;
            b.n = std::min(Block::kSize, moments.size() - at);
            next_ += b.n;
            for (std::size_t n = 0; n < b.n; ++n) {
                const Moment& m = moments[at + n];
                for (std::size_t axis = 0; axis < kAxes; ++axis) b.load[axis][n] = b.drive[axis][n] = m.load[axis];
                b.x_m[n] = m.x_m;
                b.y_m[n] = m.y_m;
                b.radius_m[n] = m.radius_m;
                b.ambient_K[n] = m.ambient_K;
                b.body_K[n] = m.body_K;
            }
            std::size_t i = 0;
            for (; i < effects_.size() && stages_[i] == Stage::material; ++i) effects_[i]->apply(b);
            for (std::size_t n = 0; n < b.n; ++n)
                for (std::size_t k = 0; k < sensor().n(); ++k) {
                    b.channel[k][n] = sensor().zero[k];
                    for (std::size_t axis = 0; axis < kAxes; ++axis)
                        b.channel[k][n] += sensor().gain[k][axis] * b.drive[axis][n];
                }
            for (; i < effects_.size(); ++i) effects_[i]->apply(b);
            for (std::size_t n = 0; n < b.n; ++n) {
                Reading& r = readings.emplace_back();
                for (std::size_t axis = 0; axis < kAxes; ++axis) r.drive[axis] = b.drive[axis][n];
                for (std::size_t k = 0; k < sensor().n(); ++k) r.channel[k] = b.channel[k][n];
            }
        }
        return readings;
    }

private:
    Scene scene_;
    Extent extent_;
    std::vector<std::unique_ptr<Effect>> effects_;
    std::vector<Stage> stages_;
    std::uint64_t next_ = 0;
};

}  // namespace tactiled::sim
