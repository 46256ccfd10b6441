// tactilectl identify LINK|DEVICE: recognises the format that a port sends, or that of a Modbus device's registers, and
// prints the [[link]] that reads it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "node/ctl/command_line.hpp"
#include "node/lab/identify_modbus.hpp"
#include "node/lab/listen.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string what, config = "/etc/tactiled/tactiled.toml", name;
    unsigned baud = 0;
    double seconds = 1.5;
    bool json = false;
    // Modbus alone
    std::string registers, parity = "even", type;
    std::optional<std::size_t> unit, function;
};

// Mean, extremes and scatter of a channel in the daemon's own decoder.
struct ChannelSeen {
    double sum = 0, squares = 0, min = 0, max = 0;
    std::size_t n = 0;
    void add(double value) {
        if (!std::isfinite(value)) return;
        min = n == 0 ? value : std::min(min, value);
        max = n == 0 ? value : std::max(max, value);
        if (n++ == 0) first = value;
        sum += value - first;  // relative to the first value, to keep a small scatter on a large number
        squares += (value - first) * (value - first);
    }
    [[nodiscard]] double mean() const { return first + sum / double(n); }
    [[nodiscard]] double sd() const {
        return n < 2 ? 0 : std::sqrt(std::max(0.0, (squares - sum * sum / double(n)) / double(n - 1)));
    }
    double first = 0;
};

// Decodes the bytes again with the recognised keys: the result is what the daemon would read.
std::vector<ChannelSeen> decode(const Heard& heard, std::size_t& frames) {
    Problems problems;
    Options options = Options::parse_text(heard.guess->keys, "the guessed keys", problems);
    LinkCounts counts;
    const auto decoder = StreamFormats::find(options.text("format"))->make(options, counts);
    problems.throw_if_any();
    std::vector<ChannelSeen> channels;
    Frame frame;
    for (std::size_t at = 0; at < heard.bytes.size(); at += StreamDecoder::kMaxBytes) {
        const std::size_t n = std::min(StreamDecoder::kMaxBytes, heard.bytes.size() - at);
        decoder->push({heard.bytes.data() + at, n}, 1);
        while (decoder->next(frame)) {
            ++frames;
            channels.resize(std::max<std::size_t>(channels.size(), frame.n_channels));
            for (std::size_t k = 0; k < frame.n_channels; ++k) channels[k].add(frame.channel[k]);
        }
    }
    return channels;
}

int identify(const Args& args) {
    catch_interrupt();
    const std::string port = device_of(args.what);
    std::optional<ModbusBlock> block;
    if (port.empty())
        block = modbus_device_of_link(args.config, args.what, args.unit);
    else if (!args.registers.empty())
        block = modbus_device_at(port, args.baud, args.parity);
    if (block) {
        if (!args.name.empty()) block->name = args.name;
        if (args.unit) block->unit = unsigned(*args.unit);
        if (args.function) block->function = unsigned(*args.function);
        if (!args.registers.empty()) set_registers(*block, args.registers);
        return identify_modbus(*block, args.seconds, args.type, args.json);
    }
    NamedDevice named{port, args.baud};
    if (port.empty()) named = device_of_link(args.config, args.what);
    if (args.baud != 0) named.baud = args.baud;
    const Heard heard = listen(named.device, named.baud, args.seconds);
    const std::string at = heard.network ? heard.device : fmt::format("{} at {} baud", heard.device, heard.baud);
    if (!heard.guess) {
        const std::string why =
            heard.bytes.empty() ? fmt::format("{}: nothing arrived in {:g} s{}", heard.device, args.seconds,
                                              heard.network ? "" : ": is the device powered, and does it send by itself?")
                                : fmt::format("{}: {} bytes in {:.1f} s, {}", at, heard.bytes.size(), heard.seconds,
                                              why_no_format(heard.bytes));
        if (args.json) fmt::print("{}\n", nlohmann::json{{"schema", 1}, {"recognised", false}, {"why", why}}.dump());
        fmt::print(stderr, "tactilectl: {}\n", why);
        return kUnhealthy;
    }
    std::size_t frames = 0;
    const auto channels = decode(heard, frames);
    const double rate_Hz = double(heard.guess->good + heard.guess->bad) / heard.seconds;
    const std::string name = !args.name.empty() ? args.name : !port.empty() ? "usb0" : args.what;
    const std::string link = link_text(name, heard.keys());
    if (args.json) {
        nlohmann::json json{{"schema", 1},
                            {"recognised", true},
                            {"device", heard.device},
                            {"baud", heard.baud},
                            {"channels", channels.size()},
                            {"rate_Hz", rate_Hz},
                            {"good", heard.guess->good},
                            {"bad", heard.guess->bad},
                            {"last_bad", heard.guess->last_bad},
                            {"notes", heard.guess->notes},
                            {"link", link}};
        fmt::print("{}\n", json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
        return kGood;
    }
    fmt::print("# {}: {} channels, {:.1f} frames a second, {} good, {} bad\n", at, channels.size(), rate_Hz,
               heard.guess->good, heard.guess->bad);
    if (!heard.guess->last_bad.empty()) fmt::print("# last bad one: {}\n", heard.guess->last_bad);
    for (std::size_t k = 0; k < channels.size(); ++k)
        fmt::print("# channel {:>2}: mean {:.6g}, sd {:.3g}, {:.6g} .. {:.6g}\n", k + 1, channels[k].mean(),
                   channels[k].sd(), channels[k].min, channels[k].max);
    for (const auto& note : heard.guess->notes) fmt::print("# {}\n", note);
    fmt::print("{}", link);
    return kGood;
}

}  // namespace

Run add_identify(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("port", args->what, "a serial port, ADDRESS:PORT, or a link of --config").required();
    verb.add_option("--config", args->config, "the configuration that has the link").show_default();
    verb.add_option("--name", args->name, "name of the printed [[link]]");
    verb.add_option("--baud", args->baud, "try this rate alone").integer_in(50, 12'000'000);
    verb.add_option(
        "--registers", args->registers,
        "FIRST..LAST: asks a Modbus device for registers of one type, and finds type, word order and first register");
    verb.add_option("--unit", args->unit, "Modbus address (1)").integer_in(0, 255);
    verb.add_option("--function", args->function, "3 or 4, by default the one that is answered").integer_in(3, 4);
    verb.add_option("--parity", args->parity, "of a Modbus line").one_of({"none", "odd", "even"}).show_default();
    verb.add_option("--type", args->type, "type of the registers, if the manual states it")
        .one_of({"int16", "uint16", "int32", "uint32", "float32"});
    verb.add_option("--seconds", args->seconds, "time to listen at each rate, or to read registers")
        .number_in(0.2, 600.0)
        .show_default();
    verb.add_flag("--json", args->json, "one JSON object");
    return [args] { return identify(*args); };
}

}  // namespace tactiled::ctl
