#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>
#include <sstream>

#include "decoupling/csv.hpp"
#include "decoupling/fit/labelled.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

// Returns the error of a reader of `text`; "" if it reads all of it.
std::string complaint(const std::string& text) {
    const ScratchFile file(text);
    try {
        CsvReader csv(file.path());
        while (csv.next())
            for (std::size_t k = 0; k < csv.columns().size(); ++k) (void)csv.number(k);
    } catch (const SetupError& error) {
        const std::string what = error.what();
        EXPECT_EQ(what.rfind(file.path() + ":", 0), 0u) << what;  // names the file first
        return what.substr(file.path().size());
    }
    return "";
}

std::string labelled_complaint(const std::string& text, const Selection& selection = {}) {
    const ScratchFile file(text);
    try {
        (void)read_labelled(file.path(), selection);
    } catch (const SetupError& error) { return std::string(error.what()).substr(file.path().size()); }
    return "";
}

std::string text_of(const std::string& path) {
    std::stringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
}

TEST(Csv, ReadsColumnsByNameAndEmptyCellsAsMissing) {
    const ScratchFile file("t_s,R1,R3\n0,1.5e-3,\n0.01,,-2\n");
    CsvReader csv(file.path());
    EXPECT_EQ(csv.columns(), (std::vector<std::string>{"t_s", "R1", "R3"}));
    ASSERT_TRUE(csv.next());
    EXPECT_EQ(csv.number(*csv.find("R1")), 1.5e-3);
    EXPECT_TRUE(std::isnan(csv.number(*csv.find("R3"))));
    ASSERT_TRUE(csv.next());
    EXPECT_EQ(csv.number(2), -2.0);
    EXPECT_EQ(csv.line(), 3);
    EXPECT_FALSE(csv.next());
    EXPECT_FALSE(csv.find("R5").has_value());
}

TEST(Csv, TakesFilesFromSpreadsheetsAndOtherSystems) {
    EXPECT_EQ(complaint("\xEF\xBB\xBFt_s,R1\r\n0,1\r\n\r\n1,2\r\n"), "");
    EXPECT_EQ(complaint("t_s,R1\n0,1\n1,2"), "");              // no line break at the end
    EXPECT_EQ(complaint("\"t_s\", \"R1\"\n 0 ,\t+1\n"), "");   // quotes, blanks, a plus
    EXPECT_EQ(complaint("t_s,R1\n0,nan\n1,NaN\n\n  \n"), "");  // numpy's form of a missing value
    const ScratchFile bom("\xEF\xBB\xBFt_s,\"a \"\"b\"\", c\"\r\n0,1\r\n");
    EXPECT_EQ(CsvReader(bom.path()).columns(), (std::vector<std::string>{"t_s", "a \"b\", c"}));
}

TEST(Csv, NamesLineAndColumnOfWhatIsWrong) {
    EXPECT_NE(complaint("t_s,R1\n0,1\n1,x2\n").find(":3: column R1: \"x2\" is no number"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,1,2\n").find(":2: 3 cells, the header has 2 columns"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0\n").find(":2: 1 cells"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,1e999\n").find("is no number"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,inf\n").find("is no number"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,0x10\n").find("is no number"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,+-3\n").find("is no number"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,1 2\n").find("is no number"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,\"1\n").find(":2: column 2: the quote is not closed"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,\"1\"2\n").find("text after the closing quote"), std::string::npos);
    EXPECT_NE(complaint("t_s;R1\n0;1,5\n").find("separated by ';'"), std::string::npos);
    EXPECT_NE(complaint("0,1\n1,2\n").find("the first line names the columns"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1,R1\n").find("\"R1\" is there twice"), std::string::npos);
    EXPECT_NE(complaint("t_s,,R1\n").find("column 2 has no name"), std::string::npos);
    EXPECT_NE(complaint(",t_s,R1\n0,0,1\n").find("is it a row number? Delete it"), std::string::npos);
    EXPECT_NE(labelled_complaint("Unnamed: 0,t_s,R1,fz_N\n0,0,1,2\n").find("a row number is no reading"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,R1,reference_N,fz_N\n0,0,1,2\n").find("would predict itself"), std::string::npos);
    EXPECT_NE(complaint("").find("is empty"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,\"1,5\"\n").find("decimals are written with '.'"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,1.5 mV\n").find("the unit is in the column's name"), std::string::npos);
    EXPECT_NE(
        complaint("t_s,R1\n0,1\nt_s,R1\n").find(":3: column t_s: \"t_s\" is no number; the header is there a second time"),
        std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,R1,fz_N\n2026-03-01T10:00,1,2\n").find("times are seconds"), std::string::npos);
    EXPECT_NE(complaint("t_s\tR1\n0\t1\n").find("separated by tabs"), std::string::npos);
    EXPECT_NE(complaint("t_s R1\n0 1\n").find("separated by blanks"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,V\n0,1\n").find("is this a row of units?"), std::string::npos);
    for (const char* other : {"t_s,R1\n0,1\n0,V\n", "t_s,R1\n0,N/A\n", "t_s,R1\n0,1 V\n"})
        EXPECT_EQ(complaint(other).find("row of units"), std::string::npos) << other;
    EXPECT_NE(complaint("t_s,R1\n0,5,1,5\n").find("decimals are written with '.'"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,1,\n").find("a ',' at the end?"), std::string::npos);
    EXPECT_NE(complaint("# made by hand\nt_s,R1\n0,1\n").find(":1: is no header"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\r0,1\r").find("a carriage return alone"), std::string::npos);
    EXPECT_NE(complaint(std::string("\xFF\xFEt\0,\0\n\0", 8)).find("UTF-8"), std::string::npos);
}

TEST(Csv, SurvivesHostileBytes) {
    EXPECT_NE(complaint(std::string("t_s,R1\n0,1\0002\n", 14)).find("\"1?2\" is no number"), std::string::npos);
    // no escape sequence may reach a terminal
    EXPECT_NE(complaint("t_s,R1\n0,\x1b[2J\n").find("?[2J"), std::string::npos);
    EXPECT_NE(complaint(std::string(3'000'000, 'a')).find("longer than"), std::string::npos);
    EXPECT_NE(complaint("t_s" + std::string(500'000, ',')).find("columns; at most"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0," + std::string(100'000, '9') + "\n").find("is no number"), std::string::npos);
    EXPECT_THROW(CsvReader("/nonexistent/x.csv"), SetupError);
    EXPECT_THROW(CsvReader("/"), SetupError);  // a folder
}

TEST(Csv, AnyBytesAreReadOrRefused) {
    std::mt19937 random(11);
    const std::string alphabet = "t_s,R1\n\r\"0123456789.e-+ ;\t\0\xff";
    for (int i = 0; i < 1000; ++i) {
        std::string text = i % 2 == 0 ? "t_s,R1\n" : "";
        for (auto n = random() % 60; n > 0; --n) text += alphabet[random() % alphabet.size()];
        (void)complaint(text);  // returns: no crash, no other exception
    }
}

TEST(Csv, WritesForcesThatReadBackToTheLastBit) {
    const ScratchFile file("");
    Estimate estimate;
    estimate.wrench_S = {0.1 + 0.2, kNaN, -1.0 / 3, kNaN, kNaN, kNaN};
    estimate.sd = {1e-300, kNaN, 5, 0.25, kNaN, 0.5};
    estimate.residual = 1.5;
    estimate.cop_S_m = {0.004, kNaN};
    estimate.cop_sd_m = {0.001, kNaN};
    {
        ForcesWriter forces(file.path());
        forces.write(0.01, estimate, "uncertain:saturated,disagreement");
        forces.write(0.02, Estimate{}, "bad:missing-channel");
        forces.close();
    }
    EXPECT_EQ(text_of(file.path()),
              "t_s,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,sd_fx_N,sd_fy_N,sd_fz_N,quality,cop_x_m,cop_y_m,direction,residual,"
              "sd_mx_Nm,sd_my_Nm,sd_mz_Nm,sd_cop_x_m,sd_cop_y_m\n"
              "0.01,0.30000000000000004,,-0.3333333333333333,,,,1e-300,,5,\"uncertain:saturated,disagreement\",0.004,,,1.5,"
              "0.25,,0.5,0.001,\n"
              "0.02,,,,,,,,,,bad:missing-channel,,,,,,,,,\n");
    CsvReader csv(file.path());
    ASSERT_TRUE(csv.next());
    EXPECT_EQ(csv.number(1), 0.1 + 0.2);
    EXPECT_EQ(csv.text(*csv.find("quality")), "uncertain:saturated,disagreement");
}

TEST(Csv, SaysWhenTheForcesCannotBeWritten) {
    EXPECT_THROW(ForcesWriter("/nonexistent/forces.csv"), SetupError);
    ForcesWriter full("/dev/full");
    EXPECT_THROW(
        {
            for (int i = 0; i < 100000; ++i) full.write(i, Estimate{}, "bad");
            full.close();
        },
        std::runtime_error);
}

TEST(Labelled, TakesEveryOtherColumnForAChannel) {
    const ScratchFile file("t_s,B1,fz_N,B2,session\n0,1,-3,2,a\n1,4,,5,b\n2,,-1,8,a\n");
    const Labelled labelled = read_labelled(file.path(), {});
    EXPECT_EQ(labelled.channels, (std::vector<std::string>{"B1", "B2"}));
    EXPECT_EQ(labelled.sessions, (std::vector<std::string>{"a", "b"}));
    ASSERT_EQ(labelled.rows.size(), 3u);
    EXPECT_EQ(labelled.rows[0].wrench_S[2], -3.0);
    EXPECT_TRUE(std::isnan(labelled.rows[0].wrench_S[0]));
    EXPECT_TRUE(std::isnan(labelled.rows[1].wrench_S[2]));
    EXPECT_TRUE(std::isnan(labelled.rows[2].channel[0]));
    EXPECT_EQ(labelled.rows[2].line, 4);
}

TEST(Labelled, ChoosesSessionsAndChannels) {
    const ScratchFile file("t_s,B1,fz_N,B2,note,session\n0,1,-3,2,x,a\n1,4,,5,y,b\n");
    const Labelled labelled = read_labelled(file.path(), {.sessions = {"b"}, .channels = {"B2", "B1"}});
    ASSERT_EQ(labelled.rows.size(), 1u);
    EXPECT_EQ(labelled.rows[0].channel, (std::vector<double>{5, 4}));
    EXPECT_NE(
        labelled_complaint("t_s,B1,fz_N,session\n0,1,2,a\n", {.sessions = {"c"}, .channels = {}}).find("its sessions are a"),
        std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N\n0,1,2\n", {.sessions = {"c"}, .channels = {}}).find("no column \"session\""),
              std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N\n0,1,2\n", {.sessions = {}, .channels = {"B7"}}).find("no channel \"B7\""),
              std::string::npos);
}

TEST(Labelled, RefusesToTakeALabelForAChannelEvenWhenAsked) {
    for (const std::string name : {"fz_N", "t_s", "session"})
        EXPECT_NE(labelled_complaint("t_s,B1,fz_N,session\n0,1,2,a\n", {.sessions = {}, .channels = {"B1", name}})
                      .find("\"" + name + "\" is no channel"),
                  std::string::npos)
            << name;
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N\n0,1,2\n", {.sessions = {}, .channels = {"B1", "B1"}}).find("chosen twice"),
              std::string::npos);
}

// A label that was used as a channel would predict itself.
TEST(Labelled, RefusesAMisspeltLabel) {
    for (const std::string name : {"fz", "Fz", "Fz_mN", "FZ_N", "mx_Nmm", "fx (N)", "fy_n"})
        EXPECT_NE(labelled_complaint("t_s,B1,fz_N," + name + "\n0,1,2,3\n").find("a label is called"), std::string::npos)
            << name;
    EXPECT_EQ(labelled_complaint("t_s,fxa,mz1,fz_N\n0,1,2,3\n"), "");
    for (const std::string name : {"t_ms", "Time", "timestamp", "index", "force_z", "Weight_g", "robot_x", "y", "pose.z",
                                   "cmd depth", "temp", "step", "stamp", "trial"})
        EXPECT_NE(labelled_complaint("t_s,B1,fz_N," + name + "\n0,1,2,3\n").find("\"" + name + "\" would be a channel, but"),
                  std::string::npos)
            << name;
    EXPECT_EQ(labelled_complaint("t_s,x1,Bx,position1,fz_N\n0,1,2,3,4\n"), "");
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N\n1795000000000,1,2\n").find("is it in ms, us or ns?"), std::string::npos);
    EXPECT_EQ(labelled_complaint("t_s,index,fz_N\n0,1,2\n", {.sessions = {}, .channels = {"index"}}), "");
    std::string each = "t_s,B1,fz_N,session\n";
    for (int i = 0; i < 21; ++i) each += fmt::format("{0},{0},{0},{0}\n", i);
    EXPECT_NE(labelled_complaint(each).find("21 sessions in 21 rows"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1\n0,1\n").find("no label"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,fz_N\n0,1\n").find("no channel"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N\n").find("has no rows"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N,session\n0,1,2,\n").find("column session is empty"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
