#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>

#include "drivers/driver.hpp"
#include "node/ctl/doctor/doctor.hpp"

namespace tactiled::ctl::doctor {
namespace {

std::vector<std::string> fields(const std::string& line, char separator) {
    std::vector<std::string> all;
    std::istringstream in(line);
    for (std::string one; std::getline(in, one, separator);) all.push_back(one);
    return all;
}

// A user in /etc/passwd and /etc/group: the daemon's user is a local one.
struct User {
    std::string name;
    long uid = -1;
    std::set<long> groups;
};

User find_user(const Machine& machine, const std::string& name) {
    User user{name, -1, {}};
    for (const auto& line : machine.lines("/etc/passwd"))
        if (const auto f = fields(line, ':'); f.size() > 3 && f[0] == name) {
            user.uid = std::atol(f[2].c_str());
            user.groups.insert(std::atol(f[3].c_str()));
        }
    for (const auto& line : machine.lines("/etc/group"))
        if (const auto f = fields(line, ':'); f.size() > 3)
            if (const auto members = fields(f[3], ','); std::find(members.begin(), members.end(), name) != members.end())
                user.groups.insert(std::atol(f[2].c_str()));
    return user;
}

std::string group_name(const Machine& machine, long gid) {
    for (const auto& line : machine.lines("/etc/group"))
        if (const auto f = fields(line, ':'); f.size() > 2 && std::atol(f[2].c_str()) == gid) return f[0];
    return fmt::format("{}", gid);
}

bool may_read_and_write(const User& user, const struct stat& file) {
    const unsigned bits = file.st_mode & 0777u;
    const unsigned own = user.uid == long(file.st_uid)             ? bits >> 6
                         : user.groups.contains(long(file.st_gid)) ? bits >> 3
                                                                   : bits;
    return user.uid == 0 || (own & 6u) == 6u;
}

void look_at_file(const Machine& machine, const std::string& link, const std::string& device, const User& user,
                  Findings& found) {
    struct stat file {};
    if (::stat(machine.path(device).c_str(), &file) != 0) {
        found.wrong("device", fmt::format("{}: {} is not there", link, device),
                    "plug it in; ls -l /dev/serial/by-id shows the ports that there are");
    } else if (!may_read_and_write(user, file)) {
        const std::string group = group_name(machine, file.st_gid);
        found.wrong("device",
                    fmt::format("{}: user {} may not open {} (group {}, mode {:o})", link, user.name, device, group,
                                file.st_mode & 0777u),
                    (file.st_mode & 060u) == 060u && group != "root"
                        ? fmt::format("adduser {} {}, then restart the daemon", user.name, group)
                        : "a udev rule that gives it to a group of the daemon's: systemd/60-tactiled.rules");
    } else {
        found.good("device", fmt::format("{}: {} is there, and user {} may open it", link, device, user.name));
    }
}

// Checks the time for which FTDI adapters, and adapters of the same kind, delay received bytes.
void look_at_latency_timer(const Machine& machine, const std::string& link, const std::string& device, Findings& found) {
    std::error_code none;
    const auto real = std::filesystem::canonical(machine.path(device), none).filename().string();
    const auto ms = machine.number("/sys/bus/usb-serial/devices/" + real + "/latency_timer");
    if (!ms) return;
    if (*ms <= 1)
        found.good("latency_timer", fmt::format("{}: {} delays bytes by at most {} ms", link, real, *ms));
    else
        found.wrong("latency_timer", fmt::format("{}: {} delays bytes by up to {} ms", link, real, *ms),
                    fmt::format("echo 1 > /sys/bus/usb-serial/devices/{}/latency_timer, or the package's udev rules", real));
}

void look_at_interface(const Machine& machine, const std::string& link, const Requirement& required, Findings& found) {
    const std::string &name = required.name, folder = "/sys/class/net/" + name;
    const auto flags = std::strtoul(machine.line(folder + "/flags").c_str(), nullptr, 16);
    if (!machine.has(folder))
        found.wrong("device", fmt::format("{}: there is no interface {}", link, name), "ip link shows those that there are");
    else if ((flags & 1u) == 0)  // IFF_UP
        found.wrong("device", fmt::format("{}: interface {} is down", link, name), required.bring_up);
    else
        found.good("device", fmt::format("{}: interface {} is up", link, name));
}

// Checks a limit of the kernel, such as net.core.rmem_max.
void look_at_socket_buffer(const Machine& machine, const std::string& link, const Requirement& required, Findings& found) {
    std::string file = required.name;
    std::replace(file.begin(), file.end(), '.', '/');
    const auto limit = machine.number("/proc/sys/" + file);
    if (!limit) return;
    if (*limit >= long(required.bytes))
        found.good("socket_buffer", fmt::format("{}: {} = {} holds 100 ms of frames", link, required.name, *limit));
    else
        found.advice(
            "socket_buffer",
            fmt::format("{}: {} = {} holds less than 100 ms of frames at 1 kHz, which need {}", link, required.name, *limit,
                        required.bytes),
            fmt::format("sysctl -w {0}={1}, and \"{0} = {1}\" in a file of /etc/sysctl.d", required.name, required.bytes));
}

}  // namespace

void look_at_devices(const Machine& machine, Config& config, const std::string& user_name, Findings& found) {
    const User user = find_user(machine, user_name);
    if (user.uid < 0) {
        found.wrong("user", fmt::format("there is no user {}", user_name),
                    "install the package, or name another with --user");
        return;
    }
    const auto look = [&](const std::string& what, const Requirement& required) {
        if (required.kind == Requirement::Kind::network_interface) return look_at_interface(machine, what, required, found);
        if (required.kind == Requirement::Kind::socket_buffer) return look_at_socket_buffer(machine, what, required, found);
        look_at_file(machine, what, required.name, user, found);
        if (required.kind == Requirement::Kind::serial_port) look_at_latency_timer(machine, what, required.name, found);
    };
    for (auto& link : config.links) {
        const DriverEntry* const driver = Drivers::find(link.driver);
        if (driver == nullptr || driver->requirements == nullptr) continue;
        for (const auto& required : driver->requirements(link.options))
            look(fmt::format("link \"{}\"", link.name), required);
    }
    using Kind = Requirement::Kind;
    if (!config.modbus.rtu.device.empty()) look("[modbus.rtu]", {Kind::serial_port, config.modbus.rtu.device});
    if (config.gpio && config.gpio->chip.starts_with("gpiochip"))
        look("[gpio]", {Kind::file, "/dev/" + config.gpio->chip});
    else if (config.gpio && config.gpio->chip.starts_with("/"))
        look("[gpio]", {Kind::file, config.gpio->chip});
}

void look_at_readers(const Machine& machine, const Config& config, Findings& found) {
    if (config.shm.group.empty()) return;
    for (const auto& line : machine.lines("/etc/group"))
        if (line.starts_with(config.shm.group + ":")) {
            found.good("shm_group", fmt::format("group {} of [shm] is there", config.shm.group));
            return;
        }
    found.wrong("shm_group", fmt::format("there is no group {} of [shm]", config.shm.group),
                fmt::format("addgroup --system {}", config.shm.group));
}

void look_at_port(const Machine& machine, const ModbusSettings& settings, bool daemon_runs, Findings& found) {
    const auto colon = settings.listen.rfind(':');
    if (colon == std::string::npos || daemon_runs) return;
    const unsigned long port = std::strtoul(settings.listen.c_str() + colon + 1, nullptr, 10);
    for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"})
        for (const auto& line : machine.lines(table)) {
            std::istringstream words(line);
            std::string number, local, remote, state;
            words >> number >> local >> remote >> state;
            const auto at = local.find(':');
            if (state != "0A" || at == local.npos || std::strtoul(local.c_str() + at + 1, nullptr, 16) != port)
                continue;  // LISTEN
            found.wrong("port", fmt::format("another program listens on port {} of [modbus] listen", port),
                        fmt::format("ss -ltnp 'sport = :{}' shows which", port));
            return;
        }
    found.good("port", fmt::format("port {} is free", port));
}

}  // namespace tactiled::ctl::doctor
