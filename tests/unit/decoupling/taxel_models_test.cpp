// Arrays whose taxels have a calibration of their own, against decouplers of each taxel alone.
#include "decoupling/patch/taxel_models.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "decoupling/patch/patch.hpp"
#include "tests/unit/config/folder.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kTaxels = 9, kValues = 5;

Calibration pad_of_documents() {
    Problems problems;
    Calibration pad = load_calibration(TACTILED_SOURCE_DIR "/config/calibration/capacitive_documents.toml", problems);
    EXPECT_TRUE(problems.empty());
    return pad;
}

// A taxel of five values and three components with a known sd.
Calibration generic_taxel() {
    Calibration taxel = pad_of_documents();
    taxel.model = "generic";
    taxel.method = "matrix";
    taxel.parameters.clear();
    taxel.tables.clear();
    taxel.matrix = {{1, 0, -1, 0, 0}, {0, 1, 0, -1, 0}, {0, 0, 0, 0, -20}};
    taxel.full_scale = {5, 5, 50};
    taxel.sd = {0.01, 0.01, 0.02};
    taxel.sd_slope = {0, 0, 0.05};
    return taxel;
}

Calibration array_of(std::vector<Calibration> taxels) {
    Calibration array;
    array.path = "array";
    array.model = "patch";
    array.method = "taxel_models";
    array.channels = taxels.front().channels;
    array.channel_unit = taxels.front().channel_unit;
    array.components = {"fx", "fy", "fz", "mx", "my", "mz"};
    array.parameters = {{"rows", 3}, {"columns", 3}, {"pitch_mm", 8}};
    for (const auto& taxel : taxels) array.taxel_files.push_back(taxel.path);
    array.taxels = std::move(taxels);
    return array;
}

std::string fault_of(const Calibration& calibration) {
    DecouplerFault fault;
    EXPECT_EQ(make_decoupler(calibration, "", 0, fault), nullptr);
    return fault.text;
}

// Raw numbers in the unit of the calibration: value v of taxel i at v n + i.
struct Raw {
    explicit Raw(const Calibration& pad) {
        for (std::size_t v = 0; v < kValues; ++v)
            for (std::size_t i = 0; i < kTaxels; ++i) at(i, v) = float(pad.zero[v]);
    }
    float& at(std::size_t i, std::size_t v) { return value[v * kTaxels + i]; }
    Estimate through(Decoupler& patch, double counts = 1) {
        std::vector<float> counted = value;
        for (float& v : counted) v = float(double(v) * counts);
        Reading reading;
        reading.taxels = {{kTaxels, kValues}, counted};
        return patch.decouple(reading);
    }
    Estimate alone(Decoupler& pad, std::size_t i) {
        std::array<double, kValues> channel{};
        for (std::size_t v = 0; v < kValues; ++v) channel[v] = double(at(i, v));
        Reading reading;
        reading.channel = channel;
        return pad.decouple(reading);
    }
    std::vector<float> value = std::vector<float>(kTaxels * kValues);
};

TEST(TaxelModels, AnArrayOfPadsIsTheSumOfItsPads) {
    const Calibration pad = pad_of_documents();
    const auto patch = make_decoupler(array_of({pad}));
    const auto one = make_decoupler(pad);
    Raw raw(pad);
    for (std::size_t i = 0; i < kTaxels; ++i) {
        raw.at(i, 4) += 0.02f * float(i);  // presses of 0 .. 3.5 N
        raw.at(i, 0) += 0.01f;
        raw.at(i, 2) -= 0.01f;
    }
    Wrench sum{};
    for (std::size_t i = 0; i < kTaxels; ++i) {
        const Estimate e = raw.alone(*one, i);
        const double x = (double(i % 3) - 1) * 8e-3, y = (1 - double(i / 3)) * 8e-3;
        const Wrench& f = e.wrench_S;
        for (std::size_t c = 0; c < 3; ++c) sum[c] += f[c];
        sum[3] += y * f[2], sum[4] -= x * f[2], sum[5] += x * f[1] - y * f[0];
    }
    ASSERT_LT(sum[2], -5);
    for (const double counts : {1., 1000.}) {
        const auto counted = make_decoupler(array_of({pad}));
        counted->patch()->set_counts_per_unit(counts);
        const Estimate e = raw.through(*counted, counts);
        for (std::size_t c = 0; c < 6; ++c) EXPECT_NEAR(e.wrench_S[c], sum[c], 2e-5) << c << " " << counts;
        EXPECT_NE(e.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);  // the file states no sd
        EXPECT_TRUE(std::isnan(e.sd[2]));
    }
    EXPECT_EQ(patch->method(), "taxel_models");
}

// The error of one calibration for all is the same in all taxels; those of nine calibrations are independent.
TEST(TaxelModels, TheSdOfOneCalibrationAddsUp) {
    const Calibration taxel = generic_taxel();
    const auto common = make_decoupler(array_of({taxel}));
    const auto own = make_decoupler(array_of(std::vector<Calibration>(kTaxels, taxel)));
    Raw raw(taxel);
    for (std::size_t i = 0; i < kTaxels; ++i) raw.at(i, 4) += 0.05f;  // 1 N each
    const double sd = std::hypot(0.02, 0.05);
    EXPECT_EQ(raw.through(*common).quality(), TACTILED_GOOD);
    EXPECT_NEAR(raw.through(*common).sd[2], 9 * sd, 1e-5);
    EXPECT_NEAR(raw.through(*own).sd[2], 3 * sd, 1e-5);
    EXPECT_NEAR(raw.through(*common).sd[0], 9 * 0.01, 1e-6);
    EXPECT_NEAR(raw.through(*own).sd[3], std::sqrt(6.) * 8e-3 * sd, 1e-6);
    EXPECT_NEAR(common->patch()->with_zero_of_taxels(array_of({taxel})).sd[2], 9 * 0.02, 1e-6);
}

TEST(TaxelModels, ATaxelWithoutAValueIsPredicted) {
    const Calibration taxel = generic_taxel();
    const auto patch = make_decoupler(array_of(std::vector<Calibration>(kTaxels, taxel)));
    Raw raw(taxel);
    for (std::size_t i = 0; i < kTaxels; ++i) raw.at(i, 4) += 0.05f;
    raw.at(4, 1) = std::numeric_limits<float>::quiet_NaN();
    EXPECT_NEAR(raw.through(*patch).wrench_S[2], -9, 1e-4);
    const auto* array = static_cast<const tactiled_array*>(patch->patch()->record(tactiled_sample{}));
    EXPECT_EQ(array->n_out, 1u);
    raw.at(4, 1) = std::numeric_limits<float>::infinity();
    EXPECT_NE(raw.through(*patch).reasons & TACTILED_SATURATED, 0u);
    raw.at(4, 1) = 1.2285f;
    raw.at(4, 4) += 3;  // 60 N, beyond the full scale of the taxel
    EXPECT_NE(raw.through(*patch).reasons & TACTILED_OUTSIDE_DOMAIN, 0u);
}

TEST(TaxelModels, ZerosAndGainsOfTaxelsApply) {
    const Calibration taxel = generic_taxel();
    Calibration array = array_of({taxel});
    Raw raw(taxel);
    for (std::size_t i = 0; i < kTaxels; ++i) raw.at(i, 4) = 2 + 0.1f * float(i);
    for (std::size_t v = 0; v < kValues; ++v) {
        auto& row = array.tables["zero"].emplace_back();
        for (std::size_t i = 0; i < kTaxels; ++i) row.push_back(double(raw.at(i, v)));
    }
    array.tables["gain"] = {{1, 1, 1, 1, 2, 1, 1, 1, 1}};
    const auto patch = make_decoupler(array);
    EXPECT_NEAR(raw.through(*patch).wrench_S[2], 0, 1e-5);
    raw.at(4, 4) += 0.05f;
    EXPECT_NEAR(raw.through(*patch).wrench_S[2], -2, 1e-4);
}

// Each file has the zero of its taxel.
TEST(TaxelModels, TheFilesHaveTheZeros) {
    std::vector<Calibration> taxels(kTaxels, generic_taxel());
    Raw raw(taxels.front());
    for (std::size_t i = 0; i < kTaxels; ++i) taxels[i].zero[4] += 0.01 * double(i), raw.at(i, 4) = float(taxels[i].zero[4]);
    const auto patch = make_decoupler(array_of(taxels));
    EXPECT_NEAR(raw.through(*patch).wrench_S[2], 0, 1e-4);
}

// A curved skin of taxels that measure the press alone: the sd of a frame does not depend on those before.
TEST(TaxelModels, CurvedTaxelsHaveTheSdOfThisFrame) {
    Calibration taxel = generic_taxel();
    taxel.components = {"fz"};
    taxel.matrix = {taxel.matrix.back()};
    taxel.sd = {0.02}, taxel.sd_slope = {0.05}, taxel.full_scale = {50};
    Calibration array = array_of({taxel});
    array.parameters.clear();
    for (std::size_t i = 0; i < kTaxels; ++i) {
        const double angle = (double(i) - 4) * 0.2;
        array.tables["place_mm"].push_back({10 * std::sin(angle), 0, 10 * std::cos(angle)});
        array.tables["normal"].push_back({std::sin(angle), 0, std::cos(angle)});
    }
    array.tables["gain"] = {std::vector<double>(kTaxels, 1.3)};
    const auto patch = make_decoupler(array);
    Raw raw(taxel);
    raw.at(2, 4) += 0.05f;
    const Estimate first = raw.through(*patch);
    ASSERT_TRUE(first.has_value);
    for (int k = 0; k < 50; ++k) (void)raw.through(*patch);
    EXPECT_EQ(raw.through(*patch).sd, first.sd);
}

// The rates of the files hold for the array, and for a force their sum at most.
TEST(TaxelModels, TheZeroAgesAsThoseOfTheTaxels) {
    Calibration taxel = generic_taxel();
    taxel.zero_rate_per_h = {0.1, 0.1, 0.2};
    const Calibration array = array_of({taxel});
    const auto patch = make_decoupler(array);
    const Calibration with = patch->patch()->with_zero_of_taxels(array);
    ASSERT_EQ(with.zero_rate_per_h.size(), 6u);
    EXPECT_NEAR(with.zero_rate_per_h[2], 9 * 0.2, 1e-12);
    EXPECT_NEAR(with.zero_rate_per_h[3], 6 * 8e-3 * 0.2, 1e-8);
    EXPECT_TRUE(with.zero_shift.empty());
}

TEST(TaxelModels, ADeadTaxelIsNotAsked) {
    const Calibration taxel = generic_taxel();
    Calibration array = array_of({taxel});
    array.tables["dead"] = {{4}};
    const auto patch = make_decoupler(array);
    Raw raw(taxel);
    raw.at(4, 4) = 50;  // far outside of its domain
    EXPECT_EQ(raw.through(*patch).quality(), TACTILED_GOOD);
}

TEST(TaxelModels, AreRefusedWithTheReason) {
    const Calibration taxel = generic_taxel();
    EXPECT_NE(fault_of(array_of({taxel, taxel})).find("taxel_calibration has 2 files for 9 taxels"), std::string::npos);
    Calibration array = array_of({taxel});
    array.channels.pop_back();
    EXPECT_NE(fault_of(array).find("has the channels C1 C2 C3 C4 Cn in pF, the array C1 C2 C3 C4 in pF"), std::string::npos);
    array = array_of({taxel});
    array.tables["taxel"] = {{0, 0, 0, 0, -20}};
    EXPECT_NE(fault_of(array).find("table taxel, the force of each value, or taxel_calibration"), std::string::npos);
    array = array_of({taxel});
    array.parameters["gain_sd"] = 0.1;
    EXPECT_NE(fault_of(array).find("gain_sd and table taxel_sd belong to table taxel"), std::string::npos);
    Calibration no_press = taxel;
    no_press.components = {"fx", "fy"};
    no_press.matrix.pop_back(), no_press.sd.pop_back(), no_press.sd_slope.pop_back(), no_press.full_scale.pop_back();
    EXPECT_NE(fault_of(array_of({no_press})).find("has no component fz"), std::string::npos);
    EXPECT_NE(fault_of(array_of({array_of({taxel})})).find("array"), std::string::npos);
}

// The files lie beside that of the array, and a change of one is a change of the array.
TEST(TaxelModels, AreReadFromTheFolderOfTheArray) {
    const test::Folder folder;
    Calibration taxel = generic_taxel(), array = array_of({taxel});
    save_calibration(taxel, folder / "taxel.toml");
    array.taxel_files = {"taxel.toml"};
    save_calibration(array, folder / "array.toml");
    Problems problems;
    const Calibration back = load_calibration(folder / "array.toml", problems);
    ASSERT_TRUE(problems.empty());
    ASSERT_EQ(back.taxels.size(), 1u);
    EXPECT_EQ(back.taxels[0].matrix, taxel.matrix);
    taxel.matrix[2][4] = -21;
    save_calibration(taxel, folder / "taxel.toml");
    EXPECT_NE(load_calibration(folder / "array.toml", problems).crc, back.crc);
    array.taxel_files = {"array.toml"};
    save_calibration(array, folder / "array.toml");
    (void)load_calibration(folder / "array.toml", problems);
    ASSERT_EQ(problems.lines().size(), 1u);
    EXPECT_NE(problems.lines()[0].find("has no taxel_calibration itself"), std::string::npos);
    array.taxel_files = {"none.toml"};
    save_calibration(array, folder / "array.toml");
    Problems missing;
    (void)load_calibration(folder / "array.toml", missing);
    ASSERT_EQ(missing.lines().size(), 1u);
    EXPECT_NE(missing.lines()[0].find("none.toml"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
