// A reader of all records of one ring of the segment.
#pragma once
#include <cstdint>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// Reads every record of one ring in order, from the newest on, and counts records that were overwritten before it
// read them.
class Tail {
public:
    Tail(const SegmentView& segment, const tactiled_ring& ring)
        : base_(segment.base()), ring_(&ring), next_(tactiled_ring_head(base_, &ring)) {}

    // Returns false if there is no further record now.
    template <class Record>
    bool next(Record& record) {
        for (;;) {
            const std::uint32_t head = tactiled_ring_head(base_, ring_);
            if (head == next_) return false;
            if (head - next_ > ring_->slots) {
                lost_ += head - ring_->slots - next_;
                next_ = head - ring_->slots;
            }
            if (tactiled_ring_read(base_, ring_, next_++, &record, sizeof record) != 0) return true;
            ++lost_;
        }
    }
    // Number of the record that next() has read.
    [[nodiscard]] std::uint32_t number() const { return next_ - 1; }
    [[nodiscard]] std::uint64_t lost() const { return lost_; }

private:
    const char* base_;
    const tactiled_ring* ring_;
    std::uint32_t next_;
    std::uint64_t lost_ = 0;
};

}  // namespace tactiled::ctl
