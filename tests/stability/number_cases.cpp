// Registers at and past their ends, counters that wrap, sums over long times, numbers as text.
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "config/calibration.hpp"
#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "node/low_pass.hpp"
#include "node/modbus/encode.hpp"
#include "node/sensor.hpp"
#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"
#include "tests/unit/modbus/cells.hpp"

namespace tactiled::stability {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

// Returns the result of a C cast of a double to 16 bits on x86, where it is undefined: by way of 32 bits.
double cast_to_16(double scaled) {
    const double cut = std::trunc(scaled);
    const std::int64_t wide = std::abs(cut) < 2147483648.0 ? std::int64_t(cut) : -2147483648LL;
    return double(std::int16_t(wide));
}
double i16(double value) {
    bool saturated = false;
    return double(std::int16_t(modbus::i16_of(value, 0.01, saturated)));
}
double u16(double value) {
    bool saturated = false;
    return double(modbus::u16_of(value, 0.01, saturated));
}

void add_registers(Cases& cases) {
    const double inf = std::numeric_limits<double>::infinity();
    cases.value("H27", "400 N in a register of 0.01 N", {cast_to_16(40000), i16(400), 32767, 1, 0});
    cases.value("N1", "-327.68 N, whose register would be the sentinel", {cast_to_16(-32768), i16(-327.68), -32767, 1, 0});
    cases.value("N2", "NaN is the sentinel 0x8000, not 0", {cast_to_16(kNaN), i16(kNaN), -32768, 1, 0});
    cases.value("N3", "an infinite force", {cast_to_16(inf), i16(inf), 32767, 1, 0});
    cases.value("N4", "0.29 N is 29, not 28", {cast_to_16(0.29 * 100), i16(0.29), 29, 1, 0});
    cases.value("N5", "-3e-310 N", {cast_to_16(-3e-310 / 0.01), i16(-3e-310), 0, 1, 0});
    cases.value("N6", "655.36 N unsigned", {double(std::uint16_t(65536)), u16(655.36), 65534, 1, 0});
    cases.value("N7", "-0.3 N unsigned", {double(std::uint16_t(std::int32_t(-30))), u16(-0.3), 0, 1, 0});
    cases.value("N8", "NaN unsigned is its sentinel", {cast_to_16(kNaN), u16(kNaN), 65535, 1, 0});
    // H29: seconds since 1970 in a float are 128 s apart; the register counts to 4096 s. A float there is 2^-24 of 4096.
    modbus::View view;
    view.snapshot.node.t_ns = 1'700'000'123'456'789'000ull;
    std::uint16_t block[modbus::kFloatSize];
    modbus::encode(modbus::area_with(modbus::Block::floats), block, view);
    const std::uint32_t bits = std::uint32_t(block[modbus::kFloatTime]) << 16 | block[modbus::kFloatTime + 1];
    const Real seconds = Real(view.snapshot.node.t_ns) / 1000000000, periods = floor(seconds / 4096);
    const Real exact = seconds - 4096 * periods;
    const auto naive = double(float(1'700'000'123.456789)) - double(4096 * periods);
    // t_ns itself as a double is rounded to 256 ns, and to seconds once more.
    cases.value("H29", "a time of 1.7e9 s in a float register",
                {naive, double(std::bit_cast<float>(bits)), exact, 1, 0, (4096 * 0x1p-24 + 1e-6) / double(exact)});
}

Frame frame_of(double value, std::uint64_t time_us, std::uint32_t sequence) {
    Frame frame;
    frame.n_channels = 1;
    frame.channel[0] = value;
    frame.device_time_us = time_us;
    frame.sequence = sequence;
    frame.has_sequence = true;
    return frame;
}

// The frames behind each other through the binary decoder.
std::vector<Frame> through_cobs(const std::vector<Frame>& sent) {
    LinkCounts counts{};
    CobsDecoder decoder(counts);
    std::vector<Frame> got;
    std::uint8_t zero = 0;
    decoder.push({&zero, 1}, 1);
    Frame frame;
    (void)decoder.next(frame);
    for (const Frame& one : sent) {
        std::array<std::uint8_t, kCobsMaxEncoded> bytes;
        const std::size_t n = encode_cobs(one, 24, bytes);
        decoder.push({bytes.data(), n}, 2);
        while (decoder.next(frame)) got.push_back(frame);
    }
    return got;
}

void add_counters(Cases& cases) {
    const auto wrap = through_cobs({frame_of(0, 4294967290u, 65534), frame_of(0, 10, 65535), frame_of(0, 20, 3)});
    cases.value(
        "H26", "a device's clock of 32 bits of us that wraps: us between two frames",
        {10.0 - 4294967290.0, wrap.size() < 2 ? kNaN : double(wrap[1].device_time_us - wrap[0].device_time_us), 16, 1, 0});
    cases.value("N9", "a counter of 16 bits that wraps with three frames lost: lost",
                {3.0 - 65535.0 - 1, wrap.size() < 3 ? kNaN : double(wrap[2].lost), 3, 1, 0});
    LinkCounts counts{};
    AsciiDecoder ascii({.channels = 1, .checksum = false, .sequence = true, .time_us = false}, counts);
    const std::string text = "#\n4294967294,1\n4294967295,1\n0,0,5\n1,0.5\n";
    ascii.push({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, 1);
    Frame frame;
    int n = 0;
    double lost = 0;
    while (ascii.next(frame)) ++n, lost += frame.lost;
    cases.value("N10", "a counter of 32 bits that wraps, the line at 0 with a decimal comma: lost",
                {1.0 - 4294967295.0 - 1, lost, 1, 1, 0});
    cases.value("N11", "a decimal comma is refused, not read as 0", {kNaN, double(n), 3, 1, 0, 0, Textbook::none});
    const auto sign = through_cobs({frame_of(-2, 0, 1), frame_of(9e6, 0, 2)});
    cases.value("H28", "24 bits, 0xFFFFFE", {double(0xFFFFFE), sign.empty() ? kNaN : sign[0].channel[0], -2, 1, 0});
    cases.value("N12", "a count beyond 24 bits is at the rail and says so",
                {9e6 - 16777216, sign.size() < 2 || sign[1].saturated == 0 ? kNaN : sign[1].channel[0], 8388607, 1, 0});
}

// fz = the channel.
Sensor sensor_of(double filter_Hz, std::uint64_t tare_ns) {
    Calibration c;
    c.path = "through";
    c.model = "generic";
    c.method = "matrix";
    c.channels = {"A"};
    c.zero = {0};
    c.components = {"fz"};
    c.matrix = {{1}};
    c.sd = {1};
    Sensor::Setup setup;
    setup.channel_of_frame = {0};
    setup.frame_channels = 1;
    setup.tuning.tare_ms = int(tare_ns / 1'000'000);
    setup.tuning.filter_hz = filter_Hz;
    setup.decoupler = made(c);
    Sensor sensor(std::move(setup));
    sensor.start(1, 0);
    return sensor;
}
double force_of(Sensor& sensor, std::uint64_t t_ns, double value) {
    Frame frame;
    frame.t_ns = t_ns;
    frame.n_channels = 1;
    frame.channel[0] = value;
    return sensor.sample(frame, t_ns).force_S_N[2];
}

// Two equal stages dy/dt = w (x - y), from 0 on; x rises to 1 within the first of n steps: the mean over one step of the
// step response 1 - (1 + w t) exp(-w t).
Real step_response(double cutoff_Hz, const Real& T_s, unsigned n) {
    const Real w = 2 * Real(3.14159265358979323846) * Real(cutoff_Hz) * Real(1.5537739740300374);
    const auto integral = [&](const Real& t_s) -> Real { return t_s + (2 / w + t_s) * exp(-w * t_s); };
    return (integral(T_s * n) - integral(T_s * (n - 1))) / T_s;
}

void add_long_times(Cases& cases) {
    // H18: a cutoff of 1e-6 of the rate. Each stage rounds its sum once a sample and forgets within 1/g of them.
    LowPass filter;
    filter.set_cutoff(1e-3);
    std::array<double, 6> value{}, sd{};
    filter.apply(value, sd, kMs);
    constexpr unsigned n = 200'000;
    float single = 0, second = 0;
    const auto g = float(-std::expm1(-2 * 3.14159265358979323846 * 1e-3 * 1.5537739740300374 * 1e-3));
    for (unsigned i = 1; i <= n; ++i) {
        value.fill(1);
        filter.apply(value, sd, (i + 1) * kMs);
        single += g * (1 - single);
        second += g * (single - second);
    }
    const double memory = 1 / double(g);
    cases.value("H18", "a filter at 1e-6 of the rate, 200,000 samples after a step",
                {double(second), value[0], step_response(1e-3, Real(1) / 1000, n), memory, 2, 0, Textbook::single});
    // A machine that is up for 146 years: seconds as a double are 1e-6 apart, nanoseconds as integers are not.
    LowPass old;
    old.set_cutoff(10);
    const std::uint64_t begin = std::uint64_t{1} << 62;
    std::array<double, 6> late{};
    old.apply(late, sd, begin);
    double textbook = 0, first = 0, t_s = double(begin) * 1e-9;
    for (unsigned i = 1; i <= 20; ++i) {
        late.fill(1);
        old.apply(late, sd, begin + i * kMs);
        const double T = double(begin + i * kMs) * 1e-9 - std::exchange(t_s, double(begin + i * kMs) * 1e-9);
        const double gain = -std::expm1(-2 * 3.14159265358979323846 * 10 * 1.5537739740300374 * T);
        first += gain * (1 - first);
        textbook += gain * (first - textbook);
    }
    cases.value("N13", "20 samples of a filter's step 146 years after the clock began",
                {textbook, late[0], step_response(10, Real(1) / 1000, 20), 2, 8});
    LowPass still;
    still.set_cutoff(10);
    std::array<double, 6> again{2, 2, 2, 2, 2, 2};
    still.apply(again, sd, 5 * kMs);
    again.fill(7);
    still.apply(again, sd, 5 * kMs);
    cases.value("N14", "a filter whose clock stands: it waits", {7, again[0], 2, 1, 0});
    // H14 through the node: one NaN, then the filter begins anew.
    Sensor poisoned = sensor_of(1, 0);
    double ours = 0, naive = 0;
    for (std::uint64_t i = 1; i <= 1001; ++i) {
        const double read = i == 501 ? kNaN : 1;
        ours = force_of(poisoned, i * kMs, read);
        naive = 0.99 * naive + 0.01 * read;
    }
    cases.value("H14b", "one NaN among 1001 samples of 1 through the node's filter", {naive, ours, 1, 1, 4});
    // H20: a tare over a million samples of 0.1; a sum of n doubles rounds n times.
    Sensor tared = sensor_of(0, 999'999 * kMs);
    (void)force_of(tared, kMs, 0.1);
    tared.begin_tare(2 * kMs);
    float sum = 0;
    for (std::uint64_t i = 0; i < 1'000'000; ++i) {
        (void)force_of(tared, (i + 2) * kMs, 0.1);
        sum += 0.1f;
    }
    cases.value("H20", "a tare over a million samples",
                {-double(sum / 1e6f), force_of(tared, 1'000'002 * kMs, 0), -Real(0.1), 1e6, 1, 0, Textbook::single});
}

// A calibration's numbers as text, and back.
void add_text(Cases& cases) {
    Calibration c = calibration_of("generic/matrix");
    const double numbers[] = {0.1 + 0.2, 5e-324, 9.999999999999999e299, -0.0, 1.0 / 3, 2.2250738585072011e-308};
    for (std::size_t k = 0; k < 6; ++k) c.matrix[0][k] = numbers[k];
    Problems problems;
    const Calibration back = parse_calibration(calibration_text(c), "text", problems);
    int ours = 0, naive = 0;
    for (std::size_t k = 0; k < 6; ++k) {
        const bool same = !back.matrix.empty() &&
                          std::bit_cast<std::uint64_t>(back.matrix[0][k]) == std::bit_cast<std::uint64_t>(numbers[k]);
        ours += same ? 0 : 1;
        char text[40];
        std::snprintf(text, sizeof text, "%.15g", numbers[k]);
        naive += std::strtod(text, nullptr) == numbers[k] ? 0 : 1;
    }
    cases.value("N15", "numbers of a calibration that do not come back from its file to the last bit",
                {double(naive), double(ours), 0, 1, 0});
}

}  // namespace

void add_number_cases(Cases& cases) {
    add_registers(cases);
    add_counters(cases);
    add_long_times(cases);
    add_text(cases);
}

}  // namespace tactiled::stability
