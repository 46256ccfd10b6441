#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <regex>
#include <sstream>

#include "decoupling/solve/load_scale.hpp"
#include "node/lab/chart/axis.hpp"
#include "node/lab/chart/text.hpp"
#include "node/lab/report/report.hpp"
#include "tests/unit/decoupling/made_by_hand.hpp"

namespace tactiled {
namespace {

// Returns the error of the page's tags, "" if every one is closed in order.
std::string fault_of_tags(const std::string& page) {
    std::vector<std::string> open;
    for (std::size_t at = page.find('<'); at != page.npos; at = page.find('<', at + 1)) {
        if (page.compare(at, 2, "<!") == 0) continue;
        const std::size_t end = page.find('>', at);
        if (end == page.npos) return "a tag has no end";
        const std::string tag = page.substr(at + 1, end - at - 1);
        if (tag.find('<') != tag.npos) return "< in tag " + tag;
        if (std::count(tag.begin(), tag.end(), '"') % 2 != 0) return "quotes of " + tag;
        const std::string name = tag.substr(tag[0] == '/', tag.find_first_of(" \n", 1) - (tag[0] == '/'));
        if (tag[0] == '/') {
            if (open.empty() || open.back() != name)
                return "</" + name + "> closes " + (open.empty() ? "none" : open.back());
            open.pop_back();
        } else if (tag.back() != '/' && name != "meta") {
            open.push_back(name);
        }
    }
    return open.empty() ? "" : open.back() + " stays open";
}

// Returns the table with that id: the cells of each row, as HTML.
std::vector<std::vector<std::string>> table(const std::string& page, const std::string& id) {
    const std::size_t from = page.find("id=\"" + id + "\""), to = page.find("</table>", from);
    if (from == page.npos) return {};
    std::vector<std::vector<std::string>> rows;
    const std::string text = page.substr(from, to - from);
    static const std::regex row("<tr>(.*?)</tr>"), cell("<t[dh][^>]*>(.*?)</t[dh]>");
    for (std::sregex_iterator r(text.begin(), text.end(), row), end; r != end; ++r) {
        const std::string inside = (*r)[1];
        rows.emplace_back();
        for (std::sregex_iterator c(inside.begin(), inside.end(), cell); c != end; ++c) rows.back().push_back((*c)[1]);
    }
    return rows;
}

// Returns the numbers of a cell, with all digits; the visible text must be the same to four digits.
std::vector<double> numbers(const std::string& cell) {
    static const std::regex data("<data value=\"([^\"]*)\">([^<]*)</data>");
    std::vector<double> result;
    for (std::sregex_iterator d(cell.begin(), cell.end(), data), end; d != end; ++d) {
        result.push_back(std::strtod((*d)[1].str().c_str(), nullptr));
        EXPECT_NEAR(std::strtod((*d)[2].str().c_str(), nullptr), result.back(), 5.1e-4 * std::abs(result.back())) << cell;
    }
    return result;
}
double number(const std::string& cell) {
    const auto all = numbers(cell);
    return all.size() == 1 ? all[0] : kNaN;
}

std::size_t count(const std::string& text, const std::string& what) {
    std::size_t n = 0;
    for (std::size_t at = text.find(what); at != text.npos; at = text.find(what, at + 1)) ++n;
    return n;
}

// Checks that every coordinate of every plot is a number inside of its picture. Returns the number of plots.
int check_plots(const std::string& page) {
    static const std::regex relative("[a-z][^MLHVZ]*");  // from a place that is checked
    int plots = 0;
    for (std::size_t at = page.find("<svg"); at != page.npos; at = page.find("<svg", at + 1)) {
        ++plots;
        const std::string svg = page.substr(at, page.find("</svg>", at) - at);
        EXPECT_EQ(svg.find("nan"), svg.npos);
        EXPECT_EQ(svg.find("inf"), svg.npos);
        for (const char* name : {" d=\"", " x=\"", " y=\"", " width=\"", " height=\""})
            for (std::size_t a = svg.find(name); a != svg.npos; a = svg.find(name, a + 1)) {
                const std::size_t from = svg.find('"', a) + 1;
                std::string text = svg.substr(from, svg.find('"', from) - from);
                text = std::regex_replace(text, relative, "");
                std::replace_if(
                    text.begin(), text.end(),
                    [](char c) { return std::string_view("MLHVZh").find(c) != std::string_view::npos; }, ' ');
                std::istringstream in(text);
                double value = 0;
                while (in >> value)
                    if (!(value >= 0 && value <= 400)) ADD_FAILURE() << value << " of " << text.substr(0, 200);
                EXPECT_TRUE(in.eof()) << text.substr(0, 200);
            }
    }
    return plots;
}

void check_page(const std::string& page) {
    EXPECT_EQ(fault_of_tags(page), "");
    EXPECT_EQ(page.find("http"), page.npos);
    for (const char* outside :
         {"<link", "<img", "<iframe", "<object", "@import", " src=", " href=", " onload=", " onerror="})
        EXPECT_EQ(page.find(outside), page.npos) << outside;
    EXPECT_EQ(page.find("<script"), page.npos);
    EXPECT_EQ(page.find("url("), page.npos);
    check_plots(page);
}

// A recording of `rows` rows in two sessions: fx and fz with noise.
Labelled two_axes(int rows, unsigned seed = 3) {
    Labelled labelled;
    labelled.name = "made.csv";
    labelled.channels = {"C1", "C2", "C3"};
    labelled.sessions = {"monday", "tuesday"};
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 0.02);
    for (int i = 0; i < rows; ++i) {
        const double fx = uniform(random), fz = -5 * std::abs(uniform(random));
        LabelledRow row{.line = i + 2, .channel = {}, .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}, .session = i % 3 == 0};
        row.channel = {fx + normal(random), 0.2 * fz + normal(random), 0.1 * fz - 0.5 * fx + normal(random)};
        labelled.rows.push_back(row);
    }
    return labelled;
}

FitRequest request(const std::string& method = "") {
    return {.model = "generic", .method = method, .serial = "S1", .channel_unit = "V", .date = "2026-03-01"};
}

// A report without a fit: one component, and given held-out rows (applied, estimated).
struct ByHand {
    FitReport report;
    explicit ByHand(const std::vector<Figure::Point>& rows, double sd = 0.1) {
        auto labelled = std::make_shared<Labelled>();
        labelled->name = "by_hand.csv";
        labelled->channels = {"C1"};
        for (const Figure::Point& dot : rows)
            labelled->rows.push_back(
                {.line = 2, .channel = {0}, .wrench_S = {kNaN, kNaN, dot.x, kNaN, kNaN, kNaN}, .session = 0});
        for (std::size_t i = 0; i < rows.size(); ++i)
            report.held_out.push_back({&labelled->rows[i], {kNaN, kNaN, rows[i].y, kNaN, kNaN, kNaN}});
        report.labelled = labelled;
        for (auto& row : report.crosstalk) row.fill(kNaN);
        Calibration& c = report.calibration;
        c.model = "generic";
        c.method = "matrix";
        c.channels = {"C1"};
        c.components = {"fz"};
        if (sd >= 0) c.sd = {sd};
        report.components.push_back({.name = "fz", .rows = int(rows.size()), .full_scale = 10, .held_out_rms = kNaN});
    }
};

TEST(Report, SaysWhatTheFitSays) {
    FitReport report = fit(two_axes(600), request("auto"));
    report.warnings = {"said twice", "said once", "said twice"};
    const std::string page = html_report(report, "Skin 7");
    check_page(page);
    EXPECT_NE(page.find("<h1>Skin 7</h1>"), page.npos);
    for (const auto& text : {"leave one session out (2 sessions)", "2026-03-01", "S1", "made.csv", "monday"})
        EXPECT_NE(page.find(text), page.npos) << text;
    EXPECT_EQ(count(page, "<li>said twice</li>"), 1u);
    EXPECT_EQ(count(page, "<li>said once</li>"), 1u);
    const auto components = table(page, "components");
    ASSERT_EQ(components.size(), 3u);
    for (std::size_t i = 0; i < 2; ++i) {
        const ComponentReport& c = report.components[i];
        const auto& row = components[i + 1];
        EXPECT_EQ(row[0], c.name);
        EXPECT_EQ(number(row[1]), c.rows);
        EXPECT_EQ(number(row[2]), c.full_scale);
        EXPECT_EQ(number(row[3]), c.fitted_rms);
        EXPECT_EQ(number(row[4]), c.held_out_rms);
        EXPECT_EQ(number(row[5]), 100 * (c.held_out_rms / c.full_scale));
        std::vector<double> sd{report.calibration.sd[i]};
        if (report.calibration.sd_slope[i] != 0) sd.push_back(report.calibration.sd_slope[i]);
        if (!report.calibration.sd_load.empty() && report.calibration.sd_load[i] != 0)
            sd.push_back(report.calibration.sd_load[i]);
        EXPECT_EQ(numbers(row[6]), sd);
        const std::size_t axis = component_index(c.name);
        double within = 0;
        for (const auto& [applied, estimated] : report.held_out)
            within += std::abs(estimated[axis] - applied->wrench_S[axis]) <= stated_sd(report.calibration, i, estimated);
        EXPECT_DOUBLE_EQ(number(row[7]), 100 * within / double(report.held_out.size()));
        EXPECT_EQ(number(row[8]), 0);
    }
    const auto methods = table(page, "methods");
    ASSERT_EQ(methods.size(), report.methods.size() + 1);
    ASSERT_GT(report.methods.size(), 2u);
    for (std::size_t m = 0; m < report.methods.size(); ++m) {
        EXPECT_EQ(methods[m + 1][0], report.methods[m].method);
        if (!report.methods[m].refused.empty()) continue;
        for (std::size_t i = 0; i < 2; ++i)
            EXPECT_EQ(number(methods[m + 1][i + 1]),
                      100 * (report.methods[m].held_out_rms[i] / report.components[i].full_scale));
    }
    const auto crosstalk = table(page, "crosstalk");
    ASSERT_EQ(crosstalk.size(), 3u);
    const std::size_t axes[] = {0, 2};
    for (std::size_t i = 0; i < 2; ++i)
        for (std::size_t j = 0; j < 2; ++j)
            EXPECT_EQ(number(crosstalk[i + 1][j + 1]), 100 * report.crosstalk[axes[i]][axes[j]]);
    const auto noise = table(page, "noise");
    ASSERT_EQ(noise.size(), 3u);
    for (std::size_t i = 0; i < 2; ++i) {
        const auto& m = report.calibration.matrix[i];
        EXPECT_NEAR(number(noise[i + 1][1]), std::hypot(m[0], m[1], m[2]), 1e-12);
        EXPECT_NEAR(number(noise[i + 1][2]) * number(noise[i + 1][1]), 0.01 * report.components[i].full_scale, 1e-12);
        EXPECT_NE(noise[i + 1][2].find(" V"), std::string::npos);
    }
    EXPECT_EQ(number(page.substr(page.find("id=\"condition\""), 120)), report.calibration.condition);
    const auto channels = table(page, "channels");
    ASSERT_EQ(channels.size(), 4u);
    for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_EQ(number(channels[k + 1][1]), report.calibration.zero[k]);
        EXPECT_EQ(number(channels[k + 1][2]), report.calibration.channel_least[k]);
        EXPECT_EQ(number(channels[k + 1][3]), report.calibration.channel_most[k]);
    }
    EXPECT_EQ(check_plots(page), 5 * 2 + 1);  // five per component, and one pair of loads
    EXPECT_EQ(page, html_report(report, "Skin 7"));
}

TEST(Report, SessionsHaveTheirOwnErrors) {
    const FitReport report = fit(two_axes(600), request());
    const auto rows = table(html_report(report, "x"), "sessions");
    ASSERT_EQ(rows.size(), 5u);
    EXPECT_EQ(rows[1][0], "monday");
    EXPECT_EQ(number(rows[1][2]) + number(rows[3][2]), 600);
    const double squares =
        number(rows[1][2]) * std::pow(number(rows[1][4]), 2) + number(rows[3][2]) * std::pow(number(rows[3][4]), 2);
    EXPECT_NEAR(std::sqrt(squares / 600), report.components[0].held_out_rms, 1e-12);
}

TEST(Report, EscapesWhatComesFromFiles) {
    FitReport report = fit(two_axes(200), request());
    const std::string evil = "<script>alert('1')</script>\"&\xff\x01";
    const std::string harmless = "&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;&quot;&amp;\xEF\xBF\xBD\xEF\xBF\xBD";
    Labelled labelled = *report.labelled;  // held_out still refers to the first
    const auto kept = report.labelled;
    labelled.name = labelled.sessions[1] = evil;
    report.labelled = std::make_shared<const Labelled>(labelled);
    Calibration& c = report.calibration;
    c.serial = c.date = c.contact_model = c.channel_unit = c.model = c.method = c.validation = c.channels[1] = evil;
    c.parameters[evil] = 1;
    report.warnings.push_back(evil);
    report.methods[0].method = evil;
    report.methods.push_back({.method = evil, .held_out_rms = {}, .refused = evil});
    report.components[0].name = evil;
    const std::string page = html_report(report, evil);
    check_page(page);
    EXPECT_EQ(page.find("alert('"), page.npos);
    EXPECT_GE(count(page, harmless), 16u);
    EXPECT_EQ(html_text("\xE2\x82\xAC \xC3\xA4\xF0\x9F\x98\x80"), "\xE2\x82\xAC \xC3\xA4\xF0\x9F\x98\x80");
    EXPECT_EQ(html_text("a\xE2\x82"), "a\xEF\xBF\xBD\xEF\xBF\xBD");
    EXPECT_EQ(html_text("\xC0\xBC"), "\xEF\xBF\xBD\xEF\xBF\xBD");  // an overlong <
}

TEST(Report, StandsDegenerateReports) {
    check_page(html_report(FitReport{}, ""));
    const double huge = 1.7e308, tiny = 5e-324;
    const std::vector<std::vector<Figure::Point>> cases{{},
                                                        {{1, 2}},
                                                        {{0, 0}, {0, 0}},
                                                        {{-1, 3}, {-2, 3}, {-3, 3}},  // a constant estimate
                                                        {{2, kNaN}, {3, kNaN}},       // always BAD
                                                        {{kNaN, 1}},
                                                        {{huge, -huge}, {-huge, huge}},
                                                        {{tiny, 0}, {0, tiny}},
                                                        {{1e9, 1e9}, {1e9, 1e9 + 1e-6}},
                                                        {{1, HUGE_VAL}, {1, -HUGE_VAL}}};
    for (const auto& rows : cases)
        for (const double sd : {-1.0, 0.0, 0.1, huge}) {
            ByHand made(rows, sd);
            check_page(html_report(made.report, "x"));
            made.report.components[0].full_scale = 0;
            made.report.components[0].held_out_rms = 0;
            made.report.calibration.matrix = {{0}};
            check_page(html_report(made.report, "x"));
        }
}

TEST(Report, DrawsNothingOfWhatWasNotHeldOut) {
    const ByHand made({});
    const std::string page = html_report(made.report, "x");
    EXPECT_NE(page.find("No held-out rows"), page.npos);
    EXPECT_NE(page.find("not validated"), page.npos);
    EXPECT_EQ(check_plots(page), 0);
    EXPECT_EQ(table(page, "components")[1][7], "unknown");
}

TEST(Report, CountsRowsWithoutAnEstimate) {
    const std::string page = html_report(ByHand({{1, 1.05}, {2, kNaN}, {3, 3.2}, {4, 4.01}, {kNaN, 1}}).report, "x");
    const auto row = table(page, "components")[1];
    EXPECT_EQ(number(row[8]), 1);
    EXPECT_NEAR(number(row[7]), 100 * 2 / 3.0, 1e-9);
}

// 20000 rows; each plot draws 2000, from all over the recording, and states it.
TEST(Report, ThinsManyRowsEvenly) {
    std::vector<Figure::Point> rows;
    for (int i = 0; i < 20000; ++i) rows.push_back({i / 20000.0, i / 20000.0});
    const std::string page = html_report(ByHand(rows).report, "x");
    check_page(page);
    EXPECT_EQ(count(page, "h0"), 4 * 2000u);
    EXPECT_EQ(count(page, "2000 of 20000 rows are drawn"), 4u);
    EXPECT_LT(page.size(), 300000u);
    const std::size_t at = page.find("stroke-linecap");
    const std::string dots = page.substr(at, page.find("/>", at) - at);
    static const std::regex dot("M([0-9.]+) ");
    double last = 0, widest = 0, first = 0;
    for (std::sregex_iterator d(dots.begin(), dots.end(), dot), end; d != end; ++d) {
        const double x = std::strtod((*d)[1].str().c_str(), nullptr);
        if (last == 0)
            first = x;
        else
            widest = std::max(widest, x - last);
        last = x;
    }
    EXPECT_GT(last - first, 250);  // width 280 px
    EXPECT_LT(widest, 0.35);       // px
}

TEST(Axis, IsTheSpanOfTheDataPlusFourPercent) {
    const Span axis = as_axis({-1, 4});
    EXPECT_DOUBLE_EQ(axis.min, -1.2);
    EXPECT_DOUBLE_EQ(axis.max, 4.2);
    const Span narrow = as_axis({1e9, 1e9 + 1e-6});  // no distinguishable ticks
    EXPECT_GT(narrow.max - narrow.min, 1);
}

}  // namespace
}  // namespace tactiled
