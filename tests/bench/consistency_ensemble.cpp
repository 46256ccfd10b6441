// The calibration's kind of use goes on for hours, with other loads, noise and mountings.
#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>

#include "consistency.hpp"
#include "decoupling/fit/fit.hpp"

namespace tactiled {
namespace {

namespace fs = std::filesystem;

// A mounting rotates the sensor by half a degree about x and y and by a degree about z (standard deviations).
constexpr double kTilt_deg = 0.5, kTurn_deg = 1;
constexpr std::uint64_t kFirstSeed = 7000;  // this seed and later ones chose nothing

// The use of the sensor, compared with its calibration.
struct Use {
    const char* name;
    bool other_loads = true, other_noise = true, is_tared = true, mounted_anew = false, only_settled = false;
    bool has_monitor = true;
    double to_share = 1;  // greatest press, shear and distance from the middle, relative to the calibration's
};
constexpr Use kUses[] = {
    {.name = "as in use"},
    {.name = "mounted anew", .mounted_anew = true},
    {.name = "not tared", .is_tared = false},
    {.name = "settled rows", .only_settled = true},
    {.name = "loads to 90 %", .to_share = 0.9},
    {.name = "no monitor", .only_settled = true, .has_monitor = false},
    {.name = "same noise", .other_noise = false},
    {.name = "same loads", .other_loads = false},
    {.name = "settled, not tared", .is_tared = false, .only_settled = true},
    {.name = "same loads, settled, not tared", .other_loads = false, .is_tared = false, .only_settled = true},
    {.name = "calibration itself", .other_loads = false, .other_noise = false, .is_tared = false, .only_settled = true},
};

// A calibration scene, changed as text: a copy beside a link to the calibrations that it names.
class Scenes {
public:
    Scenes(const std::string& folder, const std::string& name) : path_(folder + "/" + name + ".toml") {
        fs::create_directories(copies_ / "scenes");
        fs::create_directory_symlink(fs::path(folder).parent_path() / "calibration", copies_ / "calibration");
    }
    ~Scenes() { fs::remove_all(copies_); }
    Scenes(const Scenes&) = delete;
    Scenes& operator=(const Scenes&) = delete;

    [[nodiscard]] ctl::CalibrationScene original() const { return ctl::read_calibration_scene(path_); }
    [[nodiscard]] ctl::CalibrationScene with(const Use& use, std::uint64_t seed) const {
        std::ifstream in(path_);
        std::string text{std::istreambuf_iterator<char>(in), {}};
        if (use.other_loads) {
            const std::string wander = "do = \"wander\"\n";
            const auto at = text.find(wander);
            if (at == text.npos) throw SetupError(path_ + ": no load wanders");
            text.insert(at + wander.size(), fmt::format("seed = {}\n", seed));
        }
        for (const char* const key : {"press_to_N = ", "shear_to_N = ", "within_m = "}) {
            const auto at = text.find(key);
            if (use.to_share == 1 || at == text.npos) continue;
            const auto begin = at + std::strlen(key), end = text.find('\n', begin);
            text.replace(begin, end - begin, fmt::format("{}", use.to_share * std::stod(text.substr(begin, end - begin))));
        }
        if (use.mounted_anew) {
            std::mt19937_64 random(seed);
            std::normal_distribution<double> normal;
            const double x = kTilt_deg * normal(random), y = kTilt_deg * normal(random), z = kTurn_deg * normal(random);
            text += fmt::format("\n[effects.misalignment]\nabout_x_deg = {}\nabout_y_deg = {}\nabout_z_deg = {}\n", x, y, z);
        }
        const fs::path copy = copies_ / "scenes" / "copy.toml";
        std::ofstream(copy) << text;
        ctl::CalibrationScene scene = ctl::read_calibration_scene(copy);
        if (use.other_noise) scene.scene.seed = seed;
        return scene;
    }

private:
    std::string path_;
    fs::path copies_ = fs::temp_directory_path() / fmt::format("consistency_bench.{}", ::getpid());
};

// The rows that a calibration bench would record.
std::vector<bool> settled(const ctl::CalibrationScene& scene, const Labelled& rows) {
    std::vector<bool> marks;
    std::uint64_t since_ns = 0;
    for (std::size_t i = 0; i < rows.rows.size(); ++i) {
        for (std::size_t c = 0; c < 3; ++c)
            if (i == 0 || rows.rows[i].wrench_S[c] != rows.rows[i - 1].wrench_S[c]) since_ns = rows.rows[i].t_ns;
        marks.push_back(double(rows.rows[i].t_ns - since_ns) * 1e-9 >= scene.settle_s);
    }
    return marks;
}

void judge(const Scenes& scenes, const Use& use, const std::string& model, std::vector<ctl::Candidate> candidates,
           double hours) {
    if (!use.has_monitor)
        for (ctl::Candidate& candidate : candidates) candidate.calibration.monitor = {};
    const ctl::CalibrationScene first = scenes.original();
    const Labelled named{.name = "", .channels = first.scene.sensors.front().channels, .sessions = {}, .rows = {}};
    std::vector<Course> courses;
    for (const ctl::Candidate& candidate : candidates)
        courses.emplace_back(candidate, named, first.scene.delay_s(first.scene.sensors.front()));
    double done_s = 0;
    for (std::uint64_t seed = kFirstSeed; done_s < hours * 3600; ++seed) {
        const ctl::CalibrationScene source = scenes.with(use, seed);
        const Labelled rows = ctl::rows_of(source.scene, std::size_t(source.scene.samples));
        done_s += double(source.scene.samples) / source.scene.rate_Hz;
        for (Course& course : courses) {
            use.is_tared ? course.mount_again() : course.keep_zero();
            course.judge(rows, 0, 1e9, use.only_settled ? settled(source, rows) : std::vector<bool>{});
        }
    }
    for (std::size_t i = 0; i < courses.size(); ++i)
        print_shares(fmt::format("{}/{}, {}", model, candidates[i].name, use.name), courses[i].shares());
}

// Methods calibrated in `sessions` sessions, each with its own mounting, loads and noise.
std::vector<ctl::Candidate> calibrated_in(std::size_t sessions, const Scenes& scenes,
                                          const std::vector<ctl::Candidate>& like) {
    constexpr std::size_t kRows = 600;
    Labelled all;
    std::map<std::string, double> known;
    std::string influence;
    for (std::size_t s = 0; s < sessions; ++s) {
        const ctl::CalibrationScene scene = scenes.with({.name = "", .mounted_anew = true}, 100 + s);
        const Labelled rows = ctl::calibration_rows(scene, kRows);
        known = scene.known;
        if (!scene.influence.empty()) influence = scene.influence;
        if (s == 0) all = {.name = rows.name, .channels = rows.channels, .sessions = {}, .rows = {}};
        all.sessions.push_back(fmt::format("{}", s + 1));
        for (LabelledRow row : rows.rows) {
            row.session = s;
            row.line += std::int64_t(s) * 10'000'000;
            row.t_ns += s * 10'000'000'000'000;
            all.rows.push_back(std::move(row));
        }
    }
    std::vector<ctl::Candidate> candidates;
    for (ctl::Candidate candidate : like) {
        if (find_fit(candidate.model, candidate.method) == nullptr || candidate.name != candidate.method) continue;
        FitRequest request{.model = candidate.model, .method = candidate.method, .serial = "", .date = ""};
        request.parameters = known;
        if (!influence.empty()) put_fit_option("influence", influence, request);
        try {
            candidate.calibration = fit(all, request).calibration;
        } catch (const Undetermined& why) {
            fmt::print("{}/{}: {}\n", candidate.model, candidate.name, why.what());
            continue;
        }
        candidate.name += fmt::format(", {} sessions", sessions);
        candidates.push_back(std::move(candidate));
    }
    return candidates;
}

}  // namespace

void judge_ensemble(const std::string& folder, const std::vector<ctl::Contest>& contests, double hours) {
    for (const ctl::Contest& contest : contests) {
        if (!fs::exists(folder + "/tradeoff_" + contest.model + "_calibrate.toml")) continue;
        print_titles("method, use");
        // The loads and places of a method are those of its own calibration.
        std::map<std::string, std::vector<ctl::Candidate>> of_scene;
        for (const ctl::Candidate& candidate : contest.candidates) of_scene[candidate.calibration.path].push_back(candidate);
        const char* const only = std::getenv("USE");
        for (const auto& [name, candidates] : of_scene) {
            const Scenes scenes(folder, name);
            for (const Use& use : kUses)
                if (only == nullptr || std::string(only) == use.name) judge(scenes, use, contest.model, candidates, hours);
            if (only != nullptr) continue;
            for (const std::size_t sessions : {1, 2, 3, 5})
                judge(scenes, kUses[1], contest.model, calibrated_in(sessions, scenes, candidates), hours);
        }
    }
}

}  // namespace tactiled
