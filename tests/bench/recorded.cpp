// Real recordings through a sensor of the daemon: the share of the rows that the method calls GOOD, and the share that the
// sensor calls GOOD with its checks of the stream, of jumps, of noise and of the zero. Calibrated on one part, tared on the
// first rows of the other one. The rows of the tongs were published without their order: successive ones are not
// correlated, so that each is a jump. They are in no sum.
#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>

#include "decoupling/fit/fit.hpp"
#include "tests/bench/recording.hpp"
#include "tests/bench/running.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kTare = 20;  // rows

struct Shares {
    std::size_t rows = 0, method = 0, sensor = 0, stepped = 0;
    double seconds = 0, correlation = 0;
};

// Returns the correlation of the first channel with itself a row later.
double correlation_of(const Labelled& labelled) {
    const auto& rows = labelled.rows;
    double mean = 0, squares = 0, products = 0;
    for (const LabelledRow& row : rows) mean += row.channel[0] / double(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const double x = rows[i].channel[0] - mean;
        squares += x * x;
        if (i > 0) products += x * (rows[i - 1].channel[0] - mean);
    }
    return products / squares;
}

Shares judge(const std::filesystem::path& folder, const Labelled& calibrated, const Labelled& other) {
    const Calibration calibration =
        fit(calibrated, {.model = "generic", .method = "matrix", .serial = "", .date = "2026-01-01"}).calibration;
    const auto decoupler = make_decoupler(calibration);
    Running running(folder, calibration, "stale_ms = 2000\n");
    Shares shares;
    std::uint64_t before_ns = other.rows.front().t_ns;
    for (std::size_t i = 0; i < other.rows.size(); ++i) {
        const LabelledRow& row = other.rows[i];
        if (i == 1) running.tare();
        const tactiled_sample s = running.send(row.channel, row.t_ns - before_ns + (i == 0 ? 1 : 0));
        before_ns = row.t_ns;
        const Estimate e = decoupler->decouple({.channel = row.channel, .t_ns = row.t_ns});
        if (i < kTare) continue;
        ++shares.rows;
        shares.method += e.quality() == TACTILED_GOOD ? 1 : 0;
        shares.sensor += s.quality == TACTILED_GOOD ? 1 : 0;
        shares.stepped += (s.reasons & TACTILED_STEPPED) != 0 ? 1 : 0;
    }
    shares.correlation = correlation_of(other);
    shares.seconds = double(other.rows.back().t_ns - other.rows.front().t_ns) * 1e-9;
    return shares;
}

void run() {
    const std::string data = TACTILED_SOURCE_DIR "/tests/data/";
    const std::filesystem::path folder = std::filesystem::temp_directory_path() / fmt::format("recorded.{}", getpid());
    std::filesystem::create_directory(folder);
    const auto packed = [&](const char* name) { return read_labelled(unpacked(name, folder / "unpacked.csv"), {}); };
    const auto session = [&](const char* name) {
        return read_labelled(data + "eflesh/normal_labelled.csv", {.sessions = {name}, .channels = {}});
    };
    Labelled train = packed("tongs/train_labelled");
    Labelled shear = packed("eflesh/shear_labelled"), later = shear;
    shear.rows.resize(shear.rows.size() / 2);
    later.rows.erase(later.rows.begin(), later.rows.begin() + std::ptrdiff_t(shear.rows.size()));
    Shares all;
    const auto print = [&](const char* name, const Shares& s) {
        fmt::print("{}: {:.0f} s, {} rows: method {:.2f} % GOOD, sensor {:.2f} %, {:.2f} % stepped, correlation {:.2f}\n",
                   name, s.seconds, s.rows, 100. * double(s.method) / double(s.rows),
                   100. * double(s.sensor) / double(s.rows), 100. * double(s.stepped) / double(s.rows), s.correlation);
    };
    const auto add = [&](const char* name, const Shares& s) {
        print(name, s);
        all = {all.rows + s.rows,       all.method + s.method,   all.sensor + s.sensor,
               all.stepped + s.stepped, all.seconds + s.seconds, kNaN};
    };
    add("skin, session 1", judge(folder, session("2"), session("1")));
    add("skin, session 2", judge(folder, session("1"), session("2")));
    add("skin, shear", judge(folder, shear, later));
    print("all", all);
    print("tongs", judge(folder, train, packed("tongs/test_labelled")));
    std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace tactiled

int main() { tactiled::run(); }
