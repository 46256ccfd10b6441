#include "plc_page.hpp"

#include <fmt/format.h>

#include <cstring>

#include "faults.hpp"
#include "node/modbus/table.hpp"
#include "tests/unit/modbus/cells.hpp"

namespace tactiled::faults {
namespace {

using modbus::kNoI16;
using modbus::kNoU16;

std::string_view word_of(std::uint16_t value, std::string_view register_name) {
    for (const modbus::Name& name : modbus::names_of(register_name))
        if (name.value == value) return name.name;
    return "?";
}

std::string row(const Witness::Registers& now, std::uint16_t lost_before, std::uint16_t beats_before) {
    const std::uint16_t* global = now.global.data();
    const std::uint16_t* sensor = now.sensors.data();
    const auto not_available = [](std::uint16_t value, std::uint16_t none) {
        return value == none ? fmt::format("{:#06x}", value) : fmt::format("{}", value);
    };
    const std::uint16_t fx = sensor[modbus::kFx];
    const std::string fault(word_of(sensor[modbus::kSensorFault], "sensor.FAULT"));
    return fmt::format("{:#06x} | {} {} | {} | {} | +{} | {} | {:#06x} | {:#06x} | {:#06x} | {:#06x} | {}",
                       sensor[modbus::kSensorStatus], sensor[modbus::kSensorFault], fault.substr(0, fault.find(':')),
                       fx == kNoI16 ? fmt::format("{:#06x}", fx) : fmt::format("{}", std::int16_t(fx)),
                       not_available(sensor[modbus::kSensorAgeMs], kNoU16),
                       std::uint16_t(sensor[modbus::kLost] - lost_before), not_available(sensor[modbus::kRate], kNoU16),
                       global[modbus::kStatus], global[modbus::kFault], global[modbus::kWarn], global[modbus::kOk],
                       global[modbus::kHeartbeat] != beats_before ? "beats" : "stands");
}

constexpr const char* kIntro = R"(# What your PLC reads in each fault

Made by `world_test` in the simulated world (README.md), with the real register server; a test holds this page to it. Four sensors at 250 Hz with
`stale_ms = 20`, `frozen_after = 10`, `rate_Hz = 250`; each fault lasts 1.5 s and strikes the link of sensor 0, or the node. Read
right before its end, and 2.3 s after it. Addresses of sensor 0: STATUS 101, FAULT 102, FX 104 (0.01 N), AGE_MS 103, LOST 122 (what was added), RATE
121. Of the node: STATUS 7, FAULT 8 (latched until CLEAR_LATCH), WARN 9, OK 10, HEARTBEAT 5 (over the last 300 ms). What each bit means: [MAP.md](../../node/modbus/MAP.md).

**What a program should do**: use a force only where STATUS bit 0 of the sensor, or its bit in OK, is set; treat 0x8000 as no value; and watch HEARTBEAT, which stands
when no sensor delivers, and the connection, which is gone when the daemon is.

| fault | | STATUS | FAULT | FX | AGE_MS | LOST | RATE | STATUS of the node | FAULT | WARN | OK | HEARTBEAT |
|--|--|--|--|--|--|--|--|--|--|--|--|--|
)";

}  // namespace

std::string plc_page() {
    std::string page = kIntro;
    bool first = true;
    for (const Fault& fault : faults()) {
        // The PLC does not see another reader, and sees a stopped loop for longer.
        if (std::strstr(fault.name, "reader") != nullptr || std::strstr(fault.name, "60 ms") != nullptr) continue;
        World world(1);
        const auto beats = [&] { return world.witness().read_registers().global[modbus::kHeartbeat]; };
        const auto run = [&](std::uint64_t ms) {
            world.run_ms(ms - 300);
            const std::uint16_t before = world.is_running() ? beats() : 0;
            world.run_ms(300);
            return before;
        };
        world.suffer(~0u, ~0ull);
        std::uint16_t beats_before = run(2200);
        const Witness::Registers before = world.witness().read_registers();
        const std::uint16_t lost = before.sensors[modbus::kLost];
        if (std::exchange(first, false)) page += fmt::format("| none | | {} |\n", row(before, lost, beats_before));
        const bool stalls = std::strstr(fault.name, "the loop") != nullptr;
        fault.begin(world, 0);
        if (stalls) world.stall_pipeline(1500);
        beats_before = run(1490);
        const std::string during = world.is_running() ? row(world.witness().read_registers(), lost, beats_before)
                                                      : "no answer: the server ends with the daemon | | | | | | | | | |";
        fault.end(world, 0);
        beats_before = run(2300);
        page += fmt::format("| {} | in | {} |\n| | after | {} |\n", fault.name, during,
                            row(world.witness().read_registers(), lost, beats_before));
    }
    return page;
}

}  // namespace tactiled::faults
