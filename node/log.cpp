#include "node/log.hpp"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>

namespace tactiled {
namespace {
std::atomic<unsigned> dropped{0};

// Writes one line with one system call, so that lines of several threads do not mix. At most PIPE_BUF bytes, which a
// writable pipe accepts.
void write_line(const char* prefix, std::string_view text) noexcept {
    std::array<char, 1024> line{};
    const int length = std::snprintf(line.data(), line.size() - 1, "%s%.*s", prefix,
                                     int(std::min<std::size_t>(text.size(), 960)), text.data());
    if (length < 0) return;
    const auto size = std::min(std::size_t(length), line.size() - 2);
    line[size] = '\n';
    pollfd standard_error{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&standard_error, 1, 0) != 1 || (standard_error.revents & POLLOUT) == 0 ||
        ::write(STDERR_FILENO, line.data(), size + 1) < 0)
        dropped.fetch_add(1, std::memory_order_relaxed);
}
}  // namespace

void hold_standard_descriptors() noexcept {
    int fd = STDIN_FILENO;
    while (fd >= 0 && fd <= STDERR_FILENO) fd = ::open("/dev/null", O_RDWR);
    if (fd > STDERR_FILENO) ::close(fd);
}

void log_formatted(LogLevel level, fmt::string_view format, fmt::format_args values) noexcept {
    std::array<char, 960> text;
    const std::size_t size = fmt::vformat_to_n(text.data(), text.size(), format, values).size;
    log_text(level, {text.data(), std::min(size, text.size())});
}

void log_text(LogLevel level, std::string_view text) noexcept {
    static const bool journal = ::isatty(STDERR_FILENO) == 0;
    std::array<char, 8> prefix{};
    if (journal)
        std::snprintf(prefix.data(), prefix.size(), "<%d>", int(level));
    else if (level != LogLevel::info)
        std::snprintf(prefix.data(), prefix.size(), "%s", level == LogLevel::error ? "error: " : "warn: ");
    if (const unsigned lines = dropped.exchange(0, std::memory_order_relaxed); lines != 0) {
        std::array<char, 64> note{};
        std::snprintf(note.data(), note.size(), "%u lines of log were dropped here", lines);
        write_line(prefix.data(), note.data());
    }
    write_line(prefix.data(), text);
}

}  // namespace tactiled
