#include "decoupling/fit/session_pairs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace tactiled {
namespace {

using Pair = std::pair<std::size_t, std::size_t>;

constexpr std::size_t kPartners = 6;  // number of the following sessions with which each session is compared

// "1", "1 and 2", "1, 2 and 3"
std::string names(const Labelled& labelled, const std::vector<std::size_t>& sessions) {
    std::string text;
    for (std::size_t i = 0; i < sessions.size(); ++i)
        text += (i == 0 ? "" : i + 1 < sessions.size() ? ", " : " and ") + labelled.sessions[sessions[i]];
    return text;
}

// "1,3", for --session
std::string choice(const Labelled& labelled, const std::vector<std::size_t>& sessions) {
    std::string text;
    for (const std::size_t s : sessions) text += (text.empty() ? "" : ",") + labelled.sessions[s];
    return text;
}

// Returns the fewest sessions without which no pair contradicts, in order; none if they are not in the minority of those
// that were compared.
std::vector<std::size_t> odd_sessions(const std::vector<Pair>& pairs, const std::vector<std::size_t>& comparable) {
    std::vector<Pair> left = pairs;
    std::vector<std::size_t> odd;
    while (!left.empty()) {
        std::map<std::size_t, int> count;
        for (const auto& [a, b] : left) ++count[a], ++count[b];
        const auto most = std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) {
                              return a.second < b.second;
                          })->first;
        odd.push_back(most);
        std::erase_if(left, [&](const auto& pair) { return pair.first == most || pair.second == most; });
    }
    if (2 * odd.size() >= comparable.size()) return {};
    std::sort(odd.begin(), odd.end());
    return odd;
}

}  // namespace

Contradictions contradictions(std::size_t sessions,
                              const std::function<std::optional<bool>(std::size_t, std::size_t)>& contradict) {
    Contradictions result;
    std::vector<bool> compared(sessions);
    std::vector<Pair> all;
    for (std::size_t a = 0; a < sessions; ++a)
        for (std::size_t b = a + 1; b < sessions; ++b) {
            if (b - a > kPartners && sessions - (b - a) > kPartners) continue;
            const std::optional<bool> found = contradict(a, b);
            if (!found) continue;
            compared[a] = compared[b] = true;
            all.emplace_back(a, b);
            if (*found) result.pairs.emplace_back(a, b);
        }
    for (std::size_t s = 0; s < sessions; ++s)
        if (compared[s]) result.compared.push_back(s);
    if (result.pairs.empty()) return result;
    result.odd = odd_sessions(result.pairs, result.compared);
    result.shown = result.pairs.front();
    const auto is_odd = [&](std::size_t s) {
        return std::find(result.odd.begin(), result.odd.end(), s) != result.odd.end();
    };
    for (const std::size_t odd : result.odd) {
        const auto count = [&](const std::vector<Pair>& pairs) {
            return std::count_if(pairs.begin(), pairs.end(), [&](const Pair& pair) {
                return (pair.first == odd && !is_odd(pair.second)) || (pair.second == odd && !is_odd(pair.first));
            });
        };
        result.doubtful = result.doubtful || (count(all) > 1 && 2 * count(result.pairs) <= count(all));
    }
    for (const Pair& pair : result.pairs) {
        if (is_odd(pair.first) == is_odd(pair.second)) continue;
        result.shown = is_odd(pair.first) ? Pair(pair.second, pair.first) : pair;
        break;
    }
    return result;
}

std::string verdict(const Labelled& labelled, const Contradictions& found) {
    if (found.odd.empty())
        return fmt::format("sessions {} and {} contradict each other; the recording does not show which is wrong",
                           labelled.sessions[found.shown.first], labelled.sessions[found.shown.second]);
    std::vector<std::size_t> others;
    for (const Pair& pair : found.pairs)
        for (const auto& [one, other] : {pair, Pair(pair.second, pair.first)})
            if (std::find(found.odd.begin(), found.odd.end(), one) != found.odd.end() &&
                std::find(found.odd.begin(), found.odd.end(), other) == found.odd.end())
                others.push_back(other);
    std::sort(others.begin(), others.end());
    others.erase(std::unique(others.begin(), others.end()), others.end());
    return fmt::format("session{} {} contradict{} {}", found.odd.size() == 1 ? "" : "s", names(labelled, found.odd),
                       found.odd.size() == 1 ? "s" : "", names(labelled, others));
}

std::string advice(const Labelled& labelled, const Contradictions& found) {
    if (found.odd.empty())
        return fmt::format("Calibrate sessions that agree, for example --session {} or --session {}",
                           labelled.sessions[found.shown.first], labelled.sessions[found.shown.second]);
    std::vector<std::size_t> rest;
    for (std::size_t s = 0; s < labelled.sessions.size(); ++s)
        if (std::find(found.odd.begin(), found.odd.end(), s) == found.odd.end()) rest.push_back(s);
    return fmt::format("Calibrate without {}: --session {}", found.odd.size() == 1 ? "it" : "them", choice(labelled, rest));
}

}  // namespace tactiled
