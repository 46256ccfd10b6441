#include "node/ctl/guided.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <thread>

#include "node/ctl/ask.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kMoves = 0.01, kMoves_sds = 6;  // between the halves of the time: of the force, and of their noise
constexpr std::size_t kLeastSamples = 8;

struct Sum {
    std::array<double, 6> sum{}, tared{}, squares{};
    std::array<double, 6> half{};  // sums of the first half
    std::size_t n = 0, n_half = 0;
    std::uint64_t sequence = UINT64_MAX;
};

}  // namespace

std::optional<std::string> ask_person(const std::string& text) {
    fmt::print("{}", text);
    std::fflush(stdout);
    std::string line;
    for (char c = 0; interrupted == 0;) {
        const ssize_t n = ::read(STDIN_FILENO, &c, 1);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return std::nullopt;
        if (c == '\n') return line;
        line += c;
    }
    return std::nullopt;
}

std::optional<std::array<double, 3>> three_numbers(const std::string& text) {
    std::string spaced = text;
    for (char& c : spaced)
        if (c == ',' || c == '[' || c == ']') c = ' ';
    std::istringstream words(spaced);
    std::array<double, 3> out{};
    std::string more;
    if (!(words >> out[0] >> out[1] >> out[2]) || words >> more) return std::nullopt;
    return out;
}

Node configuration_of(const Segment& segment, const std::string& path) {
    std::string file = path, why;
    if (file.empty()) file = ask_plain(segment, "config-file", 5, why);
    if (file.empty() || (path.empty() && file.front() != '/'))
        throw SetupError(fmt::format("the daemon does not say where its configuration is ({}); name it with --config", why));
    Problems problems;
    Node node = load_node(std::filesystem::absolute(file).string(), problems);
    problems.throw_if_any();
    return node;
}

Observed observe(const Segment& segment, std::uint32_t mask, double seconds) {
    Observed out;
    const std::uint64_t begun_ns = monotonic_ns(), end_ns = begun_ns + std::uint64_t(seconds * 1e9);
    std::vector<Sum> sums(segment.n_sensors());
    while (monotonic_ns() < end_ns && interrupted == 0) {
        std::this_thread::sleep_for(std::chrono::microseconds(500));
        const bool first_half = monotonic_ns() < begun_ns + (end_ns - begun_ns) / 2;
        for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
            if ((mask >> i & 1u) == 0) continue;
            tactiled_sample s{};
            if (!segment.latest(i, s) || s.quality == TACTILED_BAD || s.quality == TACTILED_NO_VALUE) {
                out.fault = fmt::format("sensor \"{}\" has no value: {}", segment.sensor(i).name,
                                        quality_text(s.quality, s.reasons));
                return out;
            }
            Sum& sum = sums[i];
            if (s.sequence == sum.sequence) continue;
            sum.sequence = s.sequence;
            ++sum.n;
            sum.n_half += first_half ? 1 : 0;
            for (std::size_t k = 0; k < 6; ++k) {
                const double raw = k < 3 ? s.raw_force_S_N[k] : s.raw_torque_S_Nm[k - 3];
                sum.sum[k] += raw;
                sum.squares[k] += raw * raw;
                if (first_half) sum.half[k] += raw;
                sum.tared[k] += k < 3 ? s.force_S_N[k] : s.torque_S_Nm[k - 3];
            }
        }
    }
    tactiled_node node{};
    for (double& g : out.gravity_G_m_s2) g = kNaN;
    if (segment.latest_node(node) && node.tool.quality != TACTILED_NO_VALUE)
        for (std::size_t k = 0; k < 3; ++k) out.gravity_G_m_s2[k] = double(node.tool.gravity_G_m_s2[k]);
    out.raw_S.resize(sums.size());
    out.tared_S.resize(sums.size());
    out.scatter_N.resize(sums.size());
    for (std::size_t i = 0; i < sums.size(); ++i) {
        if ((mask >> i & 1u) == 0) continue;
        const Sum& sum = sums[i];
        const double n = double(sum.n), n_half = double(sum.n_half);
        if (sum.n_half < kLeastSamples || sum.n - sum.n_half < kLeastSamples) {
            out.fault = fmt::format("sensor \"{}\" sent {} samples in {:g} s: too few",
                                    segment.sensor(std::uint32_t(i)).name, sum.n, seconds);
            return out;
        }
        double size_N = 0, moves_N = 0;
        for (std::size_t k = 0; k < 6; ++k) {
            out.raw_S[i][k] = sum.sum[k] / n;
            out.tared_S[i][k] = sum.tared[k] / n;
            if (k >= 3 || !std::isfinite(out.raw_S[i][k])) continue;
            size_N = std::hypot(size_N, out.raw_S[i][k]);
            const double scatter = std::sqrt(std::max(0.0, sum.squares[k] / n - out.raw_S[i][k] * out.raw_S[i][k]));
            out.scatter_N[i] = std::max(out.scatter_N[i], scatter);
            moves_N = std::max(moves_N, std::abs(sum.half[k] / n_half - (sum.sum[k] - sum.half[k]) / (n - n_half)));
        }
        if (moves_N > std::hypot(kMoves * size_N, kMoves_sds * out.scatter_N[i] / std::sqrt(n_half)))
            out.fault = fmt::format("the force of sensor \"{}\" moved by {:.3f} N: wait until the hand rests",
                                    segment.sensor(std::uint32_t(i)).name, moves_N);
    }
    return out;
}

}  // namespace tactiled::ctl
