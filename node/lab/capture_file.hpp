// A labelled.csv that grows by one load after the other, and the loads that it still lacks for a calibration.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "node/lab/capture_load.hpp"

namespace tactiled::ctl {

struct CapturedRow {
    std::uint64_t t_ns = 0;
    std::vector<double> channel;  // NaN: missing
    Load load;
};

class CaptureFile {
public:
    // Reads what is there. `channels` are the names for a new file; "" names keep those of an existing one.
    // setup: throws SetupError where the file has other channels, no session, or is no labelled.csv
    CaptureFile(std::string path, std::vector<std::string> channels);

    [[nodiscard]] bool exists() const { return !label_.empty(); }
    [[nodiscard]] const std::vector<std::string>& channels() const { return channels_; }
    // The last row's session, "1" for a new file.
    [[nodiscard]] const std::string& last_session() const { return last_session_; }

    // Appends the rows, each with every component that the file has; the first rows decide which it has.
    // setup: throws SetupError where the file has a label that a row lacks, or the reverse; SaveError where it cannot be written
    void append(const std::vector<CapturedRow>& rows, const std::string& session);

    // The loads that a calibration would still need, a sentence each; empty where nothing obvious is missing.
    [[nodiscard]] std::vector<std::string> missing() const;
    // "fz_N: -9.8 .. 0 in 3 loads", a line a label.
    [[nodiscard]] std::vector<std::string> coverage() const;

private:
    void note(const Load& load, const std::string& session);

    std::string path_;
    std::vector<std::string> channels_;
    std::vector<std::size_t> label_;  // components of the file, in the order of its columns; empty: there is no file yet
    std::vector<std::string> columns_;
    std::string last_session_ = "1";
    double last_t_s_ = 0;
    bool ends_with_a_line_ = true;
    std::map<std::string, std::size_t> rows_of_session_;
    std::array<std::map<double, std::size_t>, 6> levels_;  // rows at each value, by component
};

}  // namespace tactiled::ctl
