#include "node/lab/identify_modbus.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "config/text_file.hpp"
#include "drivers/driver.hpp"
#include "drivers/modbus_device.hpp"
#include "node/ctl/verb.hpp"
#include "node/lab/listen.hpp"
#include "node/lab/register_judge.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kMaxRegisters = kMaxChannels - 2;  // one register is read before and one after them, each a channel
constexpr int kTimeoutMs = 300;                          // a slow gateway
constexpr std::size_t kShown = 6;                        // interpretations, so that the best ones fit on a screen

// Below half of what a line carries: 8 bytes for a request, 5 and the registers for an answer, 3.5 ms of silence.
double rate_Hz(const ModbusBlock& block, std::size_t count) {
    if (block.baud == 0) return 50;
    return std::clamp(0.5 / (double(13 + 2 * count) * 11 / block.baud + 0.0035), 0.5, 50.0);
}

// Reads registers with the daemon's driver, as channels of 16 bits, until there are `max_rows` rows, `seconds` have passed
// since the first one, or three requests had no good answer before it.
RegisterRows read_rows(const ModbusBlock& block, std::uint16_t first, std::size_t count, double seconds,
                       std::size_t max_rows) {
    std::vector<std::string> registers;
    for (std::size_t i = 0; i < count; ++i)
        registers.push_back(fmt::format("{{name = \"r{0}\", at = {0}, type = \"uint16\"}}", first + i));
    const std::string keys = fmt::format(
        "driver = \"modbus\"\n{}timeout_ms = {}\n[[slave]]\nunit = {}\nfunction = {}\nrate_Hz = {}\nregisters = [{}]\n",
        block.wire, kTimeoutMs, block.unit, block.function, rate_Hz(block, count), fmt::join(registers, ", "));
    Problems problems;
    Options options = Options::parse_text(keys, "the device", problems);
    const auto driver = Drivers::find(options.text("driver"))->make(options);
    problems.throw_if_any();
    if (const std::string why = driver->open(); !why.empty()) throw std::runtime_error(why);
    RegisterRows answers{first, {}};
    Frame frame;
    std::uint64_t until_ns = 0;
    while (interrupted == 0 && answers.rows.size() < max_rows && (until_ns == 0 || monotonic_ns() < until_ns)) {
        const Status status = driver->read(frame, 20);
        const LinkCounts& counts = driver->counts;
        const auto failed =
            counts[TACTILED_LINK_BUS_ERROR] + counts[TACTILED_LINK_BAD_LENGTH] + counts[TACTILED_LINK_BAD_CHECKSUM];
        if (status == Status::disconnected || (answers.rows.empty() && failed >= 3)) break;
        if (status != Status::frame) continue;
        if (until_ns == 0) until_ns = monotonic_ns() + std::uint64_t(seconds * 1e9);
        auto& row = answers.rows.emplace_back();
        for (std::size_t i = 0; i < count; ++i) row.push_back(std::uint16_t(frame.channel[i]));
    }
    driver->close();
    return answers;
}

// Finds the function, if it is not given, and the number of registers that the device answers for: some refuse a large
// block, or registers that do not exist. Sets the first register and the number of the answer with those beside the block.
void find_answered(ModbusBlock& block, std::uint16_t& first, std::size_t& count) {
    const auto answers = [&](std::uint16_t from, std::size_t n) { return !read_rows(block, from, n, 1, 1).rows.empty(); };
    const std::size_t asked = block.count;
    for (const unsigned function : block.function != 0 ? std::vector{block.function} : std::vector{3u, 4u}) {
        block.function = function;
        block.count = asked;
        while (block.count > 1 && !answers(block.at, block.count)) block.count /= 2;
        if (block.count == 1 && !answers(block.at, 1)) continue;
        first = block.at;
        count = block.count;
        if (first > 0 && answers(std::uint16_t(first - 1), count + 1)) --first, ++count;
        if (first + count <= 65535 && answers(first, count + 1)) ++count;
        return;
    }
    throw std::runtime_error(
        fmt::format("unit {} gives no registers from {} on: the manual's unit, registers (some manuals count from 1 or "
                    "40001), --baud and --parity, or --function",
                    block.unit, block.at));
}

std::string link_of(const ModbusBlock& block, const Interpretation& one) {
    std::vector<std::string> registers;
    const std::size_t words = words_of(one.type);
    for (std::size_t k = 0; k < one.numbers.size(); ++k)
        registers.push_back(
            fmt::format("    {{name = \"c{}\", at = {}, type = \"{}\"}},\n", k + 1, one.at + k * words, name_of(one.type)));
    return link_text(
        block.name,
        fmt::format("driver = \"modbus\"\n{}\n[[link.slave]]\nunit = {}\nfunction = {}\n{}"
                    "registers = [\n{}]\n",
                    block.wire, block.unit, block.function,
                    words == 1 ? "" : fmt::format("word_order = \"{}\"\n", one.low_word_first ? "low_first" : "high_first"),
                    fmt::join(registers, "")));
}

std::string why_unclear(const std::vector<Interpretation>& ranked, std::size_t changes) {
    if (ranked.empty()) return "the registers hold no number of this type";
    const Interpretation& best = ranked.front();
    if (is_clear(ranked))
        return fmt::format(
            "the registers are {}, which driver \"modbus\" does not read: choose another format at the device", best.text());
    const auto like_best = equals(ranked);
    if (like_best.size() == 1 && !best.plausible)
        return "no interpretation gives usual magnitudes and steady numbers: read registers of one type alone";
    std::vector<std::string> names;
    for (const std::size_t i : like_best)
        if (names.size() < 4) names.push_back(ranked[i].text());
    return fmt::format(
        "{} different answers leave {} interpretations: {}{}; press the sensor in both directions meanwhile "
        "(--seconds 10), or give --type, or the first register, by the manual",
        changes, like_best.size(), fmt::join(names, "; "), names.size() < like_best.size() ? "; ..." : "");
}

// Returns the extremes of each channel.
std::string ranges(const Interpretation& one) {
    std::vector<std::string> parts;
    for (const auto& numbers : one.numbers) {
        const auto [low, high] = std::minmax_element(numbers.begin(), numbers.end());
        parts.push_back(*low == *high ? fmt::format("{:.6g}", *low) : fmt::format("{:.6g} .. {:.6g}", *low, *high));
    }
    return fmt::format("{}", fmt::join(parts, ", "));
}

nlohmann::json to_json(const std::vector<Interpretation>& ranked) {
    auto list = nlohmann::json::array();
    for (const auto& one : ranked)
        list.push_back({{"type", name_of(one.type)},
                        {"word_order", one.low_word_first ? "low_first" : "high_first"},
                        {"bytes_swapped", one.low_byte_first},
                        {"at", one.at},
                        {"bits", one.bits},
                        {"plausible", one.plausible},
                        {"channels", ranges(one)}});
    return list;
}

}  // namespace

void set_registers(ModbusBlock& block, const std::string& range) {
    unsigned first = 0, last = 0;
    const char* const end = range.data() + range.size();
    auto [at, error] = std::from_chars(range.data(), end, first);
    bool is_range = error == std::errc() && end - at > 2 && at[0] == '.' && at[1] == '.';
    if (is_range) {
        const auto [rest, fault] = std::from_chars(at + 2, end, last);
        is_range = fault == std::errc() && rest == end;
    }
    if (!is_range || last < first || last > 65535 || last - first >= kMaxRegisters)
        throw SetupError(fmt::format("--registers {}: first and last register, at most {} up to 65535, such as 100..105",
                                     in_quotes(range), kMaxRegisters));
    block.at = std::uint16_t(first);
    block.count = last - first + 1;
}

ModbusBlock modbus_device_at(const std::string& where, unsigned baud, const std::string& parity) {
    ModbusBlock block{.name = "modbus0", .wire = {}};
    if (where.find('/') == where.npos) {
        block.wire = fmt::format("address = {}\n", toml_text(where));
        return block;
    }
    block.baud = baud != 0 ? baud : 19200;
    const std::string path = std::filesystem::absolute(where).lexically_normal().string();
    block.wire = fmt::format("device = {}\nbaud = {}\nparity = \"{}\"\n", toml_text(path), block.baud, parity);
    return block;
}

std::optional<ModbusBlock> modbus_device_of_link(const std::string& config, const std::string& link,
                                                 std::optional<std::size_t> unit) {
    Problems problems;
    Options root = Options::parse_file(config, problems);
    for (Options& table : root.tables("link")) {
        if (table.text("name", "") != link || !table.has("slave")) continue;
        const bool is_tcp = table.has("address");
        ModbusBlock block =
            modbus_device_at(table.text(is_tcp ? "address" : "device"),
                             unsigned(table.integer("baud", {300, 4'000'000}, 19200)), table.text("parity", "even"));
        if (table.flag("rs485", false)) block.wire += "rs485 = true\n";
        block.name = link;
        for (Options& slave : table.tables("slave")) {
            const ModbusDevice device = read_modbus_device(slave, is_tcp ? ModbusWire::tcp : ModbusWire::rtu);
            if (device.set.channel.empty() || (unit && device.unit != *unit)) continue;
            std::size_t first = 65535, end = 0;
            for (const RegisterValue& value : device.set.channel) {
                first = std::min<std::size_t>(first, value.at);
                end = std::max<std::size_t>(end, value.at + words_of(value.type));
            }
            block.unit = device.unit;
            block.function = device.function;
            block.at = std::uint16_t(first);
            block.count = std::min(end - first, kMaxRegisters);
            break;
        }
        problems.throw_if_any();
        return block;
    }
    return std::nullopt;
}

int identify_modbus(ModbusBlock block, double seconds, const std::string& type, bool json) {
    if (block.count == 0) throw SetupError("--registers FIRST..LAST are needed: those of the forces in the device's manual");
    std::uint16_t first = 0;
    std::size_t count = 0;
    find_answered(block, first, count);
    const RegisterRows answers = read_rows(block, first, count, seconds, SIZE_MAX);
    if (answers.rows.empty()) throw std::runtime_error("the device stopped answering");
    auto ranked = judge_registers(answers, block.at, block.count);
    if (!type.empty()) std::erase_if(ranked, [&](const Interpretation& one) { return name_of(one.type) != type; });
    const std::size_t changes = ranked.empty() ? 0 : ranked.front().numbers.front().size();
    const bool recognised = is_clear(ranked) && ranked.front().is_readable();
    const std::string link = recognised ? link_of(block, ranked.front()) : "";
    const std::string why = recognised ? "" : why_unclear(ranked, changes);
    if (json) {
        fmt::print("{}\n", nlohmann::json{{"schema", 1},
                                          {"recognised", recognised},
                                          {"why", why},
                                          {"answers", answers.rows.size()},
                                          {"different_answers", changes},
                                          {"interpretations", to_json(ranked)},
                                          {"link", link}}
                               .dump());
    } else {
        fmt::print("# unit {}, function {}, registers {} .. {}: {} answers, {} different ones\n", block.unit, block.function,
                   first, first + count - 1, answers.rows.size(), changes);
        for (std::size_t i = 0; i < std::min(kShown, ranked.size()); ++i)
            fmt::print("# {}. {}{}: {}\n", i + 1, ranked[i].text(),
                       i == 0 ? "" : fmt::format(" (2^{:.0f} times less likely)", ranked[i].bits - ranked[0].bits),
                       ranges(ranked[i]));
        fmt::print("{}", link);
    }
    if (!recognised) fmt::print(stderr, "tactilectl: {}\n", why);
    return recognised ? kGood : kUnhealthy;
}

}  // namespace tactiled::ctl
