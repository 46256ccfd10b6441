// Calibrates simulated arrays from presses and judges gains, dead and weak taxels against the truth, and the forces of new
// presses against their stated sd. The truth is integrated (pressed_array.hpp) and shares no code with the fit.
//
//   array_gains [ROWS COLUMNS VALUES PRESSES]     without arguments: the table of RESULTS.md, 2 min
//   array_gains --write FOLDER ROWS COLUMNS VALUES PRESSES     only writes FOLDER/array.csv
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string_view>

#include "decoupling/fit/array_fit.hpp"
#include "decoupling/patch/patch.hpp"
#include "pressed_array.hpp"

namespace {

using namespace tactiled;
using pressed::Array;
using pressed::Body;
using pressed::Kind;

constexpr int kRowsOfPress = 5, kRestRows = 200, kNewPresses = 2000;
constexpr double kReferenceError = 0.003, kPlaceError_m = 0.1e-3, kGainError = 0.2, kWeak = 0.3;

struct Truth {
    std::vector<double> sensitivity;  // 0 = dead
    std::set<std::size_t> dead, weak;
};

Truth truth_of(const Array& array, std::mt19937_64& random) {
    std::normal_distribution<double> normal(0, 1);
    Truth truth;
    for (std::size_t i = 0; i < array.taxels(); ++i)
        truth.sensitivity.push_back(1 / std::max(0.3, 1 + kGainError * normal(random)));
    while (truth.dead.size() < array.taxels() / 100) truth.dead.insert(random() % array.taxels());
    while (truth.weak.size() < array.taxels() / 50)
        if (const std::size_t i = random() % array.taxels(); truth.dead.count(i) == 0) truth.weak.insert(i);
    for (const std::size_t i : truth.dead) truth.sensitivity[i] = 0;
    for (const std::size_t i : truth.weak) truth.sensitivity[i] *= kWeak;
    return truth;
}

// A ball whose contact, of 2.5 to 4 mm at 5 N, lies on the array.
Body ball_at_random(const Array& array, double most_N, std::mt19937_64& random) {
    std::uniform_real_distribution<double> uniform(0, 1);
    Body body{.kind = Kind::ball};
    body.force = most_N * (0.1 + 0.9 * uniform(random));
    body.length = body.width = (2.5e-3 + 1.5e-3 * uniform(random)) * std::cbrt(body.force / 5);
    const double x = array.pitch_m * double(array.columns) / 2 - body.length,
                 y = array.pitch_m * double(array.rows) / 2 - body.length;
    body.x = x * (2 * uniform(random) - 1);
    body.y = y * (2 * uniform(random) - 1);
    return body;
}

std::vector<float> frame(const Array& array, const Body& body, const Truth& truth, std::mt19937_64& random) {
    std::normal_distribution<double> normal(0, 1);
    std::vector<float> raw(array.taxels() * array.values);
    pressed::press(array, body, truth.sensitivity, raw);
    for (std::size_t k = 0; k < raw.size(); ++k) {
        const bool is_dead = truth.dead.count(k % array.taxels()) != 0;
        raw[k] = is_dead ? 2000.f : std::round(2000 + raw[k] + float(array.noise_N * array.counts_per_N * normal(random)));
    }
    return raw;
}

// The signs of the calibration that a maker would state: a press counts up, as do shears against the axes.
void write_recording(const std::string& path, const Array& array, const Truth& truth, int presses, bool has_places,
                     std::mt19937_64& random) {
    std::normal_distribution<double> normal(0, 1);
    std::ofstream file(path);
    const std::size_t n = array.taxels();
    const char* const names = array.values == 1 ? "Z" : "XYZ";
    std::string line = "t_s,press,fz_N";
    if (array.values == 3) line += ",fx_N,fy_N";
    if (has_places) line += ",x_mm,y_mm";
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t v = 0; v < array.values; ++v) line += fmt::format(",{}{}", names[v], i);
    file << line << '\n';
    int row = 0;
    const auto write = [&](const std::string& labels, const Body& body) {
        const std::vector<float> raw = frame(array, body, truth, random);
        line = fmt::format("{:.2f},{}", 0.01 * row++, labels);
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t v = 0; v < array.values; ++v) line += fmt::format(",{}", raw[v * n + i]);
        file << line << '\n';
    };
    std::string none = ",0";
    none += array.values == 3 ? ",0,0" : "";
    none += has_places ? ",," : "";
    for (int k = 0; k < kRestRows; ++k) write(none, Body{});
    for (int p = 0; p < presses; ++p) {
        const Body whole = ball_at_random(array, 8, random);
        const double place_x = whole.x + kPlaceError_m * normal(random), place_y = whole.y + kPlaceError_m * normal(random);
        const double turn = normal(random), shear = array.values == 3 ? 0.4 * std::abs(normal(random)) : 0;
        for (int k = 1; k <= kRowsOfPress; ++k) {
            Body body = whole;
            body.force *= double(k) / kRowsOfPress;
            body.length = body.width = whole.length * std::cbrt(double(k) / kRowsOfPress);
            body.shear_x = shear * std::cos(turn) * body.force;
            body.shear_y = shear * std::sin(turn) * body.force;
            const double read = 1 + kReferenceError * normal(random);
            std::string labels = fmt::format("p{},{:.4f}", p, -body.force * read);
            if (array.values == 3) labels += fmt::format(",{:.4f},{:.4f}", body.shear_x * read, body.shear_y * read);
            if (has_places) labels += fmt::format(",{:.3f},{:.3f}", 1e3 * place_x, 1e3 * place_y);
            write(labels, body);
        }
    }
}

void judge_gains(const ArrayReport& report, const Truth& truth) {
    double before = 0, after = 0;
    int within = 0, n = 0, found_dead = 0, found_weak = 0, wrong_dead = 0, wrong_other = 0, unloaded = 0, beyond = 0;
    double mean = 0;
    // One factor is in the matrix.
    std::vector<double> ratio;
    for (std::size_t i = 0; i < report.taxels.size(); ++i)
        if (truth.sensitivity[i] > 0) ratio.push_back(report.taxels[i].gain * truth.sensitivity[i]);
    std::nth_element(ratio.begin(), ratio.begin() + std::ptrdiff_t(ratio.size() / 2), ratio.end());
    mean = ratio[ratio.size() / 2];
    for (std::size_t i = 0; i < report.taxels.size(); ++i) {
        const TaxelReport& taxel = report.taxels[i];
        using State = TaxelReport::State;
        const bool is_dead = truth.dead.count(i) != 0, is_weak = truth.weak.count(i) != 0;
        found_dead += is_dead && taxel.state == State::dead ? 1 : 0;
        wrong_dead += !is_dead && taxel.state == State::dead ? 1 : 0;
        found_weak += is_weak && taxel.state == State::weak ? 1 : 0;
        wrong_other += !is_weak && (taxel.state == State::weak || taxel.state == State::strong) ? 1 : 0;
        unloaded += taxel.state == State::unloaded ? 1 : 0;
        if (is_dead || is_weak || taxel.state == State::dead) continue;
        const double error = taxel.gain * truth.sensitivity[i] / mean - 1;
        before += std::pow(truth.sensitivity[i] - 1, 2);
        after += error * error;
        within += std::abs(error) <= taxel.gain_sd ? 1 : 0;
        beyond += std::abs(error) > 5 * taxel.gain_sd ? 1 : 0;
        ++n;
    }
    fmt::print(
        "  gains: error {:.2f} % before, {:.2f} % after; median gain_sd {:.2f} %; {:.1f} % within their sd, {:.2f} % beyond "
        "5\n",
        100 * std::sqrt(before / n), 100 * std::sqrt(after / n), 100 * report.gain_sd, 100. * within / n, 100. * beyond / n);
    fmt::print("  dead: {} of {} found, {} wrong; weak: {} of {} found, {} others named; {} with too little load\n",
               found_dead, truth.dead.size(), wrong_dead, found_weak, truth.weak.size(), wrong_other, unloaded);
}

// Forces of new balls, and of a punch of one taxel's size.
void judge_forces(const Array& array, const Truth& truth, const ArrayReport& report, const char* name, Kind kind,
                  std::mt19937_64& random) {
    const auto decoupler = make_decoupler(report.calibration);
    int within = 0, beyond = 0, n = 0, out = 0;
    double squares = 0, sd2 = 0;
    for (int k = 0; k < kNewPresses; ++k) {
        Body body = ball_at_random(array, 8, random);
        if (kind != Kind::ball) body.kind = kind, body.length = body.width = array.pitch_m / 2, body.force /= 8;
        const std::vector<float> raw = frame(array, body, truth, random);
        Reading reading;
        reading.taxels = {decoupler->patch()->shape(), raw};
        const Estimate estimate = decoupler->decouple(reading);
        if (!(estimate.sd[2] >= 0)) {
            ++out;
            continue;
        }
        const double error = estimate.wrench_S[2] + body.force;
        squares += error * error;
        sd2 += estimate.sd[2] * estimate.sd[2];
        within += std::abs(error) <= estimate.sd[2] ? 1 : 0;
        beyond += std::abs(error) > 5 * estimate.sd[2] ? 1 : 0;
        ++n;
    }
    fmt::print("  new {}: force error {:.3f} N rms, sd {:.3f} N; {:.1f} % within 1 sd, {:.2f} % beyond 5, {} without sd\n",
               name, std::sqrt(squares / n), std::sqrt(sd2 / n), 100. * within / n, 100. * beyond / n, out);
}

void judge(const Array& array, int presses, bool has_places, const std::string& folder) {
    std::mt19937_64 random(11);
    const Truth truth = truth_of(array, random);
    const std::string path = folder + "/array.csv";
    write_recording(path, array, truth, presses, has_places, random);
    ArrayRequest request;
    request.in = path;
    request.start.contact_model = "ball";
    request.start.channel_unit = "counts";
    request.start.parameters = {
        {"rows", double(array.rows)}, {"columns", double(array.columns)}, {"pitch_mm", 1e3 * array.pitch_m}};
    const auto start = std::chrono::steady_clock::now();
    const ArrayReport report = fit_array(request);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    save_calibration(report.calibration, folder + "/array.toml");
    fmt::print("{} x {} x {}, {} presses, {}: {:.1f} s, {} bytes\n", array.rows, array.columns, array.values, presses,
               has_places ? "places known" : "forces alone", seconds, std::filesystem::file_size(folder + "/array.toml"));
    fmt::print(
        "  s {:.4f}, beyond the noise {:.4f} of the force, {:.3f} mm; held out: ratio {:.3f}, {:.3f} N, {:.1f} % {:.2f} %\n",
        report.gain_spread, report.force_error, 1e3 * report.place_error_m, report.held_out_ratio, report.held_out_rms_N,
        100 * report.within_1_sd, 100 * report.beyond_5_sd);
    judge_gains(report, truth);
    judge_forces(array, truth, report, "balls", Kind::ball, random);
    Array quiet = array;  // the noise of all taxels hides the errors of the gains
    quiet.noise_N = 0;
    ArrayReport without = report;
    without.calibration.tables["taxel_sd"][0].assign(without.calibration.tables["taxel_sd"][0].size(), 0);
    without.calibration.sd.assign(without.calibration.sd.size(), 0);
    judge_forces(quiet, truth, without, "balls without noise", Kind::ball, random);
    judge_forces(quiet, truth, without, "punches without noise", Kind::punch, random);
}

}  // namespace

int main(int argc, char** argv) try {
    const bool writes = argc > 1 && std::string_view(argv[1]) == "--write";
    const auto number = [&](int k) { return std::size_t(std::atoi(argv[k + (writes ? 2 : 0)])); };
    std::string folder =
        writes ? argv[2] : (std::filesystem::temp_directory_path() / fmt::format("array_gains.{}", getpid())).string();
    std::filesystem::create_directories(folder);
    Array array;
    array.rows = array.columns = 32;
    int presses = 1000;
    if (argc > (writes ? 6 : 4)) {
        array.rows = number(1), array.columns = number(2), array.values = number(3);
        presses = int(number(4));
    }
    if (writes) {
        std::mt19937_64 random(11);
        const Truth truth = truth_of(array, random);
        write_recording(folder + "/array.csv", array, truth, presses, true, random);
        return 0;
    }
    for (const bool has_places : {true, false}) judge(array, presses, has_places, folder);
    if (argc == 1) {
        array.rows = array.columns = 16, array.values = 3;
        judge(array, 500, true, folder);
    }
    std::filesystem::remove_all(folder);
    return 0;
} catch (const std::exception& error) {
    fmt::print(stderr, "array_gains: {}\n", error.what());
    return 1;
}
