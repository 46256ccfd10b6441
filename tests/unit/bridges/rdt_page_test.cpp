// The page of a Net F/T.
#include "node/bridges/rdt_page.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tactiled::bridges::rdt {
namespace {

Device device() {
    Device made;
    made.node = "gripper";
    made.sensor = "a<b&c";
    made.scale = {1000, 2000};
    made.zero = 0b111000;
    made.full_scale = {10, 10, 20, NAN, NAN, NAN};
    made.newest.quality = TACTILED_GOOD;
    made.newest.force_S_N[2] = -3;
    for (double& m : made.newest.torque_S_Nm) m = NAN;
    made.newest.rate_Hz = 200;
    return made;
}

bool has(const std::string& text, const std::string& element) { return text.find(element) != std::string::npos; }

TEST(RdtPage, HasCountsUnitsAndTheNewestValue) {
    const std::string text = netft_xml(device());
    for (const char* const element :
         {"<runstat>0x00000000</runstat>", "<runft>0;0;-3000;0;0;0</runft>", "<cfgcpf>1000</cfgcpf>",
          "<cfgcpt>2000</cfgcpt>", "<cfgmr>10;10;20;0;0;0</cfgmr>", "<scfgfu>N</scfgfu>", "<comrdtrate>200</comrdtrate>",
          "<cfgnam>gripper a&lt;b&amp;c</cfgnam>"})
        EXPECT_TRUE(has(text, element)) << element << "\n" << text;
}

TEST(RdtPage, AnUncertainValueHasItsStatusAndABadOneIsEmpty) {
    Device doubtful = device();
    doubtful.newest.reasons = TACTILED_SATURATED;
    tactiled_put_verdict(&doubtful.newest, 1);
    EXPECT_TRUE(has(netft_xml(doubtful), "<runstat>0x80020000</runstat>\n<runft>0;0;-3000;0;0;0</runft>"));
    tactiled_invalidate(&doubtful.newest, TACTILED_STALE);
    EXPECT_TRUE(has(netft_xml(doubtful), "<runstat>0x88020000</runstat>\n<runft></runft>"));
}

}  // namespace
}  // namespace tactiled::bridges::rdt
