// DBC files, as far as a sensor needs them: messages and signals. Pure.
//
// Read are BO_, SG_ with its multiplexer (M, m0), SIG_VALTYPE_ and, to refuse what it changes, SG_MUL_VAL_. All else is
// skipped, comments over several lines too.
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
    std::optional<std::uint32_t> mux;  // "m7": is there when the one that selects has this value
    std::uint32_t line = 0;

    bool operator==(const DbcSignal& other) const {  // wherever it stood
        return name == other.name && signal == other.signal && selects == other.selects && mux == other.mux;
    }
};

struct DbcMessage {
    std::string name;
    std::uint32_t id = 0;
    bool extended = false;  // 29 bits
    unsigned bytes = 0;
    std::vector<DbcSignal> signals;
    std::uint32_t nested_mux_line = 0;  // extended multiplexing ("m1M", SG_MUL_VAL_) is not understood; 0: has none
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

inline constexpr std::size_t kDbcMaxBytes = 8u << 20;  // of a file; a car's has some MB

// Errors go to `problems` as file:line, at most 20. The result is then incomplete. setup: never throws for bad input
Dbc parse_dbc(std::string_view text, const std::string& file, Problems& problems);

}  // namespace tactiled
