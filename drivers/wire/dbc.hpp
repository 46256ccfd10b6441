// Reads the messages and signals of DBC files. Pure.
//
// BO_, SG_ with its multiplexer (M, m0) and SIG_VALTYPE_ are read. SG_MUL_VAL_ is read in order to refuse the
// messages that it changes. Everything else is skipped, including comments over several lines.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "drivers/wire/can_signal.hpp"

namespace tactiled {

struct DbcSignal {
    std::string name;
    CanSignal signal;
    bool selects = false;              // "M": its value says which multiplexed signals are in the message
    std::optional<std::uint32_t> mux;  // "m7": present if the selecting signal has this value
    std::uint32_t line = 0;

    bool operator==(const DbcSignal& other) const {  // regardless of the line
        return name == other.name && signal == other.signal && selects == other.selects && mux == other.mux;
    }
};

struct DbcMessage {
    std::string name;
    std::uint32_t id = 0;
    bool extended = false;  // 29 bits
    unsigned bytes = 0;
    std::vector<DbcSignal> signals;
    // line of an extended multiplexing ("m1M", SG_MUL_VAL_), which is not supported; 0: none
    std::uint32_t nested_mux_line = 0;
    std::uint32_t line = 0;

    [[nodiscard]] const DbcSignal* find(std::string_view signal) const;
    [[nodiscard]] const DbcSignal* selector() const;  // nullptr: not multiplexed

    bool operator==(const DbcMessage& other) const {
        return name == other.name && id == other.id && extended == other.extended && bytes == other.bytes &&
               signals == other.signals && (nested_mux_line != 0) == (other.nested_mux_line != 0);
    }
};

struct Dbc {
    std::vector<DbcMessage> messages;

    [[nodiscard]] const DbcMessage* find(std::string_view message) const;
};

inline constexpr std::size_t kDbcMaxBytes = 8u << 20;  // limit of a file; the file of a car has some MB

// Parses a file. Errors go to `problems` as file:line, at most 20; the result is then incomplete. setup: never throws
// for bad input
Dbc parse_dbc(std::string_view text, const std::string& file, Problems& problems);

}  // namespace tactiled
