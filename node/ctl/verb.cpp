#include "node/ctl/verb.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <system_error>

#include "config/options.hpp"
#include "config/text_file.hpp"
#include "node/version.hpp"
#include "tactiled/reader.h"

namespace tactiled::ctl {

volatile std::sig_atomic_t interrupted = 0;

void catch_interrupt() {
    struct sigaction action {};
    action.sa_handler = [](int) { interrupted = 1; };
    action.sa_flags = int(SA_RESETHAND);  // without SA_RESTART, which std::signal() sets
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
}

bool wants_colour() {
    const auto variable = [](const char* name) {
        const char* const value = std::getenv(name);
        return std::string(value != nullptr ? value : "");
    };
    const std::string terminal = variable("TERM");
    return ::isatty(STDOUT_FILENO) != 0 && variable("NO_COLOR").empty() && !terminal.empty() && terminal != "dumb";
}

std::string coloured(std::uint32_t quality, const std::string& text) {
    if (!wants_colour() || text.empty()) return text;
    const char* const code = quality == TACTILED_GOOD ? "32" : quality == TACTILED_UNCERTAIN ? "33" : "31";
    return fmt::format("\x1b[{}m{}\x1b[0m", code, text);
}

int flush_output(const std::string& program, int status, int known_error) {
    errno = 0;
    const bool written = std::cout.flush().good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    if (written) return status;
    const int error = errno != 0 ? errno : known_error;  // 0: the write failed earlier
    pollfd output{STDOUT_FILENO, POLLOUT, 0};
    if (::poll(&output, 1, 0) != 1 || (output.revents & POLLERR) == 0)
        fmt::print(stderr, "{}: standard output: {}\n", program, error != 0 ? std::strerror(error) : "a write failed");
    return status == kGood ? kUnhealthy : status;
}

std::string words_of(std::uint32_t bits, std::span<const char* const> words) {
    std::string text;
    for (std::size_t bit = 0; bit < words.size(); ++bit)
        if ((bits >> bit & 1u) != 0) text += (text.empty() ? "" : " ") + std::string(words[bit]);
    return text;
}

std::string quality_text(std::uint32_t quality, std::uint32_t reasons) {
    static constexpr const char* kQuality[] = {"no-value", "good", "uncertain", "bad"};
    std::string text = quality < std::size(kQuality) ? kQuality[quality] : "unknown";
    char separator = ':';
    for (std::size_t bit = 0; bit < kReasonWords.size(); ++bit)
        if ((reasons >> bit & 1u) != 0) {
            text += separator;
            text += kReasonWords[bit];
            separator = ',';
        }
    return text;
}

}  // namespace tactiled::ctl
