// A labelled.csv that grows load by load, and the loads that it still lacks for a calibration.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <utility>
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
    // Reads an existing file. `channels` are the names for a new file; "" names keep those of an existing one.
    // setup: throws SetupError where the file has other channels, no session, or is no labelled.csv
    CaptureFile(std::string path, std::vector<std::string> channels);

    [[nodiscard]] const std::vector<std::string>& channels() const { return channels_; }
    // The last row's session, "1" for a new file.
    [[nodiscard]] const std::string& last_session() const { return last_session_; }

    // setup: throws SetupError where a row of this load could not be appended: see append()
    void check(const Load& load) const;

    // Appends the rows, each with every component of the file; the first rows determine the components.
    // setup: throws SetupError where the file has a label that a row lacks, or the reverse; SaveError where it cannot be written
    void append(const std::vector<CapturedRow>& rows, const std::string& session);

    // Returns the greatest less the smallest value of channel k in the file; 0 without a row.
    [[nodiscard]] double range(std::size_t k) const;

    // Returns the loads that a calibration still needs, one sentence each; empty if nothing obvious is missing.
    [[nodiscard]] std::vector<std::string> missing() const;
    // Returns "fz_N: -9.8 .. 0 in 3 loads", one line per label.
    [[nodiscard]] std::vector<std::string> coverage() const;

private:
    void note(const Load& load, const std::string& session);
    void note_channel(std::size_t k, double value);

    std::string path_;
    std::vector<std::string> channels_;
    std::vector<std::size_t> label_;  // components of the file, in the order of its columns; empty: there is no file yet
    std::vector<std::string> columns_;
    std::string last_session_ = "1";
    double last_t_s_ = 0;
    bool ends_with_a_line_ = true;
    std::vector<std::pair<double, double>> extremes_;  // smallest and greatest value of each channel
    std::map<std::string, std::size_t> rows_of_session_;
    std::map<std::string, double> smallest_of_session_;  // the smallest load of its rows: their largest component
    Load last_load_{};
    std::size_t loads_ = 0;  // changes of the load from row to row: calibrate counts rows of one load once
    std::array<std::map<double, std::size_t>, 6> levels_;  // number of rows at each value, by component
};

}  // namespace tactiled::ctl
