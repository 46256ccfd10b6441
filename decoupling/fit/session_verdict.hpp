// The sessions that contradict the others, and their messages.
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Sessions that contradict each other by one check.
struct Contradictions {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    std::vector<std::size_t> compared;            // in order
    std::vector<std::size_t> odd;                 // sessions in the minority, in order; empty: no minority
    bool doubtful = false;                        // one of `odd` contradicts no more than half of the others compared
    std::pair<std::size_t, std::size_t> shown{};  // for the message: the trusted or earlier session, and another
};

// Compares each session with the next six, cyclically. `contradict` returns nothing where it cannot compare.
Contradictions contradictions(std::size_t sessions,
                              const std::function<std::optional<bool>(std::size_t, std::size_t)>& contradict);

// Returns the first part of a message, which names the sessions, and the last part, which states the remedy.
std::string verdict(const Labelled& labelled, const Contradictions& found);
std::string advice(const Labelled& labelled, const Contradictions& found);

}  // namespace tactiled
