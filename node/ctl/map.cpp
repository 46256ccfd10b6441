// tactilectl map: the register map, from the table that the server uses, for users and spreadsheets: Markdown, CSV, JSON,
// manual page. The other files of its name have the text for a PLC.
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "node/ctl/command_line.hpp"
#include "node/ctl/map_text.hpp"
#include "node/ctl/verb.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

const char* type_text(Type type) {
    static constexpr const char* kTexts[] = {"u16", "i16", "bits", "mask", "enum", "count", "i32", "f32", "constant"};
    static_assert(std::size(kTexts) == std::size_t(Type::text) + 1);
    return kTexts[std::size_t(type)];
}

unsigned size_of(const Register& r) { return r.type == Type::i32 || r.type == Type::f32 ? 2 : 1; }
bool is_block(const Area& area) { return area.at != 0 && !area.registers.empty() && area.registers.front().at < area.at; }
unsigned address_of(const Area& area, const Register& r) { return is_block(area) ? area.at + r.at : r.at; }
// Returns an address in the notation of manuals: 3xxxx or 4xxxx, with six digits where five do not suffice.
unsigned number_of(unsigned kind, unsigned at) { return at < 9999 ? 10000 * kind + 1 + at : 100000 * kind + 1 + at; }

std::string access_of(const Register& r) {
    if (!r.is_writable()) return "r";
    return r.limits.locked ? "rw, locked" : "rw";
}

// Returns the arguments with which mbpoll shows the register at `address` in its type.
std::string mbpoll_of(const Area& area, const Register& r, unsigned at) {
    const char* const type = r.type == Type::f32                            ? "-t 4:float"
                             : r.type == Type::i32                          ? "-t 4:int"
                             : r.type == Type::bits || r.type == Type::mask ? "-t 4:hex"
                                                                            : "-t 4";
    const bool swap =
        size_of(r) == 2 && !area.low_word_first && r.name != "CONST_F32_CDAB";  // mbpoll's own order: low word first
    return fmt::format("mbpoll -m tcp -p 1502 -0 {}{} -r {} -1 127.0.0.1", type, swap ? " -B" : "", at);
}

std::string names_text(const Area& area, const Register& r, const char* separator) {
    std::string text;
    for (const Name& name : names_of(fmt::format("{}.{}", area.prefix, r.name)))
        text += fmt::format("{}{} {}", text.empty() ? "" : separator, name.value, name.name);
    return text;
}

std::string meaning_of(const Area& area, const Register& r, const char* separator) {
    const std::string names = names_text(area, r, separator);
    return fmt::format("{}{}{}", r.meaning, !r.meaning.empty() && !names.empty() ? ". " : "", names);
}

std::string range_of(const Register& r) {
    if (!r.is_writable() || (r.limits.min == 0 && r.limits.max == 65535)) return "";
    return fmt::format("{} .. {}{}", r.limits.min, r.limits.max,
                       r.limits.locked        ? ", or 65535 for the configured value"
                       : r.limits.may_be_none ? ", or 65535"
                                              : "");
}

constexpr const char* kRules[] = {
    "Addresses are those on the wire, from 0. The manuals of many PLCs add 30001 (FC 4) or 40001 (FC 3), and from "
    "9999 on 300001 or 400001: both are given.",
    "All registers can be read with FC 3 and FC 4, 5000 .. 5314 with FC 3 only. Addresses without a name read 0, in an area "
    "and between areas, so that one request may reach over several. Exception 2: a request that touches no area; a page or "
    "head of an array together with anything else; FC 4 that touches 5000 .. 5314.",
    "i16 is two's complement. Not available: i16 0x8000, u16 and enum 0xFFFF, i32 0x80000000, f32 a quiet NaN. Values "
    "outside the range saturate at +-32767 or 65534 and set a status bit.",
    "i32 and f32 have the high word first; the copies of the floats from 3000 and 7000 on have the low word first. No "
    "setting "
    "changes that.",
    "A request is answered from one frame: SEQ = SEQ_END. A client that needs two requests compares the SEQ of the first "
    "with that of the second.",
    "The taxels of an array: a read of its head (10000 .. with the token) latches a snapshot for this connection, "
    "replacing that of any sensor before. The pages then are all of that snapshot, and each begins with its token. A "
    "read within the head or a page returns exception 4 without a snapshot, 5 s after the latch, and once the sensor "
    "has no value; 2 for a page that the array lacks, or across two heads or pages.",
    "Any unit identifier is answered over TCP and repeated. RTU: the configured address; 0 writes without an answer.",
    "Writing needs commands = true in [modbus], and only 5000 .. 5314 and the coils can be written (FC 5, 6, 15, 16, 22, "
    "23). "
    "Exceptions: "
    "2 read-only, locked or not allowed; 3 a value out of range, or a mask that names no sensor; 4 not possible now; 6 a "
    "tare or a SAVE "
    "runs. With an exception nothing is written.",
    "FC 43 / 14 gives vendor, product, version and the node's name. FC 17 gives the server id 0x54, a run indicator that is "
    "0xFF while "
    "the pipeline runs, and the version. FC 8 returns query data.",
};

std::string title_of(const Area& area) {
    std::string title = fmt::format("{} .. {}: {}", area.at, area.at + area.size - 1, area.title);
    if (area.repeats != 0)
        title += fmt::format(": {} + {}n, n = 0 .. {}", area.at, area.repeats == 1 ? "" : fmt::format("{} ", area.repeats),
                             area.size / area.repeats - 1);
    return title;
}

std::string span_text(unsigned at, unsigned count) {
    return count > 1 ? fmt::format("{} .. {}", at, at + count - 1) : std::to_string(at);
}

std::string escaped(std::string text, char special) {
    for (std::size_t i = 0; (i = text.find(special, i)) != std::string::npos; i += 2) text.insert(i, 1, special);
    return text;
}

// Calls `each` with (title, run, whether it may be written) for coils and inputs.
template <class Each>
void each_bits(Each&& each) {
    for (const Bits& run : coils()) each("coil", run, true);
    for (const Bits& run : discrete_inputs()) each("discrete input", run, false);
}

std::string map_markdown() {
    std::string out =
        fmt::format("# tactiled register map {}.{}\n\nPrinted by `tactilectl map`, from the table that the server uses.\n\n",
                    kMapMajor, kMapMinor);
    for (const char* rule : kRules) out += fmt::format("* {}\n", rule);
    for (const Area& area : areas()) {
        out += fmt::format("\n## {}\n\n", title_of(area));
        if (area.low_word_first) {  // the same cells with the other word order
            out +=
                fmt::format("The registers are those from {} on, each f32 with its low word first.\n", area.at - kSwapped);
            continue;
        }
        if (area.block == Block::scratch)
            out += "These registers exist with `scratch = true`. They start at 0 and keep the written values.\n";
        if (!area.copies.empty()) out += "| + | first | copy of | there |\n|--|--|--|--|\n";
        for (const Copy& copy : area.copies)
            out += fmt::format("| {} | {} | {} | {} |\n", span_text(copy.at, copy.count), area.at + copy.at,
                               span_text(copy.from, copy.count), area_of(copy.from, 1)->title);
        if (area.registers.empty()) continue;
        if (!area.copies.empty()) out += "\n";
        const bool writable = area.block == Block::controls;
        out += writable ? "| address | 4xxxx | name | type | unit | access | range | meaning |\n|--|--|--|--|--|--|--|--|\n"
               : is_block(area) ? "| + | first | 3xxxx / 4xxxx | name | type | unit | meaning |\n|--|--|--|--|--|--|--|\n"
                                : "| address | 3xxxx / 4xxxx | name | type | unit | meaning |\n|--|--|--|--|--|--|\n";
        for (const Register& r : area.registers) {
            const unsigned at = address_of(area, r);
            const std::string meaning = meaning_of(area, r, " · ");
            if (writable) {
                out += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", at, number_of(4, at), r.name,
                                   type_text(r.type), r.unit.text, access_of(r), range_of(r), meaning);
                continue;
            }
            if (is_block(area)) out += fmt::format("| {} ", r.at);
            out += fmt::format("| {} | {} / {} | {} | {} | {} | {} |\n", at, number_of(3, at), number_of(4, at), r.name,
                               type_text(r.type), r.unit.text, meaning);
        }
    }
    out +=
        "\n## Coils (FC 1, 5, 15) and discrete inputs (FC 2)\n\n| | address | number | name | meaning |\n|--|--|--|--|--|\n";
    each_bits([&](const char* kind, const Bits& run, bool coil) {
        const std::string last = run.count > 1 ? fmt::format(" .. {}", run.at + run.count - 1) : "";
        out += fmt::format("| {} | {}{} | {} | {} | {} |\n", kind, run.at, last, (coil ? 1u : 10001u) + run.at, run.name,
                           run.meaning);
    });
    out += "\n## From a shell\n\n```\n";
    for (const Area& area : areas())
        for (const Register& r : area.registers)
            if (r.name == "HEARTBEAT" || (r.name == "FZ" && !area.is_holding_only()) || r.name == "CONST_U16")
                out += fmt::format("{:<70} # {} {}\n", mbpoll_of(area, r, address_of(area, r)), area.title, r.name);
    return out + "```\n";
}

std::string map_csv() {
    std::string out =
        "kind,address,number_3xxxx,number_4xxxx,registers,sensor,name,type,unit,access,least,most,meaning,mbpoll\n";
    const auto quoted = [](const std::string& text) { return '"' + escaped(text, '"') + '"'; };
    const auto add = [&](const Area& area, unsigned at, const std::string& sensor, std::string_view name, const Register& r,
                         const std::string& meaning) {
        const bool writable = r.is_writable();
        out += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", area.prefix, at,
                           area.is_holding_only() ? "" : std::to_string(number_of(3, at)), number_of(4, at), size_of(r),
                           sensor, name, type_text(r.type), r.unit.text, quoted(access_of(r)),
                           writable ? std::to_string(r.limits.min) : "", writable ? std::to_string(r.limits.max) : "",
                           quoted(meaning), quoted(mbpoll_of(area, r, at)));
    };
    for (const Area& area : areas()) {
        for (unsigned n = 0; n < (area.repeats != 0 ? area.size / area.repeats : 1u); ++n)
            for (const Register& plain : area.registers) {
                const unsigned at = address_of(area, plain) + n * area.repeats;
                add(area, at, area.repeats != 0 ? std::to_string(n) : "", plain.name, plain, meaning_of(area, plain, "; "));
            }
        for (const CopiedRegister& c : copied_registers(area))
            add(area, c.at, "", c.name, *c.row, meaning_of(*c.origin, *c.row, "; "));
    }
    each_bits([&](const char* kind, const Bits& run, bool coil) {
        for (unsigned i = 0; i < run.count; ++i)
            out += fmt::format("{},{},,,1,{},{},bit,,{},,,{},\"mbpoll -m tcp -p 1502 -0 -t {} -r {} -1 127.0.0.1\"\n", kind,
                               run.at + i, run.count > 1 ? std::to_string(i) : "", run.name, coil ? "rw" : "r",
                               quoted(std::string(run.meaning)), coil ? 0 : 1, run.at + i);
    });
    return out;
}

std::string map_json() {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    const auto add = [&](const Area& area, unsigned at, std::string_view name, const Register& r, const Area& origin) {
        nlohmann::ordered_json row{
            {"area", area.prefix},     {"address", at},          {"repeats_every", area.repeats},
            {"registers", size_of(r)}, {"name", name},           {"type", type_text(r.type)},
            {"unit", r.unit.text},     {"access", access_of(r)}, {"low_word_first", area.low_word_first}};
        if (r.is_writable()) row["least"] = r.limits.min, row["most"] = r.limits.max;
        row["meaning"] = r.meaning;
        for (const Name& one : names_of(fmt::format("{}.{}", origin.prefix, r.name)))
            row["values"][std::to_string(one.value)] = one.name;
        rows.push_back(std::move(row));
    };
    for (const Area& area : areas()) {
        for (const Register& r : area.registers) add(area, address_of(area, r), r.name, r, area);
        for (const CopiedRegister& c : copied_registers(area)) add(area, c.at, c.name, *c.row, *c.origin);
    }
    each_bits([&](const char* kind, const Bits& run, bool coil) {
        rows.push_back({{"area", kind},
                        {"address", run.at},
                        {"count", run.count},
                        {"name", run.name},
                        {"access", coil ? "rw" : "r"},
                        {"meaning", run.meaning}});
    });
    const nlohmann::ordered_json map{
        {"schema", 1}, {"map", fmt::format("{}.{}", kMapMajor, kMapMinor)}, {"rows", std::move(rows)}};
    return map.dump(2) + "\n";
}

std::string map_manual_page() {
    std::string out = fmt::format(
        ".TH TACTILED-REGISTERS 7 \"\" \"tactiled {}\" \"Register map {}.{}\"\n.SH NAME\ntactiled-registers \\- the "
        "Modbus register map of tactiled\n.SH DESCRIPTION\n",
        TACTILED_VERSION, kMapMajor, kMapMinor);
    // roff interprets a backslash, and a dot or an apostrophe at the start of a line
    const auto safe = [](const std::string& plain) {
        const std::string text = escaped(plain, '\\');
        return text.empty() || (text[0] != '.' && text[0] != '\'') ? text : "\\&" + text;
    };
    for (const char* rule : kRules) out += fmt::format(".IP \\(bu 2\n{}\n", safe(rule));
    for (const Area& area : areas()) {
        out += fmt::format(".SH \"{}\"\n", safe(title_of(area)));
        if (area.low_word_first)
            out +=
                fmt::format("The registers are those from {} on, each f32 with its low word first.\n", area.at - kSwapped);
        for (const Register& r : area.registers) {
            if (area.low_word_first) break;
            out += fmt::format(".TP 8\n{}{}\n.B {}\n{}", is_block(area) ? "+" : "", r.at, safe(std::string(r.name)),
                               type_text(r.type));
            if (!r.unit.text.empty()) out += fmt::format(", {}", r.unit.text);
            if (r.is_writable()) out += ", " + access_of(r);
            if (const std::string range = range_of(r); !range.empty()) out += ", " + range;
            const std::string meaning = meaning_of(area, r, "; ");
            out += meaning.empty() ? "\n" : fmt::format(". {}\n", safe(meaning));
        }
        for (const CopiedRegister& c : copied_registers(area))
            out += fmt::format(".TP 8\n+{}\n.B {}\nA copy of this register.\n", c.at - area.at, safe(c.name));
    }
    out += ".SH COILS AND DISCRETE INPUTS\n";
    each_bits([&](const char* kind, const Bits& run, bool) {
        out += fmt::format(".TP 8\n{} {}\n.B {}\n{}\n", kind, run.at, run.name, safe(std::string(run.meaning)));
    });
    return out + ".SH SEE ALSO\n.BR tactilectl (1)\n";
}

}  // namespace

Run add_map(Command verb) {
    struct Args {
        std::string format = "md";
        bool json = false;
        unsigned values = 1024;
    };
    auto args = std::make_shared<Args>();
    verb.add_option(
            "--format", args->format,
            "md: Markdown; csv: a row a register; st: IEC 61131-3 structured text, for CODESYS and TwinCAT; scl: the "
            "same for TIA Portal; man: manual page")
        .one_of({"md", "csv", "st", "scl", "man"})
        .show_default();
    verb.add_flag("--json", args->json, "the same rows as csv, as JSON");
    verb.add_option("--values", args->values, "st, scl: how many values of an array to join: taxels times components")
        .integer_in(1, TACTILED_MAX_TAXELS * 3)
        .show_default();
    return [args] {
        fmt::print("{}", args->json              ? map_json()
                         : args->format == "csv" ? map_csv()
                         : args->format == "st"  ? map_structured_text(args->values)
                         : args->format == "scl" ? scl_of(map_structured_text(args->values))
                         : args->format == "man" ? map_manual_page()
                                                 : map_markdown());
        return kGood;
    };
}

}  // namespace tactiled::ctl
