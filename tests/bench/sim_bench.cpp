// Time and error of the simulator, scene by scene: ns a sample of one sensor with no effect, with
// those that the scene calls for, and with all; the largest difference between the last two beside the wanted accuracy.
//   sim_bench SCENE.toml ...              the table
//   sim_bench --effects SCENE.toml        each effect of the scene: bound, share, ns
//   sim_bench --run EFFECTS N SCENE.toml  N samples of each sensor, nothing else (for valgrind)
//   sim_bench --costs                     drivers/sim/costs.inc: each effect and level alone, on each model, in one run
//   sim_bench --memory SCENE.toml         10^8 samples: resident memory at each tenth
// Times are the least of 7 runs, each over whole blocks; on a shared machine compare them within one run alone.
#include <fmt/format.h>

#include <time.h>
#include <unistd.h>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string>

#include "drivers/sim/simulation.hpp"

using namespace tactiled;
using namespace tactiled::sim;

namespace {

// Time of the processor for this program: other programs on the machine do not count.
double seconds() {
    timespec now{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return double(now.tv_sec) + double(now.tv_nsec) * 1e-9;
}

// ns a sample of one sensor, the least of several runs.
double cost_ns(const Scene& scene, const std::string& effects, std::uint64_t max = 20'000) {
    double min = 1e300;
    for (int run = 0; run < 7; ++run) {
        Simulation simulation(scene, effects);
        std::uint64_t done = 0;
        const double begun = seconds();
        for (bool any = true; any && done < max * scene.sensors.size();) {
            any = false;
            for (std::size_t i = 0; i < scene.sensors.size(); ++i) {
                const std::size_t n = simulation.advance(i).n;
                any |= n > 0;
                done += n;
            }
        }
        min = std::min(min, (seconds() - begun) / double(done) * 1e9);
    }
    return min;
}

// The largest difference of any channel at any sample that both have, N.
double difference_N(const Scene& scene, const std::string& a, const std::string& b) {
    Simulation one(scene, a), other(scene, b);
    double max = 0;
    for (std::size_t i = 0; i < scene.sensors.size(); ++i) {
        const Sensor& sensor = scene.sensors[i];
        for (;;) {
            const Block& x = one.advance(i);
            const Block& y = other.advance(i);
            if (x.n == 0) break;
            for (std::size_t n = 0; n < x.n; ++n) {
                if (x.dropped[n] || y.dropped[n]) continue;
                std::array<double, kMaxSensorChannels> change{};
                for (std::size_t k = 0; k < sensor.n(); ++k)
                    if (((x.missing[n] | y.missing[n]) >> k & 1u) == 0) change[k] = x.channel[k][n] - y.channel[k][n];
                max = std::max(max, sensor.largest_N(change));
            }
        }
    }
    return max;
}

struct Row {
    std::size_t on = 0, of = 0;
    double wanted = 0, guaranteed = 0, over_parts = 0;
};

// The effects that are on but for one, as a list.
std::string without(const Choice& choice, const EffectEntry* left_out) {
    std::string list;
    for (const Decision& d : choice.decisions)
        if (d.on && d.effect != left_out)
            list += (list.empty() ? "" : ",") + std::string(d.effect->name) +
                    (d.level == Decision::kItself ? "" : ":" + std::string(d.levels[d.level].name));
    return list.empty() ? "none" : list;
}

// Values over all sensors: the strictest wanted accuracy, the largest guarantee. For the first sensor, the cost of
// its effects, each as the difference by leaving it out alone, and without effects.
Row row_of(const Scene& scene) {
    Row row;
    row.wanted = 1e300;
    const Simulation simulation(scene, "auto");
    for (std::size_t i = 0; i < scene.sensors.size(); ++i) {
        row.wanted = std::min(row.wanted, simulation.choice(i).wanted_N);
        row.guaranteed = std::max(row.guaranteed, simulation.choice(i).guaranteed_N);
    }
    const Choice& choice = simulation.choice(0);
    Scene first = scene;  // the others may have other effects
    first.sensors.resize(1);
    const double none_ns = cost_ns(first, "none"), auto_ns = cost_ns(first, "auto");
    double parts = none_ns;
    for (const Decision& d : choice.decisions) {
        ++row.of;
        if (!d.on) continue;
        ++row.on;
        parts += std::max(0.0, auto_ns - cost_ns(first, without(choice, d.effect)));
    }
    row.over_parts = auto_ns / parts;
    return row;
}

void print_scenes(int n, char** files) {
    fmt::print(
        "| scene | sensors | effects on | ns none | auto | all | all / auto | auto / its parts | auto - all, mN | "
        "guaranteed | "
        "wanted | |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (int i = 0; i < n; ++i) {
        const Scene scene = read_scene(files[i]);
        const double none = cost_ns(scene, "none"), automatic = cost_ns(scene, "auto"), all = cost_ns(scene, "all");
        const Row row = row_of(scene);
        const double difference = difference_N(scene, "auto", "all");
        const std::string path = files[i], name = path.substr(path.rfind('/') + 1);
        fmt::print("| {} | {} | {} of {} | {:.0f} | {:.0f} | {:.0f} | {:.1f} | {:.2f} | {:.3g} | {:.3g} | {:.3g} | {} |\n",
                   name.substr(0, name.size() - 5), scene.sensors.size(), row.on, row.of, none, automatic, all,
                   all / automatic, row.over_parts, difference * 1e3, row.guaranteed * 1e3, row.wanted * 1e3,
                   difference <= row.wanted ? "kept" : "**BROKEN**");
        std::fflush(stdout);
    }
}

void print_effects(const char* file) {
    const Scene scene = read_scene(file);
    Simulation all(scene, "all");
    all.measure_shares(true);
    for (std::size_t i = 0; i < scene.sensors.size(); ++i)
        while (all.advance(i).n > 0) {}
    const Simulation automatic(scene, "auto");
    const double none = cost_ns(scene, "none");
    fmt::print(
        "| effect | class | bound, mN | largest change, mN | instructions (declared) | ns alone | auto "
        "|\n|---|---|---|---|---|---|---|\n");
    for (std::size_t d = 0; d < all.choice(0).decisions.size(); ++d) {
        const Decision& decision = all.choice(0).decisions[d];
        fmt::print("| {} | {} | {:.4g} | {:.4g} | {} | {:.1f} | {} |\n", decision.effect->name, cost_class(*decision.effect),
                   decision.bound.change_N * 1e3, all.shares_N(0)[d] * 1e3, decision.effect->instructions,
                   cost_ns(scene, std::string(decision.effect->name)) - none,
                   automatic.choice(0).decisions[d].on ? "on" : automatic.choice(0).decisions[d].why);
    }
}

long resident_kB() {
    std::ifstream file("/proc/self/statm");
    long whole = 0, resident = 0;
    file >> whole >> resident;
    return resident * (::sysconf(_SC_PAGESIZE) / 1024);
}

// A scene in which everything moves, so that every effect is active.
Scene moving(Model model, bool round, bool array) {
    const char* name[] = {"table", "hair", "capacitive"};
    const double full_N[] = {0.8, 0.04, 6};
    const double N = full_N[std::size_t(model)];
    Problems problems;
    return read_scene(
        Options::parse_text(
            fmt::format(R"(format = 1
title = "everything moves"
[body]
shape = "{}"
radius_m = 3e-4
temperature_C = 33
[[sensor]]
name = "s"
model = "{}"
{}{}
[[motion]]
do = "press"
to_N = {}
[[motion]]
do = "shear"
to_N = {}
direction_deg = 20
[[motion]]
do = "slide"
speed_m_s = 0.05
[[motion]]
do = "warm"
ambient_by_K = 2
in_s = 0.1
[[motion]]
{}
[effects.late_frames]
begins = 1e-3
[effects.repeated_frames]
share = 1e-3
[effects.overtaken_frames]
share = 1e-3
[effects.cut_frames]
share = 1e-3
)",
                        round ? "sphere" : "textured", name[std::size_t(model)], array ? "array = [2, 2]\n" : "",
                        model == Model::table && round ? "influence = \"" TACTILED_SOURCE_DIR
                                                         "/config/calibration/table_influence.toml\"\n"
                                                       : "",
                        N, N / 3,
                        round ? "do = \"move\"\nx_m = 6e-4\nin_s = 20"
                              : fmt::format("do = \"shake\"\namplitude_N = {}\nfrom_Hz = 10\nfor_s = 20", N / 3)),
            "moving.toml", problems),
        problems);
}

// ns that one step adds to a run without effects: pieces of both in turn, the median of their differences.
double added_ns(const Scene& scene, const std::string& effects) {
    constexpr std::uint64_t kPiece = 2048;
    std::vector<double> differences;
    for (int trial = 0; trial < 3; ++trial) {
        Simulation with(scene, effects), without(scene, "none");
        const auto piece = [](Simulation& simulation) {
            const double begun = seconds();
            std::uint64_t done = 0;
            while (done < kPiece) {
                const std::size_t n = simulation.advance(0).n;
                if (n == 0) return std::nan("");
                done += n;
            }
            return (seconds() - begun) / double(done) * 1e9;
        };
        for (;;) {
            const double a = piece(with), b = piece(without);
            if (std::isnan(a) || std::isnan(b)) break;
            differences.push_back(a - b);
        }
    }
    std::nth_element(differences.begin(), differences.begin() + std::ptrdiff_t(differences.size() / 2), differences.end());
    return std::max(0.1, differences[differences.size() / 2]);
}

void print_costs() {
    for (const EffectEntry* effect : chain()) {
        const bool round = effect->name == "contact_patch" || effect->name == "hertz_contact";
        std::vector<std::string> levels{""};
        std::vector<std::array<double, 3>> ns;
        for (std::size_t i = 0; i < levels.size(); ++i) {
            auto& row = ns.emplace_back();
            for (const Model model : {Model::table, Model::hair, Model::capacitive}) {
                if ((effect->models >> unsigned(model) & 1u) == 0) continue;
                const Scene scene = moving(model, round, effect->name == "array_spread");
                const Sensor& sensor = scene.sensors[0];
                if (i == 0)
                    for (const Decision& d : choose(scene, sensor, scene.motion.extent(sensor), "auto").decisions)
                        for (const Level& level : d.levels)
                            if (d.effect == effect && std::find(levels.begin(), levels.end(), level.name) == levels.end())
                                levels.emplace_back(level.name);
                const std::string name = std::string(effect->name) + (levels[i].empty() ? "" : ":" + levels[i]);
                try {
                    row[std::size_t(model)] = added_ns(scene, name);
                } catch (const SetupError&) {}  // this model has no such level
            }
        }
        for (std::size_t i = 0; i < levels.size(); ++i) {
            fmt::print("    Cost{{\"{}\", \"{}\", {{{:.3g}, {:.3g}, {:.3g}}}}},\n", effect->name, levels[i], ns[i][0],
                       ns[i][1], ns[i][2]);
            std::fflush(stdout);
        }
    }
}

void print_memory(const char* file) {
    Scene scene = read_scene(file);
    scene.samples = 100'000'000;
    Simulation simulation(scene, "auto");
    const double begun = seconds();
    for (std::uint64_t done = 0, next = 0;;) {
        if (done >= next) {
            fmt::print("{:>11} samples {:6.1f} s {:>7} kB\n", done, seconds() - begun, resident_kB());
            std::fflush(stdout);
            next += 10'000'000;
        }
        const std::size_t n = simulation.advance(0).n;
        if (n == 0) break;
        done += n;
    }
}

void run(const std::string& effects, std::uint64_t samples, const char* file) {
    Scene scene = read_scene(file);
    scene.samples = samples;
    Simulation simulation(scene, effects);
    for (std::size_t i = 0; i < scene.sensors.size(); ++i)
        while (simulation.advance(i).n > 0) {}
}

}  // namespace

int main(int argc, char** argv) {
    try {
        const std::string first = argc > 1 ? argv[1] : "";
        if (first == "--effects" && argc == 3)
            print_effects(argv[2]);
        else if (first == "--costs" && argc == 2)
            print_costs();
        else if (first == "--memory" && argc == 3)
            print_memory(argv[2]);
        else if (first == "--run" && argc == 5)
            run(argv[2], std::stoull(argv[3]), argv[4]);
        else if (argc > 1)
            print_scenes(argc - 1, argv + 1);
        else
            return fmt::print(stderr,
                              "usage: sim_bench [--costs] [--effects | --memory | --run EFFECTS N] SCENE.toml ...\n"),
                   2;
    } catch (const std::exception& e) { return fmt::print(stderr, "{}\n", e.what()), 1; }
}
