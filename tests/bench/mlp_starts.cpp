// Random starts of method mlp: does each end with a network, and is its error on unseen rows below its affine part's?
//
//   mlp_starts SEEDS ROWS SET...
//
// SET: skin1, skin2 (presses of one session), shear, tongs (six components), six (a synthetic six-axis sensor). Each
// seed is five fits, each from a start of its own and without one of five stretches of time. The errors are those on
// all stretches left out. At most ROWS rows are used, evenly over the set; 0: all of them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"
#include "tests/bench/recording.hpp"

namespace {

using namespace tactiled;

constexpr std::size_t kStretches = 5;

// Six axes with random loads. A channel bends by a tenth of full scale; noise of 0.2 %.
Labelled six_axes() {
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    double mix[8][6];
    for (auto& row : mix)
        for (double& m : row) m = normal(random) / 2;
    Labelled labelled;
    labelled.name = "six";
    for (int k = 0; k < 8; ++k) labelled.channels.push_back(fmt::format("c{}", k));
    Wrench load{}, wanted{};
    const double scale[6] = {50, 50, 100, 2, 2, 2};
    for (int i = 0; i < 3000; ++i) {
        if (i % 20 == 0)
            for (double& part : wanted) part = uniform(random);
        LabelledRow row{
            .line = i + 2, .channel = {}, .wrench_S = kUnseen, .session = 0, .t_ns = std::uint64_t(i + 1) * 10'000'000};
        for (std::size_t c = 0; c < 6; ++c) load[c] += (wanted[c] - load[c]) / 8;
        for (const auto& of_channel : mix) {
            double x = 0;
            for (std::size_t c = 0; c < 6; ++c) x += of_channel[c] * load[c];
            row.channel.push_back(x + 0.1 * x * x + 0.05 * std::sin(4 * x) + 2e-3 * normal(random));
        }
        for (std::size_t c = 0; c < 6; ++c) row.wrench_S[c] = scale[c] * load[c];
        labelled.rows.push_back(row);
    }
    return labelled;
}

Labelled read_set(const std::string& name, const std::string& scratch) {
    const std::string data = TACTILED_SOURCE_DIR "/tests/data/";
    if (name == "six") return six_axes();
    if (name == "skin1") return read_labelled(data + "eflesh/normal_labelled.csv", {.sessions = {"1"}, .channels = {}});
    if (name == "skin2") return read_labelled(data + "eflesh/normal_labelled.csv", {.sessions = {"2"}, .channels = {}});
    if (name != "shear" && name != "tongs") throw SetupError(name + ": no set; skin1 skin2 shear tongs six are");
    return read_labelled(unpacked(name == "shear" ? "eflesh/shear_labelled" : "tongs/train_labelled", scratch), {});
}

void run(const std::string& set, int seeds, std::size_t max_rows, const std::string& scratch) {
    const Labelled labelled = read_set(set, scratch);
    Calibration start;
    start.model = "generic";
    start.method = "mlp";
    start.channels = labelled.channels;
    Rows known;
    for (const auto& row : labelled.rows)
        if (std::any_of(row.wrench_S.begin(), row.wrench_S.end(), [](double v) { return std::isfinite(v); }))
            known.push_back(&row);
    for (std::size_t c = 0; c < 6; ++c)
        if (std::isfinite(known.front()->wrench_S[c])) start.components.emplace_back(kComponentNames[c]);
    Rows rows;
    const std::size_t every = max_rows == 0 ? 1 : (known.size() + max_rows - 1) / max_rows;
    for (std::size_t i = 0; i < known.size(); i += every) rows.push_back(known[i]);
    int fits = 0, zero = 0, kept = 0, worse = 0, outputs = 0;
    double worst = 0, sum = 0;
    const std::clock_t begun = std::clock();
    for (int seed = 1; seed <= seeds; ++seed) {
        Wrench squares{}, before{};
        std::vector<int> networks(start.components.size());
        for (std::size_t part = 0; part < kStretches; ++part) {
            Rows seen, unseen;
            for (std::size_t i = 0; i < rows.size(); ++i)
                (i * kStretches / rows.size() == part ? unseen : seen).push_back(rows[i]);
            Calibration calibration = start;
            calibration.parameters = {{"seed", double(20 * seed) + double(4 * part)}};  // a fit compares four starts
            set_domain(seen, calibration);
            std::vector<std::string> warnings;
            find_fit("generic", "mlp")->fit(seen, calibration, warnings);
            Calibration matrix = calibration;
            matrix.method = "matrix";
            const Wrench error = rms_error(calibration, unseen), of_matrix = rms_error(matrix, unseen);
            bool any = false;
            for (std::size_t i = 0; i < networks.size(); ++i) {
                const std::size_t c = component_index(calibration.components[i]);
                squares[c] += error[c] * error[c] * double(unseen.size());
                before[c] += of_matrix[c] * of_matrix[c] * double(unseen.size());
                const auto& output = calibration.tables.at("layer2")[i];
                const bool is_network = std::any_of(output.begin(), output.end(), [](double w) { return w != 0; });
                networks[i] += is_network ? 1 : 0;
                any = any || is_network;
            }
            zero += any ? 0 : 1;
            ++fits;
        }
        for (std::size_t i = 0; i < networks.size(); ++i) {
            const std::size_t c = component_index(start.components[i]);
            const double ratio = std::sqrt(squares[c] / before[c]);
            const int of_matrix = int(kStretches) - networks[i];
            ++outputs;
            kept += of_matrix;
            worse += ratio > 1 ? 1 : 0;
            worst = std::max(worst, ratio);
            sum += ratio;
            if (ratio > 1 || of_matrix > 0)
                fmt::print("  {} seed {} {}: error {:.3f} of the matrix's, {} of {} fits keep the matrix\n", set, seed,
                           start.components[i], ratio, of_matrix, kStretches);
        }
        std::fflush(stdout);
    }
    fmt::print(
        "{}: {} rows, {} seeds, {} random starts: {} networks of zeros; {} of {} outputs keep the matrix; {} of {} "
        "components are "
        "worse than the matrix on unseen rows; error over the matrix's: mean {:.3f}, worst {:.3f}; {:.2f} s of CPU time a "
        "fit\n",
        set, rows.size(), seeds, fits, zero, kept, outputs * int(kStretches), worse, outputs, sum / outputs, worst,
        double(std::clock() - begun) / CLOCKS_PER_SEC / fits);
    std::fflush(stdout);
}

}  // namespace

int main(int count, char** word) {
    if (count < 4) {
        fmt::print(stderr, "mlp_starts SEEDS ROWS SET...    sets: skin1 skin2 shear tongs six\n");
        return 2;
    }
    char scratch[] = "/tmp/mlp_starts_XXXXXX";
    const int file = ::mkstemp(scratch);
    if (file < 0) return 1;
    try {
        for (int i = 3; i < count; ++i) run(word[i], std::atoi(word[1]), std::size_t(std::atoi(word[2])), scratch);
    } catch (const std::exception& error) {
        fmt::print(stderr, "mlp_starts: {}\n", error.what());
        std::remove(scratch);
        return 1;
    }
    std::remove(scratch);
}
