#include "config/options.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <ctime>
#include <limits>

#include "folder.hpp"

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;
using test::Folder;

struct Parsed {
    Problems problems;
    Options options;
    explicit Parsed(std::string_view text) : options(Options::parse_text(text, "t.toml", problems)) {}
};

TEST(Options, GiveWhatIsInTheFile) {
    Parsed p(
        "text = 'abc'\nnumber = 2.5\nwhole = 3\nint = -7\nfloat_int = 1e3\nflag = true\nchoice = \"b\"\n"
        "texts = ['x', 'y']\nnumbers = [1, 2.5]\nrows = [[1, 2], [3.5, 4]]\n");
    auto& o = p.options;
    EXPECT_EQ(o.text("text"), "abc");
    EXPECT_EQ(o.number("number", {0, 10}), 2.5);
    EXPECT_EQ(o.number("whole", {0, 10}), 3.0);
    EXPECT_EQ(o.integer("int", {-10, 10}), -7);
    EXPECT_EQ(o.integer("float_int", {0, 5000}), 1000);
    EXPECT_TRUE(o.flag("flag", false));
    EXPECT_EQ(o.one_of("choice", {"a", "b"}), "b");
    EXPECT_EQ(o.texts("texts"), (Lines{"x", "y"}));
    EXPECT_EQ(o.numbers("numbers", {0, 10}), (std::vector<double>{1, 2.5}));
    EXPECT_EQ(o.rows("rows"), (std::vector<std::vector<double>>{{1, 2}, {3.5, 4}}));
    o.finish();
    EXPECT_EQ(p.problems.lines(), Lines{});
}

TEST(Options, GiveTheFallbackForAMissingKey) {
    Parsed p("");
    auto& o = p.options;
    EXPECT_EQ(o.text("a", "x"), "x");
    EXPECT_EQ(o.number("b", {0, 1}, 7.0), 7.0);
    EXPECT_EQ(o.integer("c", {0, 1}, -1), -1);
    EXPECT_TRUE(o.flag("d", true));
    EXPECT_EQ(o.one_of("e", {"p", "q"}, "q"), "q");
    EXPECT_TRUE(o.texts("f").empty() && o.numbers("g", {0, 1}).empty() && o.rows("h").empty() && o.tables("i").empty());
    EXPECT_EQ(o.table("j").text("k", "z"), "z");
    EXPECT_FALSE(o.has("a"));
    EXPECT_TRUE(p.problems.empty());
}

TEST(Options, SayWhatIsMissingAtTheLineOfTheTable) {
    Parsed p("\n\n[[link]]\nname = 'skin'\n\n[[link]]\n");
    auto links = p.options.tables("link");
    ASSERT_EQ(links.size(), 2u);
    EXPECT_EQ(links[0].text("driver"), "");
    EXPECT_EQ(links[1].integer("baud", {300, 1e6}), 300);
    EXPECT_EQ(links[1].number("x", {2, 3}), 2.0);
    EXPECT_EQ(links[1].one_of("format", {"a"}), "");
    EXPECT_EQ(p.problems.lines(),
              (Lines{"t.toml:3: link \"skin\": key \"driver\" is missing", "t.toml:6: [[link]]: key \"baud\" is missing",
                     "t.toml:6: [[link]]: key \"x\" is missing", "t.toml:6: [[link]]: key \"format\" is missing"}));
}

TEST(Options, NameFileLineTableKeyAndRange) {
    Parsed p("[[sensor]]\nname = \"left\"\nstale_ms = 0\nratio = 1.5\nbig = 9223372036854775807\n");
    auto sensor = p.options.tables("sensor").at(0);
    EXPECT_EQ(sensor.integer("stale_ms", {1, 10000}, 100), 100);
    EXPECT_EQ(sensor.number("ratio", {0, 1}, 0.5), 0.5);
    EXPECT_EQ(sensor.integer("big", {0, 100}), 0);
    EXPECT_EQ(p.problems.lines(), (Lines{"t.toml:3: sensor \"left\": stale_ms = 0 is outside 1 .. 10000",
                                         "t.toml:4: sensor \"left\": ratio = 1.5 is outside 0 .. 1",
                                         "t.toml:5: sensor \"left\": big = 9223372036854775807 is outside 0 .. 100"}));
}

TEST(Options, AllowBothEndsOfARange) {
    Parsed p("a = 1\nb = 10\nc = 0\nd = 11\n");
    for (const char* key : {"a", "b"}) p.options.integer(key, {1, 10});
    EXPECT_TRUE(p.problems.empty());
    for (const char* key : {"c", "d"}) p.options.number(key, {1, 10});
    EXPECT_EQ(p.problems.lines().size(), 2u);
}

TEST(Options, SayWhatTheTypeIsAndWhatItShouldBe) {
    Parsed p(
        "a = 'ten'\nb = 5\nc = 1.5\nd = 1\ne = [1]\nf = ['x', 5]\ng = [1,\n 'y']\nh = [[1], 2]\ni = {x = 1}\nj = "
        "1979-05-27\nk = 'x'\n");
    auto& o = p.options;
    o.integer("a", {0, 1});
    o.text("b");
    o.integer("c", {0, 9});
    o.flag("d", false);
    o.number("e", {0, 1});
    o.texts("f");
    o.numbers("g", {0, 1});
    o.rows("h");
    o.text("i", "");
    o.text("j");
    o.numbers("k", {0, 1});
    EXPECT_EQ(p.problems.lines(), (Lines{
                                      "t.toml:1: a = \"ten\" is a string, should be an integer",
                                      "t.toml:2: b = 5 is an integer, should be a string",
                                      "t.toml:3: c = 1.5 is a number, should be an integer",
                                      "t.toml:4: d = 1 is an integer, should be true or false",
                                      "t.toml:5: e is an array, should be a number",
                                      "t.toml:6: f[1] = 5 is an integer, should be a string",
                                      "t.toml:8: g[1] = \"y\" is a string, should be a number",
                                      "t.toml:9: h[1] = 2 is an integer, should be an array of numbers",
                                      "t.toml:10: i is a table, should be a string",
                                      "t.toml:11: j is a date, should be a string",
                                      "t.toml:12: k = \"x\" is a string, should be an array of numbers",
                                  }));
}

TEST(Options, RefuseWhatIsNoFiniteNumber) {
    constexpr double kInf = std::numeric_limits<double>::infinity();
    EXPECT_FALSE(Parsed("f = 1e999\n").problems.empty());
    Parsed q("a = nan\nb = inf\nc = [1, -inf]\nd = [[nan]]\ne = inf\n");
    q.options.number("a", {-kInf, kInf});
    q.options.number("b", {-kInf, kInf});
    EXPECT_TRUE(q.options.numbers("c", {-kInf, kInf}).empty());
    EXPECT_TRUE(q.options.rows("d").empty());
    EXPECT_EQ(q.options.integer("e", {-kInf, kInf}, 7), 7);
    EXPECT_EQ(q.problems.lines(),
              (Lines{"t.toml:1: a = nan is not a finite number", "t.toml:2: b = inf is not a finite number",
                     "t.toml:3: c[1] = -inf is not a finite number", "t.toml:4: d[0][0] = nan is not a finite number",
                     "t.toml:5: e = inf is a number, should be an integer"}));
}

TEST(Options, SayHowManyEntriesAnArrayShouldHave) {
    Parsed p("a = [1, 2, 3]\nb = []\nc = ['x']\n");
    EXPECT_TRUE(p.options.numbers("a", {0, 9}, {2, 2}).empty());
    EXPECT_TRUE(p.options.numbers("b", {0, 9}, {1, 4}).empty());
    EXPECT_EQ(p.options.texts("c", {1, 1}), Lines{"x"});
    EXPECT_EQ(p.problems.lines(),
              (Lines{"t.toml:1: a has 3 entries, should have 2", "t.toml:2: b has 0 entries, should have 1 .. 4"}));
}

TEST(Options, NameTheNearestOfAChoice) {
    Parsed p("a = 'cosb'\nb = 'xyz'\nc = 4\n");
    EXPECT_EQ(p.options.one_of("a", {"cobs", "lines"}, "lines"), "lines");
    p.options.one_of("b", {"cobs", "lines"});
    p.options.one_of("c", {"cobs", "lines"});
    EXPECT_EQ(p.problems.lines(),
              (Lines{"t.toml:1: a = \"cosb\" is unknown; did you mean \"cobs\"? known: \"cobs\", \"lines\"",
                     "t.toml:2: b = \"xyz\" is unknown; known: \"cobs\", \"lines\"",
                     "t.toml:3: c = 4 is an integer, should be one of \"cobs\", \"lines\""}));
}

TEST(Options, RefuseAnEmptyTextWhereOneIsRequired) {
    Parsed p("a = ''\nb = ''\n");
    p.options.text("a");
    EXPECT_EQ(p.options.text("b", "x"), "");
    EXPECT_EQ(p.problems.lines(), Lines{"t.toml:1: a is empty"});
}

TEST(Options, NameTheNearestOfAnUnknownKey) {
    Parsed p("[[link]]\nname = 'skin'\ndevcie = '/dev/x'\nzzz = 1\n[lnik]\n[[grasp]]\nx = 1\n");
    auto link = p.options.tables("link").at(0);
    link.text("name");
    link.text("device", "");
    p.options.finish();
    EXPECT_EQ(p.problems.lines(), (Lines{"t.toml:3: link \"skin\": unknown key \"devcie\"; did you mean \"device\"?",
                                         "t.toml:4: link \"skin\": unknown key \"zzz\"; known: name, device",
                                         "t.toml:5: unknown table [lnik]; did you mean \"link\"?",
                                         "t.toml:6: unknown table [[grasp]]; known: link"}));
}

TEST(Options, ReportAMisspeltKeyOnceAndNotAlsoAsMissing) {
    Parsed p("[[link]]\nname = 'skin'\ndevcie = '/dev/x'\ndevice_baud = 1\n[[sensr]]\nx = 1\n");
    auto link = p.options.tables("link").at(0);
    link.text("name");
    link.text("device");
    link.text("driver");  // is missing, and no key resembles it
    EXPECT_TRUE(p.options.tables("sensor").empty());
    p.options.problem("sensor", "there is no [[sensor]]");
    p.options.finish();
    EXPECT_EQ(p.problems.lines(), (Lines{"t.toml:1: link \"skin\": key \"driver\" is missing",
                                         "t.toml:3: link \"skin\": unknown key \"devcie\"; did you mean \"device\"?",
                                         "t.toml:4: link \"skin\": unknown key \"device_baud\"; did you mean \"device\"?",
                                         "t.toml:5: unknown table [[sensr]]; did you mean \"sensor\"?"}));
    // The keys of an unknown driver are not judged, but the misspelt one is.
    Parsed r("[[link]]\ndrivr = 'uart'\nbaud = 9600\n");
    auto unknown = r.options.tables("link").at(0);
    unknown.text("driver");
    unknown.accept_other_keys();
    r.options.finish();
    EXPECT_EQ(r.problems.lines(), Lines{"t.toml:2: [[link]]: unknown key \"drivr\"; did you mean \"driver\"?"});
    // A near name that is not there is meant rather than one that is.
    Parsed q("fx_N = 1\nfz_N = 2\nfz_n = 3\n");
    for (const char* key : {"fx_N", "fy_N", "fz_N"}) q.options.number(key, {0, 9});
    q.options.finish();
    EXPECT_EQ(q.problems.lines(), Lines{"t.toml:3: unknown key \"fz_n\"; did you mean \"fy_N\"?"});
}

TEST(Options, ShareBetweenCopiesWhichKeysWereAsked) {
    Parsed p("[node]\nname = 'x'\nb = 1\n");
    Options copy = p.options.table("node");
    Options other = copy;
    other.text("name");
    p.options.table("node").integer("b", {0, 2});
    p.options.finish();
    p.options.finish();
    EXPECT_EQ(p.problems.lines(), Lines{});
}

TEST(Options, ReportNoMoreUnknownKeysThanAnyoneReads) {
    std::string text;
    for (int i = 0; i < 50; ++i) text += "k" + std::to_string(i) + " = 1\n";
    Parsed p(text);
    p.options.finish();
    const auto lines = p.problems.lines();
    ASSERT_EQ(lines.size(), 21u);
    EXPECT_EQ(lines.front(), "t.toml:1: unknown key \"k0\"");  // no key is known
    EXPECT_EQ(lines.back(), "t.toml:21: and 30 more unknown keys");
}

TEST(Options, TellOneTableFromSeveral) {
    Parsed p("[link]\nname = 'x'\n[[node]]\nname = 'y'\n[a]\n[[b]]\n");
    EXPECT_TRUE(p.options.tables("link").empty());
    p.options.table("node");
    EXPECT_EQ(p.options.tables("b", 0).size(), 0u);
    p.options.text("a");
    Parsed q("x = 1\ny = 'a'\nz = []\n");
    q.options.table("x");
    q.options.tables("y");
    q.options.tables("z");
    EXPECT_EQ(p.problems.lines(),
              (Lines{"t.toml:1: [link] can be there more than once: write [[link]]",
                     "t.toml:3: [[node]] can be there but once: write [node]", "t.toml:5: a is a table, should be a string",
                     "t.toml:6: this is [[b]] number 1; at most 0 are possible"}));
    EXPECT_EQ(q.problems.lines(), (Lines{"t.toml:1: x = 1 is an integer, should be the table [x]",
                                         "t.toml:2: y = \"a\" is a string, should be tables [[y]]",
                                         "t.toml:3: z is an array, should be tables [[z]]"}));
}

TEST(Options, ReportEveryErrorInTheOrderOfTheLines) {
    Parsed q("a = 1\nb = 'x'\nc = nan\nunknown = 7\n");
    q.options.number("c", {0, 1});
    q.options.integer("b", {0, 1});
    q.options.text("a");
    q.options.finish();
    const auto lines = q.problems.lines();
    ASSERT_EQ(lines.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(lines[i].find("t.toml:" + std::to_string(i + 1) + ": "), 0u) << lines[i];
}

TEST(Options, TellInWhichKeysTwoTablesDiffer) {
    Problems problems;
    const auto before = Options::parse_text("a = 1\nb = [1, 2]\nc = 'x'\n[d]\ne = 1\n[[f]]\ng = 1\n", "t", problems);
    const auto differing = [&](const char* text) {
        return fmt::format("{}", fmt::join(Options::parse_text(text, "t", problems).differing_keys(before), " "));
    };
    EXPECT_EQ(differing("# a comment\nc = \"x\"\nb = [ 1,2 ]\na = 1\nd = {e = 1}\n[[f]]\ng = 1\n"), "");
    EXPECT_EQ(differing("a = 2\nb = [2, 1]\nc = 'x'\n[d]\ne = 1\n[[f]]\ng = 1\n"), "a b");
    EXPECT_EQ(differing("a = 1.0\nb = [1, 2]\nc = 'x'\n[d]\ne = 1\n[[f]]\ng = 1\n"), "a");  // another type, another value
    EXPECT_EQ(differing("a = 1\nb = [1, 2]\nh = 1\n[d]\ne = 2\n[[f]]\ng = 1\n[[f]]\ng = 1\n"), "d f h c");
    EXPECT_TRUE(problems.empty());
}

TEST(Options, ProblemsOfOthersStandAtTheirKey) {
    Parsed p("[[link]]\nname = 'a'\ndriver = 'uatr'\n");
    auto link = p.options.tables("link").at(0);
    link.problem("driver", "driver is unknown");
    link.problem("baud", "baud is needed");
    EXPECT_EQ(link.where("driver"), "t.toml:3");
    EXPECT_EQ(link.file(), "t.toml");
    EXPECT_EQ(p.problems.lines(),
              (Lines{"t.toml:1: link \"a\": baud is needed", "t.toml:3: link \"a\": driver is unknown"}));
}

TEST(Options, SayWhereATextIsNoToml) {
    Parsed p("[node]\nname = 'x'\nwatchdog_ms = = 5\nrest = \n");
    EXPECT_EQ(p.options.text("name"), "");  // no error for a key that is missing because the file is unreadable
    p.options.finish();
    const auto lines = p.problems.lines();
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_EQ(lines[0].find("t.toml:3:15: "), 0u) << lines[0];
}

TEST(Options, ReadFilesFromWindows) {
    Parsed p("\xef\xbb\xbf[node]\r\nname = 'x'\r\nbad = 1\r\n");
    EXPECT_EQ(p.options.table("node").text("name"), "x");
    p.options.finish();
    EXPECT_EQ(p.problems.lines(), Lines{"t.toml:3: [node]: unknown key \"bad\"; known: name"});
}

TEST(Options, RefuseWhatIsNoText) {
    Parsed zero(std::string_view("a = 1\n\0\n", 8));
    EXPECT_EQ(zero.problems.lines(), Lines{"t.toml:2: holds a zero byte: not a text file; save it as UTF-8 text"});
    Parsed utf16(std::string_view("\xff\xfe[\0n\0", 6));
    EXPECT_EQ(utf16.problems.lines().size(), 1u);
    Parsed latin1("name = \"gr\xfc\xdf\"\n");
    EXPECT_EQ(latin1.problems.lines().size(), 1u);
}

// Each of these made the parser assert or reach code that it declares unreachable.
TEST(Options, SurviveWhatConfusesTheParser) {
    for (const char* text : {"a = { .b = 1 }",
                             "a = 1979-05-",
                             "a = 1979-05-27T07:32:",
                             "a = [ # ]",
                             "a = ,",
                             "a = 1x\"\xc3\xa9\"",
                             "a = \xcf\xa5",
                             "\xcf\xa5 = 1",
                             "a = \xc2\xa0 1",
                             "a = \xe2\x80\x9cleft\xe2\x80\x9d",
                             "a = {b = 1, . = 2}",
                             "a = 07:32:",
                             "a = +",
                             "a = 0x",
                             "= 1",
                             "[",
                             "[[",
                             "[.]",
                             "a.",
                             "a = \"\\u00\"",
                             "a = \"\\ud800\""})
        EXPECT_EQ(Parsed(text).problems.lines().size(), 1u) << text;
}

// The parser's own limits, and those of unfit() before it; each would otherwise end in a stack overflow.
TEST(Options, SurviveHostileNesting) {
    const auto deep = [](std::string_view open, int n, std::string_view close) {
        std::string text = "a = ";
        for (int i = 0; i < n; ++i) text += open;
        for (int i = 0; i < n; ++i) text += close;
        return text;
    };
    EXPECT_FALSE(Parsed(deep("[", 100'000, "]")).problems.empty());
    EXPECT_FALSE(Parsed(deep("{a=", 100'000, "}")).problems.empty());
    EXPECT_FALSE(Parsed(deep("[{a=", 50'000, "}]")).problems.empty());
    std::string dotted = "a";
    for (int i = 0; i < 400'000; ++i) dotted += ".a";
    EXPECT_FALSE(Parsed(dotted + " = 1\n").problems.empty());
    EXPECT_FALSE(Parsed("[" + dotted + "]\n").problems.empty());
    // The deepest nesting that both limits accept.
    std::string line = "a";
    for (int i = 0; i < 500; ++i) line += ".a";
    std::string deepest = "[" + line + "]\n" + line + " = [\n";
    for (int i = 0; i < 7; ++i) deepest += "{" + line + " = [\n";
    deepest += "1";
    for (int i = 0; i < 7; ++i) deepest += "]}\n";
    EXPECT_TRUE(Parsed(deepest + "]\n").problems.empty());
}

TEST(Options, AreQuickWithAnyMegabyte) {
    const std::clock_t started = std::clock();  // processor time: other programs may be busy
    std::string many, tables, array = "a = [";
    for (int i = 0; many.size() < 1'000'000; ++i) many += "k" + std::to_string(i) + "=1\n";
    while (tables.size() < 1'000'000) tables += "[[sensor]]\n";
    while (array.size() < 1'000'000) array += "'',";
    for (const auto& text :
         {many, tables, array + "]", std::string(1'000'000, '\n'), "a = '" + std::string(1'000'000, 'x') + "'"}) {
        Parsed p(text);
        p.options.tables("sensor", 16);
        p.options.texts("a", {0, 32});
        p.options.finish();
        (void)p.problems.lines();
    }
    const double seconds = double(std::clock() - started) / CLOCKS_PER_SEC;
    EXPECT_LT(seconds / 5, 1.0);  // s per file, in a build without optimisation
}

TEST(OptionsFile, SaysWhichPathIsWrongAndWhatToDo) {
    const Folder folder;
    const auto why = [](const std::string& path) {
        Problems problems;
        Options options = Options::parse_file(path, problems, 1000);
        EXPECT_FALSE(options.has("x"));
        EXPECT_EQ(options.text("x"), "");
        options.finish();
        EXPECT_EQ(options.file(), path);
        EXPECT_EQ(problems.lines().size(), 1u) << path;
        return problems.lines().at(0);
    };
    EXPECT_EQ(why(folder / "none.toml"), folder / "none.toml" + ": there is no such file; give the path of one that exists");
    EXPECT_NE(why("none.toml").find("seen from the folder " + std::filesystem::current_path().string()), std::string::npos);
    EXPECT_EQ(why(folder.path()), folder.path() + ": is a folder; give the path of a file in it");
    EXPECT_EQ(why(""), "\"\": the path is empty; give the path of a file");
    EXPECT_EQ(why("/dev/zero"), "/dev/zero: is a pipe or a device; give the path of a regular file");
    ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
    EXPECT_NE(why(folder / "pipe").find("is a pipe"), std::string::npos);  // and does not wait for a writer
    EXPECT_NE(why(folder.write("big.toml", std::string(1001, '\n'))).find("is larger than 1000 bytes"), std::string::npos);
    EXPECT_NE(why(std::string(5000, 'x')).find("cannot be opened"), std::string::npos);
}

TEST(OptionsFile, MayBeEmptyOrJustSmallEnough) {
    const Folder folder;
    Problems problems;
    Options::parse_file(folder.write("empty.toml", ""), problems, 1000).finish();
    Options::parse_file(folder.write("full.toml", std::string(1000, '\n')), problems, 1000).finish();
    EXPECT_TRUE(problems.empty());
}

TEST(Options, KeysThatAFileHasLostAreNamedWithTheirTables) {
    Problems problems;
    const auto parse = [&](const std::string& text) { return Options::parse_text(text, "t.toml", problems); };
    const Options before = parse(
        "[grasp]\nfriction = 1\nmargin = 2\n[[grasp.jaw]]\nsensor = 'a'\nshare = 1\n"
        "[[sensor]]\nname = 'a'\nfilter_hz = 5\n[[sensor]]\nname = 'b'\ntare_ms = 50\n[shm]\n");
    EXPECT_EQ(before.lost_keys(before), std::vector<std::string>{});
    const Options devices =
        parse("[[link]]\nname = 'can'\n[[link.device]]\ndevice = 1\ndbc = 'a'\n[[link.device]]\ndevice = 2\nid = 5\n");
    EXPECT_EQ(devices.lost_keys(devices), std::vector<std::string>{});
    const Options now = parse("[grasp]\nfriction = 1\n[[grasp.jaw]]\nsensor = 'a'\n[[sensor]]\nname = 'b'\nadded = 1\n");
    EXPECT_EQ(now.lost_keys(before), (std::vector<std::string>{"grasp.jaw \"a\": share", "grasp.margin", "sensor \"a\"",
                                                               "sensor \"b\": tare_ms", "shm"}));
}

}  // namespace
}  // namespace tactiled
