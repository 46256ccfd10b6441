// Effects of the converter and the link against closed forms.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "one_effect.hpp"

namespace tactiled::sim {
namespace {

double rms(const std::vector<double>& x, double mean, std::size_t from = 0) {
    double sum = 0;
    for (std::size_t n = from; n < x.size(); ++n) sum += (x[n] - mean) * (x[n] - mean);
    return std::sqrt(sum / double(x.size() - from));
}

// Returns the amplitude of a sine on channel k after an effect.
double sine_gain(const std::string& effect, const std::string& model, double frequency_Hz, std::size_t k,
                 const std::string& keys = "") {
    const Scene scene = scene_with(
        model, keys + press(0.4, 0.1) +
                   fmt::format("[[motion]]\ndo = \"shake\"\namplitude_N = 0.2\nfrom_Hz = {}\nfor_s = 20\n", frequency_Hz));
    const Recording is = run(scene, effect), ideal = run(scene, "none");
    double a = 0, b = 0, c = 0;  // over whole periods after two seconds
    for (std::size_t n = 5000; n < 20000; ++n) {
        const double turn = 2 * std::numbers::pi * frequency_Hz * is.t_s[n], mean = ideal.channel[k][99];
        a += (is.channel[k][n] - mean) * std::sin(turn);
        b += (is.channel[k][n] - mean) * std::cos(turn);
        c += std::abs(scene.sensors[0].gain[k][kFz]) * 0.2 / 2;
    }
    return std::hypot(a, b) / c;
}

// AD7746 at 10 Hz: 0.757 at 4 Hz, 0.955 at 5/3 Hz.
TEST(ConverterWindow, AttenuatesAsSinc) {
    EXPECT_NEAR(sine_gain("converter_window", "capacitive", 4, 4), 0.757, 0.001);
    EXPECT_NEAR(sine_gain("converter_window", "capacitive", 5.0 / 3, 4), 0.955, 0.001);
    EXPECT_NEAR(sine_gain("converter_window", "capacitive", 4, 5), 1, 0.001) << "the film has another converter";
}

TEST(ConverterWindow, NeedsNoWholeNumberOfSamples) {
    const Scene scene = scene_with("table", "[effects.converter_window]\nwindow_s = 0.0123\n" + press(1, 1));
    const Recording is = run(scene, "converter_window");
    EXPECT_NEAR(is.channel[0][900] / scene.sensors[0].gain[0][kFz], -(0.9 - 0.0123 / 2),
                1e-9);  // a ramp is delayed by half the window
}

TEST(AntiAlias, HalvesAtItsCorner) {
    EXPECT_NEAR(sine_gain("anti_alias", "table", 5, 0, "[effects.anti_alias]\ncorner_Hz = 5\n"), 0.5, 1e-4);
    EXPECT_NEAR(sine_gain("anti_alias", "table", 1, 0, "[effects.anti_alias]\ncorner_Hz = 5\n"), 1 / 1.04, 1e-4);
}

// A ramp is delayed by 2 / w_c: with the corner at a quarter of the rate, 4 / (pi rate).
TEST(AntiAlias, DelaysARampByTwiceItsTimeConstant) {
    for (const double rate_Hz : {1000.0, 200.0}) {
        const Scene scene = scene_with("table", press(1, 1), fmt::format("rate_Hz = {}", rate_Hz));
        const Recording is = run(scene, "anti_alias");
        const double late_s = 0.9 + is.channel[0][std::size_t(0.9 * rate_Hz)] / scene.sensors[0].gain[0][kFz];
        EXPECT_NEAR(late_s, 4 / (std::numbers::pi * rate_Hz), 1e-9) << rate_Hz << " Hz";
    }
}

// The jump takes one sample, h: its response is the mean of 1 - (1 + w t) exp(-w t) over the last h.
TEST(AntiAlias, AnswersAJumpAsTwoPoles) {
    const Scene scene = scene_with("table", hold(0.01) + press(1, 0.01, "at_once") + hold(0.1));
    const Recording is = run(scene, "anti_alias"), ideal = run(scene, "none");
    std::size_t at = 0;
    while (ideal.load[kFz][at] == 0) ++at;
    const double w = std::numbers::pi / 2 * 1000, h = 1e-3;
    const auto risen = [&](double t) { return t - 2 / w + (t + 2 / w) * std::exp(-w * t); };  // its integral
    for (std::size_t n = 0; n < 20; ++n) {
        const double t = double(n + 1) * h, expected = (risen(t) - risen(t - h)) / h;
        EXPECT_NEAR(-is.channel[0][at + n] / scene.sensors[0].gain[0][kFz], expected, 1e-9) << n;
    }
}

TEST(AntiAlias, PassesWhatStandsStillToTheLastBit) {
    const Scene scene = scene_with("capacitive", "[effects.anti_alias]\ncorner_Hz = 1e-3\n" + hold(0.5), "rate_Hz = 100000");
    const Recording is = run(scene, "anti_alias");
    for (const double x : is.channel[4]) ASSERT_EQ(x, scene.sensors[0].zero[4]);
}

// 900 Hz sampled at 1 kHz is a line at 100 Hz, with the filter's amplitude at 900 Hz, 1 / (1 + 3.6^2), and its phase
// there. A filter of the samples alone would give 1 / (1 + 0.4^2).
TEST(AntiAlias, LeavesOfALineThatFoldsWhatItLeavesAtTheLinesOwnFrequency) {
    for (const double line_Hz : {900.0, 1100.0, 730.0, 400.0}) {
        const Scene scene =
            scene_with("table", press(0.4, 0.1) + fmt::format("[[motion]]\ndo = \"shake\"\namplitude_N = 0.2\nfrom_Hz = {}\n"
                                                              "for_s = 1.1\n",
                                                              line_Hz));
        const Recording is = run(scene, "anti_alias");
        const double gain = scene.sensors[0].gain[0][kFz], turn = 2 * std::numbers::pi * line_Hz;
        double in_phase = 0, quadrature = 0;
        for (std::size_t n = 200; n < 1200; ++n) {
            const double t = is.t_s[n] - 0.1, reads = -is.channel[0][n] / gain - 0.4;
            in_phase += reads * std::sin(turn * t) / 500;
            quadrature += reads * std::cos(turn * t) / 500;
        }
        const double r = line_Hz / 250, scale = 0.2 / ((1 + r * r) * (1 + r * r));  // 1 / (1 + i r)^2
        EXPECT_NEAR(in_phase, scale * (1 - r * r), 0.01 * 0.2 / (1 + r * r)) << line_Hz;
        EXPECT_NEAR(quadrature, -scale * 2 * r, 0.01 * 0.2 / (1 + r * r)) << line_Hz;
    }
}

TEST(ChannelSkew, ReadsTheFirstElectrodeFourStepsBeforeTheLast) {
    const Scene scene = scene_with("capacitive", press(1, 2));
    const Recording is = run(scene, "channel_skew"), ideal = run(scene, "none");
    EXPECT_NEAR(is.channel[0][1500], ideal.channel[0][1100], 1e-12);
    EXPECT_NEAR(is.channel[3][1500], ideal.channel[3][1400], 1e-12);
    EXPECT_EQ(is.channel[4][1500], ideal.channel[4][1500]);
    EXPECT_EQ(is.channel[5][1500], ideal.channel[5][1500]);
}

// 1 kOhm over 500 Hz: 90.7 nV; a quarter of 3.3 V corresponds to 1.
TEST(JohnsonNoise, HasNyquistsPower) {
    const Scene scene = scene_with("table", hold(20));
    EXPECT_NEAR(rms(run(scene, "johnson_noise").channel[0], 0), 90.7e-9 * 4 / 3.3, 2e-9);
}

// Equal power in each decade: averaging over ten times as long reduces the power by a fifth, not to a tenth.
TEST(FlickerNoise, HardlyAveragesOut) {
    const Scene scene = scene_with("table", hold(100));
    const std::vector<double> x = run(scene, "flicker_noise").channel[0];
    const auto of_means = [&](std::size_t length) {
        std::vector<double> means;
        for (std::size_t n = 0; n + length <= x.size(); n += length) {
            double sum = 0;
            for (std::size_t i = 0; i < length; ++i) sum += x[n + i];
            means.push_back(sum / double(length));
        }
        return rms(means, 0);
    };
    EXPECT_GT(of_means(100), 0.6 * of_means(1));
    EXPECT_GT(of_means(1000), 0.7 * of_means(100));
}

TEST(MainsHum, Folds) {
    const Scene scene = scene_with("table", hold(10), "rate_Hz = 60");
    const std::vector<double> x = run(scene, "mains_hum").channel[0];
    for (std::size_t n = 6; n < x.size(); ++n) EXPECT_NEAR(x[n], x[n - 6], 1e-12);  // 50 Hz at 60 Hz: 10 Hz
    EXPECT_GT(std::abs(x[3] - x[0]), 0);
}

TEST(Spikes, ComeAsOftenAsTheyShallAndGo) {
    const Scene scene = scene_with("table", "[effects.spikes]\nrate_1_s = 2\ntime_s = 1e-3\n" + hold(200));
    const std::vector<double> x = run(scene, "spikes").channel[0];
    int begun = 0;
    for (std::size_t n = 1; n < x.size(); ++n) {
        const double decayed = x[n - 1] * std::exp(-1.0);
        begun += std::abs(x[n] - decayed) > 1e-9;
    }
    EXPECT_NEAR(begun, 400, 60);
}

TEST(LeadWires, TakeTheirShareOfTheGain) {
    const Scene scene = scene_with("table", "[effects.lead_wires]\nshare = 0.01\n" + press(1, 0.1) + hold(0.1));
    EXPECT_NEAR(run(scene, "lead_wires").channel[0].back() / scene.sensors[0].gain[0][kFz], -1 / 1.01, 1e-12);
}

TEST(ExcitationDrift, WarmsUp) {
    const Scene scene =
        scene_with("table", "[effects.excitation_drift]\namount = 0.01\ntime_s = 1\n" + press(1, 0.1) + hold(2));
    EXPECT_NEAR(run(scene, "excitation_drift").channel[0][1000] / scene.sensors[0].gain[0][kFz],
                -(1 + 0.01 * (1 - std::exp(-1.0))), 1e-9);
}

TEST(PiezoAmplifier, ClipsTheFilmAndNothingElse) {
    const Scene scene = scene_with("capacitive", "[effects.piezo_amplifier]\nrail_V = 1\n" + press(10, 1) + hold(0.1));
    const Recording is = run(scene, "piezo_amplifier"), ideal = run(scene, "none");
    EXPECT_NEAR(is.channel[5].back() - scene.sensors[0].zero[5], 1, 1e-12);
    EXPECT_EQ(is.channel[0], ideal.channel[0]);
}

TEST(Quantisation, KnowsMultiplesOfItsStepOnly) {
    const Scene scene = scene_with("capacitive", press(1, 1));
    const Recording is = run(scene, "quantisation"), ideal = run(scene, "none");
    for (std::size_t n = 0; n < is.t_s.size(); ++n) {
        const double steps = is.channel[4][n] / 4e-6;  // AD7746: 4 aF
        EXPECT_NEAR(steps, std::round(steps), 1e-6);
        EXPECT_LE(std::abs(is.channel[4][n] - ideal.channel[4][n]), 2.0001e-6);
    }
}

TEST(Saturation, EndsAtTheSaturationLimit) {
    const Scene scene = scene_with("hair", press(1, 1));
    const Sensor& sensor = scene.sensors[0];
    const double rail = 1.25 * (std::abs(sensor.gain[0][kFx]) + std::abs(sensor.gain[0][kFz])) * sensor.full_scale_N;
    EXPECT_NEAR(run(scene, "saturation").channel[0].back(), rail, 1e-15);
}

TEST(ConverterNonlinearity, IsLargestAtOneOverRootThree) {
    const Scene scene = scene_with("table", "[effects.converter_nonlinearity]\ninl = 0.01\n" + press(2, 1));
    const Recording is = run(scene, "converter_nonlinearity"), ideal = run(scene, "none");
    const Sensor& sensor = scene.sensors[0];
    const double range = std::abs(sensor.gain[0][kFx]) + std::abs(sensor.gain[0][kFz]);
    double max = 0, at = 0;
    for (std::size_t n = 0; n < is.t_s.size(); ++n)
        if (is.channel[0][n] - ideal.channel[0][n] > max) {
            max = is.channel[0][n] - ideal.channel[0][n];
            at = ideal.channel[0][n];
        }
    EXPECT_NEAR(max, 0.01 * range, 1e-4 * 0.01 * range);
    EXPECT_NEAR(at / range, 1 / std::sqrt(3), 0.01);
}

// Bursts of 1 / q frames, begun by each p-th; lost frames are counted in the next one that arrives.
TEST(LostFrames, ComeInBursts) {
    const Scene scene = scene_with("table", "[effects.lost_frames]\nbegins = 0.01\nends = 0.25\nmost = 100\n" + hold(200));
    const Recording is = run(scene, "lost_frames");
    std::size_t dropped = 0, bursts = 0, lost = 0, waiting = 0;
    for (std::size_t n = 0; n < is.t_s.size(); ++n) {
        dropped += is.dropped[n];
        bursts += is.lost[n] > 0;
        lost += is.lost[n];
        waiting = is.dropped[n] ? waiting + 1 : 0;
    }
    EXPECT_EQ(lost + waiting, dropped);
    EXPECT_NEAR(double(dropped) / double(bursts), 4, 0.3);
    EXPECT_NEAR(double(bursts), 0.01 * double(is.t_s.size() - dropped), 130);
}

TEST(DeadChannel, SticksAtItsLastReading) {
    const Scene scene = scene_with("table", "[effects.dead_channel]\nrate_1_h = 3600\n" + press(1, 10));
    const Recording is = run(scene, "dead_channel"), ideal = run(scene, "none");
    for (std::size_t k = 0; k < 8; ++k) {
        std::size_t n = 0;
        while (n < is.t_s.size() && is.channel[k][n] == ideal.channel[k][n]) ++n;
        for (std::size_t m = n; m < is.t_s.size(); ++m) EXPECT_EQ(is.channel[k][m], is.channel[k][n]);
    }
}

TEST(BitErrors, ChangeAValueByAPowerOfTwo) {
    const Scene scene = scene_with("capacitive", "[effects.bit_errors]\nprobability = 1e-4\nbits = 24\n" + hold(10));
    const Recording is = run(scene, "bit_errors");
    int hits = 0;
    for (const double x : is.channel[4]) {
        const double change = std::abs(x - scene.sensors[0].zero[4]);
        if (change == 0) continue;
        ++hits;
        const double bit = std::log2(change / 4e-6);
        EXPECT_NEAR(bit, std::round(bit), 1e-6);
    }
    EXPECT_NEAR(hits, 1e-4 * 24 * 1e4, 25);
}

}  // namespace
}  // namespace tactiled::sim
