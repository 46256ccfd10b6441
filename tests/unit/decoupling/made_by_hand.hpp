// Hand-made calibrations and readings, for the tests of the models.
#pragma once
#include <gtest/gtest.h>
#include <unistd.h>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/decoupler.hpp"
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// The gains of the documents' table sensor, 1/N, and its noise.
inline constexpr double kNormal_per_N = 19366e-6;
inline constexpr double kTangential_per_N = 10847e-6;
inline constexpr double kOuter_per_N = 8582e-6;

inline Calibration table_calibration(std::vector<std::string> channels) {
    Calibration calibration;
    calibration.path = "table.toml";
    calibration.model = "table";
    calibration.method = "linear";
    calibration.zero.assign(channels.size(), 0.0);
    calibration.channels = std::move(channels);
    calibration.components = {"fx", "fy", "fz"};
    calibration.parameters = {{"normal_inner", kNormal_per_N}, {"tangential_inner", kTangential_per_N}, {"noise", 20e-6}};
    if (calibration.channels.size() > 4) calibration.parameters["tangential_outer"] = kOuter_per_N;
    calibration.sd = {0.01, 0.01, 0.02};
    return calibration;
}

inline std::vector<std::string> inner_gauges() { return {"R1", "R3", "R5", "R7"}; }
inline std::vector<std::string> all_gauges() { return {"R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8"}; }

// The strains of the four inner gauges under a force in N; n presses, against fz.
inline std::vector<double> reading_of(double fx, double fy, double n) {
    const double t = kTangential_per_N, p = kNormal_per_N;
    return {-t * fx + p * n, -t * fy + p * n, t * fx + p * n, t * fy + p * n};
}

inline Rows pointers(const std::vector<LabelledRow>& rows) {
    Rows result;
    for (const auto& row : rows) result.push_back(&row);
    return result;
}

// Returns the problems in the file of a calibration of which `from` is replaced by `to`.
inline std::vector<std::string> problems_of(const Calibration& calibration, const std::string& from, const std::string& to) {
    std::string text = calibration_text(calibration);
    text.resize(text.rfind("crc"));
    const auto at = text.find(from);
    if (at == text.npos) return {"there is no " + from};
    text.replace(at, from.size(), to);
    Problems problems;
    parse_calibration(text, "c.toml", problems);
    return problems.lines();
}

// Returns the reason why a calibration that must be refused is refused.
inline std::string refusal(const Calibration& calibration, const std::string& method = "") {
    DecouplerFault fault;
    EXPECT_EQ(make_decoupler(calibration, method, 0, fault), nullptr);
    EXPECT_NE(fault.text, "");
    return fault.text;
}

inline Estimate decouple(Decoupler& decoupler, const std::vector<double>& channel, std::uint32_t missing = 0,
                         std::uint32_t saturated = 0) {
    return decoupler.decouple({.channel = channel, .missing = missing, .saturated = saturated});
}

// A file that is removed at the end of the test.
class ScratchFile {
public:
    explicit ScratchFile(const std::string& text) {
        std::string pattern = (std::filesystem::temp_directory_path() / "tactiled_test_XXXXXX").string();
        const int fd = mkstemp(pattern.data());
        if (fd < 0) std::abort();
        ::close(fd);
        path_ = pattern;
        std::ofstream(path_, std::ios::binary) << text;
    }
    ~ScratchFile() { std::filesystem::remove(path_); }
    ScratchFile(const ScratchFile&) = delete;
    ScratchFile& operator=(const ScratchFile&) = delete;
    [[nodiscard]] const std::string& path() const { return path_; }

private:
    std::string path_;
};

}  // namespace tactiled
