// tactilectl map: the register map, from the table that the server uses.
#include <fmt/format.h>

#include <memory>

#include "node/ctl/verb.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

const char* type_text(Type type) {
    switch (type) {
        case Type::u16: return "u16";
        case Type::i16: return "i16";
        case Type::bits: return "bits";
        case Type::mask: return "mask";
        case Type::enumeration: return "enum";
        case Type::count: return "count";
        case Type::i32: return "i32";
        case Type::text: return "constant";
    }
    return "";
}

void print_table(std::string_view prefix, std::span<const Register> registers, bool offsets) {
    if (offsets)
        fmt::print("| + | sensor 0: address | 3xxxx / 4xxxx | name | type | unit | meaning |\n|--|--|--|--|--|--|--|\n");
    else
        fmt::print("| address | 3xxxx / 4xxxx | name | type | unit | meaning |\n|--|--|--|--|--|--|\n");
    for (const Register& r : registers) {
        const unsigned address = offsets ? kSensorsAt + r.at : r.at;
        if (offsets) fmt::print("| {} ", r.at);
        fmt::print("| {} | {} / {} | {} | {} | {} | {}", address, 30001 + address, 40001 + address, r.name,
                   type_text(r.type), r.unit, r.meaning);
        const char* separator = r.meaning.empty() ? "" : ". ";
        for (const Name& name : names_of(fmt::format("{}.{}", prefix, r.name))) {
            fmt::print("{}{} {}", separator, name.value, name.name);
            separator = " · ";
        }
        fmt::print(" |\n");
    }
    fmt::print("\n");
}

int print_map() {
    fmt::print("# tactiled register map {}.{}\n\n", kMapMajor, kMapMinor);
    fmt::print(
        "Addresses are those on the wire, from 0; the manuals of many PLCs add 30001 (FC 4) or 40001 (FC 3). FC 3 and FC 4 "
        "read\n"
        "the same. Any unit identifier is answered. Writing: exception 2. Outside the blocks: exception 2; cells without a "
        "name\n"
        "inside them read 0. i16 is two's complement; not available: i16 0x8000, u16 0xFFFF, i32 0x80000000; what leaves "
        "the range\n"
        "saturates at +-32767 or 65534 and sets a status bit. A request is answered from one frame: SEQ = SEQ_END.\n\n"
        "From a shell, the register at address A:   mbpoll -m tcp -p 1502 -t 3 -0 -r A -1 127.0.0.1   (-t 3:hex in "
        "hexadecimal)\n\n");
    fmt::print("## {} .. {}: global block\n\n", kGlobalAt, kGlobalAt + kGlobalSize - 1);
    print_table("global", global_registers(), false);
    fmt::print("## {} + {} n .. : block of sensor n = 0 .. {}\n\n", kSensorsAt, kSensorSize, kSensorBlocks - 1);
    fmt::print(
        "Five blocks fit one read of 125. Forces act on the sensor, in frame S. A block without a sensor holds "
        "sentinels.\n\n");
    print_table("sensor", sensor_registers(), true);
    fmt::print("## {} .. {}: constants, to check base, sign and word order\n\n", kConstantsAt,
               kConstantsAt + kConstantsSize - 1);
    print_table("constant", constant_registers(), false);
    return kGood;
}

}  // namespace

void add_map(CLI::App& app, Run& run) {
    auto format = std::make_shared<std::string>("md");
    auto* verb = app.add_subcommand("map", "The Modbus register map");
    verb->add_option("--format", *format, "md: Markdown")->check(CLI::IsMember({"md"}))->capture_default_str();
    verb->callback([&run] { run = print_map; });
}

}  // namespace tactiled::ctl
