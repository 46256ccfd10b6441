// [modbus] and [modbus.rtu]: the address of the server and its allowed clients.
#include <fmt/format.h>

#include "config/network_address.hpp"
#include "config/tables.hpp"

namespace tactiled {
namespace {

void check_networks(Options& table, const char* key, const std::vector<std::string>& networks) {
    for (const auto& network : networks)
        if (const auto fault = fault_of_network(network); !fault.empty())
            table.problem(key, fmt::format("{}: {}", key, fault));
}

void check_listen(Options& table, const ModbusSettings& modbus) {
    if (modbus.listen.empty()) return;
    const ListenAddress address = check_listen_address(modbus.listen);
    if (!address.fault.empty())
        table.problem("listen", address.fault);
    else if (!address.loopback && modbus.allow.empty() && modbus.plc.empty())
        table.problem("listen", fmt::format("listen = {} is open to other machines, and Modbus has no passwords: name the "
                                            "machines that may connect, for example allow = [\"192.168.0.10/32\"]",
                                            in_quotes(modbus.listen)));
}

}  // namespace

const Fields<ModbusSettings>& modbus_fields() {
    using S = ModbusSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, listen), "127.0.0.1:1502", Text::any,
         "ADDRESS:PORT of Modbus TCP, \"[::1]:1502\" for IPv6; \"\" = no Modbus TCP. Port 502 needs a capability."},
        {TACTILED_KEY(S, allow), "[]", Count{},
         "Networks that may connect, as \"192.168.0.10/32\". Required where `listen` is not the loopback and `plc` is "
         "empty."},
        {TACTILED_KEY(S, plc), "[]", Count{},
         "Addresses, as \"192.168.0.10\", that may connect and always find a place, 4 connections each."},
        {TACTILED_KEY(S, max_clients), 8, range(1, 64), "",
         "Clients at a time, in addition to those of `plc`. A newcomer takes the place of a client that has never asked, of "
         "one whose host holds two places more, or of one that is silent for 5 s."},
        {TACTILED_KEY(S, max_requests_per_s), 2000, range(0, 1'000'000), "1/s",
         "Requests of a client; 0 = no limit. Faster requests wait, and none is lost."},
        {TACTILED_KEY(S, commands), false,
         "If true, commands, settings and hints (5000 .. 5091, 5300 .. 5314, coils) may be written."},
        {TACTILED_KEY(S, command_allow), "[], all that may connect", Count{},
         "Networks that may write, as \"192.168.0.10/32\". Needs commands = true."},
        {TACTILED_KEY(S, hints_expire_ms), 2000, range(0, 60'000), "ms",
         "Without a heartbeat and without a new hint of the PLC for longer, its gravity, acceleration and gripper state are "
         "not known; 0 = never, else at least 10. The start value of PLC_WATCHDOG."},
        {TACTILED_KEY(S, scratch), false, "If true, there are 128 free registers at 5100, to try a client."},
        {TACTILED_KEY(S, settings), "/var/lib/tactiled/NAME.settings.toml", Text::full_path,
         "File in which the register SAVE stores."},
    };
    return fields;
}

const Fields<RtuSettings>& rtu_fields() {
    using S = RtuSettings;
    static const Fields<S> fields = {
        {TACTILED_KEY(S, device), "", Text::any, "A tty, such as \"/dev/serial/by-id/usb-FTDI_...\"; \"\" = no Modbus RTU."},
        {TACTILED_KEY(S, baud), 19'200, range(300, 4'000'000), "bit/s", "Rate of the line."},
        {TACTILED_KEY(S, parity), "even", Choices{"none", "odd", "even"}, "With \"none\" there are two stop bits."},
        {TACTILED_KEY(S, address), 1, range(1, 247), "", "Address of this server on the line."},
        {TACTILED_KEY(S, silence_us), 0, range(0, 50'000), "us",
         "Silence between a request and its answer; 0 = 3.5 characters. The pieces of a request may be 1750 us apart, or so "
         "long: set more where a USB adapter makes larger gaps."},
        {TACTILED_KEY(S, rs485), false,
         "If true, the driver of the kernel switches the direction (TIOCSRS485). Most USB adapters switch it themselves."},
    };
    return fields;
}

ModbusSettings read_modbus(Options table, const std::string& node_name) {
    ModbusSettings modbus{};
    read_fields(modbus_fields(), table, modbus, node_name);
    Options rtu = table.table("rtu");
    read_fields(rtu_fields(), rtu, modbus.rtu);
    check_networks(table, "allow", modbus.allow);
    check_networks(table, "command_allow", modbus.command_allow);
    for (const auto& address : modbus.plc)
        if (!fault_of_network(address + (address.find(':') == std::string::npos ? "/32" : "/128")).empty())
            table.problem("plc",
                          fmt::format("plc has {}; each is one address, such as \"192.168.0.10\"", in_quotes(address)));
    if (!modbus.command_allow.empty() && !modbus.commands)
        table.problem("command_allow", "command_allow has no effect without commands = true");
    if (modbus.hints_expire_ms > 0 && modbus.hints_expire_ms < 10)
        table.problem("hints_expire_ms",
                      fmt::format("hints_expire_ms = {} is outside 10 .. 60000; 0 = never", modbus.hints_expire_ms));
    check_listen(table, modbus);
    return modbus;
}

}  // namespace tactiled
