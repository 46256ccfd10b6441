// Changes with their times: qualities, links, latched faults, the daemon itself. They are kept in the server, so that a
// reload of the page shows it, too.
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "node/web/source.hpp"

namespace tactiled::web {

// Words of tactiled_node.fault and .warning, bit by bit; nullptr: no such bit.
extern const std::array<const char*, 9> kFaultWords;
extern const std::array<const char*, 10> kWarningWords;
// Returns the words of the bits that are set.
std::vector<const char*> words_of(std::span<const char* const> all, std::uint32_t bits);

struct Event {
    std::uint64_t id = 0;
    std::uint64_t revision = 0;    // revision of the last change of this event
    std::int64_t wall_ms = 0;      // since 1970, first time
    double t_s = 0, last_t_s = 0;  // CLOCK_MONOTONIC, first and last time
    std::uint32_t times = 1;
    int severity = 0;  // 0 back to normal or a notice, 1 uncertain, 2 no value or a fault
    std::string subject, text;
};

class Timeline {
public:
    static constexpr std::size_t kMaxEvents = 200;
    static constexpr double kRepeatS = 10;  // the same change within this time is counted and not listed again

    void observe(const View& view);
    // Appends a JSON list of the events that are newer than `revision`, oldest first; returns the newest revision.
    std::uint64_t encode(std::uint64_t revision, std::string& out) const;
    [[nodiscard]] std::uint64_t revision() const { return revision_; }
    [[nodiscard]] const std::deque<Event>& events() const { return events_; }

private:
    void add(const View& view, const std::string& subject, const std::string& text, int severity);
    void observe_sensor(const View& view, std::uint32_t i);

    std::deque<Event> events_;
    std::uint64_t revision_ = 0;
    bool any_ = false, alive_ = false;
    std::string why_;
    std::uint32_t epoch_ = 0, reloads_ = 0, fault_ = 0, warning_ = 0, slips_ = 0;
    std::array<std::uint64_t, TACTILED_MAX_SENSORS> quality_{};  // quality << 32 | reasons
    std::array<std::uint32_t, TACTILED_MAX_LINKS> link_{};
};

}  // namespace tactiled::web
