// A device whose numbers are scaled or read in another way than in its calibration: range, unit, order of words, registers
// beside, types. 40 sensors are calibrated from a recording with rests, tared, and changed; they rest for 5 s and are
// pressed for 5 s. Prints the samples that are GOOD and wrong by more than 10 % of full scale, in parentheses with
// accept_too_quiet, and when the last one was published, counted from the first rest. Then 100 hours without a change.
//
//   quiet                 70 s
//   quiet --count N       N frames, for instruction counts by valgrind; --count N bare: without the check
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string_view>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/recording_checks.hpp"
#include "node/quiet_check.hpp"
#include "tests/bench/running.hpp"

namespace tactiled {
namespace {

constexpr double kFullScale_N = 10, kNoise = 8, kWidth = 16'000, kRate_Hz = 100;  // counts
constexpr int kSensors = 40;
constexpr auto kPeriod_ns = std::uint64_t(1e9 / kRate_Hz);
using Force = std::array<double, 3>;

// Words of float32 numbers, as a device has them in its registers: the high word first.
std::vector<std::uint16_t> words_of(const Numbers& numbers) {
    std::vector<std::uint16_t> words;
    for (const double x : numbers) {
        const auto bits = std::bit_cast<std::uint32_t>(float(x));
        words.push_back(std::uint16_t(bits >> 16));
        words.push_back(std::uint16_t(bits));
    }
    return words;
}
double float_of(std::uint16_t high, std::uint16_t low) {
    return double(std::bit_cast<float>(std::uint32_t(high) << 16 | low));
}

struct Change {
    const char* name;
    std::function<Numbers(const Numbers&)> read;
};
Change scaled(const char* name, double factor, bool rounds) {
    return {name, [=](Numbers numbers) {
                for (double& x : numbers) x = rounds ? std::round(x * factor) : x * factor;
                return numbers;
            }};
}
Change of_words(const char* name, const std::function<double(const std::vector<std::uint16_t>&, std::size_t)>& number) {
    return {name, [=](Numbers numbers) {
                auto words = words_of(numbers);
                words.resize(words.size() + 4 * numbers.size());
                for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] = number(words, k);
                return numbers;
            }};
}
const std::vector<Change> kChanges = {
    scaled("16 bits become 12", 1. / 16, true),
    scaled("12 bits become 16", 16, true),
    scaled("unit 1000 times larger", 1e-3, false),
    scaled("unit 1000 times smaller", 1e3, false),
    of_words("word order", [](const auto& words, std::size_t k) { return float_of(words[2 * k + 1], words[2 * k]); }),
    of_words("one register on",
             [](const auto& words, std::size_t k) { return float_of(words[2 * k + 1], words[2 * k + 2]); }),
    of_words("int16 for float32", [](const auto& words, std::size_t k) { return double(std::int16_t(words[k])); }),
    of_words("float64 for float32",
             [](const auto& words, std::size_t k) {
                 std::uint64_t bits = 0;
                 for (std::size_t i = 0; i < 4; ++i) bits = bits << 16 | words[4 * k + i];
                 return std::bit_cast<double>(bits);
             }),
    scaled("gain 10 % larger", 1.1, false),
};

// Channels with random gains and zeros, and noise.
class Made {
public:
    explicit Made(int number) : random_(unsigned(number)) {
        static constexpr std::size_t kChannels[] = {3, 6, 8, 15};
        gain_.resize(kChannels[std::size_t(number) % 4]);
        for (auto& row : gain_)
            for (double& x : row) x = normal_(random_) * kWidth / kFullScale_N / 2;
        const double zero = number < kSensors / 2 ? kWidth / 4 : 0;  // at 0, a scale does not show without a load
        for (std::size_t k = 0; k < gain_.size(); ++k) zero_.push_back(zero * normal_(random_));
    }
    Numbers read(const Force& force) {
        Numbers numbers;
        for (std::size_t k = 0; k < gain_.size(); ++k) {
            double x = zero_[k] + kNoise * normal_(random_);
            for (std::size_t c = 0; c < 3; ++c) x += gain_[k][c] * force[c];
            numbers.push_back(std::round(x));
        }
        return numbers;
    }
    Force load() {
        std::uniform_real_distribution<double> uniform(-0.8, 0.8);
        return {kFullScale_N * uniform(random_), kFullScale_N * uniform(random_), kFullScale_N * uniform(random_)};
    }
    // 60 loads of half a second, and a rest after each.
    Calibration calibrate() {
        Labelled labelled{.name = "made.csv", .channels = {}, .sessions = {"1"}, .rows = {}};
        for (std::size_t k = 0; k < gain_.size(); ++k) labelled.channels.push_back(fmt::format("c{}", k + 1));
        for (int held = 0; held < 120; ++held) {
            const Force force = held % 2 == 0 ? Force{} : load();
            for (int i = 0; i < int(kRate_Hz / 2); ++i) {
                const std::size_t n = labelled.rows.size() + 1;
                labelled.rows.push_back({.line = std::int64_t(n) + 1,
                                         .channel = read(force),
                                         .wrench_S = {force[0], force[1], force[2], kNaN, kNaN, kNaN},
                                         .session = 0,
                                         .t_ns = std::uint64_t(double(n) * 1e9 / kRate_Hz)});
            }
        }
        FitRequest request;
        request.model = "generic";
        request.method = "matrix";
        request.date = "2026-01-01";
        return fit(labelled, request).calibration;
    }

private:
    std::mt19937_64 random_;
    std::normal_distribution<double> normal_;
    std::vector<Force> gain_;
    Numbers zero_;
};

struct Count {
    int wrong = 0, samples = 0;
    double last_s = 0;
};

// The device has changed, and has started again where that `is_seen`.
Count changed(const std::filesystem::path& folder, Made made, const Calibration& calibration, const Change& change,
              bool is_seen, const std::string& keys) {
    Running running(folder, calibration, keys);
    const auto seconds = [](double s) { return int(s * kRate_Hz); };
    for (int i = 0; i < seconds(1); ++i) (void)running.send(made.read({}), kPeriod_ns);
    running.tare();
    for (int i = 0; i < seconds(5); ++i) (void)running.send(made.read({}), kPeriod_ns);
    if (is_seen) running.restart_device();
    Count count;
    Force force{};
    for (int i = 0; i < seconds(10); ++i, ++count.samples) {
        if (i == seconds(5)) force = made.load();
        const tactiled_sample s = running.send(change.read(made.read(force)), kPeriod_ns);
        bool wrong = false;
        for (std::size_t c = 0; c < 3; ++c) wrong |= std::abs(s.force_S_N[c] - force[c]) > 0.1 * kFullScale_N;
        if (s.quality != TACTILED_GOOD || !wrong) continue;
        ++count.wrong;
        count.last_s = i / kRate_Hz;
    }
    return count;
}

// A real skin (tests/data/eflesh): the rests of a part of its recording, and whether the rest of it alarms, as it is and
// with a sixteenth of its numbers.
void run_skin(const std::filesystem::path& folder) {
    constexpr double kPart = 0.7;  // a shorter one has fewer than 200 readings of held loads
    const std::string packed = TACTILED_SOURCE_DIR "/tests/data/eflesh/shear_labelled.csv.xz", file = folder / "shear.csv";
    if (std::system(fmt::format("xz -dc {} > {}", packed, file).c_str()) != 0) throw SetupError(packed + ": xz failed");
    const Labelled skin = read_labelled(file, {});
    Rows calibrated, other;
    for (const auto& row : skin.rows)
        (double(calibrated.size()) < kPart * double(skin.rows.size()) ? calibrated : other).push_back(&row);
    const Repeats repeats = repeats_of(calibrated);
    if (repeats.noise.empty()) throw SetupError(packed + ": has no rests");
    Tuning tuning;
    tuning.noise_interval_ns = std::uint64_t(repeats.interval_s * 1e9);
    for (std::size_t k = 0; k < repeats.noise.size(); ++k)
        tuning.least_noise_of[k] = 2 * repeats.noise[k] * repeats.noise[k] / 16;
    for (const double scale : {1., 1. / 16}) {
        QuietCheck check;
        int alarms = 0;
        double first_s = kNaN;
        const auto seconds = [&](const LabelledRow& row) { return double(row.t_ns - other[0]->t_ns) * 1e-9; };
        for (const auto* row : other) {
            Numbers numbers = row->channel;
            for (double& x : numbers) x *= scale;
            if (check.judge(numbers, ~0u, row->t_ns, tuning) && alarms++ == 0) first_s = seconds(*row);
        }
        fmt::print("skin, {}: {} alarms in {:.0f} s, first after {:.2f} s\n", scale == 1 ? "unchanged" : "scaled", alarms,
                   seconds(*other.back()), first_s);
    }
}

void run() {
    const std::filesystem::path folder = std::filesystem::temp_directory_path() / fmt::format("quiet.{}", getpid());
    std::filesystem::create_directory(folder);
    std::vector<Calibration> calibrations;
    for (int number = 0; number < kSensors; ++number) calibrations.push_back(Made(number).calibrate());
    for (const Change& change : kChanges)
        for (const bool is_seen : {true, false}) {
            Count count, before;
            for (int number = 0; number < kSensors; ++number) {
                const Calibration& calibration = calibrations[std::size_t(number)];
                const Count one = changed(folder, Made(number), calibration, change, is_seen, "");
                const Count other = changed(folder, Made(number), calibration, change, is_seen, "accept_too_quiet = true\n");
                count = {count.wrong + one.wrong, count.samples + one.samples, std::max(count.last_s, one.last_s)};
                before = {before.wrong + other.wrong, before.samples + other.samples, 0};
            }
            fmt::print("{}, {}: {:.2f} % ({:.2f} %), last after {:.2f} s\n", change.name,
                       is_seen ? "restart seen" : "not seen", 100. * count.wrong / count.samples,
                       100. * before.wrong / before.samples, count.last_s);
        }
    run_skin(folder);
    int alarms = 0, samples = 0;
    for (int number = 0; number < kSensors; ++number) {
        Made made(number);
        Running running(folder, calibrations[std::size_t(number)], "");
        Force force{};
        for (int i = 0; i < int(100 * 3600 * kRate_Hz / kSensors); ++i, ++samples) {
            if (i % int(10 * kRate_Hz) == 0) force = i % int(20 * kRate_Hz) == 0 ? Force{} : made.load();
            alarms += (running.send(made.read(force), kPeriod_ns).reasons & TACTILED_TOO_QUIET) != 0 ? 1 : 0;
        }
    }
    fmt::print("unchanged: {} of {} samples too quiet, {:.0f} h\n", alarms, samples, samples / kRate_Hz / 3600);
    std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace tactiled

// The check of a frame with six channels, for instruction counts by valgrind.
int main(int argc, char** argv) {
    if (argc < 3 || std::string_view(argv[1]) != "--count") return tactiled::run(), 0;
    tactiled::Tuning tuning;
    tuning.least_noise_of.fill(1);
    tuning.noise_interval_ns = 1;
    tactiled::QuietCheck check;
    std::array<double, 6> raw{};
    unsigned quiet = 0;
    for (std::uint64_t i = 1; i <= std::strtoull(argv[2], nullptr, 10); ++i) {
        for (std::size_t k = 0; k < raw.size(); ++k) raw[k] = double(i * (k + 3) % 7);
        if (argc == 3) quiet += check.judge(raw, 0x3F, i * 1'000'000, tuning) ? 1 : 0;
    }
    return quiet != 0 || raw[0] > 7;
}
