// Time of a Modbus request in the daemon, without any network: read of 32 registers at 0 against a published segment of
// one sensor, by parts.
//
//   modbus_bench [rounds]
//
// Parts take turns, so that a hypervisor that slows one slows all; a round is the mean of 1,000 calls. Answers are sent into
// a pair of local sockets and taken from it again, which is timed apart. Not shown: TCP, epoll, waiting.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "node/modbus/service.hpp"
#include "node/shm/writer.hpp"
#include "tests/unit/modbus/answer_socket.hpp"

using namespace tactiled;
using namespace tactiled::modbus;

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 300;
    SegmentPlan plan;
    plan.name = "modbus_bench_" + std::to_string(::getpid());
    plan.watchdog_ms = 3'600'000;
    plan.sensors.resize(1);
    std::copy_n("left", 4, plan.sensors[0].name);
    plan.sensors[0].stale_ms = 3'600'000;
    SegmentWriter writer(plan);
    tactiled_sample sample{};
    sample.t_ns = sample.t_published_ns = monotonic_ns();
    sample.quality = TACTILED_GOOD;
    writer.publish(0, sample);
    tactiled_node node{};
    node.t_ns = sample.t_ns;
    node.count[0] = 1;
    writer.publish(node);
    writer.set_state(TACTILED_RUNNING);

    CommandRing commands(16);
    ModbusSettings settings;
    settings.commands = true;
    Service service(plan.name, settings, commands);
    Session session;
    const std::array<std::uint8_t, 12> adu{0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 32};
    std::array<std::uint8_t, kMaxAdu> out{};
    const test::AnswerSocket socket;
    Responder responder(ModbusWire::tcp);
    responder.set_descriptor(socket.fd());
    Tables tables;
    const auto take = [&] { return socket.take(out); };
    const Segment segment = Segment::open(plan.name);
    std::array<std::uint16_t, kGlobalSize> global{};
    const View view = view_of(segment);
    if (!view.alive) return 2;

    const std::array<std::uint8_t, 9 + 2 * 32> sent{};
    struct Part {
        const char* name;
        std::function<void()> run;
        std::vector<double> ns;
    };
    std::vector<Part> parts{
        {"whole answer, sent and taken", [&] { (void)service.answer(adu, session, responder), (void)take(); }, {}},
        {"  check the request", [&] { (void)check_pdu(responder.pdu_of(adu), false); }, {}},
        {"  snapshot of shared memory", [&] { (void)view_of(segment); }, {}},
        {"  registers of a block", [&] { encode(area_with(Block::global), global, view); }, {}},
        {"  libmodbus: compose, send; taken", [&] { (void)responder.reply(adu, tables), (void)take(); }, {}},
        {"  the same bytes sent; taken", [&] { (void)!::send(socket.fd(), sent.data(), sent.size(), 0), (void)take(); }, {}},
    };
    for (int round = 0; round < rounds; ++round)
        for (Part& part : parts) {
            const std::uint64_t begun_ns = monotonic_ns();
            for (int n = 0; n < 1000; ++n) part.run();
            part.ns.push_back(double(monotonic_ns() - begun_ns) / 1000);
        }
    for (Part& part : parts) {
        std::sort(part.ns.begin(), part.ns.end());
        const auto at = [&](double share) { return part.ns[std::size_t(share * double(part.ns.size() - 1))]; };
        std::printf("%-36s %8.0f ns (p50)  %8.0f (p99)\n", part.name, at(0.5), at(0.99));
    }
    (void)service.answer(adu, session, responder);
    return take() == sent.size() && out[7] == 3 && out[8] == 64 ? 0 : 1;
}
