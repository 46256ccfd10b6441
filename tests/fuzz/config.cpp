// Configuration and calibration texts. Oracles: a calibration that is accepted is written and read back the same.
#include <cstdlib>

#include "config/calibration.hpp"
#include "config/options.hpp"

using namespace tactiled;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    Problems problems;
    Options options = Options::parse_text(text, "fuzz.toml", problems);
    (void)options.text("name", "");
    (void)options.number("x", {0, 1}, 0.5);
    for (auto& table : options.tables("sensor")) (void)table.texts("channels");
    options.finish();
    (void)problems.lines();
    Problems of_calibration;
    const Calibration calibration = parse_calibration(std::string(text), "fuzz.toml", of_calibration);
    if (!of_calibration.empty()) return 0;
    Problems again;
    const std::string written = calibration_text(calibration);
    const Calibration back = parse_calibration(written, "again.toml", again);
    if (!again.empty() || calibration_text(back) != written) std::abort();
    return 0;
}
