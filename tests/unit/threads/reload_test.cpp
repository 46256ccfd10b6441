// SIGHUP without a daemon: the effect of each kind of change on the running loop, and refused changes.
// tests/system/reload_test.py tests the same on the release daemon while devices stream.
#include "node/reload.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <thread>

#include "node/realtime.hpp"
#include "tactiled/reader.hpp"
#include "tests/unit/config/folder.hpp"
#include "tests/unit/node/unit_calibration.hpp"

namespace tactiled {
namespace {

constexpr char kConfig[] = R"(
[[link]]
name = "one"
driver = "uart"
device = "/dev/null"
format = "lines"
channels = 3

[[link]]
name = "two"
driver = "uart"
device = "/dev/zero"
format = "lines"
channels = 3

[[sensor]]
name = "left"
link = "one"
model = "generic"
calibration = "left.toml"

[[sensor]]
name = "right"
link = "two"
model = "generic"
calibration = "right.toml"

[grasp]
gravity_G_m_s2 = [0, 0, 9.81]
friction = 0.7
objects = "objects.toml"

[[grasp.jaw]]
sensor = "left"
x_S_in_G = [0, 0, -1]
z_S_in_G = [1, 0, 0]
)";
const std::string kCalibration = test::unit_calibration();
constexpr char kLeft[] = "name = \"left\"\n", kFriction[] = "friction = 0.7\n";

bool has(const std::string& log, const std::string& words) { return log.find(words) != std::string::npos; }

class ReloadTest : public testing::Test {
protected:
    ReloadTest() {
        config_ = "[node]\nname = \"reload-test-" + std::to_string(::getpid()) + "\"\ncontrol = \"" + (folder_ / "sock") +
                  "\"\n" + kConfig;
        for (const char* name : {"left.toml", "right.toml"}) (void)folder_.write(name, kCalibration);
    }
    ~ReloadTest() override { end(); }

    static std::string with(std::string text, const std::string& what, const std::string& by) {
        const std::size_t at = text.find(what);
        EXPECT_NE(at, std::string::npos) << what;
        return text.replace(at, what.size(), by);
    }
    void start(const std::string& config) {
        (void)folder_.write("tactiled.toml", config);
        Problems problems;
        node_ = std::make_unique<Node>(load_node(folder_ / "tactiled.toml", problems));
        ASSERT_TRUE(problems.empty()) << problems.lines().front();
        segment_ = std::make_unique<SegmentWriter>(node_->plan);
        pipeline_ = std::make_unique<Pipeline>(node_->links, node_->sensors, *segment_, 0, node_->grasp);
        segment_->set_state(TACTILED_RUNNING);
        pipeline_->start(monotonic_ns());
        reloader_ = std::make_unique<Reloader>(*node_, "");
        turns_ = true;
        loop_ = std::thread([this] {
            while (turns_) {
                pipeline_->cycle(monotonic_ns());
                ::usleep(500);
            }
        });
    }
    void end() {
        turns_ = false;
        if (loop_.joinable()) loop_.join();
    }
    // Returns the log of SIGHUP with this configuration in the file.
    // The log; a file that has lost keys is reloaded twice.
    std::string reload(const std::string& config) {
        (void)folder_.write("tactiled.toml", config);
        std::string log;
        for (int times = 0; times == 0 || (times == 1 && log.find("is not in the file any more") != log.npos); ++times) {
            testing::internal::CaptureStderr();
            reloader_->reload(*pipeline_);
            log = testing::internal::GetCapturedStderr();
        }
        return log;
    }
    // Returns the warning of the last reload, once the loop has published it.
    bool is_warned(bool wanted) {
        Snapshot look;
        for (int i = 0; i < 400; ++i) {
            if (Segment::open(node_->plan.name).snapshot(look) &&
                ((look.node.warning & TACTILED_WARN_RELOAD) != 0) == wanted)
                return wanted;
            ::usleep(5000);
        }
        return !wanted;
    }

    test::Folder folder_;
    std::string config_;
    std::unique_ptr<Node> node_;
    std::unique_ptr<SegmentWriter> segment_;
    std::unique_ptr<Pipeline> pipeline_;
    std::unique_ptr<Reloader> reloader_;
    std::atomic<bool> turns_{false};
    std::thread loop_;
};

TEST_F(ReloadTest, OnlyWhatChangedIsReplaced) {
    start(config_);
    EXPECT_PRED2(has, reload(config_), "SIGHUP: neither the configuration nor a calibration has changed\n");
    EXPECT_PRED2(has, reload(with(config_, kLeft, "name = \"left\"\nfilter_hz = 10\n")),
                 "SIGHUP: changed sensor \"left\"\n");
    // A jaw's threshold belongs to the grasp, too.
    EXPECT_PRED2(has, reload(with(config_, kLeft, "name = \"left\"\ncontact_on_N = 0.2\n")),
                 "SIGHUP: changed sensor \"left\", the grasp\n");
    EXPECT_PRED2(has, reload(config_), "SIGHUP: changed sensor \"left\", the grasp\n");
    EXPECT_PRED2(has, reload(with(config_, kFriction, "friction = 0.6\n")), "SIGHUP: changed the grasp\n");
    EXPECT_PRED2(has, reload(with(config_, kFriction, "friction = 0.6\nslip_sensitivity = 80\n")),
                 "SIGHUP: changed the grasp\n");
    EXPECT_PRED2(has, reload(config_), "SIGHUP: changed the grasp\n");
    // The pair concerns both sensors, whichever names the other.
    EXPECT_PRED2(has, reload(with(config_, kLeft, "name = \"left\"\nagrees_with = \"right\"\nagree_N = 2\n")),
                 "SIGHUP: changed sensor \"left\", sensor \"right\"\n");
    EXPECT_FALSE(is_warned(false));
}

TEST_F(ReloadTest, ACalibrationIsANewEpochAndOfAJawANewScaleOfTheWeight) {
    start(config_);
    (void)folder_.write("right.toml", with(kCalibration, "[[1.0", "[[2.0"));
    EXPECT_PRED2(has, reload(config_), "SIGHUP: changed sensor \"right\" (a new epoch, without its tare)\n");
    (void)folder_.write("left.toml", with(kCalibration, "[[1.0", "[[2.0"));
    EXPECT_PRED2(has, reload(config_), "SIGHUP: changed sensor \"left\" (a new epoch, without its tare), the grasp\n");
    EXPECT_PRED2(has, reload(with(config_, kLeft, "name = \"left\"\ncounts_per_unit = 2\n")),
                 "SIGHUP: changed sensor \"left\" (a new epoch, without its tare), the grasp\n");
    // The same numbers with another identity: the register shows it, and nothing else changes.
    const std::uint32_t before = Segment::open(node_->plan.name).calibration_id();
    EXPECT_PRED2(has, reload("# said twice\n" + with(config_, kLeft, "name = \"left\"\ncounts_per_unit = 2\n")),
                 "SIGHUP: neither");
    EXPECT_NE(Segment::open(node_->plan.name).calibration_id(), before);
}

TEST_F(ReloadTest, WhatStandsInTheDirectoryNeedsARestart) {
    start(config_);
    const std::string no_grasp = config_.substr(0, config_.find("[grasp]"));
    const std::string restart = "cannot change while the daemon runs; restart it (systemctl restart tactiled)\n";
    struct Case {
        std::string config, says;
    };
    for (const auto& [config, says] :
         {Case{no_grasp, "whether there is a [grasp] "},
          Case{with(config_, "objects.toml", "others.toml"), "[grasp]: objects "},
          Case{with(config_, "control", "watchdog_ms = 99\ncontrol"), "[node] "},
          Case{with(config_, kLeft, "name = \"left\"\nstale_ms = 50\n"), "sensor \"left\": stale_ms "},
          Case{
              with(with(config_, "link = \"two\"", "link = \"one\"\ndevice = 1"),
                   "[[link]]\nname = \"two\"\ndriver = \"uart\"\ndevice = \"/dev/zero\"\nformat = \"lines\"\nchannels = 3\n",
                   ""),
              "[link] "},
          Case{with(config_, "name = \"right\"", "name = \"third\""), "which [[sensor]] there are "}}) {
        const std::string log = reload(config);
        EXPECT_PRED2(has, log, says + restart);
        EXPECT_PRED2(has, log, "SIGHUP: refused, nothing was changed\n");
        EXPECT_TRUE(is_warned(true)) << says;
        EXPECT_PRED2(has, reload(config_), "SIGHUP: neither") << says;
        EXPECT_FALSE(is_warned(false)) << says;
    }
    ::unlink((folder_ / "tactiled.toml").c_str());
    testing::internal::CaptureStderr();
    reloader_->reload(*pipeline_);
    EXPECT_PRED2(has, testing::internal::GetCapturedStderr(), "there is no such file");
    EXPECT_TRUE(is_warned(true));
}

TEST_F(ReloadTest, AGraspCannotBeAddedAndALoopThatStandsIsReported) {
    const std::string no_grasp = config_.substr(0, config_.find("[grasp]"));
    start(no_grasp);
    EXPECT_PRED2(has, reload(config_), "whether there is a [grasp] cannot change");
    EXPECT_PRED2(has, reload(with(no_grasp, kLeft, "name = \"left\"\nfilter_hz = 10\n")), "changed sensor \"left\"\n");
    end();
    const std::string log = reload(no_grasp);
    EXPECT_PRED2(has, log, "the pipeline did not respond within 1000 ms; the reload was aborted");
    EXPECT_PRED2(has, log, "SIGHUP: refused, nothing was changed\n");
}

}  // namespace
}  // namespace tactiled
