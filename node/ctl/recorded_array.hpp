// The channels of arrays in a recording of tactilectl record.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "decoupling/csv.hpp"
#include "drivers/frame.hpp"
#include "drivers/mcap/writer.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// The numbers of the schemas of arrays. A recording without an array has none of them.
struct ArraySchemas {
    explicit ArraySchemas(mcap::Writer& file);
    std::uint16_t raw, array, cloud;
};

// The raw taxels of the frames of one link.
class RecordedRawTaxels {
public:
    RecordedRawTaxels(const SegmentView& segment, std::uint32_t link, mcap::Writer& file, const ArraySchemas& schemas,
                      const std::string& node);
    // Records the taxels of frame number `number` of the link, if they are still kept. Call it before the frame is recorded.
    // Throws std::runtime_error if writing fails.
    void record(std::uint32_t number, const Frame& frame, std::uint64_t wall_ns);
    [[nodiscard]] std::uint64_t lost() const { return lost_; }

private:
    const SegmentView& segment_;
    tactiled_ring ring_;
    mcap::Writer& file_;
    std::uint16_t channel_;
    std::vector<std::uint64_t> record_;
    std::uint64_t lost_ = 0;
    std::string message_;
};

// The arrays of one sensor: their results with each sample, and their taxels at a rate.
class RecordedArray {
public:
    struct Setup {
        std::uint32_t sensor;
        std::string node, frame_id;                // the node begins the topics
        std::map<std::string, std::string> about;  // metadata of the channels
        double rate_Hz;                            // maps of the taxels; 0 = none
        std::string csv;                           // path of a file with the same taxels, "" = none
    };
    // setup: throws SetupError where the CSV file cannot be created
    RecordedArray(const SegmentView& segment, mcap::Writer& file, const ArraySchemas& schemas, Setup setup);

    // Records the array of a sample, if it is still kept. Call it before the sample is recorded. Throws std::runtime_error
    // if writing fails.
    void record(const tactiled_sample& sample, std::uint64_t wall_ns);
    void close();  // throws like record()
    [[nodiscard]] std::uint64_t lost() const { return lost_; }

private:
    [[nodiscard]] bool is_due(std::uint64_t t_ns);
    void record_taxels(std::uint32_t sequence, std::uint64_t wall_ns);

    const SegmentView& segment_;
    mcap::Writer& file_;
    Setup setup_;
    std::uint16_t results_, taxels_ = 0;
    File csv_;
    Array array_;
    std::uint64_t due_ns_ = 0, lost_ = 0;
    std::string message_, rows_;
};

}  // namespace tactiled::ctl
