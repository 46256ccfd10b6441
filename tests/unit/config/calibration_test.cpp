#include "config/calibration.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "config/seal.hpp"
#include "example_calibration.hpp"
#include "folder.hpp"

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;
using test::example;
using test::Folder;

// Compares everything except the path; doubles bit by bit, so that -0 is not 0.
using Bits = std::vector<std::uint64_t>;
Bits bits(const std::vector<double>& numbers) {
    Bits all;
    for (const double x : numbers) all.push_back(std::bit_cast<std::uint64_t>(x));
    return all;
}
void expect_same(const Calibration& a, const Calibration& b) {
    EXPECT_EQ(a.model, b.model);
    EXPECT_EQ(a.method, b.method);
    EXPECT_EQ(a.contact_model, b.contact_model);
    EXPECT_EQ(a.serial, b.serial);
    EXPECT_EQ(a.date, b.date);
    EXPECT_EQ(a.channels, b.channels);
    EXPECT_EQ(a.channel_unit, b.channel_unit);
    EXPECT_EQ(bits(a.zero), bits(b.zero));
    EXPECT_EQ(bits(a.channel_least), bits(b.channel_least));
    EXPECT_EQ(bits(a.channel_most), bits(b.channel_most));
    EXPECT_EQ(a.components, b.components);
    ASSERT_EQ(a.matrix.size(), b.matrix.size());
    for (std::size_t i = 0; i < a.matrix.size(); ++i) EXPECT_EQ(bits(a.matrix[i]), bits(b.matrix[i]));
    ASSERT_EQ(a.parameters.size(), b.parameters.size());
    for (auto p = a.parameters.begin(), q = b.parameters.begin(); p != a.parameters.end(); ++p, ++q) {
        EXPECT_EQ(p->first, q->first);
        EXPECT_EQ(bits({p->second}), bits({q->second}));
    }
    EXPECT_EQ(bits(a.zero_drift), bits(b.zero_drift));
    EXPECT_EQ(bits(a.sd), bits(b.sd));
    EXPECT_EQ(bits(a.held_out_rms), bits(b.held_out_rms));
    EXPECT_EQ(bits(a.full_scale), bits(b.full_scale));
    EXPECT_EQ(bits({a.condition}), bits({b.condition}));
    EXPECT_EQ(a.validation, b.validation);
    EXPECT_EQ(a.rows, b.rows);
}

Calibration parse(const std::string& text, Problems& problems) { return parse_calibration(text, "c.toml", problems); }
Lines errors_of_calibration(const std::string& text) {
    Problems problems;
    parse(text, problems);
    return problems.lines();
}

TEST(Calibration, ComesBackToTheLastBit) {
    const Folder folder;
    save_calibration(example(), folder / "c.toml");
    Problems problems;
    const Calibration loaded = load_calibration(folder / "c.toml", problems);
    EXPECT_EQ(problems.lines(), Lines{});
    EXPECT_EQ(loaded.path, folder / "c.toml");
    expect_same(loaded, example());
}

TEST(Calibration, ComesBackToTheLastBitForAnyNumbers) {
    std::mt19937_64 random(7);
    const auto number = [&] {
        for (;;) {
            const auto x = std::bit_cast<double>(random() >> (random() % 12));  // some of them denormal
            if (std::abs(x) <= 1e300) return x;
        }
    };
    for (int round = 0; round < 300; ++round) {
        Calibration c = example();
        for (auto& x : c.zero) x = number();
        for (auto& row : c.matrix)
            for (auto& x : row) x = number();
        for (auto& [name, x] : c.parameters) x = number();
        for (auto& x : c.sd) x = std::abs(number());
        c.condition = std::abs(number());
        Problems problems;
        const Calibration back = parse(calibration_text(c), problems);
        ASSERT_EQ(problems.lines(), Lines{});
        expect_same(back, c);
    }
    for (const double x : {0.0, -0.0, 5e-324, -5e-324, 2.2250738585072011e-308, 2.2250738585072014e-308, 1e300, -1e300, 1e22,
                           1e23, 123456789.0, 9007199254740993.0, 0.1, 1e16, 1e15, 4.9e-320}) {
        Calibration c = example();
        c.zero[0] = x;
        Problems problems;
        EXPECT_EQ(bits(parse(calibration_text(c), problems).zero), bits(c.zero)) << x;
        EXPECT_EQ(problems.lines(), Lines{});
    }
}

TEST(Calibration, TextIsStable) {
    Problems problems;
    const std::string text = calibration_text(example());
    EXPECT_EQ(calibration_text(parse(text, problems)), text);
}

TEST(Calibration, NeedsFewKeys) {
    Problems problems;
    const Calibration c = parse(
        "format = 1\nmodel = 'generic'\nchannels = ['a']\nzero = [0]\ncomponents = ['fz']\nmatrix = [[2]]\n", problems);
    EXPECT_EQ(problems.lines(), Lines{});
    EXPECT_EQ(c.contact_model, "unknown");
    EXPECT_TRUE(c.sd.empty() && c.full_scale.empty() && c.channel_least.empty() && c.parameters.empty());
    EXPECT_EQ(c.condition, 0.0);
    expect_same(parse(calibration_text(c), problems), c);
    EXPECT_EQ(errors_of_calibration(""),
              (Lines{
                  "c.toml:1: key \"format\" is missing",
                  "c.toml:1: key \"model\" is missing",
                  "c.toml:1: key \"channels\" is missing: the names of the channels, in the order of all numbers below",
                  "c.toml:1: key \"components\" is missing: those of fx fy fz mx my mz that the sensor sees",
                  "c.toml:1: key \"zero\" is missing: what each channel reads at no load",
                  "c.toml:1: key \"matrix\" is missing: a row for each component, in it N or Nm a channel_unit for each "
                  "channel (or "
                  "[parameters], for models that have some)",
              }));
}

TEST(Calibration, ReadsParametersAsATableToo) {
    Problems problems;
    std::string text =
        "format = 1\nmodel = 'table'\nchannels = ['R1']\nzero = [0]\ncomponents = ['fx']\n[parameters]\nnormal_inner = "
        "1e-3\n";
    EXPECT_EQ(parse(text, problems).parameters.at("normal_inner"), 1e-3);
    text += "crc = \"0x" + [&] {
        char digits[5];
        std::snprintf(digits, sizeof digits, "%04x", crc_of_lines(text));
        return std::string(digits);
    }() + "\"\n";
    EXPECT_EQ(parse(text, problems).parameters.size(), 1u);  // the crc line is not a parameter
    EXPECT_EQ(problems.lines(), Lines{});
}

TEST(Calibration, CrcIsTheKnownOne) { EXPECT_EQ(crc_of_lines("123456789"), 0x29B1); }

TEST(Calibration, RefusesAChangedFileAndSaysWhatToDo) {
    std::string text = calibration_text(example());
    text.replace(text.find("0.25"), 4, "0.26");
    const auto lines = errors_of_calibration(text);
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_NE(
        lines[0].find("the file was changed or is damaged; calibrate again, or delete this line if the change is meant"),
        std::string::npos);
    EXPECT_EQ(lines[0].find("c.toml:" + std::to_string(std::count(text.begin(), text.end(), '\n')) + ": crc = \"0x"), 0u)
        << lines[0];
    text.erase(text.rfind("crc"));
    EXPECT_EQ(errors_of_calibration(text), Lines{});
    Problems problems;
    EXPECT_EQ(parse(text, problems).crc, crc_of_lines(text));
}

TEST(Calibration, WantsTheCrcAsTheLastLine) {
    const std::string text = calibration_text(example());
    const std::string body = text.substr(0, text.rfind("crc"));
    EXPECT_EQ(errors_of_calibration("crc = \"0x1234\"\n" + body).size(), 1u);
    EXPECT_NE(errors_of_calibration(text + "# later\n"), Lines{});
    EXPECT_NE(errors_of_calibration(body + "crc = \"0x12\"\n"), Lines{});
    EXPECT_NE(errors_of_calibration(body + "crc = 5\n"), Lines{});
    EXPECT_EQ(errors_of_calibration(text.substr(0, text.size() - 1)), Lines{});  // an editor that drops the last newline
    std::string windows;
    for (const char c : text) windows += c == '\n' ? "\r\n" : std::string(1, c);
    EXPECT_EQ(errors_of_calibration(windows).size(), 1u);  // other bytes
}

std::string with(const std::string& line, const std::string& but = "") {
    const std::pair<const char*, const char*> keys[] = {
        {"format", "1"},    {"model", "'generic'"},         {"channels", "['a', 'b']"},
        {"zero", "[0, 0]"}, {"components", "['fx', 'fz']"}, {"matrix", "[[1, 2], [3, 4]]"}};
    std::string text;
    for (const auto& [key, value] : keys)
        if (key != but) text += std::string(key) + " = " + value + "\n";
    return text + line + "\n";
}

TEST(Calibration, RefusesWhatDoesNotFitTogether) {
    EXPECT_EQ(errors_of_calibration(with("")), Lines{});
    const std::pair<std::string, std::string> cases[] = {
        {with("zero = [0]", "zero"), "zero has 1 entries, should have 2"},
        {with("zero = [0, nan]", "zero"), "zero[1] = nan is not a finite number"},
        {with("zero = [0, inf]", "zero"), "zero[1] = inf is not a finite number"},
        {with("zero = [0, 1.1e300]", "zero"), "zero[1] = 1.1e+300 is outside -1e+300 .. 1e+300"},
        {with("zero = []", "zero"), "zero has 0 entries, should have 2"},
        {with("channels = []", "channels"), "channels has 0 entries, should have 1 .. 32"},
        {with("channels = ['a', 'a']", "channels"), "channels has \"a\" twice"},
        {with("channels = ['a', '-']", "channels"),
         "channels has \"-\"; a channel's name has 1 .. 31 bytes and no space, comma or quote"},
        {with("components = ['fz', 'fx']", "components"),
         "components has \"fx\" here; possible are fx fy fz mx my mz, in this order, each once"},
        {with("components = ['fx', 'fx']", "components"),
         "components has \"fx\" here; possible are fx fy fz mx my mz, in this order, each once"},
        {with("components = ['fx', 'gz']", "components"),
         "components has \"gz\" here; possible are fx fy fz mx my mz, in this order, each once"},
        {with("matrix = [[1, 2]]", "matrix"), "matrix has 1 rows for 2 components"},
        {with("matrix = [[1, 2], [3]]", "matrix"), "matrix[1] has 1 numbers for 2 channels"},
        {with("matrix = [[1, 2], [3, 1e301]]", "matrix"), "matrix[1][1] = 1e+301 is outside -1e+300 .. 1e+300"},
        {with("matrix = [1, 2]", "matrix"), "matrix[0] = 1 is an integer, should be an array of numbers"},
        {with("sd = [1]"), "sd has 1 entries, should have 2"},
        {with("sd = [1, -1]"), "sd[1] = -1 is outside 0 .. 1e+300"},
        {with("sd = [1, 0]"),
         "sd[1] = 0: no sensor is without an error; give one standard deviation in N or Nm above 0, or delete sd if it is "
         "not "
         "known (then UNCERTAIN)"},
        {with("full_scale = [1, 2, 3]"), "full_scale has 3 entries, should have 2"},
        {with("channel_least = [0, 0]"), "channel_least and channel_most belong together: give both or none"},
        {with("channel_least = [0, 5]\nchannel_most = [0, 4]"), "channel_most[1] = 4 is below channel_least[1] = 5"},
        {with("date = '2026-02-30'"), "date = \"2026-02-30\" should be a day as YYYY-MM-DD"},
        {with("date = '1.2.2026'"), "date = \"1.2.2026\" should be a day as YYYY-MM-DD"},
        {with("serial = '" + std::string(32, 's') + "'"), "serial has 32 bytes; at most 31 are published"},
        {with("model = '../x y'", "model"), "model = \"../x y\"; a name has 1 .. 31 of A-Z a-z 0-9 _ . -"},
        {with("format = 2", "format"), "a later version of tactiled wrote this file; this one reads format = 1"},
        {with("rows = -1"), "rows = -1 is outside 0 .. 1000000000"},
        {with("condition = nan"), "condition = nan is not a finite number"},
        {with("channel_units = 'pF'"), "unknown key \"channel_units\"; did you mean \"channel_unit\"?"},
        {with("[parameters]\na = 'x'"), "[parameters]: a = \"x\" is a string, should be a number"},
        {with("[parameters]\na = inf"), "[parameters]: a = inf is not a finite number"},
        {with("[tables]\nt = [[1, 2], [3]]"), "[tables]: t: its rows have 2 and 1 numbers; all need as many"},
        {with("[tables]\n'a.b' = [[1]]"),
         "[tables]: table \"a.b\"; a name has 1 .. 31 of A-Z a-z 0-9 _ . -, and no dot here"},
        {with("method = 'a b'"), "method = \"a b\"; a name has 1 .. 31 of A-Z a-z 0-9 _ . -"},
        {with("[[other]]\nzero = [0, 0]\nmatrix = [[1, 2], [3, 4]]"), "[[other]]: key \"method\" is missing"},
        {with("[[other]]\nmethod = 'b'\nzero = [0, 0]\nmatrix = [[1, 2]]"), "[[other]]: matrix has 1 rows for 2 components"},
        {with("date = '2026-x2-20'"), "date = \"2026-x2-20\" should be a day as YYYY-MM-DD"},
        {with("date = '2026-13-01'"), "date = \"2026-13-01\" should be a day as YYYY-MM-DD"},
        {with("[parameters]\n'a b' = 1"),
         "[parameters]: parameter \"a b\"; a name has 1 .. 31 of A-Z a-z 0-9 _ . -, and no dot here"},
    };
    for (const auto& [text, error] : cases) {
        const auto lines = errors_of_calibration(text);
        ASSERT_EQ(lines.size(), 1u) << error << "\n" << (lines.empty() ? "" : lines[1]);
        EXPECT_EQ(lines[0].substr(lines[0].find(": ") + 2), error);
    }
}

TEST(Calibration, HoldsTablesAndOtherMethodsOfWhichOneIsChosenByName) {
    Problems problems;
    const Calibration c = parse_calibration(with("method = 'first'\n[tables]\nt = [[1, 2], [3, 4]]\n[[other]]\nmethod = "
                                                 "'second'\nzero = [5, 6]\nmatrix = [[7, 8], [9, 10]]"),
                                            "c.toml", problems);
    EXPECT_EQ(problems.lines(), Lines{});
    EXPECT_EQ(c.tables.at("t"), (std::vector<std::vector<double>>{{1, 2}, {3, 4}}));
    const Calibration second = c.with_method("second"), first = c.with_method("first");
    EXPECT_EQ(second.matrix[0][0], 7);
    EXPECT_EQ(second.zero[0], 5);
    EXPECT_EQ(second.method, "second");
    EXPECT_EQ(first.matrix, c.matrix);
    EXPECT_TRUE(first.others.empty() && second.others.empty());
    EXPECT_EQ(parse_calibration(calibration_text(c), "c.toml", problems).others.size(), 1u);
}

TEST(Calibration, SaysWhichFileIsMissingOrTooLarge) {
    Problems problems;
    EXPECT_EQ(load_calibration("/nowhere/c.toml", problems).path, "/nowhere/c.toml");
    EXPECT_EQ(problems.lines(), Lines{"/nowhere/c.toml: there is no such file; give the path of one that exists"});
    const Folder folder;
    Problems large;
    load_calibration(folder.write("c.toml", std::string((16u << 20) + 1, '#')), large);
    EXPECT_EQ(large.lines().size(), 1u);
}

// Truncation removes the crc line, so the rest must fail or have the same meaning.
TEST(Calibration, CutAnywhereIsAnErrorOrTheSame) {
    const std::string text = calibration_text(example());
    std::size_t accepted = 0;
    for (std::size_t n = 0; n < text.size(); ++n) {
        Problems problems;
        const Calibration c = parse(text.substr(0, n), problems);
        if (!problems.empty()) continue;
        ++accepted;
        EXPECT_EQ(c.matrix, example().matrix) << n;  // the matrix is complete, whatever a hand-written file may omit
        EXPECT_EQ(c.zero, example().zero) << n;
    }
    EXPECT_LT(accepted, 300u);
}

TEST(Calibration, OneChangedBitAnywhereIsAnErrorOrTheSame) {
    const std::string text = calibration_text(example());
    std::size_t accepted = 0;
    for (std::size_t bit = 0; bit < 8 * text.size(); ++bit) {
        std::string changed = text;
        changed[bit / 8] = static_cast<char>(changed[bit / 8] ^ (1 << bit % 8));
        Problems problems;
        const Calibration c = parse(changed, problems);
        if (!problems.empty()) continue;
        ++accepted;
        expect_same(c, example());
    }
    EXPECT_LT(accepted, 10u);  // in the crc line itself: upper and lower case, the line as a comment
}

}  // namespace
}  // namespace tactiled
