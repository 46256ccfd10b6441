// Events after which the zero, the range or the sensor may be another one. Eight sensors are calibrated, tared and pressed;
// the event happens; they are held, pressed five times, unloaded, tared if they are not GOOD, and pressed again. Each event
// is repeated with a device that has changed and with one that has not. Prints the samples that are GOOD and wrong by more
// than 10 % of full scale and 5 sd, in parentheses with zero_after = "keep" and accept_too_quiet, and the longest time until
// the sensor stays GOOD: from the first frame on, unchanged and under the same force, and from the command of a tare on.
// Some events leave no trace: they are listed for themselves.
//
//   events                 20 s
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/bench/made_device.hpp"

namespace tactiled {
namespace {

constexpr int kSensors = 8;
constexpr char kUnchecked[] = "zero_after = \"keep\"\naccept_too_quiet = true\n";
constexpr auto kMs = std::uint64_t{1'000'000};

struct Count {
    int wrong = 0, samples = 0;
    double again_s = 0, tared_s = 0;  // 0: never
};

// A device, its daemon and its user. `changes`: the device does not come out of an event as it was.
class Trial {
public:
    Trial(const std::filesystem::path& folder, int number, const Calibration& calibration, bool changes, const char* keys)
        : daemon(folder, calibration, keys), made(number, number < kSensors / 2), changes_(changes) {
        daemon.keep_zeros();
    }
    Running daemon;
    Made made;
    Force force{};  // on the sensor

    // Returns the time until the samples remain GOOD; 0: the last one is not.
    double run(double seconds) {
        double last_s = 0;
        bool is_good = false;
        for (int i = 1; i <= int(seconds * kRate_Hz); ++i) {
            Force seen;
            for (std::size_t c = 0; c < seen.size(); ++c) seen[c] = force[c] - taken_[c];
            if (!is_repeated) numbers_ = reads_(made.read(seen));
            const tactiled_sample s = daemon.send(numbers_, kPeriod_ns);
            is_good = s.quality == TACTILED_GOOD;
            if (!is_good) last_s = i / kRate_Hz;
            bool is_wrong = false;
            for (std::size_t c = 0; c < 3; ++c) {
                const double error_N = std::abs(s.force_S_N[c] - force[c]);
                is_wrong |= error_N > 0.1 * kFullScale_N && error_N > 5 * s.sd_force_N[c];
            }
            ++count.samples;
            count.wrong += is_good && is_wrong ? 1 : 0;
        }
        return is_good ? last_s + 1 / kRate_Hz : 0;
    }
    double tare() {
        force = {};
        (void)run(1.5);
        daemon.tare();
        return run(2);
    }
    void press_often() {
        for (int i = 0; i < 5; ++i) {
            force = made.load();
            (void)run(1);
        }
    }

    // ---- events of the device ----

    void take_zero() {
        if (changes_) taken_ = force;
    }
    void drift_N(double fz_N) {
        if (changes_) taken_[2] += fz_N;
    }
    void exchange() {
        if (changes_) made.move_zero();
    }
    void read_as(const Change& change) {
        if (changes_) reads_ = change.read;
    }
    void restart(std::uint64_t ms, bool is_connected = true) {
        daemon.wait(ms * kMs, is_connected);
        daemon.restart_device();
    }
    void blink(std::uint64_t ms, bool is_connected) { daemon.wait(ms * kMs, is_connected, std::uint32_t(ms / 10)); }
    // Everything is switched off for two seconds.
    void power_cycle(bool is_killed) {
        daemon.end_daemon(is_killed);
        daemon.restart_device();
        daemon.start_daemon(2000 * kMs);
    }
    bool is_repeated = false;
    Count count;

private:
    bool changes_;
    Force taken_{};  // by the device for its zero
    std::function<Numbers(const Numbers&)> reads_ = [](const Numbers& numbers) { return numbers; };
    Numbers numbers_;
};

enum class Has { clock, number, byte, neither };
enum class Use { held, rests, untared };
enum class Remedy { tare, none };
struct Event {
    const char* name;
    Has has;
    Use use;
    std::function<void(Trial&)> happens;
    Remedy remedy = Remedy::tare;
};

const Change kSwapped =
    of_words("", [](const auto& words, std::size_t k) { return float_of(words[2 * k + 1], words[2 * k]); });
const Change kShifted =
    of_words("", [](const auto& words, std::size_t k) { return float_of(words[2 * k + 1], words[2 * k + 2]); });
const Change kShort = of_words("", [](const auto& words, std::size_t k) { return double(std::int16_t(words[k])); });

// The zero moves, and a new tare takes it; the force is then the one before.
void tare_again(Trial& t) {
    const Force held = t.force;
    t.drift_N(0.15 * kFullScale_N);
    (void)t.tare();
    t.force = held;
    (void)t.run(1);
}

// A tare cannot repair a device whose numbers have another scale or sign.
const std::vector<Event> kEvents = {
    {"restart of 30 ms, takes its load for zero", Has::clock, Use::held, [](Trial& t) { t.restart(30), t.take_zero(); }},
    {"restart of 300 ms, takes its load for zero", Has::clock, Use::held, [](Trial& t) { t.restart(300), t.take_zero(); }},
    {"the same with a number alone", Has::number, Use::held, [](Trial& t) { t.restart(300), t.take_zero(); }},
    {"restart of 2 s without clock or number", Has::neither, Use::held, [](Trial& t) { t.restart(2000), t.take_zero(); }},
    {"restart at rest", Has::clock, Use::rests, [](Trial& t) { t.restart(300); }},
    {"20 restarts at rest, each moves the zero by 0.6 % of full scale", Has::clock, Use::rests,
     [](Trial& t) {
         for (int i = 0; i < 20; ++i, (void)t.run(1)) t.restart(300), t.drift_N(0.006 * kFullScale_N);
     }},
    {"blink of 50 ms, the link stays", Has::clock, Use::held, [](Trial& t) { t.blink(50, true); }},
    {"blink of 50 ms, the link is lost", Has::clock, Use::held, [](Trial& t) { t.blink(50, false); }},
    {"blink of 50 ms, the link is lost, takes its load for zero, without clock or number", Has::neither, Use::held,
     [](Trial& t) { t.blink(50, false), t.take_zero(); }},
    {"link lost for 500 ms, the same", Has::neither, Use::held, [](Trial& t) { t.blink(500, false), t.take_zero(); }},
    {"silent for 3 s, the number goes on", Has::number, Use::held, [](Trial& t) { t.blink(3000, true); }},
    {"link reopened after 3 s, the clock goes on", Has::clock, Use::held, [](Trial& t) { t.blink(3000, false); }},
    {"daemon and device off for 2 s, takes its load for zero", Has::clock, Use::held,
     [](Trial& t) { t.take_zero(), t.power_cycle(false); }},
    {"kill -9, the device takes its load for zero", Has::clock, Use::held,
     [](Trial& t) { t.take_zero(), t.power_cycle(true); }},
    {"kill -9, another load, the device takes it for zero", Has::clock, Use::held,
     [](Trial& t) { t.force = t.made.load(), t.take_zero(), t.power_cycle(true); }},
    {"kill -9 while doubted", Has::clock, Use::held,
     [](Trial& t) { t.restart(300), t.take_zero(), (void)t.run(1), t.power_cycle(true); }},
    {"end in order while doubted", Has::clock, Use::held,
     [](Trial& t) { t.restart(300), t.take_zero(), (void)t.run(1), t.power_cycle(false); }},
    {"reload while doubted, never tared", Has::clock, Use::untared,
     [](Trial& t) { t.restart(300), t.take_zero(), (void)t.run(1), t.daemon.reload(); }},
    {"unplugged for 3 s, another sensor", Has::neither, Use::held, [](Trial& t) { t.restart(3000, false), t.exchange(); }},
    {"unplugged for 400 ms, another sensor with a clock", Has::clock, Use::held,
     [](Trial& t) { t.restart(400, false), t.exchange(); }},
    {"unplugged for 400 ms, another sensor with a number ahead", Has::number, Use::held,
     [](Trial& t) { t.restart(400, false), t.daemon.restart_device(20'000), t.exchange(); }},
    {"head exchanged, a channel is missing for 3 s", Has::clock, Use::held,
     [](Trial& t) { t.daemon.missing = 1, (void)t.run(3), t.daemon.missing = 0, t.exchange(); }},
    {"signs turned after a restart", Has::clock, Use::held,
     [](Trial& t) { t.restart(300), t.read_as(scaled("", -1, false)); }, Remedy::none},
    {"16 bits become 12 after a restart", Has::clock, Use::held,
     [](Trial& t) { t.restart(300), t.read_as(scaled("", 1. / 16, true)); }, Remedy::none},
    {"12 bits become 16 after a restart", Has::clock, Use::held,
     [](Trial& t) { t.restart(300), t.read_as(scaled("", 16, true)); }, Remedy::none},
    {"link lost for 300 ms, words swapped", Has::neither, Use::held,
     [](Trial& t) { t.blink(300, false), t.read_as(kSwapped); }, Remedy::none},
    {"link lost for 300 ms, one register on", Has::neither, Use::held,
     [](Trial& t) { t.blink(300, false), t.read_as(kShifted); }, Remedy::none},
    {"link lost for 300 ms, int16 for float32", Has::neither, Use::held,
     [](Trial& t) { t.blink(300, false), t.read_as(kShort); }, Remedy::none},
    {"a gateway repeats its numbers, the force changes 1 s later", Has::neither, Use::held,
     [](Trial& t) {
         t.is_repeated = true, (void)t.run(1), t.force = t.made.load(), (void)t.run(3);
         t.is_repeated = false;
     }},
    {"two daemons with one file of zeros", Has::clock, Use::held,
     [](Trial& t) {
         try {
             const ZeroStore second({t.daemon.file_of_zeros(), t.daemon.file_of_zeros()}, {});
             ++t.count.wrong;
         } catch (const SetupError&) {}
     }},
    {"a digit of the file of zeros is changed", Has::clock, Use::held,
     [](Trial& t) {
         t.daemon.end_daemon(false);
         std::fstream file(t.daemon.file_of_zeros());
         const std::string text((std::istreambuf_iterator<char>(file)), {});
         const std::size_t at = text.find('.', text.find("wrench_S")) - 1;
         file.seekp(std::streamoff(at)).put(text[at] == '9' ? '8' : '9').flush();
         t.daemon.start_daemon(2000 * kMs);
     }},
    {"the file of zeros of an earlier tare", Has::clock, Use::held,
     [](Trial& t) {
         const std::string file = t.daemon.file_of_zeros(), earlier = file + ".earlier";
         t.daemon.end_daemon(false);
         std::filesystem::copy_file(file, earlier, std::filesystem::copy_options::overwrite_existing);
         t.daemon.start_daemon(2000 * kMs);
         tare_again(t);
         t.daemon.end_daemon(false);
         std::filesystem::copy_file(earlier, file, std::filesystem::copy_options::overwrite_existing);
         t.daemon.start_daemon(2000 * kMs);
     }},
};

// The frames before and after are those of an unchanged device, or the evidence comes too late.
const std::vector<Event> kUnobservable = {
    {"zero button of the device, its clock goes on", Has::clock, Use::held, [](Trial& t) { t.take_zero(); }},
    {"zero button between two frames, without clock or number", Has::neither, Use::held,
     [](Trial& t) { t.restart(300), t.take_zero(); }},
    {"restart of 500 ms with a number of 8 bits alone", Has::byte, Use::held,
     [](Trial& t) { t.restart(500), t.take_zero(); }},
    {"front end zeroed in a silence of 3 s, the clock goes on", Has::clock, Use::held,
     [](Trial& t) { t.blink(3000, true), t.take_zero(); }},
    {"off at rest, a part is gripped, the device takes it for zero", Has::clock, Use::rests,
     [](Trial& t) { t.force = t.made.load(), t.take_zero(), t.power_cycle(false); }},
    {"the file of zeros is deleted after the zero has moved", Has::clock, Use::held,
     [](Trial& t) {
         tare_again(t);
         t.daemon.end_daemon(false);
         std::filesystem::remove(t.daemon.file_of_zeros());
         t.daemon.start_daemon(2000 * kMs);
     }},
    {"signs turned on a link that stays", Has::clock, Use::rests, [](Trial& t) { t.read_as(scaled("", -1, false)); },
     Remedy::none},
    {"gain 20 % larger on a link that stays", Has::clock, Use::rests, [](Trial& t) { t.read_as(scaled("", 1.2, false)); },
     Remedy::none},
    {"12 bits become 16 after a restart at rest", Has::clock, Use::rests,
     [](Trial& t) { t.restart(300), t.read_as(scaled("", 16, true)); }, Remedy::none},
    {"a gateway repeats its numbers, the force changes at once", Has::neither, Use::held,
     [](Trial& t) {
         t.is_repeated = true, t.force = t.made.load(), (void)t.run(3);
         t.is_repeated = false;
     }},
};

Count try_once(const std::filesystem::path& folder, int number, const Calibration& calibration, const Event& event,
               bool changes, const char* keys = "") {
    std::filesystem::remove(folder / "zeros.toml");
    Trial trial(folder, number, calibration, changes, keys);
    trial.daemon.has_clock = event.has == Has::clock;
    trial.daemon.has_number = event.has == Has::number || event.has == Has::byte;
    trial.daemon.bits = event.has == Has::byte ? 8 : 16;
    (void)trial.run(2);
    if (event.use != Use::untared) (void)trial.tare();
    if (event.use != Use::rests) trial.force = trial.made.load();
    (void)trial.run(3);
    trial.count = {};
    event.happens(trial);
    trial.count.again_s = trial.run(5);
    trial.press_often();
    trial.force = {};
    if (event.remedy == Remedy::none && changes) return trial.count;
    if (trial.run(1) == 0) trial.count.tared_s = trial.tare();
    trial.press_often();
    return trial.count;
}

struct Summary {
    int events = 0, wrong = 0, without = 0;
    std::vector<double> again_s, tared_s;
};

Summary try_all(const std::filesystem::path& folder, const std::vector<Event>& events) {
    std::vector<Calibration> calibrations;
    for (int number = 0; number < kSensors; ++number)
        calibrations.push_back(Made(number, number < kSensors / 2).calibrate());
    Summary summary;
    for (const Event& event : events) {
        Count all;
        int again = 0, without = 0;
        for (int number = 0; number < kSensors; ++number) {
            const Calibration& calibration = calibrations[std::size_t(number)];
            without += try_once(folder, number, calibration, event, true, kUnchecked).wrong;
            for (const bool changes : {true, false}) {
                const Count one = try_once(folder, number, calibration, event, changes);
                all.wrong += one.wrong;
                all.samples += one.samples;
                all.tared_s = std::max(all.tared_s, one.tared_s);
                if (changes) continue;
                again += one.again_s > 0 ? 1 : 0;
                all.again_s = std::max(all.again_s, one.again_s);
            }
        }
        ++summary.events;
        summary.wrong += all.wrong > 0 ? 1 : 0;
        summary.without += without > 0 ? 1 : 0;
        if (again == kSensors) summary.again_s.push_back(all.again_s);
        if (all.tared_s > 0) summary.tared_s.push_back(all.tared_s);
        fmt::print("{}: {} of {} ({}) GOOD and wrong; GOOD again: {}, after a tare: {}\n", event.name, all.wrong,
                   all.samples, without,
                   again == kSensors ? fmt::format("{:.2f} s", all.again_s) : fmt::format("{} of {}", again, kSensors),
                   all.tared_s > 0 ? fmt::format("{:.2f} s", all.tared_s) : "-");
        std::fflush(stdout);
    }
    return summary;
}

double median(std::vector<double> of) {
    std::sort(of.begin(), of.end());
    return of[of.size() / 2];
}

void run() {
    const std::filesystem::path folder = std::filesystem::temp_directory_path() / fmt::format("events.{}", getpid());
    std::filesystem::create_directory(folder);
    const Summary seen = try_all(folder, kEvents);
    fmt::print("\nunobservable:\n");
    const Summary unseen = try_all(folder, kUnobservable);
    fmt::print("\n{} events, {} ({}) with a sample GOOD and wrong\n", seen.events, seen.wrong, seen.without);
    fmt::print("GOOD again, unchanged: median {:.2f} s, longest {:.2f} s, {} events\n", median(seen.again_s),
               *std::max_element(seen.again_s.begin(), seen.again_s.end()), seen.again_s.size());
    fmt::print("GOOD again, after a tare: median {:.2f} s, longest {:.2f} s, {} events\n", median(seen.tared_s),
               *std::max_element(seen.tared_s.begin(), seen.tared_s.end()), seen.tared_s.size());
    fmt::print("{} unobservable events, {} with a sample GOOD and wrong\n", unseen.events, unseen.wrong);
    std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace tactiled

int main() { tactiled::run(); }
