#include "node/lab/capture_load.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

#include "config/options.hpp"
#include "decoupling/fit/labelled.hpp"
#include "drivers/tty.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kG_m_s2 = 9.80665;                 // CGPM 1901
constexpr std::uint64_t kMaxApart_ns = 50'000'000;  // between frame and reference: a load by hand changes within 0.1 s
constexpr std::uint64_t kScaleHolds_ns = 1'000'000'000;
constexpr std::size_t kLongestLine = 200;

std::optional<double> number_of(std::string_view text) {
    if (text.starts_with('+')) text.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size() && std::isfinite(value) ? std::optional(value)
                                                                                            : std::nullopt;
}

class SensorReference final : public Reference {
public:
    SensorReference(const std::string& node, const std::string& sensor) : reader_(node, sensor) {
        if (!reader_.is_attached()) throw SetupError(reader_.why_not());
    }
    void poll() override {
        tactiled_sample s;
        while (reader_.next(s))
            if (s.quality == TACTILED_GOOD || s.quality == TACTILED_UNCERTAIN) samples_.push_back(s);
    }
    [[nodiscard]] std::optional<Load> at(std::uint64_t t_ns) const override {
        const auto after = std::lower_bound(samples_.begin(), samples_.end(), t_ns,
                                            [](const tactiled_sample& s, std::uint64_t t) { return s.t_ns < t; });
        if (after == samples_.end() || after == samples_.begin()) return std::nullopt;
        const tactiled_sample &one = *(after - 1), &two = *after;
        if (two.t_ns - one.t_ns > kMaxApart_ns) return std::nullopt;
        const double share = double(t_ns - one.t_ns) / double(two.t_ns - one.t_ns);
        Load load;
        for (std::size_t c = 0; c < 3; ++c) {
            load[c] = one.force_S_N[c] + share * (two.force_S_N[c] - one.force_S_N[c]);
            load[c + 3] = one.torque_S_Nm[c] + share * (two.torque_S_Nm[c] - one.torque_S_Nm[c]);
        }
        return load;
    }

private:
    Reader reader_;
    std::vector<tactiled_sample> samples_;
};

class ScaleReference final : public Reference {
public:
    ScaleReference(const std::string& device, unsigned baud) {
        std::string why;
        fd_ = open_tty(device, {.baud = baud}, why);
        if (fd_ < 0) throw SetupError(why);
    }
    ScaleReference(const ScaleReference&) = delete;
    ScaleReference& operator=(const ScaleReference&) = delete;
    ~ScaleReference() override { ::close(fd_); }

    void poll() override {
        std::array<char, 512> piece;
        for (pollfd waiting{fd_, POLLIN, 0}; ::poll(&waiting, 1, 0) == 1;) {
            const ssize_t n = ::read(fd_, piece.data(), piece.size());
            if (n <= 0) return;
            for (ssize_t i = 0; i < n; ++i) take(piece[std::size_t(i)]);
        }
    }
    [[nodiscard]] std::optional<Load> at(std::uint64_t t_ns) const override {
        const auto after = std::upper_bound(weights_.begin(), weights_.end(), t_ns,
                                            [](std::uint64_t t, const Weight& w) { return t < w.t_ns; });
        if (after == weights_.begin() || t_ns - (after - 1)->t_ns > kScaleHolds_ns) return std::nullopt;
        return Load{0, 0, -(after - 1)->N, kNaN, kNaN, kNaN};
    }

private:
    struct Weight {
        std::uint64_t t_ns;
        double N;
    };
    void take(char c) {
        if (c != '\n') {
            if (line_.size() < kLongestLine) line_ += c;
            return;
        }
        if (const auto N = scale_line_N(line_); N && begun_) weights_.push_back({monotonic_ns(), *N});
        begun_ = true;  // the first line may have lost its beginning
        line_.clear();
    }
    int fd_ = -1;
    bool begun_ = false;
    std::string line_;
    std::vector<Weight> weights_;
};

}  // namespace

Load parse_load(const std::vector<std::string>& words) {
    Load load;
    load.fill(kNaN);
    std::vector<std::string> known;
    for (std::size_t c = 0; c < load.size(); ++c) known.push_back(label_column(c));
    for (std::string text : words) {
        std::replace(text.begin(), text.end(), ',', ' ');
        for (std::size_t at = 0; (at = text.find_first_not_of(' ', at)) != text.npos;) {
            const std::size_t end = std::min(text.find(' ', at), text.size());
            const std::string word = text.substr(at, end - at);
            const std::size_t equals = word.find('=');
            const std::string name = word.substr(0, equals);
            const auto found = std::find(known.begin(), known.end(), name);
            const auto value = equals == word.npos ? std::nullopt : number_of(std::string_view(word).substr(equals + 1));
            if (equals == word.npos && number_of(word))
                throw SetupError(
                    fmt::format("label {}: a number without a name; write a decimal point in {}=-0.5, and a "
                                "comma between two loads",
                                in_quotes(word), known[2]));
            if (found == known.end())
                throw SetupError(fmt::format("label {}: {} {}", in_quotes(word), in_quotes(name), is_unknown(name, known)));
            if (!value)
                throw SetupError(fmt::format("label {}: write {}=NUMBER, such as {}=-5", in_quotes(word), name, name));
            load[std::size_t(found - known.begin())] = *value;
            at = end;
        }
    }
    return load;
}

std::string load_text(const Load& load) {
    std::vector<std::string> parts;
    for (std::size_t c = 0; c < load.size(); ++c)
        if (std::isfinite(load[c])) parts.push_back(fmt::format("{}={:g}", label_column(c), load[c]));
    return fmt::format("{}", fmt::join(parts, " "));
}

std::optional<double> scale_line_N(const std::string& line) {
    // Finds the last number of the line that is followed by a unit.
    for (std::size_t at = line.size(); at-- > 0;) {
        if (std::isdigit(static_cast<unsigned char>(line[at])) == 0) continue;
        std::size_t begin = at + 1;
        while (begin > 0 && (std::isdigit(static_cast<unsigned char>(line[begin - 1])) != 0 || line[begin - 1] == '.'))
            --begin;
        std::size_t sign = begin;
        while (sign > 0 && line[sign - 1] == ' ') --sign;  // scales print a blank between the sign and the digits
        const bool negative = sign > 0 && line[sign - 1] == '-';
        const auto value = number_of(std::string_view(line).substr(begin, at + 1 - begin));
        std::size_t unit = at + 1;
        while (unit < line.size() && line[unit] == ' ') ++unit;
        std::size_t end = unit;
        while (end < line.size() && std::isalpha(static_cast<unsigned char>(line[end])) != 0) ++end;
        const std::string name = line.substr(unit, end - unit);
        const double factor = name == "kg" ? kG_m_s2 : name == "g" ? kG_m_s2 / 1000 : name == "N" ? 1 : 0;
        if (value && factor != 0) return (negative ? -*value : *value) * factor;
        at = begin;
    }
    return std::nullopt;
}

std::unique_ptr<Reference> reference_sensor(const std::string& node, const std::string& sensor) {
    return std::make_unique<SensorReference>(node, sensor);
}
std::unique_ptr<Reference> reference_scale(const std::string& device, unsigned baud) {
    return std::make_unique<ScaleReference>(device, baud);
}

}  // namespace tactiled::ctl
