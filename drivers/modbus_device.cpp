#include "drivers/modbus_device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace tactiled {
namespace {

constexpr Range kAddress{0, 65535}, kWord{0, 65535};
constexpr int kMaxGap = 124;

std::uint16_t word(Options& table, std::string_view key, Range range) { return std::uint16_t(table.integer(key, range)); }
std::uint16_t word(Options& table, std::string_view key, Range range, int fallback) {
    return std::uint16_t(table.integer(key, range, fallback));
}

RegisterType type_of(const std::string& name) {
    if (name == "uint16") return RegisterType::uint16;
    if (name == "int32") return RegisterType::int32;
    if (name == "uint32") return RegisterType::uint32;
    return name == "float32" ? RegisterType::float32 : RegisterType::int16;
}

RegisterValue read_channel(Options table, bool low_word_first) {
    RegisterValue value;
    value.name = table.text("name");
    value.at = word(table, "at", kAddress);
    value.type = type_of(table.one_of("type", {"int16", "uint16", "int32", "uint32", "float32"}, "int16"));
    value.scale = table.number("scale", {-1e12, 1e12}, 1);
    if (value.scale == 0) table.problem("scale", fmt::format("scale = 0 makes register \"{}\" nothing", value.name));
    value.low_word_first = low_word_first;
    return value;
}

RegisterSet::Ready read_ready(Options table) {
    const RegisterSet::Ready ready{word(table, "at", kAddress), word(table, "mask", kWord, 0xFFFF),
                                   word(table, "value", kWord)};
    if ((ready.value & ~ready.mask) != 0)
        table.problem("value", fmt::format("value = {:#x} has bits that mask = {:#x} takes away: it could never be ready",
                                           ready.value, ready.mask));
    return ready;
}

ModbusDevice::Write read_write(Options table) {
    const std::uint16_t at = word(table, "at", kAddress), value = word(table, "value", kWord);
    using modbus::kWriteRegister, modbus::kWriteRegisters;
    const std::int64_t function = table.integer("function", {kWriteRegister, kWriteRegisters}, kWriteRegister);
    if (function != kWriteRegister && function != kWriteRegisters)
        table.problem("function", fmt::format("function = {}; 6 and 16 write registers", function));
    return {at, value, std::uint8_t(function)};
}

// Sets one request that covers all registers. Small gaps are read, too; some devices refuse to read registers that do
// not exist.
void cover(RegisterSet& set, Options& table, int max_gap) {
    struct Span {
        unsigned first, last;
    };
    std::vector<Span> spans;
    const auto add = [&](const RegisterValue& value) { spans.push_back({value.at, value.at + words_of(value.type) - 1}); };
    for (const auto& value : set.channel) add(value);
    for (const auto& value : set.sequence) add(value);
    for (const auto& ready : set.ready) spans.push_back({ready.at, ready.at});
    if (spans.empty()) return;
    std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.first < b.first; });
    unsigned last = spans.front().last;
    for (const auto& span : spans) {
        if (span.first > last + 1 + unsigned(max_gap)) {
            const unsigned gap = span.first - last - 1;
            table.problem(
                "registers",
                fmt::format("between registers {} and {} lie {} that are not used, more than max_gap = {}; a frame "
                            "is one answer: give each group its own [[link.slave]]{}",
                            last, span.first, gap, max_gap,
                            gap > unsigned(kMaxGap) ? ""
                                                    : fmt::format(", or set max_gap = {} where the device answers for "
                                                                  "what lies between",
                                                                  gap)));
            return;
        }
        last = std::max(last, span.last);
    }
    const unsigned first = spans.front().first, count = last - first + 1;
    if (count > modbus::kMaxRead || last > 65535) {
        table.problem(
            "registers",
            fmt::format("registers {} .. {} are {}; one answer has at most {}, up to 65535: give each group its own "
                        "[[link.slave]]",
                        first, last, count, modbus::kMaxRead));
        return;
    }
    set.at = std::uint16_t(first);
    set.count = std::uint16_t(count);
}

// Reads the keys that describe a kind of device, from the link's table or from a file.
void read_kind(ModbusDevice& device, Options& table) {
    device.function =
        std::uint8_t(table.integer("function", {modbus::kReadHolding, modbus::kReadInputRegisters}, modbus::kReadHolding));
    const bool low_word_first = table.one_of("word_order", {"high_first", "low_first"}, "high_first") == "low_first";
    const int max_gap = int(table.integer("max_gap", {0, kMaxGap}, 8));
    for (auto& one : table.tables("registers", kMaxChannels))
        device.set.channel.push_back(read_channel(one, low_word_first));
    if (device.set.channel.empty())
        table.problem("registers",
                      "registers is missing: registers = [{name = \"fx\", at = 180, type = \"int16\", scale = 0.01}, ...]");
    for (std::size_t i = 0; i < device.set.channel.size(); ++i)
        for (std::size_t k = 0; k < i; ++k)
            if (device.set.channel[i].name == device.set.channel[k].name && !device.set.channel[i].name.empty())
                table.problem("registers", fmt::format("registers has \"{}\" twice", device.set.channel[i].name));
    for (auto& one : table.tables("ready", 4)) device.set.ready.push_back(read_ready(one));
    if (table.has("sequence")) {
        Options sequence = table.table("sequence");
        RegisterValue value;
        value.at = word(sequence, "at", kAddress);
        value.type = type_of(sequence.one_of("type", {"uint16", "uint32"}, "uint16"));
        value.low_word_first = low_word_first;
        device.set.sequence.push_back(value);
    }
    for (auto& one : table.tables("start", 16)) device.start.push_back(read_write(one));
    cover(device.set, table, max_gap);
}

}  // namespace

ModbusDevice read_modbus_device(Options table, ModbusWire wire) {
    constexpr Range kRate{0.01, 2000};
    const Range units = wire == ModbusWire::rtu ? Range{1, 247} : Range{0, 255};
    ModbusDevice device;
    device.device = std::uint16_t(table.integer("device", {0, 65535}, 0));
    if (!table.has("registers_file")) {
        device.unit = std::uint8_t(table.integer("unit", units, 1));
        device.rate_Hz = table.number("rate_Hz", kRate, 50);
        read_kind(device, table);
        return device;
    }
    const std::string name = table.text("registers_file");
    Problems of_file;
    Options file = Options::parse_file((std::filesystem::path(table.file()).parent_path() / name).string(), of_file);
    device.unit = std::uint8_t(file.integer("unit", units, 1));
    device.rate_Hz = file.number("rate_Hz", kRate, 50);
    if (of_file.empty()) {
        read_kind(device, file);
        file.finish();
    }
    for (const auto& line : of_file.lines()) table.problem("registers_file", line);
    device.unit = std::uint8_t(table.integer("unit", units, device.unit));
    device.rate_Hz = table.number("rate_Hz", kRate, device.rate_Hz);
    return device;
}

}  // namespace tactiled
