// DBC files: the parts that are read or skipped, and the errors of invalid ones.
#include "drivers/wire/dbc.hpp"

#include <gtest/gtest.h>

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;

constexpr const char* kGripper = R"(VERSION "1.0"

NS_ :
	CM_
	BA_DEF_
	SIG_VALTYPE_
	SG_MUL_VAL_

BS_:
BU_: PLC GRIPPER

BO_ 291 Fingertip: 8 GRIPPER
 SG_ Fx : 7|16@0- (0.01,0) [-320|320] "N" PLC
 SG_ Fy : 16|16@1+ (1E-2,-5.5) [0|0] "N" PLC
 SG_ Count : 56|8@1+ (1,0) [0|255] "" PLC

BO_ 2147484200 Taxels: 64 GRIPPER
 SG_ Which M : 0|4@1+ (1,0) [0|0] "" PLC
 SG_ T0 m0 : 32|32@1- (1,0) [0|0] "" PLC
 SG_ T1 m1 : 32|32@1- (1,0) [0|0] "" PLC

BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ Lost : 0|8@1+ (1,0) [0|0] "" Vector__XXX

CM_ SG_ 291 Fx "Over several lines:
 SG_ NotASignal : 900|99@7+ \"quoted\"
BO_ 1 NotAMessage: 99";
BA_ "GenMsgCycleTime" BO_ 291 10;
VAL_ 291 Count 0 "zero" 1 "one" ;
SIG_VALTYPE_ 552 T1 : 1;
SIG_VALTYPE_ 2147484200 T1 : 1;
)";

Lines problems_of(const std::string& text) {
    Problems problems;
    (void)parse_dbc(text, "g.dbc", problems);
    return problems.lines();
}

TEST(Dbc, ReadsMessagesSignalsMultiplexersAndFloats) {
    std::string text = kGripper;
    text.erase(text.find("SIG_VALTYPE_ 552 T1 : 1;\n"), 25);
    Problems problems;
    const Dbc dbc = parse_dbc(text, "g.dbc", problems);
    EXPECT_EQ(problems.lines(), Lines{});
    ASSERT_EQ(dbc.messages.size(), 2u);
    const DbcMessage& tip = dbc.messages[0];
    EXPECT_EQ(tip.name, "Fingertip");
    EXPECT_EQ(tip.id, 0x123u);
    EXPECT_FALSE(tip.extended);
    EXPECT_EQ(tip.bytes, 8u);
    EXPECT_EQ(tip.line, 12u);
    EXPECT_EQ(tip.selector(), nullptr);
    ASSERT_EQ(tip.signals.size(), 3u);
    const CanSignal& fx = tip.find("Fx")->signal;
    EXPECT_EQ(fx.start, 7u);
    EXPECT_EQ(fx.length, 16u);
    EXPECT_EQ(fx.order, CanSignal::Order::motorola);
    EXPECT_EQ(fx.type, CanSignal::Type::is_signed);
    EXPECT_EQ(fx.factor, 0.01);
    EXPECT_EQ(tip.find("Fy")->signal.order, CanSignal::Order::intel);
    EXPECT_EQ(tip.find("Fy")->signal.type, CanSignal::Type::is_unsigned);
    EXPECT_EQ(tip.find("Fy")->signal.factor, 0.01);
    EXPECT_EQ(tip.find("Fy")->signal.offset, -5.5);
    EXPECT_EQ(tip.find("Fy")->line, 14u);
    const DbcMessage& taxels = *dbc.find("Taxels");
    EXPECT_TRUE(taxels.extended);
    EXPECT_EQ(taxels.id, 552u);
    EXPECT_EQ(taxels.selector()->name, "Which");
    EXPECT_EQ(taxels.find("T1")->mux, 1u);
    EXPECT_EQ(taxels.find("T0")->signal.type, CanSignal::Type::is_signed);
    EXPECT_EQ(taxels.find("T1")->signal.type, CanSignal::Type::is_float);
}

TEST(Dbc, TellsFileAndLineOfWhatIsWrong) {
    EXPECT_EQ(problems_of(kGripper), (Lines{"g.dbc:30: there is no message with id 552"}));
    const std::string head = "BO_ 291 A: 8 X\n";
    const auto one = [&](const std::string& signal) {
        const Lines lines = problems_of(head + signal + "\n");
        return lines.size() == 1 ? lines[0] : lines.empty() ? std::string("accepted") : "several";
    };
    EXPECT_EQ(one(" SG_ F : 0|8@1+ (1,0)"), "accepted");
    EXPECT_EQ(one(" SG_ F : 60|8@1+ (1,0)"),
              "g.dbc:2: signal \"F\": 8 bits from start bit 60 (Intel) need 9 bytes, but the message has 8");
    EXPECT_EQ(one(" SG_ F : 0|8@2+ (1,0)"),
              "g.dbc:2: signal \"F\": should be: SG_ NAME : START|LENGTH@ORDER, with ORDER 0 (Motorola) or 1 (Intel)");
    EXPECT_EQ(one(" SG_ F : 0|8@1 (1,0)"), "g.dbc:2: signal \"F\": after the order comes + (unsigned) or - (signed)");
    EXPECT_EQ(one(" SG_ F : 0|8@1+ (nan,0)"), "g.dbc:2: signal \"F\": then comes (FACTOR,OFFSET), two numbers");
    EXPECT_EQ(one(" SG_ F : 0|8@1+ (1e999,0)"), "g.dbc:2: signal \"F\": then comes (FACTOR,OFFSET), two numbers");
    EXPECT_EQ(one(" SG_ F : 0|8@1+ (0,1)"),
              "g.dbc:2: signal \"F\": factor 0 makes no number of it; a factor is finite and not 0");
    EXPECT_EQ(one(" SG_ F q1 : 0|8@1+ (1,0)"),
              "g.dbc:2: signal \"F\": \"q1\" is no multiplexer; should be M, or m and a number");
    EXPECT_EQ(one(" SG_ F m1 : 0|8@1+ (1,0)"),
              "g.dbc:2: signal \"F\" is multiplexed (m1), but no signal of its message selects (M)");
    EXPECT_EQ(one(" SG_ F : 0|8@1+ (1,0)\n SG_ F : 8|8@1+ (1,0)"), "g.dbc:3: signal \"F\" is there already, in line 2");
    EXPECT_EQ(one("SIG_VALTYPE_ 291 G : 1;"), "g.dbc:2: message \"A\" has no signal \"G\"");
    EXPECT_EQ(one(" SG_ F : 0|16@1+ (1,0)\nSIG_VALTYPE_ 291 F : 1;"),
              "g.dbc:3: signal \"F\" is said to be a float of 32 bits, but has 16 in line 2");
    EXPECT_EQ(one("BO_ 291 B: 8 X"), "g.dbc:2: message \"B\" has the id of the one in line 1");
    EXPECT_EQ(one("BO_ 292 A: 8 X"), "g.dbc:2: message \"A\" is there already, in line 1");
    EXPECT_EQ(
        one("BO_ 2048 B: 8 X"),
        "g.dbc:2: message \"B\": id 0x800 is larger than 0x7ff; an id of 29 bits is written with bit 31 set, + 2147483648");
    EXPECT_EQ(one("BO_ 4294967296 B: 8 X"),
              "g.dbc:2: the message's id is no number of 32 bits; should be: BO_ ID NAME: BYTES SENDER");
    const std::string is_129(129, 'n');
    EXPECT_EQ(one("BO_ 292 : 8 X"), "g.dbc:2: should be: BO_ ID NAME: BYTES SENDER");
    EXPECT_EQ(one("BO_ 292 B 8 X"), "g.dbc:2: should be: BO_ ID NAME: BYTES SENDER");
    EXPECT_EQ(one("BO_ 292 B: many X"), "g.dbc:2: should be: BO_ ID NAME: BYTES SENDER");
    EXPECT_EQ(one("BO_ 292 B: -8 X"), "g.dbc:2: should be: BO_ ID NAME: BYTES SENDER");
    EXPECT_NE(one("BO_ 292 " + is_129 + ": 8 X").find(": the name has more than 128 letters"), std::string::npos);
    EXPECT_NE(one("BO_ 292 B: 5000000 X").find("5000000 bytes; a message has at most "), std::string::npos);
    EXPECT_NE(one("BO_ 3758096384 B: 8 X").find("is larger than 0x1fffffff"), std::string::npos);
    EXPECT_EQ(one(" SG_ : 0|8@1+ (1,0)"), "g.dbc:2: the signal's name is missing or has more than 128 letters");
    EXPECT_EQ(one(" SG_ " + is_129 + " : 0|8@1+ (1,0)"),
              "g.dbc:2: the signal's name is missing or has more than 128 letters");
    for (const char* place : {" F 0|8@1+", " F : x|8@1+", " F : 0-8@1+", " F : 0|x@1+", " F : 0|8#1+", " F : 0|8@x+"})
        EXPECT_NE(one(std::string(" SG_") + place + " (1,0)").find("should be"), std::string::npos) << place;
    for (const char* numbers : {"1,0)", "(x,0)", "(1;0)", "(1,x)", "(1,0", "(+-1,0)", "(.,0)", "(-,0)"})
        EXPECT_EQ(one(std::string(" SG_ F : 0|8@1+ ") + numbers),
                  "g.dbc:2: signal \"F\": then comes (FACTOR,OFFSET), two numbers")
            << numbers;
    EXPECT_EQ(one(" SG_ F : 0|8@1+ (-.5,+1e1)"), "accepted");
    EXPECT_EQ(one(" SG_ F mx : 0|8@1+ (1,0)"),
              "g.dbc:2: signal \"F\": \"mx\" is no multiplexer; should be M, or m and a number");
    EXPECT_EQ(one(" SG_ F m1x : 0|8@1+ (1,0)"),
              "g.dbc:2: signal \"F\": \"m1x\" is no multiplexer; should be M, or m and a number");
    EXPECT_EQ(one(" SG_ F M : 0|8@1- (1,0)"), "g.dbc:2: signal \"F\" selects (M), but is not unsigned");
    EXPECT_EQ(one(" SG_ F M : 0|8@1+ (1,0)\n SG_ G M : 8|8@1+ (1,0)"),
              "g.dbc:3: signal \"G\" selects (M), but so does \"F\"");
    EXPECT_EQ(one("SIG_VALTYPE_ x F : 1;"), "g.dbc:2: should be: SIG_VALTYPE_ ID SIGNAL : TYPE;");
    EXPECT_EQ(one("SIG_VALTYPE_ 291 : 1;"), "g.dbc:2: should be: SIG_VALTYPE_ ID SIGNAL : TYPE;");
    for (const char* type : {"3", "x"})
        EXPECT_EQ(one(std::string(" SG_ F : 0|8@1+ (1,0)\nSIG_VALTYPE_ 291 F : ") + type + ";"),
                  "g.dbc:3: the type of SIG_VALTYPE_ should be 0 (integer), 1 (float) or 2 (double)");
    EXPECT_EQ(one(" SG_ F : 0|8@1+ (1,0)\nSIG_VALTYPE_ 291 F 0;"), "accepted");
    EXPECT_EQ(one(" SG_ F : 0|64@1+ (1,0)\nSIG_VALTYPE_ 291 F : 2;"), "accepted");
    EXPECT_EQ(one("SIG_VALTYPE_ 3221225472 Lost : 1;"), "accepted");  // the message for signals without a message
    EXPECT_EQ(one("SG_MUL_VAL_ x F S 0-3;"), "g.dbc:2: should be: SG_MUL_VAL_ ID SIGNAL SELECTOR RANGES;");
    EXPECT_EQ(one("SG_MUL_VAL_ 9 F S 0-3;"), "accepted");
    EXPECT_EQ(one("CM_ \"a \\\" and a \\\\\";"), "accepted");
    EXPECT_EQ(one("CM_ \"never closed"), "g.dbc:2: a quoted text that begins here never ends; close it with \"");
    EXPECT_EQ(problems_of("BO_ x A: 8 X\n SG_ F : 0|8@1+ (1,0)\n SG_ G : 0|8@1+ (1,0)\n").size(), 1u);
    EXPECT_EQ(problems_of(" SG_ F : 0|8@1+ (1,0)"),
              (Lines{"g.dbc:1: a signal that belongs to no message; SG_ stands below its BO_"}));
}

TEST(Dbc, MarksNestedMultiplexersSoThatTheyAreRefusedWhereUsed) {
    Problems problems;
    const std::string plain = "BO_ 1 A: 8 X\n SG_ S M : 0|8@1+ (1,0)\n SG_ F m0 : 8|8@1+ (1,0)\n";
    EXPECT_EQ(parse_dbc(plain, "g.dbc", problems).messages[0].nested_mux_line, 0u);
    const std::string nested = plain + " SG_ G m1M : 16|8@1+ (1,0)\n SG_ H m0 : 24|8@1+ (1,0)\n";
    EXPECT_EQ(parse_dbc(nested, "g.dbc", problems).messages[0].nested_mux_line, 4u);
    EXPECT_EQ(parse_dbc(plain + "SG_MUL_VAL_ 1 F S 0-3;\n", "g.dbc", problems).messages[0].nested_mux_line, 4u);
    EXPECT_TRUE(problems.empty());
}

TEST(Dbc, HasRoomForOnlySoMuch) {
    std::string text = "BO_ 1 Long: 4095 X\n SG_ Far : 4000|8@1+ (1,0)\n";
    EXPECT_EQ(problems_of(text), Lines{}) << "a transport protocol's message: what lies beyond a frame is nothing to us";
    for (int n = 0; n < 2000; ++n) text += " SG_ S" + std::to_string(n) + " : 0|8@1+ (1,0)\n";
    ASSERT_FALSE(problems_of(text).empty());
    EXPECT_NE(problems_of(text)[0].find(" signals in a message"), std::string::npos) << problems_of(text)[0];
    text.clear();
    for (int n = 0; n < 20'000; ++n)
        text += "BO_ " + std::to_string(0x80000000u + unsigned(n)) + " M" + std::to_string(n) + ": 8 X\n";
    ASSERT_FALSE(problems_of(text).empty());
    EXPECT_NE(problems_of(text)[0].find(" messages"), std::string::npos) << problems_of(text)[0];
}

TEST(Dbc, ReportsAtMostTwentyProblems) {
    std::string text;
    for (int n = 0; n < 1000; ++n) text += "BO_ x y z\n";
    EXPECT_EQ(problems_of(text).size(), 20u);
}

TEST(Dbc, TakesBlanksAndLineEndsOfOtherWriters) {
    EXPECT_EQ(
        problems_of("BO_  291  A :8  X\r\n\tSG_  F m0:0 | 8 @1+( +1.5 , -2 )[0|0]\"\" X\r\n SG_ S M : 8|8@1+ (1,0)\r\n"),
        Lines{});
}

}  // namespace
}  // namespace tactiled
