// Controls without a server or a pipeline: the test acknowledges the sent commands.
#pragma once
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "node/modbus/controls.hpp"
#include "node/shm/writer.hpp"
#include "tests/unit/modbus/cells.hpp"

namespace tactiled::modbus {

using Bytes = std::vector<std::uint8_t>;
inline constexpr std::uint64_t kSecond = 1'000'000'000;

class ControlsTest : public testing::Test {
protected:
    ControlsTest() : writer_(plan()) {
        ::mkdir(folder_.c_str(), 0700);
        settings_.commands = true;
        settings_.settings = folder_ + "/settings.toml";
        settings_.objects = folder_ + "/objects.toml";
        session_.may_write = true;
        writer_.set_state(TACTILED_RUNNING);
        segment_ = Segment::open(plan().name);
        start();
        beat();
    }
    ~ControlsTest() override {
        controls_.reset();
        std::filesystem::remove_all(folder_);
    }
    static SegmentPlan plan() {
        SegmentPlan p;
        p.name = "controls-test-" + std::to_string(::getpid());
        p.history = 64;
        p.sensors.resize(1);
        p.sensors[0].stale_ms = 10'000;
        return p;
    }
    void start() {
        controls_ = std::make_unique<Controls>(settings_, commands_);
        put(kCmdSeq, 0);  // the first number is adopted and runs nothing
    }
    // Publishes a frame of the pipeline with `node_.command`.
    void beat() {
        tactiled_sample s{};
        s.sequence = node_.sequence;
        s.t_ns = node_.t_ns = monotonic_ns();
        s.quality = TACTILED_GOOD;
        writer_.publish(0, s);
        node_.count[0] = node_.sequence + 1;
        writer_.publish(node_);
        ++node_.sequence;
    }
    void answer(std::uint32_t number, tactiled_command_state state, tactiled_command_result result = TACTILED_COMMAND_OK) {
        node_.command[TACTILED_FROM_MODBUS] = {number, std::uint32_t(state), std::uint32_t(result)};
        beat();
    }
    int ask(const Bytes& pdu, std::uint64_t now_ns = kSecond) {
        const Request request = check_pdu(pdu, scratch_);
        EXPECT_EQ(request.exception, kNone) << "not a matter of Controls";
        const View view = view_of(segment_);
        controls_->follow(view, now_ns);
        const Exception found = controls_->check(request, view, session_, now_ns);
        if (found == kNone) controls_->write(request, view, session_, now_ns);
        return found;
    }
    int put(unsigned at, unsigned value, std::uint64_t now_ns = kSecond) {
        return ask({6, std::uint8_t(at >> 8), std::uint8_t(at), std::uint8_t(value >> 8), std::uint8_t(value)}, now_ns);
    }
    int put(unsigned at, const std::vector<unsigned>& values) { return put_at(at, values, kSecond); }
    int put_at(unsigned at, const std::vector<unsigned>& values, std::uint64_t now_ns) {
        Bytes pdu{16, std::uint8_t(at >> 8),       std::uint8_t(at),
                  0,  std::uint8_t(values.size()), std::uint8_t(2 * values.size())};
        for (const unsigned v : values) pdu.insert(pdu.end(), {std::uint8_t(v >> 8), std::uint8_t(v)});
        return ask(pdu, now_ns);
    }
    std::array<std::uint16_t, kGlobalSize> global(std::uint64_t now_ns = kSecond) {
        std::array<std::uint16_t, kGlobalSize> out{};
        controls_->follow(view_of(segment_), now_ns);
        View nothing_wrong;  // STATUS and FAULT have only bits of Controls
        nothing_wrong.alive = true;
        encode(area_with(Block::global), out, nothing_wrong, 0, controls_->report(session_, now_ns));
        return out;
    }
    std::uint16_t cell(unsigned at) {
        std::uint16_t value = 0;
        controls_->read({std::uint16_t(at), 1}, session_, kSecond, &value);
        return value;
    }
    // Returns the oldest command that the pipeline has not taken.
    Command sent() {
        const Command* const front = commands_.front();
        EXPECT_NE(front, nullptr) << "nothing was sent";
        if (front == nullptr) return {};
        const Command command = *front;
        commands_.pop();
        return command;
    }

    std::string folder_ = "/tmp/controls-test-" + std::to_string(::getpid());
    ModbusSettings settings_{};
    SegmentWriter writer_;
    Segment segment_;
    CommandRing commands_{16};
    std::unique_ptr<Controls> controls_;
    Session session_;
    bool scratch_ = false;  // value of [modbus] scratch
    tactiled_node node_{};
};

}  // namespace tactiled::modbus
