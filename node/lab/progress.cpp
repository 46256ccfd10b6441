#include "node/lab/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

Progress::Progress(std::string what) : what_(std::move(what)), began_ns_(monotonic_ns()), watched_(::isatty(2) != 0) {}

Progress::~Progress() {
    if (shown_ns_ != 0) fmt::print(stderr, "\r\x1b[K");
}

void Progress::show(double share) {
    if (!watched_) return;
    const std::uint64_t now_ns = monotonic_ns();
    if (now_ns - began_ns_ < 2'000'000'000u || now_ns - shown_ns_ < 100'000'000u) return;
    shown_ns_ = now_ns;
    constexpr int kWidth = 30;
    const int full = int(share * kWidth);
    const double left_s = double(now_ns - began_ns_) * 1e-9 * (1 / std::max(share, 1e-9) - 1);
    fmt::print(stderr, "\r{} [{:#<{}}{:.<{}}] {:3.0f} %, {:.0f} s left\x1b[K", what_, "", full, "", kWidth - full,
               100 * share, left_s);
}

}  // namespace tactiled::ctl
