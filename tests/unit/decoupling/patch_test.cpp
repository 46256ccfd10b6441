#include "decoupling/patch/patch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <utility>

#include "tactiled/reader.h"
#include "tests/bench/pressed_array.hpp"

namespace tactiled {
namespace {

using pressed::Body;
using pressed::Kind;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinite = std::numeric_limits<float>::infinity();

// A 6 x 5 array of three axes without noise, and its frames.
class PatchTest : public testing::Test {
protected:
    PatchTest() {
        array_.rows = 6;
        array_.columns = 5;
        array_.values = 3;
        raw_.assign(90, 0);
        make();
    }
    void make() { patch_ = make_decoupler(calibration_); }
    Calibration with(const char* table, std::vector<std::vector<double>> rows) {
        Calibration c = calibration_;
        c.tables[table] = std::move(rows);
        return c;
    }
    Estimate decouple() {
        Reading reading;
        reading.taxels = {{30, 3}, raw_};
        is_new_ = true;
        return patch_->decouple(reading);
    }
    // The record of the last reading, which has one.
    const tactiled_array& record(std::uint32_t quality = TACTILED_GOOD) {
        tactiled_sample sample{};
        sample.quality = quality;
        if (std::exchange(is_new_, false)) {
            const auto* const words = static_cast<const std::uint64_t*>(patch_->patch()->record(sample));
            record_.assign(words, words + patch_->patch()->record_size() / 8);
        }
        return *reinterpret_cast<const tactiled_array*>(record_.data());
    }
    float force(std::size_t taxel, std::size_t component) { return tactiled_taxel_forces(&record())[taxel * 3 + component]; }
    unsigned state(std::size_t taxel) {
        tactiled_array_plan plan{};
        plan.n_taxels = 30, plan.n_components = 3;
        return tactiled_taxel_states(&record(), &plan)[taxel];
    }
    void press_at(std::size_t taxel, float counts) { raw_[60 + taxel] += counts; }
    void press_all(float counts) {
        for (std::size_t i = 0; i < 30; ++i) press_at(i, counts);
    }
    std::string fault_of(const Calibration& calibration) {
        DecouplerFault fault;
        EXPECT_EQ(make_decoupler(calibration, "", 0, fault), nullptr);
        return fault.text;
    }

    pressed::Array array_;
    Calibration calibration_ = pressed::calibration_of([] {
        pressed::Array a;
        a.rows = 6, a.columns = 5, a.values = 3;
        return a;
    }());
    std::vector<float> raw_;
    std::unique_ptr<Decoupler> patch_;
    bool is_new_ = true;
    std::vector<std::uint64_t> record_;
};

TEST_F(PatchTest, SumsForcesAndTheirMoments) {
    press_at(0, 2000);  // upper left: x = -4 mm, y = 5 mm
    raw_[29] = 500;     // lower right: 0.5 N along x at x = 4 mm, y = -5 mm
    const Estimate e = decouple();
    EXPECT_EQ(e.quality(), TACTILED_GOOD);
    EXPECT_NEAR(e.wrench_S[0], 0.5, 1e-6);
    EXPECT_NEAR(e.wrench_S[1], 0, 1e-6);
    EXPECT_NEAR(e.wrench_S[2], -2, 1e-6);
    EXPECT_NEAR(e.wrench_S[3], 5e-3 * -2, 1e-8);   // y fz
    EXPECT_NEAR(e.wrench_S[4], 4e-3 * -2, 1e-8);   // -x fz, x = -4 mm
    EXPECT_NEAR(e.wrench_S[5], 5e-3 * 0.5, 1e-8);  // -y fx
    EXPECT_NEAR(force(0, 2), -2, 1e-6);
    EXPECT_NEAR(force(29, 0), 0.5, 1e-6);
}

// The sd of the sum without a load is that of all taxels; under a load the gains' is added.
TEST_F(PatchTest, StatesTheSdOfTheSum) {
    EXPECT_NEAR(decouple().sd[2], std::sqrt(30.) * 0.005, 1e-9);
    press_all(1000);
    EXPECT_NEAR(decouple().sd[2], std::sqrt(30 * (0.005 * 0.005 + 0.02 * 0.02)), 1e-7);
    calibration_.sd_slope = {0, 0, 0.1, 0, 0, 0};
    make();
    EXPECT_NEAR(decouple().sd[2], std::sqrt(30 * (0.005 * 0.005 + 0.02 * 0.02) + 3 * 3), 1e-6);
}

TEST_F(PatchTest, ATaxelWithoutAValueHasTheMeanOfItsNeighboursInTheSum) {
    press_all(1000);
    raw_[60 + 12] = kNan;
    const Estimate e = decouple();
    EXPECT_EQ(e.quality(), TACTILED_GOOD);
    EXPECT_NEAR(e.wrench_S[2], -30, 1e-4);
    EXPECT_TRUE(std::isnan(force(12, 2)));
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_MISSING));
    EXPECT_EQ(record().n_out, 1u);
}

// The neighbours' own predictions say how far to trust that mean.
TEST_F(PatchTest, TheSdContainsWhatTheNeighboursDoNotPredict) {
    press_all(1000);
    const double even = decouple().sd[2];
    raw_[60 + 12] = kNan;
    EXPECT_NEAR(decouple().sd[2], even, 1e-3);
    for (const std::size_t beside : {7u, 17u, 11u, 13u}) raw_[60 + beside] = 3000;
    EXPECT_GT(decouple().sd[2], 1);
}

// The press of one body has no valley: a weak taxel in its middle is doubted, in the sd of force and moment as well.
TEST_F(PatchTest, DoubtsATaxelBelowTheTwoBesideIt) {
    press_all(1000);
    const double even = decouple().sd[2];
    press_at(12, -200);
    Estimate e = decouple();
    EXPECT_EQ(e.quality(), TACTILED_GOOD);  // 0.2 N of 30 N
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_DOUBTED));
    EXPECT_NEAR(force(12, 2), -0.8, 1e-6);
    EXPECT_NEAR(e.sd[2] * e.sd[2], even * even + 0.2 * 0.2, 1e-3);
    for (const std::size_t i : {2u, 7u, 17u, 22u, 27u}) press_at(i, -200);  // the whole column
    e = decouple();
    EXPECT_EQ(state(2) & state(27), unsigned(TACTILED_TAXEL_DOUBTED));
    EXPECT_NEAR(e.sd[2] * e.sd[2], even * even + 1.2 * 1.2, 1e-2);
    EXPECT_EQ(e.quality(), TACTILED_GOOD);  // 1.2 N of 28.8 N
    for (const std::size_t i : {2u, 7u, 12u, 17u, 22u, 27u}) press_at(i, -200);
    EXPECT_EQ(decouple().reasons, unsigned(TACTILED_DISAGREEMENT));
}

TEST_F(PatchTest, DoubtsNoSlopeNoEdgeAndNoNoise) {
    for (std::size_t i = 0; i < 30; ++i) press_at(i, float(i % 5) * 300 + (i / 5 > 2 ? 1000.f : 0.f));
    press_at(12, -20);  // 4 sd of 600
    EXPECT_EQ(decouple().quality(), TACTILED_GOOD);
    for (std::size_t i = 0; i < 30; ++i) EXPECT_EQ(state(i), 0u) << i;
}

// A needle is a press like another, unless the calibration states how narrow a contact may be.
TEST_F(PatchTest, DoubtsAPressOnOneTaxelWhereContactsAreWider) {
    press_at(12, 1000);
    EXPECT_EQ(decouple().quality(), TACTILED_GOOD);
    calibration_.parameters["narrowest_contact_mm"] = 6;
    make();
    const Estimate e = decouple();
    EXPECT_EQ(e.reasons, unsigned(TACTILED_DISAGREEMENT));
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_DOUBTED));
    EXPECT_GT(e.sd[2], 1);
    for (const std::size_t i : {7u, 11u, 13u, 17u}) press_at(i, 700);  // a ball of 6 mm
    EXPECT_EQ(decouple().quality(), TACTILED_GOOD);
    calibration_.parameters["narrowest_contact_mm"] = 3;
    EXPECT_NE(fault_of(calibration_).find("narrowest_contact_mm = 3 is less than two pitches, 4 mm"), std::string::npos);
}

// Each taxel shows a tenth of each neighbour's force: the forces on them are found again, in all components.
TEST_F(PatchTest, RemovesCrosstalk) {
    for (const double part : {0.01, 0.1, 0.2}) {
        calibration_.parameters["crosstalk"] = part;
        make();
        std::vector<float> on(90, 0);
        for (std::size_t i = 0; i < 90; ++i) on[i] = float((i * 37) % 11) * 100;
        for (std::size_t v = 0; v < 3; ++v)
            for (std::size_t i = 0; i < 30; ++i) {
                const std::size_t row = i / 5, column = i % 5;
                float others = 0;
                if (row > 0) others += on[v * 30 + i - 5];
                if (row < 5) others += on[v * 30 + i + 5];
                if (column > 0) others += on[v * 30 + i - 1];
                if (column < 4) others += on[v * 30 + i + 1];
                raw_[v * 30 + i] = on[v * 30 + i] + float(part) * others;
            }
        (void)decouple();
        for (std::size_t i = 0; i < 30; ++i) {
            EXPECT_NEAR(force(i, 0), double(on[i]) / 1000, 2e-3) << i << " " << part;
            EXPECT_NEAR(force(i, 2), -double(on[60 + i]) / 1000, 2e-3) << i << " " << part;
        }
    }
}

// With a tare of offsets and a dead taxel, in the domain of what the taxels show: no contact at rest, and no force.
TEST_F(PatchTest, PredictsBesideCrosstalkAfterATare) {
    calibration_.parameters["crosstalk"] = 0.1;
    calibration_.tables["dead"] = {{12}};
    make();
    for (std::size_t i = 0; i < 90; ++i) raw_[i] = float((i * 53) % 17) * 100;
    Patch& patch = *patch_->patch();
    patch.begin_tare();
    (void)decouple();
    patch.add_to_tare();
    const Estimate tared = decouple();
    (void)patch.end_tare(true);
    const Estimate after = decouple();
    for (std::size_t c = 0; c < 6; ++c) EXPECT_NEAR(after.wrench_S[c], tared.wrench_S[c], 1e-5) << c;
    EXPECT_EQ(record().n_contact, 0u);
}

// The inverse of crosstalk raises the noise of a taxel, and the limit of a contact with it.
TEST_F(PatchTest, CrosstalkMakesNoContactOfNoise) {
    calibration_.parameters["crosstalk"] = 0.2;
    make();
    std::mt19937_64 random(3);
    std::normal_distribution<float> noise(0, 5);
    int frames = 0;
    for (int k = 0; k < 1000; ++k) {
        for (float& value : raw_) value = noise(random);
        (void)decouple();
        frames += record().n_contact > 0 ? 1 : 0;
    }
    EXPECT_LE(frames, 20);  // at most 10 by the level
}

// The error of a predicted column exceeds a twentieth of the press.
TEST_F(PatchTest, IsUncertainWhereMuchOfThePressIsPredicted) {
    for (std::size_t i = 0; i < 30; ++i) press_at(i, i % 5 == 2 ? 2000 : i % 5 == 1 || i % 5 == 3 ? 1000 : 0);
    EXPECT_EQ(decouple().quality(), TACTILED_GOOD);
    raw_[60 + 12] = kNan;
    EXPECT_EQ(decouple().quality(), TACTILED_GOOD);
    for (const std::size_t i : {2u, 7u, 17u, 22u, 27u}) raw_[60 + i] = kNan;
    EXPECT_EQ(decouple().reasons, unsigned(TACTILED_MISSING_CHANNEL));
}

TEST_F(PatchTest, IsUncertainWhereATaxelHasNoNeighbours) {
    for (const std::size_t i : {12u, 7u, 17u, 11u}) raw_[60 + i] = kNan;
    const Estimate e = decouple();
    EXPECT_EQ(e.quality(), TACTILED_UNCERTAIN);
    EXPECT_NE(e.reasons & TACTILED_MISSING_CHANNEL, 0u);
    EXPECT_TRUE(std::isnan(e.sd[2]));
}

TEST_F(PatchTest, HasNoValueIfMoreThanHalfIsOut) {
    for (std::size_t i = 0; i < 15; ++i) raw_[60 + 2 * i] = kNan;
    EXPECT_TRUE(decouple().has_value);
    raw_[61] = kNan;
    const Estimate e = decouple();
    EXPECT_FALSE(e.has_value);
    EXPECT_EQ(e.quality(), TACTILED_BAD);
    EXPECT_TRUE(std::isnan(tactiled_taxel_forces(&record(TACTILED_BAD))[6]));
    EXPECT_EQ(record().n_out, 16u);
}

TEST_F(PatchTest, ASaturatedTaxelHasNoSd) {
    press_all(1000);
    raw_[60 + 12] = kInfinite;
    const Estimate e = decouple();
    EXPECT_EQ(e.quality(), TACTILED_UNCERTAIN);
    EXPECT_NE(e.reasons & TACTILED_SATURATED, 0u);
    EXPECT_TRUE(std::isnan(e.sd[2]));
    EXPECT_NE(state(12) & TACTILED_TAXEL_SATURATED, 0u);
}

TEST_F(PatchTest, ATaxelThatRepeatsItsValuesIsFrozenWhereTheCalibrationSaysSo) {
    calibration_.parameters["frozen_after"] = 5;
    make();
    for (int k = 0; k < 20; ++k) {
        for (float& value : raw_) value += 1;
        raw_[12] = raw_[42] = raw_[72] = 7;
        (void)decouple();
        EXPECT_EQ(state(12), k < 5 ? 0u : unsigned(TACTILED_TAXEL_FROZEN)) << k;
        EXPECT_EQ(state(13), 0u);
    }
    raw_[72] = 8;
    (void)decouple();
    EXPECT_EQ(state(12), 0u);
}

TEST_F(PatchTest, UsesTheZeroAndTheGainOfEachTaxel) {
    std::vector<double> zero(30, 10), gain(30, 2);
    calibration_.tables["zero"] = {zero, zero, std::vector<double>(30, 100)};
    calibration_.tables["gain"] = {gain};
    make();
    patch_->patch()->set_counts_per_unit(1);
    for (std::size_t i = 0; i < 60; ++i) raw_[i] = 10;
    press_all(100);
    EXPECT_NEAR(decouple().wrench_S[2], 0, 1e-6);
    press_at(3, 1000);
    EXPECT_NEAR(decouple().wrench_S[2], -2, 1e-5);
}

TEST_F(PatchTest, ADeadTaxelNeverHasAForce) {
    patch_ = make_decoupler(with("dead", {{12, 14}}));
    press_all(1000);
    EXPECT_NEAR(decouple().wrench_S[2], -30, 1e-4);
    EXPECT_TRUE(std::isnan(force(12, 2)) && std::isnan(force(14, 2)));
    EXPECT_EQ(state(14), unsigned(TACTILED_TAXEL_DEAD));
}

TEST_F(PatchTest, IsOutsideWhereATaxelIsBeyondItsRange) {
    calibration_.parameters["taxel_full_scale_N"] = 1;
    make();
    press_at(12, 1040);
    EXPECT_EQ(decouple().quality(), TACTILED_GOOD);
    press_at(12, 20);
    EXPECT_EQ(decouple().reasons, std::uint32_t(TACTILED_OUTSIDE_DOMAIN));
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_OUTSIDE));
}

TEST_F(PatchTest, AnotherShapeIsAnotherDevice) {
    Reading reading;
    reading.taxels = {{29, 3}, std::span(raw_).first(87)};
    EXPECT_EQ(patch_->decouple(reading).reasons, std::uint32_t(TACTILED_WRONG_DEVICE));
    EXPECT_EQ(patch_->decouple(Reading{}).reasons, std::uint32_t(TACTILED_WRONG_DEVICE));
}

// The tare of the wrench is the sensor's; the forces of the taxels and the contact have their own.
TEST_F(PatchTest, ATareIsTheMeanOfEachTaxelsForce) {
    Patch& patch = *patch_->patch();
    patch.begin_tare();
    for (const float counts : {100.f, 200.f}) {
        press_at(12, counts);
        (void)decouple();
        patch.add_to_tare();
    }
    patch.end_tare(true);
    EXPECT_NEAR(force(12, 2), -0.1, 1e-6);  // 0.3 N less the mean, 0.2 N
    (void)decouple();
    EXPECT_NEAR(decouple().wrench_S[2], -0.3, 1e-6);
    patch.begin_tare();  // a tare that is refused
    press_at(12, 1000);
    (void)decouple();
    patch.add_to_tare();
    patch.end_tare(false);
    EXPECT_NEAR(force(12, 2), -1.1, 1e-6);
    (void)decouple();
    patch.untare();
    (void)decouple();
    EXPECT_NEAR(force(12, 2), -1.3, 1e-6);
}

// Its zero is not the prediction by its neighbours.
TEST_F(PatchTest, ATaxelThatWasMissingInATareHasNoForceUntilTheNext) {
    Patch& patch = *patch_->patch();
    const auto tare = [&](bool is_taken) {
        patch.begin_tare();
        (void)decouple();
        patch.add_to_tare();
        patch.end_tare(is_taken);
    };
    raw_[60 + 12] = kNan;
    tare(true);
    raw_[60 + 12] = 300;
    EXPECT_NEAR(decouple().wrench_S[2], 0, 1e-6);
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_MISSING));
    tare(false);
    (void)decouple();
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_MISSING));
    tare(true);
    (void)decouple();
    EXPECT_EQ(state(12), 0u);
}

// A tare of an earlier run is the wrench's alone.
TEST_F(PatchTest, TheZeroOfATaxelIsUnknownAfterARestoredTare) {
    patch_->patch()->lose_zeros();
    press_at(12, 1000);
    const Estimate e = decouple();
    EXPECT_TRUE(std::isnan(e.cop_S_m[0]));
    EXPECT_EQ(e.reasons, unsigned(TACTILED_ZERO_UNKNOWN));  // no check sees faults of taxels until a tare
    EXPECT_EQ(record().n_contact, 0u);
}

TEST_F(PatchTest, AResultThatIsNotFiniteIsNone) {
    for (std::size_t i = 0; i < 30; ++i) press_at(i, i % 2 == 0 ? 3e38f : -3e38f);
    const Estimate e = decouple();
    EXPECT_FALSE(e.has_value);
    EXPECT_NE(e.reasons & TACTILED_NOT_FINITE, 0u);
}

TEST_F(PatchTest, RawNumbersAtTheLimitsAreSaturated) {
    patch_->patch()->set_saturates_at({-1, 4095});
    press_at(12, 4095);
    EXPECT_NE(decouple().reasons & TACTILED_SATURATED, 0u);
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_SATURATED));
    EXPECT_EQ(state(13), 0u);
}

// A zero that was taken under a load leaves a taxel that is pulled: press and pull have no common centre.
TEST_F(PatchTest, APullBesideAPressHasNoCentre) {
    press_at(12, 200);
    press_at(13, -500);
    (void)decouple();
    EXPECT_EQ(record().n_contact, 1u);
    EXPECT_TRUE(std::isnan(record().cop_S_m[0]));
}

TEST_F(PatchTest, ASdThatIsUnknownIsUnknownForTheContact) {
    press_all(1000);
    raw_[60 + 12] = kInfinite;
    (void)decouple();
    EXPECT_FALSE(std::isnan(record().cop_S_m[0]));
    EXPECT_TRUE(std::isnan(record().cop_sd_m[0]) && std::isnan(record().area_sd_m2));
}

TEST_F(PatchTest, ARecordWithoutAReadingHasNoStates) {
    raw_[60 + 12] = kNan;
    (void)decouple();
    EXPECT_EQ(state(12), unsigned(TACTILED_TAXEL_MISSING));
    EXPECT_EQ(static_cast<const tactiled_array*>(patch_->patch()->record(tactiled_sample{}))->n_out, 0u);
}

TEST_F(PatchTest, RowsMayBeFurtherApartThanColumns) {
    calibration_.parameters["pitch_y_mm"] = 3;
    make();
    EXPECT_EQ(patch_->patch()->places().neighbours[12].n, 4u);
    EXPECT_EQ(patch_->patch()->places().neighbours[0].n, 2u);
}

// The noise along the normal of a taxel on the side is one along x of S.
TEST_F(PatchTest, TurnsTheNoiseOfACurvedSkin) {
    Calibration c = calibration_;
    c.parameters = {{"gain_sd", 0}};
    c.tables["taxel_sd"] = {{0, 0, 0.005}};
    c.tables["place_mm"] = {{5, 0, 0}, {5, 3, 0}};
    c.tables["normal"] = {{1, 0, 0}, {1, 0, 0}};
    patch_ = make_decoupler(c);
    const std::vector<float> raw(6, 0);
    Reading reading;
    reading.taxels = {{2, 3}, raw};
    const Estimate e = patch_->decouple(reading);
    EXPECT_NEAR(e.sd[0], std::sqrt(2.) * 0.005, 1e-8);
    EXPECT_NEAR(e.sd[2], 0, 1e-8);
    EXPECT_NEAR(e.sd[5], 0.003 * 0.005, 1e-10);  // mz = x fy - y fx
}

TEST_F(PatchTest, ABadSampleHasNoForces) {
    press_all(1000);
    (void)decouple();
    const tactiled_array& bad = record(TACTILED_BAD);
    for (std::size_t k = 0; k < 90; ++k) EXPECT_TRUE(std::isnan(tactiled_taxel_forces(&bad)[k])) << k;
    EXPECT_TRUE(std::isnan(bad.cop_S_m[0]) && std::isnan(bad.area_m2));
}

TEST_F(PatchTest, FindsCentreAreaAndPeak) {
    std::vector<double> gain(30, 1);
    pressed::press(array_, Body{Kind::ball, 1.2e-3, -0.7e-3, 4, 3e-3, 3e-3, 0}, gain, raw_);
    const Estimate e = decouple();
    const tactiled_array& seen = record();
    EXPECT_NEAR(double(seen.cop_S_m[0]), 1.2e-3, 3 * double(seen.cop_sd_m[0]));
    EXPECT_NEAR(double(seen.cop_S_m[1]), -0.7e-3, 3 * double(seen.cop_sd_m[1]));
    EXPECT_LT(seen.cop_sd_m[0], 2e-4f);
    EXPECT_EQ(e.cop_S_m[0], double(seen.cop_S_m[0]));
    EXPECT_NEAR(double(seen.area_m2), 28.3e-6, 2 * double(seen.area_sd_m2));
    EXPECT_EQ(seen.peak_taxel, 18u);  // x = 2 mm, y = -1 mm
    EXPECT_TRUE(std::isnan(seen.axis_rad));
}

TEST_F(PatchTest, FindsTheDirectionOfALongContact) {
    std::vector<double> gain(30, 1);
    pressed::press(array_, Body{Kind::edge, 0, 0, 4, 4.5e-3, 0.8e-3, 0.7}, gain, raw_);
    (void)decouple();
    EXPECT_NEAR(double(record().axis_rad), 0.7, 3 * double(record().axis_sd_rad));
    EXPECT_LT(record().axis_sd_rad, 0.15f);
}

TEST_F(PatchTest, HasNoPlaceWithoutAContact) {
    (void)decouple();
    EXPECT_TRUE(std::isnan(record().cop_S_m[0]) && std::isnan(record().peak_N));
    EXPECT_EQ(record().n_contact, 0u);
}

// Taxels on a cylinder around y: a press along the normal of one is a force in its direction.
TEST_F(PatchTest, TurnsForcesOnACurvedSkin) {
    Calibration c = calibration_;
    c.parameters = {{"gain_sd", 0}};
    c.tables["place_mm"] = {{0, 0, 5}, {5, 0, 0}, {0, 3, 5}};
    c.tables["normal"] = {{0, 0, 2}, {3, 0, 0}, {0, 0, 1}};
    patch_ = make_decoupler(c);
    std::vector<float> raw(9, 0);
    raw[6 + 1] = 1000;  // 1 N on the side
    Reading reading;
    reading.taxels = {{3, 3}, raw};
    const Estimate e = patch_->decouple(reading);
    EXPECT_NEAR(e.wrench_S[0], -1, 1e-6);
    EXPECT_NEAR(e.wrench_S[2], 0, 1e-6);
    EXPECT_NEAR(e.wrench_S[4], 0, 1e-8);
}

TEST_F(PatchTest, TaxelsAreInTheOrderOfTheirWiring) {
    std::vector<double> wiring(30);
    for (std::size_t i = 0; i < 30; ++i) wiring[i] = double(29 - i);
    patch_ = make_decoupler(with("wiring", {wiring}));
    press_at(0, 1000);  // is at the lower right: x = 4 mm, y = -5 mm
    const Estimate e = decouple();
    EXPECT_NEAR(e.wrench_S[3], -5e-3 * -1, 1e-8);
    EXPECT_NEAR(e.wrench_S[4], -4e-3 * -1, 1e-8);
}

TEST_F(PatchTest, EachTaxelHasTheSdOfItsGain) {
    std::vector<double> of_each(30, 0.01);
    of_each[7] = 0.2;
    calibration_.tables["gain_sd"] = {of_each};
    EXPECT_NE(fault_of(calibration_).find("gain_sd is a parameter and a table"), std::string::npos);
    calibration_.parameters.erase("gain_sd");
    calibration_.tables["taxel_sd"] = {{1e-6, 1e-6, 1e-6}};
    make();
    press_at(7, 1000);
    EXPECT_NEAR(decouple().sd[2], 0.2, 1e-4);
    // Its y is 3 mm, and the place within it and within a neighbour above or below is unknown (contact.hpp).
    EXPECT_NEAR(decouple().sd[3], std::sqrt(std::pow(0.2 * 3e-3, 2) + std::pow(2e-3, 2) * (1. / 12 + 1. / 720)), 1e-6);
    EXPECT_NEAR(double(record().peak_sd_N), 0.2, 1e-4);
    raw_.assign(90, 0);
    press_at(8, 1000);
    EXPECT_NEAR(decouple().sd[2], 0.01, 1e-4);
    EXPECT_NE(fault_of(with("gain_sd", {{0.1}})).find("table gain_sd has 1 numbers for 30 taxels"), std::string::npos);
}

TEST_F(PatchTest, RefusesACalibrationWithItsReason) {
    EXPECT_NE(fault_of(with("taxel", {{1, 0, 0}, {0, 1, 0}})).find("table taxel has 2 rows; it needs 1 (fz) or 3"),
              std::string::npos);
    EXPECT_NE(fault_of(with("gain", {{1, 2}})).find("table gain has 2 numbers in a row for 30 taxels"), std::string::npos);
    EXPECT_NE(fault_of(with("dead", {{30}})).find("table dead has 30; a taxel is 0 .. 29"), std::string::npos);
    EXPECT_NE(fault_of(with("place_mm", {{0, 0, 0}})).find("given twice"), std::string::npos);
    EXPECT_NE(fault_of(with("wiring", {std::vector<double>(30, 1)})).find("each of the 30 places is needed once"),
              std::string::npos);
    EXPECT_NE(fault_of(with("taxel_sd", {{1, 2}})).find("taxel_sd has 2 numbers"), std::string::npos);
    Calibration c = calibration_;
    c.tables["taxel"] = {{0, 0, 1}};
    EXPECT_NE(fault_of(c).find("components has \"fx\", but the taxels measure fz alone"), std::string::npos);
    c = calibration_;
    c.parameters["rows"] = 2.5;
    EXPECT_NE(fault_of(c).find("whole numbers"), std::string::npos);
    c = calibration_;
    c.parameters["rows"] = c.parameters["columns"] = 100;
    EXPECT_NE(fault_of(c).find("10000 taxels; an array has at most 4096"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
