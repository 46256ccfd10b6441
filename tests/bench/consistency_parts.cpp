// The scenes with an [[expect]] on many sensors of a kind, each calibrated by itself, beside oracles that know the errors of
// such sensors in use: could a standard deviation be sharper in these scenes, and still be true?
#include <fmt/format.h>
#include <fnmatch.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>

#include "consistency.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kSerials = 1000;  // between two sensors of a kind: an array has up to 16
constexpr std::array kEdges{0.02F, 0.1F, 0.2F, 0.3F, 0.4F, 0.5F, 0.6F, 0.7F, 0.8F, 0.9F};  // load
constexpr std::array kPeaks{0.05F, 0.2F, 0.4F, 0.6F, 0.8F};                                // peak since the last rest

template <std::size_t kN>
std::size_t bin_of(const std::array<float, kN>& edges, float value) {
    return std::size_t(std::upper_bound(edges.begin(), edges.end(), value) - edges.begin());
}

// The errors of sensors in use by their load, and by the peak since the last rest, too.
class Oracle {
public:
    void add(const std::vector<Traced>& traced, const std::vector<Traced>& not_tared) {
        for (const Traced& each : not_tared) add(not_tared_[bin_of(kEdges, each.load)], squared_of(each));
        for (const Traced& each : traced) {
            const double squared = squared_of(each);
            const std::size_t load = bin_of(kEdges, each.load);
            add(by_load_[load], squared);
            add(by_peak_[load][bin_of(kPeaks, each.load + each.below_peak)], squared);
        }
    }
    // The rms error of such samples, without and with knowledge of the peak.
    [[nodiscard]] double sd(const Traced& at) const { return rms(by_load_[bin_of(kEdges, at.load)], at); }
    [[nodiscard]] double sd_with_peak(const Traced& at) const {
        return rms(by_peak_[bin_of(kEdges, at.load)][bin_of(kPeaks, at.load + at.below_peak)], at);
    }
    // The larger one of those with a tare and without.
    [[nodiscard]] double sd_without_tare(const Traced& at) const {
        return std::max(sd(at), rms(not_tared_[bin_of(kEdges, at.load)], at));
    }

private:
    struct Bin {
        double squares = 0;
        std::size_t n = 0;
    };
    // The part that latency explains is not of the sensor.
    static double squared_of(const Traced& each) {
        return std::max(0.0, double(each.error) * double(each.error) - double(each.late) * double(each.late));
    }
    static void add(Bin& bin, double squared) { bin.squares += squared, ++bin.n; }
    static double rms(const Bin& bin, const Traced& at) {
        return bin.n == 0 ? double(at.sd) : std::hypot(std::sqrt(bin.squares / double(bin.n)), double(at.late));
    }
    std::array<Bin, kEdges.size() + 1> by_load_{}, not_tared_{};
    std::array<std::array<Bin, kPeaks.size() + 1>, kEdges.size() + 1> by_peak_{};
};

// One scene, or one use, with one method over the sensors.
struct Kind {
    std::vector<std::array<std::vector<Traced>, 6>> of_sensor;
    Shares shares;
    std::array<double, 5> terms{};
    Calibration calibration;  // each sensor sets it

    void take(Course& course, const Calibration& of) {
        of_sensor.push_back(std::move(course.traced()));
        const Shares s = course.shares();
        shares.samples += s.samples, shares.good += s.good;
        shares.undetected += s.undetected, shares.wrong += s.wrong;
        for (std::size_t k = 0; k < terms.size(); ++k) terms[k] += course.terms()[k];
        calibration = of;
    }
};
using Oracles = std::array<Oracle, 6>;

// The sharpness of standard deviations: their median over the rms of the errors, over the components in full scales.
struct Sharpness {
    double sds = 0, errors = 0;
    void add(const std::vector<double>& sd, double squares, double full_scale) {
        if (sd.empty()) return;
        sds += std::pow(median(sd) / full_scale, 2);
        errors += squares / double(sd.size()) / full_scale / full_scale;
    }
    [[nodiscard]] double value() const { return std::sqrt(sds / errors); }
};

constexpr std::size_t kWays = 4;  // ours, the oracle, the oracle with the peak, the oracle that also holds without a tare

void print(const std::string& name, const Kind& kind, const Oracles* oracles) {
    std::array<std::size_t, kWays> within{};
    std::array<Sharpness, kWays> sharpness;
    std::vector<Sharpness> of_sensor(kind.of_sensor.size());
    std::size_t values = 0;
    for (std::size_t i = 0; i < kind.calibration.components.size(); ++i) {
        const std::size_t c = component_index(kind.calibration.components[i]);
        std::array<std::vector<double>, kWays> sds;
        double squares = 0;
        for (std::size_t s = 0; s < kind.of_sensor.size(); ++s) {
            std::vector<double> sds_of_sensor;
            double squares_of_sensor = 0;
            for (const Traced& each : kind.of_sensor[s][c]) {
                const double error = std::abs(double(each.error)), sd = double(each.sd);
                const std::array<double, kWays> ways{sd, oracles == nullptr ? sd : (*oracles)[c].sd(each),
                                                     oracles == nullptr ? sd : (*oracles)[c].sd_with_peak(each),
                                                     oracles == nullptr ? sd : (*oracles)[c].sd_without_tare(each)};
                for (std::size_t w = 0; w < kWays; ++w) within[w] += error <= ways[w], sds[w].push_back(ways[w]);
                squares_of_sensor += error * error;
                sds_of_sensor.push_back(sd);
                ++values;
            }
            of_sensor[s].add(sds_of_sensor, squares_of_sensor, kind.calibration.full_scale[i]);
            squares += squares_of_sensor;
        }
        for (std::size_t w = 0; w < kWays; ++w) sharpness[w].add(sds[w], squares, kind.calibration.full_scale[i]);
    }
    if (values == 0) {
        fmt::print("{:<44} no GOOD sample\n", name);
        return;
    }
    double min = 1e300, max = 0, sum = 0;
    for (const Sharpness& s : of_sensor)
        if (std::isfinite(s.value())) min = std::min(min, s.value()), max = std::max(max, s.value());
    const Shares& s = kind.shares;
    fmt::print("{:<44} {:>3} {:>6.1f} |", name, kind.of_sensor.size(), percent(s.good, s.samples));
    for (std::size_t w = 0; w < (oracles == nullptr ? 1 : kWays); ++w) fmt::print(" {:>5.1f}", percent(within[w], values));
    fmt::print(" | {:>5.2f} {:>5.2f} |", percent(s.undetected, s.good), percent(s.wrong, s.good));
    for (std::size_t w = 0; w < (oracles == nullptr ? 1 : kWays); ++w) fmt::print(" {:>5.2f}", sharpness[w].value());
    fmt::print(" | {:>5.2f} to {:>5.2f} |", min, max);
    for (const double term : kind.terms) sum += term;
    for (const double term : kind.terms) fmt::print(" {:>3.0f}", 100 * term / sum);
    fmt::print("\n");
    std::fflush(stdout);
}

// The loads of a calibration scene with another seed, and with rests: other loads than the calibration's, and the same
// places. "" if no load wanders there.
std::string use_of(const fs::path& path, std::uint64_t seed, bool rests = true) {
    std::ifstream in(path);
    const std::string text{std::istreambuf_iterator<char>(in), {}}, begin = "[[motion]]\ndo = \"wander\"\n";
    const auto wander = text.find(begin);
    if (wander == std::string::npos) return "";
    std::string loads = text.substr(wander + begin.size());
    loads = "\n" + loads.substr(0, loads.find("[["));
    for (const char* const own : {"count", "seed", "rest_s", "mirrored"})
        if (const auto at = loads.find(fmt::format("\n{} = ", own)); at != std::string::npos)
            loads.erase(at, loads.find('\n', at + 1) - at);
    const auto hold = loads.find("\nhold_s = ");
    const double hold_s = hold == std::string::npos ? 0.2 : std::stod(loads.substr(loads.find('=', hold) + 1));
    return text.substr(0, text.find("[[motion]]")) + "[[motion]]\ndo = \"hold\"\nfor_s = 1\n" + begin +
           fmt::format("count = 120\nseed = {}\nrest_s = {}", std::mt19937_64(seed)() % 1'000'000 + 1,
                       rests ? std::max(0.7, hold_s) : 0) +
           loads;
}

class Sensors {
public:
    Sensors(fs::path folder, std::uint64_t first, std::uint64_t count)
        : folder_(std::move(folder)), first_(first), count_(count) {}

    // The scene, or the use, on every sensor.
    Kind judged(const Expectation& e, const sim::Scene& scene, const sim::Sensor& sensor) {
        Kind kind;
        for (std::uint64_t part = first_; part < first_ + count_; ++part) judge(e, scene, sensor, part, kind);
        return kind;
    }
    const Oracles* oracles(const Expectation& e) {
        const std::string key = e.calibration + " " + e.method;
        if (const auto known = oracles_.find(key); known != oracles_.end()) return known->second.get();
        const fs::path path = folder_ / e.calibration.substr(6);
        auto& oracles = oracles_[key];
        if (use_of(path, 0).empty()) return nullptr;
        Kind kind, not_tared, without_rests;
        for (std::uint64_t part = first_; part < first_ + count_; ++part) {
            const sim::Scene use = scene_of_use(path, part);
            const Expectation all{e.sensor, e.calibration, e.method, 0, 1e9, e.max_rows};
            judge(all, use, use.sensors.front(), part, kind);
            judge(all, use, use.sensors.front(), part, not_tared, false);
            const sim::Scene course = scene_of_use(path, part, false);
            judge(all, course, course.sensors.front(), part, without_rests);
        }
        oracles = std::make_unique<Oracles>();
        for (std::size_t s = 0; s < kind.of_sensor.size(); ++s)
            for (std::size_t c = 0; c < 6; ++c) (*oracles)[c].add(kind.of_sensor[s][c], not_tared.of_sensor[s][c]);
        print(fmt::format("USE without rests {} {}", e.calibration.substr(6), e.method), without_rests, oracles.get());
        print(fmt::format("USE of {} {}", e.calibration.substr(6), e.method), kind, oracles.get());
        return oracles.get();
    }

private:
    [[nodiscard]] sim::Scene scene_of_use(const fs::path& path, std::uint64_t seed, bool rests = true) const {
        const fs::path copy = folder_ / fmt::format("use.{}.toml", ::getpid());
        std::ofstream(copy) << use_of(path, seed, rests);
        sim::Scene use = ctl::read_calibration_scene(copy.string()).scene;
        fs::remove(copy);
        return use;
    }
    const Calibration& calibrated(const Expectation& e, std::uint64_t part) {
        auto& calibrations = calibrations_[e.calibration + " " + e.method];
        if (calibrations.count(part) == 0) {
            const fs::path path = folder_ / e.calibration.substr(6);
            CalibrationOfScene of = calibration_of_scene(path, e.method);
            const auto rows_of_part = [&] {
                of.scene.scene.seed = part;
                for (sim::Sensor& sensor : of.scene.scene.sensors) sensor.serial += kSerials * part;
                return ctl::calibration_rows(of.scene, e.max_rows);
            };
            const char* const rests = use_of(path, part).empty() ? nullptr : std::getenv("RESTS");
            Labelled rows;
            if (rests == nullptr || std::string(rests) == "also") rows = rows_of_part();
            if (rests != nullptr) {
                of.scene.scene = scene_of_use(path, 1'000'000 + part);
                const std::uint64_t end_ns = rows.rows.empty() ? 0 : rows.rows.back().t_ns;
                Labelled in_use = rows_of_part();
                for (LabelledRow& row : in_use.rows) row.t_ns += end_ns;
                if (rows.rows.empty())
                    rows = std::move(in_use);
                else
                    std::move(in_use.rows.begin(), in_use.rows.end(), std::back_inserter(rows.rows));
            }
            calibrations[part] = fit(rows, of.request).calibration;
        }
        return calibrations[part];
    }
    void judge(const Expectation& e, sim::Scene scene, const sim::Sensor& sensor, std::uint64_t part, Kind& kind,
               bool is_tared = true) {
        const Calibration& calibration = calibrated(e, part);
        const Candidate candidate{calibration.model, e.method, e.method, calibration};
        scene.seed = kSerials + part;
        scene.sensors = {sensor};
        scene.sensors.front().serial += kSerials * part;
        const Labelled rows = ctl::rows_of(scene, 10 * ctl::kMaxOfScene);
        Course course(candidate, rows, scene.delay_s(scene.sensors.front()));
        course.trace();
        if (!is_tared) course.keep_zero();
        course.judge(rows, e.from_s, e.to_s);
        if (std::getenv("SETTLED") != nullptr)
            for (std::vector<Traced>& of_component : course.traced())
                std::erase_if(of_component, [](const Traced& each) { return !each.is_settled; });
        kind.take(course, calibration);
    }

    fs::path folder_;
    std::uint64_t first_, count_;
    std::map<std::string, std::map<std::uint64_t, Calibration>> calibrations_;
    std::map<std::string, std::unique_ptr<Oracles>> oracles_;
};

}  // namespace

void judge_parts(const std::string& folder, std::uint64_t first, std::uint64_t count, const std::string& name) {
    fmt::print(
        "in %: GOOD | within 1 sd: ours, oracle by load, by load and peak, by load with and without tare | beyond 5 sd, "
        "not late | sharpness: the same four | ours within one sensor's scene | variance: constant, with component, "
        "with load, unloading and method, latency\n");
    Sensors sensors(folder, first, count);
    const auto is_asked = [&](const std::string& stem) {
        return name.empty() || ::fnmatch(name.c_str(), stem.c_str(), 0) == 0;
    };
    const auto judge = [&](const fs::path& path, const Expectation& e) {
        const sim::Scene scene = sim::read_scene(path.string());
        const auto of = std::find_if(scene.sensors.begin(), scene.sensors.end(), [&](const sim::Sensor& sensor) {
            return ::fnmatch(e.sensor.c_str(), sensor.name.c_str(), 0) == 0;
        });
        if (of == scene.sensors.end()) return;
        const Oracles* const oracles = sensors.oracles(e);
        print(fmt::format("{} {}, {}", path.stem().string(), of->name, e.method), sensors.judged(e, scene, *of), oracles);
    };
    for (const fs::path& path : scenes_in(folder, name))
        for (const Expectation& e : expectations_of(path))
            if (e.calibration.starts_with("scene:")) judge(path, e);
    for (const Contested& contest : contested())
        for (const char* const method : contest.methods)
            for (const char* const kind : {"easy", "combined", "eccentric", "dynamic"}) {
                const std::string stem = fmt::format("{}_{}", contest.scenes, kind);
                if (is_asked(stem))
                    judge(fs::path(folder) / (stem + ".toml"),
                          {"*", fmt::format("scene:{}.toml", contest.calibration), method, 0, 1e9, kRowsOfContest});
            }
}

}  // namespace tactiled
