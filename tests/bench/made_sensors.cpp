// Sensors that the project has not seen: made at random, calibrated by every method, judged on fresh rows.
//
//   made_sensors CASES [--first N] [--methods matrix,quadratic,rbf,mlp,auto] [--rows MOST] [--verbose]
//   made_sensors --csv N labelled.csv fresh.csv        writes case N
//
// A case is 1 to 32 channels and 1 to 6 components, straight, bent, saturating or with backlash, with crosstalk, noise,
// drift, sessions with zeros of their own, labels rounded to those of a scale, loads in steps, ramps or at random, of one
// sign or both, mostly small or evenly spread, and gaps in time. All of its labels are right. Printed with `!` is what a
// user could not trust: a network of zeros, an error above that of the method's affine part, more than 0.5 % of good
// rows left out, 3 % of GOOD fresh rows beyond 5 sd, fewer than 50 % within 1 sd, or a fit of more than 120 s.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/solve/domain.hpp"

namespace {

using namespace tactiled;

enum class Response { straight, bent, saturating, backlash };
enum class Loads { random, steps, ramps, presses, small };
constexpr const char* kResponses[] = {"straight", "bent", "saturating", "backlash"};
constexpr const char* kLoads[] = {"random", "steps", "ramps", "presses", "small"};
constexpr double kScale[6] = {20, 20, 40, 0.5, 0.5, 0.5};  // N, Nm

struct Sensor {
    Response response = Response::straight;
    Loads loads = Loads::random;
    std::size_t channels = 0, sessions = 0, rows = 0, hold = 1;  // hold: rows per load
    std::vector<std::size_t> components;
    double noise = 0, drift = 0, zeros = 0, quantum = 0;  // relative to full scale
    bool gaps = false, times = true;
    std::vector<std::array<double, 6>> gain, curve;
    std::vector<double> limit, loop;
    mutable std::vector<double> rest_;  // readings at rest in the last recording

    Sensor(unsigned number, std::size_t max_rows) {
        std::mt19937_64 random(1000 + number);
        std::normal_distribution<double> normal(0, 1);
        const auto one_of = [&](auto... values) {
            const std::array all{values...};
            return all[random() % all.size()];
        };
        response = Response(random() % 4);
        loads = Loads(random() % 5);
        channels = std::size_t(one_of(1, 2, 3, 6, 8, 16, 32));
        const std::vector<std::vector<std::size_t>> kComponents = {{2},          {0, 2},          {0, 1, 2},
                                                                   {0, 1, 2, 5}, {0, 1, 2, 3, 4}, {0, 1, 2, 3, 4, 5}};
        components = kComponents[random() % std::min<std::size_t>(channels, 6)];
        rows = std::size_t(20 * std::pow(double(max_rows) / 20, std::uniform_real_distribution<double>(0, 1)(random)));
        sessions = rows < 100 ? 1 : std::size_t(one_of(1, 1, 2, 3, 5));
        hold = loads == Loads::steps || loads == Loads::presses ? std::size_t(one_of(1, 1, 5, 20)) : 1;
        noise = one_of(2e-4, 1e-3, 5e-3, 2e-2);
        drift = one_of(0.0, 0.0, 0.003, 0.01);
        zeros = one_of(0.0, 0.0, 0.01, 0.05);
        quantum = one_of(0.0, 0.0, 0.002, 0.02);
        gaps = random() % 3 == 0;
        times = random() % 4 != 0;
        // Enough to be accepted: every axis in both directions, three loads per coefficient.
        if (hold > 1 || loads == Loads::steps || loads == Loads::presses)
            rows = std::max(rows, 40 * hold * components.size() * sessions);
        rows = std::max(rows, 4 * hold * (channels + 1) * (loads == Loads::random || loads == Loads::small ? 2 : 1));
        for (std::size_t k = 0; k < channels; ++k) {
            gain.emplace_back();
            curve.emplace_back();
            for (std::size_t c = 0; c < 6; ++c) {
                gain.back()[c] =
                    (k == c || (channels <= 6 && components[std::min(k, components.size() - 1)] == c) ? 1 : 0.3) *
                    (1 + 0.3 * normal(random)) * (random() % 2 == 0 ? 1 : -1);
                curve.back()[c] = 0.15 * normal(random);
            }
            limit.push_back(1 + 0.5 * std::abs(normal(random)));
            loop.push_back(0.02 + 0.04 * std::uniform_real_distribution<double>(0, 1)(random));
        }
    }

    // Loads from -1 to 1 of full scale, one per row.
    [[nodiscard]] std::vector<std::array<double, 6>> loads_of(std::size_t n, std::mt19937_64& random) const {
        std::uniform_real_distribution<double> uniform(-1, 1);
        std::normal_distribution<double> normal(0, 1);
        std::vector<std::array<double, 6>> result(n);
        std::array<double, 6> from{}, to{};
        std::size_t axis = 0, step = 0;
        double sign = 1;
        for (std::size_t i = 0; i < n; ++i) {
            std::array<double, 6> load{};
            if (loads == Loads::random || loads == Loads::small) {
                if (i % 12 == 0)
                    for (const std::size_t c : components) {
                        from[c] = to[c];
                        to[c] = loads == Loads::small ? std::pow(uniform(random), 5) : uniform(random);
                    }
                for (const std::size_t c : components) load[c] = from[c] + (to[c] - from[c]) * double(i % 12) / 11;
            } else if (loads == Loads::ramps) {
                for (std::size_t a = 0; a < components.size(); ++a) {
                    const double phase = double(i) * (0.013 + 0.0047 * double(a)) + double(a);
                    load[components[a]] = 4 * std::abs(phase - std::floor(phase + 0.5)) - 1;
                }
            } else {
                // One axis after the other, up and down in five steps.
                if (i > 0 && i % hold == 0 && ++step == 10) {
                    step = 0;
                    if (++axis == components.size()) axis = 0, sign = -sign;
                }
                const double level = (step <= 5 ? double(step) : double(10 - step)) / 5;
                const std::size_t c = components[axis];
                load[c] = level * (loads == Loads::presses ? (c == 2 ? -1 : 1) : sign);
            }
            result[i] = load;
        }
        return result;
    }

    // `fresh`: another recording of the same sensor, with true labels: of the same mounting if there is one session, else
    // of a new one.
    [[nodiscard]] Labelled recording(std::size_t n, unsigned seed, bool fresh) const {
        std::mt19937_64 random(seed);
        std::normal_distribution<double> normal(0, 1);
        Labelled labelled;
        labelled.name = "made.csv";
        for (std::size_t k = 0; k < channels; ++k) labelled.channels.push_back(fmt::format("c{}", k));
        const std::size_t parts = fresh ? 1 : sessions;
        if (parts > 1)
            for (std::size_t s = 0; s < parts; ++s) labelled.sessions.push_back(fmt::format("day{}", s));
        const auto all = loads_of(n, random);
        std::vector<double> zero(channels), wander(channels), play(channels);
        double t_s = 1;
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t session = i * parts / n;
            if (i == 0 || session != (i - 1) * parts / n)
                for (std::size_t k = 0; k < channels; ++k) {
                    zero[k] = sessions > 1 ? zeros * normal(random) : zeros;
                    wander[k] = drift * normal(random);
                    play[k] = 0;
                }
            if (i == 0) rest_ = zero;
            LabelledRow row{.line = std::int64_t(i) + 2, .channel = {}, .wrench_S = kUnseen, .session = session, .t_ns = 0};
            t_s += gaps && random() % 200 == 0 ? 60 : 0.01;
            if (times) row.t_ns = std::uint64_t(t_s * 1e9);
            for (std::size_t k = 0; k < channels; ++k) {
                double x = 0;
                for (const std::size_t c : components) x += gain[k][c] * all[i][c];
                if (response == Response::bent)
                    for (const std::size_t c : components) x += curve[k][c] * all[i][c] * all[i][c];
                if (response == Response::saturating) x = limit[k] * std::tanh(x / limit[k]);
                play[k] = std::clamp(play[k], x - loop[k], x + loop[k]);
                if (response == Response::backlash) x = play[k];
                // The zero wanders with a standard deviation of `drift` over a 20th of the
                // rows.
                const double turn = std::min(1.0, 20.0 / double(rows));
                wander[k] = (1 - turn) * wander[k] + drift * std::sqrt(turn * (2 - turn)) * normal(random);
                row.channel.push_back(x + zero[k] + wander[k] + noise * normal(random));
            }
            for (const std::size_t c : components) {
                const double unit = kScale[c] * quantum;
                row.wrench_S[c] = kScale[c] * all[i][c];
                if (!fresh && quantum > 0) row.wrench_S[c] = unit * std::round(row.wrench_S[c] / unit);
            }
            labelled.rows.push_back(std::move(row));
        }
        return labelled;
    }
};

struct Judged {
    double rms = 0, within = 100, beyond = 0, sharpness = 0,
           good = 0;  // %, but sharpness: median sd over rms; worst component
};

// `rest`: readings at rest for a tare; empty: none.
Judged judge(const Calibration& calibration, const Labelled& fresh, const std::vector<double>& rest) {
    Judged worst;
    const auto decoupler = make_decoupler(calibration);
    std::map<std::size_t, std::vector<double>> errors, sds;
    std::map<std::size_t, int> beyond;
    int good = 0;
    for (const auto& row : fresh.rows) {
        std::vector<double> channel = row.channel;
        for (std::size_t k = 0; k < rest.size(); ++k) channel[k] += calibration.zero[k] - rest[k];
        const Estimate estimate = decoupler->decouple({.channel = channel, .t_ns = row.t_ns});
        good += estimate.quality() == TACTILED_GOOD ? 1 : 0;
        for (const auto& name : calibration.components) {
            const std::size_t c = component_index(name);
            const double error = std::abs(estimate.wrench_S[c] - row.wrench_S[c]);
            errors[c].push_back(error);
            sds[c].push_back(estimate.sd[c]);
            beyond[c] += estimate.quality() == TACTILED_GOOD && error > 5 * estimate.sd[c] ? 1 : 0;
        }
    }
    worst.good = 100.0 * good / double(fresh.rows.size());
    for (auto& [c, of] : errors) {
        double squares = 0, within = 0;
        for (std::size_t i = 0; i < of.size(); ++i) squares += of[i] * of[i], within += of[i] <= sds[c][i] ? 1 : 0;
        const double n = double(of.size()), rms = std::sqrt(squares / n);
        std::nth_element(sds[c].begin(), sds[c].begin() + std::ptrdiff_t(of.size() / 2), sds[c].end());
        worst.rms = std::max(worst.rms, 100 * rms / kScale[c]);
        worst.within = std::min(worst.within, 100 * within / n);
        worst.beyond = std::max(worst.beyond, good > 0 ? 100.0 * beyond[c] / good : 0);
        worst.sharpness = std::max(worst.sharpness, sds[c][of.size() / 2] / rms);
    }
    return worst;
}

void write_csv(const Labelled& labelled, const char* path) {
    std::FILE* file = std::fopen(path, "w");
    fmt::print(file, "t_s,{}", fmt::join(labelled.channels, ","));
    std::vector<std::size_t> components;
    for (std::size_t c = 0; c < 6; ++c)
        if (std::isfinite(labelled.rows.front().wrench_S[c])) components.push_back(c);
    for (const std::size_t c : components) fmt::print(file, ",{}", label_column(c));
    fmt::print(file, "{}\n", labelled.sessions.empty() ? "" : ",session");
    for (const auto& row : labelled.rows) {
        fmt::print(file, "{}", row.t_ns == 0 ? "" : fmt::format("{:.6f}", double(row.t_ns) * 1e-9));
        for (const double reading : row.channel) fmt::print(file, ",{:.7g}", reading);
        for (const std::size_t c : components) fmt::print(file, ",{:.7g}", row.wrench_S[c]);
        fmt::print(file, "{}\n", labelled.sessions.empty() ? "" : "," + labelled.sessions[row.session]);
    }
    std::fclose(file);
}

struct Counts {
    int fits = 0, refused = 0, zero = 0, worse = 0, outliers = 0, beyond = 0, within = 0, wide = 0, slow = 0,
        not_validated = 0;
    std::vector<double> inside, of_rms;
};

}  // namespace

int main(int count, char** word) {
    unsigned cases = 40, first = 0;
    std::size_t max_rows = 5000, exactly = 0;
    std::string methods = "matrix,quadratic,rbf,mlp,auto";
    bool verbose = false;
    if (count == 5 && std::strcmp(word[1], "--csv") == 0) {
        const auto number = unsigned(std::atoi(word[2]));
        const Sensor sensor(number, max_rows);
        write_csv(sensor.recording(sensor.rows, number, false), word[3]);
        write_csv(sensor.recording(std::min<std::size_t>(sensor.rows, 2000), number + 7777, true), word[4]);
        return 0;
    }
    for (int i = 1; i < count; ++i) {
        const std::string text = word[i];
        if (text == "--first" && i + 1 < count)
            first = unsigned(std::atoi(word[++i]));
        else if (text == "--methods" && i + 1 < count)
            methods = word[++i];
        else if (text == "--rows" && i + 1 < count)
            max_rows = std::size_t(std::atof(word[++i]));
        else if (text == "--exactly" && i + 1 < count)
            exactly = std::size_t(std::atof(word[++i]));
        else if (text == "--verbose")
            verbose = true;
        else
            cases = unsigned(std::atoi(word[i]));
    }
    std::map<std::string, Counts> table;
    for (unsigned number = first; number < first + cases; ++number) {
        Sensor sensor(number, max_rows);
        if (exactly > 0) sensor.rows = exactly;
        const Labelled seen = sensor.recording(sensor.rows, number, false);
        const Labelled fresh = sensor.recording(std::clamp<std::size_t>(sensor.rows, 500, 2000), number + 7777, true);
        fmt::print(
            "{}: {} channels, {} components, {}, {}, {} rows (hold {}), {} sessions, noise {}, drift {}, zeros {}, labels "
            "{}{}{}\n",
            number, sensor.channels, sensor.components.size(), kResponses[int(sensor.response)], kLoads[int(sensor.loads)],
            sensor.rows, sensor.hold, sensor.sessions, sensor.noise, sensor.drift, sensor.zeros, sensor.quantum,
            sensor.gaps ? ", gaps" : "", sensor.times ? "" : ", no times");
        double of_matrix = 0;
        for (std::size_t at = 0; at < methods.size();) {
            const std::size_t end = std::min(methods.find(',', at), methods.size());
            const std::string method = methods.substr(at, end - at);
            at = end + 1;
            Counts& counts = table[method];
            const auto begun = std::chrono::steady_clock::now();
            try {
                const FitReport report = fit(
                    seen, {.model = "generic", .method = method, .serial = "", .channel_unit = "V", .date = "2026-03-01"});
                const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
                const Judged judged =
                    judge(report.calibration, fresh, report.zeros.own ? sensor.rest_ : std::vector<double>{});
                if (method == "matrix") of_matrix = judged.rms;
                ++counts.fits;
                std::string odd;
                const auto note = [&](bool when, int& counter, const std::string& text) {
                    if (!when) return;
                    ++counter;
                    odd += " !" + text;
                };
                if (report.calibration.method == "mlp") {
                    bool any = false;
                    for (const auto& output : report.calibration.tables.at("layer2"))
                        any = any || std::any_of(output.begin(), output.end(), [](double w) { return w != 0; });
                    note(!any, counts.zero, "zero network");
                }
                const auto out = std::count_if(report.suspects.begin(), report.suspects.end(),
                                               [](const Suspect& s) { return s.left_out; });
                const bool validated = !report.calibration.sd.empty();
                note(!validated, counts.not_validated, "not validated");
                note(of_matrix > 0 && judged.rms > 1.02 * of_matrix && judged.rms > 0.05, counts.worse, "worse than matrix");
                note(double(out) > std::max(0.005 * double(sensor.rows), 0.5), counts.outliers, "left out");
                if (validated) {
                    note(judged.beyond > 3, counts.beyond, "beyond 5 sd");
                    note(judged.within < 50, counts.within, "within 1 sd");
                    note(judged.within > 95, counts.wide, "wide");
                    counts.inside.push_back(judged.within);
                    if (of_matrix > 0) counts.of_rms.push_back(judged.rms / of_matrix);
                }
                note(took > 120, counts.slow, "slow");
                double held_out = 0;
                for (const auto& c : report.components) held_out = std::max(held_out, 100 * c.held_out_rms / c.full_scale);
                fmt::print(
                    "   {:9} {:9} held out {:6.2f} fresh {:6.2f} % of FS, within 1 sd {:3.0f} %, beyond 5 {:4.1f} %, sd/rms "
                    "{:4.1f}, GOOD {:3.0f} %, named {} out {}, {:.1f} s{}{}\n",
                    method, report.calibration.method, held_out, judged.rms, judged.within, judged.beyond, judged.sharpness,
                    judged.good, report.suspects.size(), out, took, report.zeros.own ? ", own zeros" : "", odd);
                if (verbose)
                    for (const auto& warning : report.warnings) fmt::print("      {}\n", warning);
            } catch (const std::exception& error) {
                ++counts.refused;
                fmt::print("   {:9} refused: {}\n", method, error.what());
            }
            std::fflush(stdout);
        }
    }
    const auto median = [](std::vector<double>& values) {
        std::sort(values.begin(), values.end());
        return values.empty() ? 0 : values[values.size() / 2];
    };
    fmt::print(
        "method     fits refused  zero  worse  left-out  not-valid  beyond-5  within<50  within>95  slow  median within, "
        "error/matrix\n");
    for (auto& [method, c] : table)
        fmt::print("{:9} {:5} {:7} {:5} {:6} {:9} {:10} {:9} {:10} {:10} {:5}  {:.0f} %, {:.2f}\n", method, c.fits,
                   c.refused, c.zero, c.worse, c.outliers, c.not_validated, c.beyond, c.within, c.wide, c.slow,
                   median(c.inside), median(c.of_rms));
}
