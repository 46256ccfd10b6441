#include <fmt/format.h>
#include <fmt/ranges.h>
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

// Returns the columns and the cells of the first row, with '|' between them, and what is unusual about the file.
std::string first_row(const std::string& text) {
    const ScratchFile file(text);
    CsvReader csv(file.path());
    std::string result = fmt::format("{}", fmt::join(csv.columns(), "|"));
    if (!csv.next()) return result;
    for (std::size_t k = 0; k < csv.columns().size(); ++k)
        result += fmt::format("{}{}", k == 0 ? " = " : "|", csv.number(k));
    return result + (csv.about().empty() ? "" : " " + csv.about());
}

TEST(Csv, ReadsOtherSeparatorsDecimalsAndHeaders) {
    EXPECT_EQ(first_row("t_s;R1\n0;1,5\n"), "t_s|R1 = 0|1.5 separated by ';', decimals with ','");
    EXPECT_EQ(first_row("t_s\tR1\n0\t1\n"), "t_s|R1 = 0|1 separated by tabs");
    EXPECT_EQ(first_row("  t_s   R1\n  0   1.25\n"), "t_s|R1 = 0|1.25 separated by blanks");
    EXPECT_EQ(first_row("# t_s, R1\n0,1\n"), "t_s|R1 = 0|1 header behind '#'");
    EXPECT_EQ(first_row("# made by hand, twice\n\nRate;20\nt_s,R1\n0,1\n"), "t_s|R1 = 0|1");
    EXPECT_EQ(first_row("sep=;\nt_s;R1\n0;1\n"), "t_s|R1 = 0|1 separated by ';'");
    EXPECT_EQ(first_row("t_s,R1,Fz\ns,counts,mN\n0,1,2\n"), "t_s|R1 [counts]|Fz [mN] = 0|1|2");
    EXPECT_EQ(first_row("t_s,R1\r0,1\r"), "t_s|R1 = 0|1");
    EXPECT_EQ(first_row(",t_s,R1\n7,0,1\n"), "column 1|t_s|R1 = 7|0|1");
    EXPECT_EQ(first_row("Zeit [s];B 1 [\xB5T]\n0;1\n"), "Zeit [s]|B 1 [\u00b5T] = 0|1 Latin-1, separated by ';'");
    EXPECT_EQ(first_row(std::string("\xFF\xFEt\0,\0R\0\n\0"
                                    "0\0,\0"
                                    "5\0\n\0",
                                    18)),
              "t|R = 0|5 UTF-16");
    EXPECT_EQ(first_row("t_s,R1\n0,N/A\n"), "t_s|R1 = 0|nan");
    EXPECT_EQ(complaint("t_s,R1\n0,1\nt_s,R1\n# later\n1,2\n"), "");  // two files joined
    EXPECT_NE(complaint("t_s;R1\n0;1,5\n0;1.5\n").find("the decimals before have ','"), std::string::npos);
    EXPECT_NE(complaint("t_s;R1\n0;1.234,5\n").find("is no number"), std::string::npos);
}

// Keys and values of an instrument above the header are no header and no row.
TEST(Csv, TakesTheLastLineOfNamesAboveTheRows) {
    const std::string table = "t_s,R1,R2\n0,1,2\n1,3,4\n";
    for (const char* above : {"Rate,1000\n", "Instrument,Nano17\nRate,1000\n", "Rate,1000\nGain,5\nInstrument,Nano17\n",
                              "Instrument,Nano17\nRate,1000\nGain,5\n", "time,skin,skin\n", "a,b,c\n", ",skin,\n"})
        EXPECT_EQ(first_row(above + table), "t_s|R1|R2 = 0|1|2") << above;
    const ScratchFile session("session,R1\na,1\na,2\n");
    EXPECT_EQ(CsvReader(session.path()).columns(), (std::vector<std::string>{"session", "R1"}));
    EXPECT_EQ(complaint("R1,R2\nNA,NA\n0,1\n"), "");
    EXPECT_EQ(first_row("Rate,1000\nGain,5\nt_s,R1\n0,1\n"), "t_s|R1 = 0|1");
}

TEST(Csv, RefusesTwoUnitsOfOneColumn) {
    EXPECT_NE(complaint("t_s,R1,fz_N\ns,counts,mN\n0,1,2\n").find(":2: column fz_N is in N by its name and in mN"),
              std::string::npos);
    EXPECT_EQ(first_row("t_s,R1,fz_N\ns,counts,newton\n0,1,2\n"), "t_s|R1 [counts]|fz_N = 0|1|2");
    EXPECT_EQ(first_row("t_s,ch_A,ch_C\ns,mV,mV\n0,1,2\n"), "t_s|ch_A [mV]|ch_C [mV] = 0|1|2");
}

// Channels have no blanks in a calibration, and are found in the file nevertheless.
TEST(Csv, FindsAChannelByItsNameInACalibration) {
    const ScratchFile file("t_s,Kanal 1 [V],R3\n0,1,2\n");
    const CsvReader csv(file.path());
    EXPECT_EQ(csv.find("Kanal_1_[V]"), 1u);
    EXPECT_EQ(csv.find("Kanal 1 [V]"), 1u);
    EXPECT_FALSE(csv.find("Kanal").has_value());
}

TEST(Csv, NamesOtherFormatsAndTheirConversion) {
    for (const auto& [bytes, word] : {std::pair{std::string("PK\x03\x04[Content_Types].xml"), "libreoffice"},
                                      {std::string("\x89HDF\r\n\x1a\n"), "HDF5"},
                                      {std::string("PAR1\x15\x04"), "read_parquet"},
                                      {std::string("{\"t\":0,\"R1\":1}\n"), "lines=True"},
                                      {std::string("MATLAB 5.0 MAT-file"), "loadmat"},
                                      {std::string("#ROSBAG V2.0\n"), "rostopic echo"}}) {
        const std::string text = complaint(bytes);
        EXPECT_NE(text.find("convert it: "), std::string::npos) << bytes << text;
        EXPECT_NE(text.find(word), std::string::npos) << text;
    }
    for (const char* header : {"PAR1,PAR2", "PK1,PK2", "FEA1,FEA2", "ARROW1,ARROW2", "BZh1,BZh2", "MATLAB_1,MATLAB_2"})
        EXPECT_EQ(complaint(std::string(header) + "\n0.5,1.5\n"), "") << header;
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
    EXPECT_NE(complaint("0,1\n1,2\n").find("the first line names the columns"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1,R1\n").find("\"R1\" is there twice"), std::string::npos);
    EXPECT_NE(complaint("").find("is empty"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,\"1,5\"\n").find("decimals are written with '.'"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,1.5 mV\n").find("the unit is in the column's name"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,V\n0,1\n").find("is this a row of units?"), std::string::npos);
    for (const char* other : {"t_s,R1\n0,1\n0,V\n", "t_s,R1\n0,N/A\n", "t_s,R1\n0,1 V\n"})
        EXPECT_EQ(complaint(other).find("row of units"), std::string::npos) << other;
    EXPECT_NE(complaint("t_s,R1\n0,5,1,5\n").find("decimals are written with '.'"), std::string::npos);
    EXPECT_NE(complaint("t_s,R1\n0,1,\n").find("a ',' at the end?"), std::string::npos);
}

TEST(Csv, SurvivesHostileBytes) {
    EXPECT_NE(complaint(std::string("t_s,R1\n0,1\0002\n", 14)).find(":2: has a byte 0"), std::string::npos);
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

TEST(Labelled, TakesChannelsOfOneStem) {
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

// Rows with noise, so that no column is a copy: B1 B2 and fz_N, and one column more.
std::string with(const std::string& name, const std::string& cell = "") {
    std::string text = "t_s,B1,B2,fz_N," + name + "\n";
    for (int i = 0; i < 40; ++i)
        text += fmt::format("{},{},{},{},{}\n", 0.01 * i, i % 7 + 0.1 * (i % 3), i % 5, -(i % 4) - 0.01 * (i % 9),
                            cell.empty() ? fmt::format("{}", (i * i) % 11) : cell);
    return text;
}

// Returns the channels that are found with one column more, or the complaint.
std::string channels_beside(const std::string& name, const std::string& cell = "") {
    const ScratchFile file(with(name, cell));
    try {
        return fmt::format("{}", fmt::join(read_labelled(file.path(), {}).channels, " "));
    } catch (const SetupError& error) { return error.what(); }
}

// A label, a time or a command that was used as a channel would predict itself.
TEST(Labelled, TakesNoColumnThatIsNoChannel) {
    for (const char* name : {"t_ms", "timestamp", "index", "sample", "robot_x", "y", "pose.z", "depth_mm", "joint1", "temp",
                             "qx", "Chip [degC]", "stamp", "mx_Nmm", "Fx [g]", "session"})
        EXPECT_EQ(channels_beside(name), "B1 B2") << name;
    for (const char* name : {"trial", "contact", "step", "loadcell_raw", "Weight_g", "fz_cmd_N", "sd_fz_N", "loss", "A"}) {
        const std::string text = channels_beside(name);
        EXPECT_NE(text.find(name), std::string::npos) << text;
        EXPECT_NE(text.find("--channels B1,B2"), std::string::npos) << text;
    }
    for (const char* name : {"q1", "taxel_3", "adc7"})  // another family
        EXPECT_NE(channels_beside(name).find("choose with --channels"), std::string::npos) << name;
    for (const char* name : {"fx", "Fx", "force_x", "mx"})
        EXPECT_NE(channels_beside(name).find(std::string("no unit: ") + name), std::string::npos) << name;
    EXPECT_EQ(channels_beside("B9"), "B1 B2 B9");
    for (const char* name : {"Bx1", "B_7", "B5_cmd", "Bz"})
        EXPECT_NE(channels_beside(name).find("written otherwise than the channels"), std::string::npos) << name;
    EXPECT_NE(channels_beside("operator", "M, A").find("6 cells, the header has 5"), std::string::npos);
    EXPECT_EQ(channels_beside("operator", "\"M, A\""), "B1 B2");
    EXPECT_EQ(channels_beside("gain", "64"), "B1 B2");
}

TEST(Labelled, ColumnsWithTheNamesOfChannelsAndOtherNumbersAreAskedFor) {
    const auto t_of = [](int i) { return 0.01 * i + 0.003 * (i % 4 == 1); };  // no row number
    const auto beside = [&](auto value) {
        std::string text = "t_s,B1,B2,B3,fz_N\n";
        for (int i = 0; i < 60; ++i) {
            const double fz = -(i / 6) - 0.5 * (i / 12);
            text += fmt::format("{},{},{},{},{}\n", t_of(i), fz + 0.01 * (i % 7), 0.02 * (i % 5), value(i, fz), fz);
        }
        const ScratchFile file(text);
        try {
            return fmt::format("{}", fmt::join(read_labelled(file.path(), {}).channels, " "));
        } catch (const SetupError& error) { return std::string(error.what()); }
    };
    EXPECT_EQ(beside([](int i, double fz) { return fz + 0.03 * (i % 4); }), "B1 B2 B3");
    EXPECT_NE(beside([](int, double fz) { return 3 - 1000 * fz; }).find("B3 (a copy of fz_N)"), std::string::npos);
    EXPECT_NE(beside([&](int i, double) { return 7 + 50 * t_of(i); }).find("B3 (a copy of the time)"), std::string::npos);
    EXPECT_NE(beside([](int, double fz) { return fz * fz; }).find("the same in all rows of a load"), std::string::npos);
    EXPECT_EQ(beside([](int i, double) { return 7.0 + i; }), "B1 B2");  // a row number
}

TEST(Labelled, ConvertsUnitsAndTimes) {
    const ScratchFile file(
        "timestamp,B1,\"Fz [g]\",torque_x_Nmm,T_C\n1717000000000000000,1,100,5,20\n1717000000050000000,2,-200,7,21\n");
    const Labelled labelled = read_labelled(file.path(), {});
    EXPECT_DOUBLE_EQ(labelled.rows[0].wrench_S[2], 0.980665);
    EXPECT_DOUBLE_EQ(labelled.rows[1].wrench_S[3], 0.007);
    EXPECT_EQ(labelled.rows[1].t_ns - labelled.rows[0].t_ns, 50'000'000u);
    EXPECT_EQ(labelled.rows[1].temperature_C, 21);
    for (const char* text : {"in ns since 1970, by its size", "fz in g: times 0.00980665", "mx in Nmm: times 0.001"})
        EXPECT_NE(labelled.columns.find(text), std::string::npos) << labelled.columns;
    const auto interval = [](const std::string& name, const std::string& first, const std::string& second) {
        const ScratchFile times(name + ",B1,fz_N\n" + first + ",1,2\n" + second + ",2,3\n");
        const auto rows = read_labelled(times.path(), {}).rows;
        return rows[1].t_ns - rows[0].t_ns;
    };
    EXPECT_EQ(interval("t_ms", "10", "60"), 50'000'000u);
    EXPECT_EQ(interval("t_s", "1717000000000", "1717000000050"), 50'000'000u);
    EXPECT_EQ(interval("time", "2026-03-01T10:00:00.95Z", "2026-03-01T11:00:01+01:00"), 50'000'000u);
    EXPECT_EQ(interval("stamp.sec,stamp.nanosec", "1717000000,950000000", "1717000001,0"), 50'000'000u);
    EXPECT_EQ(interval("Zeit [s]", "10.95", "11"), 50'000'000u);
    EXPECT_NE(labelled_complaint("time,B1,fz_N\n10,1,2\n20,2,3\n").find("seconds are in doubt"), std::string::npos);
}

// A user corrects the file once.
TEST(Labelled, NamesAllFaultsInOneMessage) {
    const std::string text =
        labelled_complaint("time,B1,B2,fz,trial,session\n10,1,x7,2,1,a\n20,2,y,3,1,\n25,2,y,3,1,a\n30,2,3,3,2,a\n40,1,2\n");
    for (const char* fault :
         {":1: no unit: fz", "column B2: \"x7\" is no number; a missing one is an empty cell; also in 1 rows",
          "Name the channels: --channels B1,B2", ":3: column session is empty", ":6: 3 cells", "no unit: time",
          "columns of"})
        EXPECT_NE(text.find(fault), std::string::npos) << fault << " in " << text;
}

TEST(Labelled, NamesThatNoCalibrationHoldsAreFoundBeforeTheFit) {
    const std::string text = labelled_complaint(
        "t_s,a_very_long_name_of_a_pressure_sensor_1,a_very_long_name_of_a_pressure_sensor_2,fz_N\n0,1,2,3\n");
    EXPECT_NE(text.find("1 .. 31 bytes"), std::string::npos) << text;
}

TEST(Labelled, RefusesOtherMistakes) {
    EXPECT_EQ(labelled_complaint("t_s,index,fz_N\n0,1,2\n", {.sessions = {}, .channels = {"index"}}), "");
    std::string each = "t_s,B1,fz_N,session\n";
    for (int i = 0; i < 21; ++i) each += fmt::format("{0},{1},{0},{0}\n", i, i % 5);
    EXPECT_NE(labelled_complaint(each).find("21 sessions in 21 rows"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1\n0,1\n").find("no label"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,fz_N\n0,1\n").find("no channel"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N\n").find("has no rows"), std::string::npos);
    EXPECT_NE(labelled_complaint("t_s,B1,fz_N,session\n0,1,2,\n").find("column session is empty"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
