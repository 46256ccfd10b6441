// Requests of PLCs, one after the other, while the pipeline acknowledges late, wrongly or never. Oracles: a request
// that is refused changes no register and sends no command; who may not write changes nothing; of one request comes at most
// one command, for sensors that there are; what was stored as a plain number reads back; states are those of the map.
#include <unistd.h>

#include <array>
#include <string>

#include "node/modbus/controls.hpp"
#include "node/shm/writer.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::modbus;
using fuzz::check;
using fuzz::Input;

constexpr unsigned kCount = 2;  // number of sensors

class Node {  // two sensors that deliver
public:
    Node() : writer_(plan()) {
        writer_.set_state(TACTILED_RUNNING);
        segment_ = Segment::open(plan().name);
    }
    View view(const tactiled_command& answer) {
        tactiled_sample sample{};
        sample.sequence = node_.sequence;
        sample.t_ns = node_.t_ns = monotonic_ns();
        sample.quality = TACTILED_GOOD;
        for (unsigned i = 0; i < kCount; ++i) {
            writer_.publish(i, sample);
            node_.count[i] = node_.sequence + 1;
        }
        node_.command[TACTILED_FROM_MODBUS] = answer;
        writer_.publish(node_);
        ++node_.sequence;
        return view_of(segment_);
    }

private:
    static SegmentPlan plan() {
        SegmentPlan plan;
        plan.name = "fuzz-controls-" + std::to_string(::getpid());
        plan.history = 8;
        plan.sensors.resize(kCount);
        for (auto& sensor : plan.sensors) sensor.stale_ms = 10'000;
        return plan;
    }
    SegmentWriter writer_;
    Segment segment_;
    tactiled_node node_{};
};

using Registers = std::array<std::uint16_t, kControlsSize + kScratchSize>;

Registers all_of(const Controls& controls, const Session& session, std::uint64_t now_ns) {
    Registers all{};
    controls.read({kControlsAt, kControlsSize + kScratchSize}, session, now_ns, all.data());
    return all;
}

// A request out of a few bytes: the addresses that mean something, now and then any.
std::vector<std::uint8_t> request_of(Input& input) {
    constexpr std::uint16_t kPlaces[] = {kCmd,           kCmdMask,      kCmdSeq,      kTareCell, kClearLatchCell,
                                         kResetPeakCell, kPlcHeartbeat, kPlcWatchdog, kFilterHz, kContactOn,
                                         kContactOff,    kGravityX,     kAccelX,      kUnlock,   kScratchAt,
                                         kWeighCell,     kCycleAt};
    const unsigned what = input.byte();
    const std::uint16_t at = what % 32 < std::size(kPlaces) ? kPlaces[what % 32] : std::uint16_t(kControlsAt + input.byte());
    std::vector<std::uint8_t> pdu;
    const auto word = [&](unsigned value) { pdu.insert(pdu.end(), {std::uint8_t(value >> 8), std::uint8_t(value)}); };
    constexpr std::uint8_t kFunctions[] = {6, 16, 22, 5, 15, 6, 16, 6};
    const std::uint8_t function = kFunctions[what / 32];
    pdu.push_back(function);
    if (function == 6) {
        word(at);
        word(at == kUnlock && input.byte() % 2 == 0 ? kUnlockWord : input.number(2));
    } else if (function == 22) {
        word(at);
        word(input.number(2));
        word(input.number(2));
    } else if (function == 16) {
        const unsigned n = 1 + input.byte() % 15;
        word(at);
        word(n);
        pdu.push_back(std::uint8_t(2 * n));
        for (unsigned k = 0; k < n; ++k) word(input.byte());
    } else {
        const unsigned n = function == 5 ? 1 : 1 + input.byte() % 16;
        word(input.byte() % kCoils);
        if (function == 5) {
            word(input.byte() % 2 == 0 ? 0xFF00 : 0);
        } else {
            word(n);
            pdu.push_back(std::uint8_t((n + 7) / 8));
            for (unsigned k = 0; k < (n + 7) / 8; ++k) pdu.push_back(input.byte());
        }
    }
    return pdu;
}

bool saves(const Request& request) {  // a thread and a disk: not here
    return request.write.at <= kSave && request.write.at + request.write.count > kSave;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static Node node;
    Input input(data, size);
    ModbusSettings settings{};
    settings.commands = true;
    settings.hints_expire_ms = 2000;
    CommandRing commands(16);
    Controls controls(settings, commands);
    Session sessions[2];
    sessions[0].may_write = true;
    std::uint64_t now_ns = 1'000'000'000;
    tactiled_command answer{};
    std::uint32_t sent = 0;
    while (!input.is_empty()) {
        const unsigned what = input.byte();
        now_ns += std::uint64_t(what) * 1'000'000;
        if (what % 4 == 0)
            answer = {what % 8 == 0 ? sent : input.byte(), input.byte() % 4u,
                      input.byte() % (TACTILED_COMMAND_NOT_STORED + 1u)};
        Session& session = sessions[what % 16 == 1 ? 1 : 0];
        const auto pdu = request_of(input);
        const Request request = check_pdu(pdu, true);
        if (request.exception != kNone || saves(request)) continue;
        const View view = node.view(answer);
        controls.follow(view, now_ns);
        while (commands.front() != nullptr) commands.pop();  // commands that an earlier request left to be sent
        const Registers before = all_of(controls, session, now_ns);
        const Exception found = controls.check(request, view, session, now_ns);
        check(all_of(controls, session, now_ns) == before && commands.front() == nullptr);
        if (!session.may_write) check(found != kNone);
        if (found != kNone) continue;
        controls.write(request, view, session, now_ns);
        const Registers after = all_of(controls, session, now_ns);
        const bool registers = request.function != kWriteCoil && request.function != kWriteCoils;
        for (unsigned k = 0; registers && request.function != kMaskWrite && k < request.write.count; ++k) {
            const unsigned at = origin_of(std::uint16_t(request.write.at + k));
            const bool is_number = at >= kScratchAt || (at >= kFilterHz && at <= kSlipSensitivity) || at == kPlcHeartbeat;
            if (is_number) check(after[at - kControlsAt] == (request.written[2 * k] << 8 | request.written[2 * k + 1]));
        }
        unsigned asked = 0;
        for (; const Command* const command = commands.front(); commands.pop()) {
            if (command->kind >= Command::Kind::set) continue;  // these have no acknowledgement
            ++asked;
            sent = command->number;
            check((command->mask & ~((1u << kCount) - 1)) == 0);
            if (command->kind == Command::Kind::tare || command->kind == Command::Kind::untare) check(command->mask != 0);
        }
        check(asked <= 1);
        std::array<std::uint16_t, kGlobalSize> global{};
        encode(area_with(Block::global), global, view, 0, controls.report(session, now_ns));
        check(global[kCmdState] <= TACTILED_COMMAND_REJECTED && global[kCmdResult] <= TACTILED_COMMAND_REPEATED);
    }
    return 0;
}
