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
#include <cmath>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>
#include <random>
#include <string_view>
#include <vector>

#include "decoupling/fit/recording_checks.hpp"
#include "node/quiet_check.hpp"
#include "tests/bench/made_device.hpp"
#include "tests/bench/recording.hpp"

namespace tactiled {
namespace {

constexpr int kSensors = 40;

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

// At 0, a scale does not show without a load.
Made made_device(int number) { return {number, number < kSensors / 2}; }

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
    const std::string name = "eflesh/shear_labelled";
    const Labelled skin = read_labelled(unpacked(name, folder / "shear.csv"), {});
    Rows calibrated, other;
    for (const auto& row : skin.rows)
        (double(calibrated.size()) < kPart * double(skin.rows.size()) ? calibrated : other).push_back(&row);
    const Repeats repeats = repeats_of(calibrated);
    if (repeats.noise.empty()) throw SetupError(name + ": has no rests");
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
    for (int number = 0; number < kSensors; ++number) calibrations.push_back(made_device(number).calibrate());
    for (const Change& change : kChanges)
        for (const bool is_seen : {true, false}) {
            Count count, before;
            for (int number = 0; number < kSensors; ++number) {
                const Calibration& calibration = calibrations[std::size_t(number)];
                const Count one = changed(folder, made_device(number), calibration, change, is_seen, "");
                const Count other =
                    changed(folder, made_device(number), calibration, change, is_seen, "accept_too_quiet = true\n");
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
        Made made = made_device(number);
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
int main(int argc, char** argv) try {
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
} catch (const std::exception& error) {
    fmt::print(stderr, "quiet: {}\n", error.what());
    return 1;
}
