#include "drivers/can_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "drivers/wire/dbc.hpp"
#include "drivers/wire/isotp.hpp"

namespace tactiled {
namespace {

constexpr double kWindowWithCounter_ms = 20;  // batches of USB adapters were up to 10 ms late

// A signal that the configuration requests, defined in place or in a DBC file.
struct Wanted {
    std::string name;
    std::uint32_t id = 0;
    std::size_t bytes = 0;  // length of the message
    CanSignal signal;
    bool multiplexed = false;
    CanSignal selector;
    std::uint64_t selected = 0;
};

struct Sequence {
    std::optional<std::uint32_t> id;  // the message with the signal; no value: all messages of the device have it
    CanSignal signal;
};

constexpr Range kStarts{0, 8 * double(IsoTp::kMaxBytes) - 1}, kLengths{1, 64}, kFinite{-1e300, 1e300};

CanSignal read_place(Options& table) {
    CanSignal signal;
    signal.start = unsigned(table.integer("start", kStarts));
    signal.length = unsigned(table.integer("length", kLengths));
    if (table.one_of("order", {"intel", "motorola"}) == "motorola") signal.order = CanSignal::Order::motorola;
    return signal;
}

std::uint32_t read_id(Options& table, std::string_view key, bool extended) {
    const auto id = std::uint32_t(table.integer(key, {0, extended ? double(0x1FFF'FFFF) : double(0x7FF)}));
    return extended ? id | kCanExtended : id;
}

std::vector<Wanted> read_signals(Options& device, std::optional<Sequence>& sequence) {
    const bool extended = device.flag("extended", false);
    const std::uint32_t id = read_id(device, "id", extended);
    const auto max = double(device.has("isotp_reply_id") ? IsoTp::kMaxBytes : kCanMaxBytes);
    const auto bytes = std::size_t(device.integer("bytes", {1, max}, 8));
    std::optional<CanSignal> selector;
    if (device.has("selector")) {
        Options table = device.table("selector");
        selector = read_place(table);
        if (const auto why = why_no_signal(*selector, bytes); !why.empty()) table.problem("start", why);
    }
    std::vector<Wanted> all;
    for (auto& table : device.tables("signals", kMaxChannels)) {
        Wanted wanted;
        wanted.name = table.text("name", "");
        wanted.id = table.has("id") ? read_id(table, "id", extended) : id;
        wanted.bytes = bytes;
        wanted.signal = read_place(table);
        const std::string type = table.one_of("type", {"signed", "unsigned", "float"});
        wanted.signal.type = type == "signed"  ? CanSignal::Type::is_signed
                             : type == "float" ? CanSignal::Type::is_float
                                               : CanSignal::Type::is_unsigned;
        wanted.signal.factor = table.number("factor", kFinite, 1);
        wanted.signal.offset = table.number("offset", kFinite, 0);
        if (const auto why = why_no_signal(wanted.signal, bytes); !why.empty()) table.problem("start", why);
        if (table.has("mux")) {
            wanted.multiplexed = true;
            wanted.selected = std::uint64_t(table.integer("mux", {0, double(UINT32_MAX)}));
            wanted.selector = selector.value_or(CanSignal{});
            if (!selector)
                table.problem("mux", "mux needs the device's key selector = {start, length, order}, whose value it is");
        }
        all.push_back(wanted);
    }
    if (!device.has("signals")) device.problem("signals", "key \"signals\" is missing: [{name = \"Fx\", start = 0, ...}]");
    if (device.has("sequence")) {
        Options table = device.table("sequence");
        sequence = Sequence{};
        if (table.has("id")) sequence->id = read_id(table, "id", extended);
        sequence->signal = read_place(table);
        if (const auto why = why_no_signal(sequence->signal, bytes); !why.empty()) table.problem("start", why);
    }
    return all;
}

template <class Items>
std::string known_names(const Items& items, std::string_view name) {
    std::vector<std::string> names;
    for (const auto& item : items) names.push_back(item.name);
    if (const auto near = nearest_name(name, names)) return fmt::format("did you mean \"{}\"?", *near);
    return names.empty() ? "it has none" : fmt::format("it has {} of them, \"{}\" first", names.size(), names.front());
}

// Finds the signal `name` of `message`. Returns nullopt and reports an error if that is not possible.
std::optional<Wanted> find_signal(Options& device, std::string_view key, const std::string& path, const DbcMessage& message,
                                  std::string_view name) {
    const auto refuse = [&](const std::string& why) {
        device.problem(key, why);
        return std::nullopt;
    };
    const DbcSignal* const found = message.find(name);
    if (found == nullptr)
        return refuse(fmt::format("{}:{}: message {} has no signal {}; {}", path, message.line, in_quotes(message.name),
                                  in_quotes(name), known_names(message.signals, name)));
    if (message.bytes > kCanMaxBytes)
        return refuse(fmt::format("{}:{}: message {} has {} bytes; a CAN message has at most {}", path, message.line,
                                  in_quotes(message.name), message.bytes, kCanMaxBytes));
    if (message.nested_mux_line != 0 && found->mux)
        return refuse(
            fmt::format("{}:{}: message {} is multiplexed in several stages or by ranges, which is not understood; "
                        "its signals without m can be used",
                        path, message.nested_mux_line, in_quotes(message.name)));
    Wanted wanted;
    wanted.name = fmt::format("{}.{}", message.name, name);
    wanted.id = message.extended ? message.id | kCanExtended : message.id;
    wanted.bytes = message.bytes;
    wanted.signal = found->signal;
    if (found->mux) {
        wanted.multiplexed = true;
        wanted.selector = message.selector()->signal;
        wanted.selected = *found->mux;
    }
    return wanted;
}

// Finds "Msg.Signal" of the file. Returns nullopt and reports an error if there is none.
std::optional<Wanted> find_in_dbc(Options& device, std::string_view key, const std::string& path, const Dbc& dbc,
                                  const std::string& name) {
    const std::size_t dot = name.find('.');
    if (dot == name.npos) {
        device.problem(key, fmt::format("{} should be \"MESSAGE.SIGNAL\"", in_quotes(name)));
        return std::nullopt;
    }
    const std::string message = name.substr(0, dot);
    if (const DbcMessage* const found = dbc.find(message))
        return find_signal(device, key, path, *found, std::string_view(name).substr(dot + 1));
    device.problem(key,
                   fmt::format("{} has no message {}; {}", path, in_quotes(message), known_names(dbc.messages, message)));
    return std::nullopt;
}

class DbcFiles {
public:
    // Returns the device's DBC file, which is read once; nullptr with errors if it is not valid.
    const Dbc* get(Options& device, std::string& path) {
        const auto file = device.text_file("dbc", kDbcMaxBytes);
        if (!file) return nullptr;
        path = file->path;
        const auto known = files_.find(path);
        if (known != files_.end()) return &known->second;
        Problems found;
        Dbc dbc = parse_dbc(file->text, path, found);
        for (const auto& line : found.lines()) device.problem("dbc", line);
        if (!found.empty()) return nullptr;
        return &files_.emplace(path, std::move(dbc)).first->second;
    }

private:
    std::map<std::string, Dbc> files_;
};

std::vector<Wanted> read_signals_of_dbc(Options& device, DbcFiles& files, std::map<std::uint32_t, Sequence>& sequences) {
    const auto names = device.texts("signals", {1, kMaxChannels});
    const std::string sequence = device.text("sequence", "");
    if (!device.has("signals")) device.problem("signals", "key \"signals\" is missing: [\"MESSAGE.SIGNAL\", ...]");
    std::string path;
    const Dbc* const dbc = files.get(device, path);
    std::vector<Wanted> all;
    if (dbc == nullptr) return all;
    for (const auto& name : names)
        if (auto wanted = find_in_dbc(device, "signals", path, *dbc, name)) all.push_back(std::move(*wanted));
    if (sequence.empty()) return all;
    std::vector<std::string> places{sequence};
    if (sequence.find('.') == sequence.npos) {  // a signal of that name in every message
        places.clear();
        for (const auto& wanted : all) places.push_back(wanted.name.substr(0, wanted.name.find('.') + 1) + sequence);
    }
    for (const auto& place : places) {
        const auto found = find_in_dbc(device, "sequence", path, *dbc, place);
        if (!found) continue;
        if (found->multiplexed)
            device.problem("sequence", fmt::format("{} is multiplexed; a counter is in every message", in_quotes(place)));
        sequences[found->id] = {found->id, found->signal};
    }
    return all;
}

// Groups signals by message. A signal that is in each message of a multiplexed id is read from the first of these messages
// that is used, so that a sample has the signal once.
std::vector<CanPart> parts_of(const std::vector<Wanted>& all) {
    std::vector<CanPart> parts;
    for (std::size_t n = 0; n < all.size(); ++n) {
        const Wanted* place = &all[n];
        if (!place->multiplexed)
            for (const auto& other : all)
                if (other.id == place->id && other.multiplexed) {
                    place = &other;
                    break;
                }
        auto part = std::find_if(parts.begin(), parts.end(), [&](const CanPart& p) {
            return p.id == place->id && p.multiplexed == place->multiplexed && p.selected == place->selected;
        });
        if (part == parts.end()) {
            CanPart added;
            added.id = place->id;
            added.multiplexed = place->multiplexed;
            added.selector = place->selector;
            added.selected = place->selected;
            if (added.multiplexed) added.bytes = bytes_needed(added.selector);
            part = parts.insert(parts.end(), std::move(added));
        }
        part->channels.push_back({std::uint8_t(n), all[n].signal});
        part->bytes = std::max(part->bytes, bytes_needed(all[n].signal));
    }
    return parts;
}

void add_sequence(Options& device, CanDevice& plan, const Sequence& sequence) {
    if (sequence.signal.length < 2 || sequence.signal.length > 32 ||
        sequence.signal.type != CanSignal::Type::is_unsigned) {  // one bit cannot distinguish a gap from a repetition
        device.problem("sequence", "a sequence counter is unsigned and has 2 .. 32 bits");
        return;
    }
    bool found = false;
    for (auto& part : plan.parts) {
        if (sequence.id && *sequence.id != part.id) continue;
        part.sequence = sequence.signal;
        part.bytes = std::max(part.bytes, bytes_needed(sequence.signal));
        found = true;
    }
    if (!found) device.problem("sequence", "sequence is in a message that none of the signals is in");
}

// Reads a sample that comes as one message of several frames. The signals are places in the whole message.
void read_transport(Options& device, const CanDevice& read, CanPlan& plan) {
    const bool extended = device.flag("extended", false);
    const std::uint32_t reply_id = read_id(device, "isotp_reply_id", extended);
    if (device.has("dbc")) return device.problem("isotp_reply_id", "isotp_reply_id is for signals in place, without dbc");
    for (const auto& part : read.parts)
        if (part.id != read.parts.front().id)
            return device.problem("isotp_reply_id", "with isotp_reply_id all signals are in the device's own message");
    plan.transports.push_back({read.parts.front().id, reply_id});
}

void read_window(Options& device, CanDevice& plan) {
    constexpr Range kWindows{0.1, 1000};
    const bool by_counter = plan.is_assembled_by_counter();
    if (plan.parts.size() > 1) {
        if (!by_counter && !device.has("window_ms"))
            device.problem("window_ms",
                           fmt::format("the sample comes in {} messages and no counter is in all of them: give "
                                       "window_ms, shorter than half the time between two samples, or a sequence",
                                       plan.parts.size()));
        plan.window_ns = std::uint64_t(device.number("window_ms", kWindows, kWindowWithCounter_ms) * 1e6);
    } else if (device.has("window_ms")) {
        (void)device.number("window_ms", kWindows);
        device.problem("window_ms", "window_ms has no meaning where the sample is one message; leave it out");
    }
    std::vector<unsigned> widths;
    for (const auto& part : plan.parts)
        if (part.sequence) widths.push_back(part.sequence->length);
    if (!widths.empty() && widths != std::vector<unsigned>(widths.size(), widths.front()))
        device.problem("sequence", "the counters of the messages have different numbers of bits");
}

}  // namespace

CanPlan read_can_plan(Options& link) {
    CanPlan plan;
    DbcFiles files;
    std::map<unsigned, bool> seen;
    for (auto& table : link.tables("device", kCanMaxDevices)) {
        CanDevice device;
        device.device = std::uint16_t(table.integer("device", {0, 65535}));
        if (!seen.emplace(device.device, true).second)
            table.problem("device", fmt::format("device = {} is there already; give each its own number", device.device));
        std::optional<Sequence> sequence;
        std::map<std::uint32_t, Sequence> sequences;  // by id
        const auto signals = table.has("dbc") ? read_signals_of_dbc(table, files, sequences) : read_signals(table, sequence);
        if (signals.empty()) continue;  // an error is reported already
        device.n_channels = std::uint8_t(signals.size());
        device.parts = parts_of(signals);
        if (sequence) add_sequence(table, device, *sequence);
        for (const auto& [id, each] : sequences) add_sequence(table, device, each);
        read_window(table, device);
        const bool has_transport = table.has("isotp_reply_id");
        if (has_transport) read_transport(table, device, plan);
        for (const auto& signal : signals) {
            if (!has_transport) plan.max_bytes = std::max(plan.max_bytes, signal.bytes);
            if (std::find(plan.ids.begin(), plan.ids.end(), signal.id) == plan.ids.end()) plan.ids.push_back(signal.id);
        }
        plan.devices.push_back(std::move(device));
    }
    if (!link.has("device"))
        link.problem("device", "there is no [[link.device]]; add one with the messages of the channels");
    if (plan.ids.size() > kCanMaxIds)
        link.problem("device", fmt::format("{} different ids; the kernel filters at most {}", plan.ids.size(), kCanMaxIds));
    return plan;
}

}  // namespace tactiled
