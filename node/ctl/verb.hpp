// The common parts of the verbs. verb.cpp is the part of this header that the laboratory's program (node/lab) links,
// too.
#pragma once
#include <array>
#include <bit>
#include <csignal>
#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>

#include "tactiled/layout.h"

namespace tactiled::ctl {

// Exit status of every verb.
inline constexpr int kGood = 0;
inline constexpr int kUnhealthy = 1;     // unhealthy, or the check failed
inline constexpr int kUsage = 2;         // the arguments or the files are wrong
inline constexpr int kNotReachable = 3;  // no daemon of that name

// The action of a verb, which run_program() calls after parsing. An exception of it (std::exception) is printed as an
// error, with exit status kUsage for SetupError, that of a VerbError, else kUnhealthy.
using Run = std::function<int()>;

// Ends a verb with a message and that exit status.
struct VerbError : std::runtime_error {
    VerbError(int exit_status, const std::string& why) : std::runtime_error(why), status(exit_status) {}
    int status;
};

// ---- shared by several verbs ----

// The texts of a reason (layout.h), from bit 0 on.
struct ReasonText {
    const char *word = "", *meaning = "", *remedy = "";
};
inline constexpr auto kReasonTexts = [] {
    std::array<ReasonText, 28> texts{};
#define TACTILED_TEXT_(reason, word, best, fault, constant, use, meaning, remedy) \
    texts[std::size_t(std::countr_zero(unsigned(TACTILED_##reason)))] = {word, meaning, remedy};
    TACTILED_REASON_TABLE(TACTILED_TEXT_)
#undef TACTILED_TEXT_
    return texts;
}();
inline constexpr auto kReasonWords = [] {
    std::array<const char*, kReasonTexts.size()> words{};
    for (std::size_t bit = 0; bit < words.size(); ++bit) words[bit] = kReasonTexts[bit].word;
    return words;
}();
// Returns "good", "uncertain", "bad" or "no-value"; with reasons after a colon: "uncertain:saturated", as in
// forces.csv.
std::string quality_text(std::uint32_t quality, std::uint32_t reasons);

// Returns the words of the bits that are set, with blanks between them.
std::string words_of(std::uint32_t bits, std::span<const char* const> words);

// True if the standard output is a terminal that shows colours, and NO_COLOR is not set.
bool wants_colour();
// Returns `text` in green, yellow or red for GOOD, UNCERTAIN and BAD, if wants_colour().
std::string coloured(std::uint32_t quality, const std::string& text);

// Returns `status`, or kUnhealthy if a write to the standard output failed, which is printed after the name of the
// program. `known_error`: errno of the failed write, 0 if none is known.
int flush_output(const std::string& program, int status, int known_error = 0);

// Ends a verb that runs continuously: set by SIGINT and SIGTERM.
extern volatile std::sig_atomic_t interrupted;

// After this call the first SIGINT or SIGTERM sets `interrupted` and ends the present system call, also a write into
// a full pipe; the second one kills the process.
void catch_interrupt();

}  // namespace tactiled::ctl
