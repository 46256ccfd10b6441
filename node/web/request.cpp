#include "node/web/request.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>

#include "config/names.hpp"

namespace tactiled::web {
namespace {

std::string lower(std::string_view text) {
    std::string out(text);
    std::transform(out.begin(), out.end(), out.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return out;
}

bool is_port(std::string_view text) {
    return !text.empty() && text.size() <= 5 && text.find_first_not_of("0123456789") == text.npos;
}

bool is_address(const std::string& name) {
    in6_addr unused{};
    if (name.size() > 2 && name.front() == '[' && name.back() == ']')
        return ::inet_pton(AF_INET6, name.substr(1, name.size() - 2).c_str(), &unused) == 1;
    return ::inet_pton(AF_INET, name.c_str(), &unused) == 1;
}

}  // namespace

std::optional<std::string> host_of(std::string_view host) {
    std::string_view name = host, port;
    const std::size_t bracket = host.rfind(']');
    const std::size_t colon = host.find(':', bracket == host.npos ? 0 : bracket);
    if (colon != host.npos) {
        name = host.substr(0, colon);
        port = host.substr(colon + 1);
        if (!is_port(port)) return std::nullopt;
    }
    if (name.empty() || name.size() > 255) return std::nullopt;
    std::string out = lower(name);
    if (out.size() > 1 && out.back() == '.') out.pop_back();
    return out;
}

bool is_same_secret(std::string_view given, std::string_view right) {
    unsigned different = given.size() == right.size() ? 0 : 1;
    for (std::size_t i = 0; i < right.size(); ++i)
        different |=
            unsigned(static_cast<unsigned char>(right[i]) ^ static_cast<unsigned char>(i < given.size() ? given[i] : '\0'));
    return different == 0;
}

Refusal judge_read(const Access& access, const Fields& fields) {
    const auto name = host_of(fields.host);
    if (!name) return {400, "the field Host names no host"};
    const auto& names = access.host_names;
    if (*name != "localhost" && !is_address(*name) && std::find(names.begin(), names.end(), *name) == names.end())
        return {403, fmt::format("this server is not known as \"{}\": tactiled-web --host-name {} allows the name", *name,
                                 *name)};
    const bool own =
        lower(fields.origin) == "http://" + lower(fields.host) || lower(fields.origin) == "https://" + lower(fields.host);
    if (!fields.origin.empty() && !own) return {403, "a page of another origin may not ask this server"};
    // A link on another page may lead here; its scripts and frames may not.
    if ((fields.fetch_site == "cross-site" || fields.fetch_site == "same-site") && fields.fetch_mode != "navigate")
        return {403, "a page of another origin may not ask this server"};
    return {};
}

Refusal judge_change(const Access& access, const Fields& fields) {
    if (Refusal refusal = judge_read(access, fields); refusal.status != 0) return refusal;
    if (access.token.empty()) return {403, "commands are off: start tactiled-web with --token-file FILE"};
    if (fields.origin.empty()) return {403, "the field Origin is missing; a program sends -H 'Origin: http://HOST:PORT'"};
    if (!fields.fetch_site.empty() && fields.fetch_site != "same-origin")
        return {403, "a page of another origin may not ask this server"};
    constexpr std::string_view kBearer = "Bearer ";
    if (!fields.authorization.starts_with(kBearer) ||
        !is_same_secret(fields.authorization.substr(kBearer.size()), access.token))
        return {401, "the token is wrong or missing"};
    const std::string_view type = fields.content_type.substr(0, fields.content_type.find(';'));
    if (lower(type) != "application/json") return {415, "the body must be application/json"};
    return {};
}

Order order_of(std::string_view body, const std::vector<std::string>& sensors) {
    const auto wanted = nlohmann::json::parse(body, nullptr, false);
    if (!wanted.is_object())
        return {"", "the body must be a JSON object such as {\"command\": \"tare\", \"sensor\": \"all\"}"};
    const auto text = [&](const char* key) {
        const auto found = wanted.find(key);
        return found != wanted.end() && found->is_string() ? found->get<std::string>() : std::string();
    };
    for (const auto& [key, value] : wanted.items())
        if (key != "command" && key != "sensor" && key != "weigh" && key != "object")
            return {"", "the keys are command, sensor, weigh and object"};
    const std::string command = text("command");
    if (command == "clear") return {"clear", ""};
    if (command == "weigh") {
        const auto weigh = wanted.find("weigh");
        if (weigh != wanted.end() && weigh->is_number()) {
            const double mass_kg = weigh->get<double>();
            if (!(mass_kg > 0 && mass_kg < 1000)) return {"", "a known weight is a number of kg above 0 and below 1000"};
            return {fmt::format("weigh {}", mass_kg), ""};
        }
        const std::string what = text("weigh");
        if (what == "start" || what == "stop" || what == "zero") return {"weigh " + what, ""};
        return {"", "weigh is \"start\", \"stop\", \"zero\" or the known weight in kg"};
    }
    if (command == "teach") {
        if (!valid_name(text("object"))) return {"", fmt::format("object: {}", kValidName)};
        return {"teach " + text("object"), ""};
    }
    if (command != "tare" && command != "untare") return {"", "the commands are tare, untare, clear, weigh and teach"};
    const std::string sensor = text("sensor");
    std::uint32_t mask = 0;
    for (std::size_t i = 0; i < sensors.size(); ++i)
        if (sensor == "all" || sensor == sensors[i]) mask |= 1u << i;
    if (mask == 0) return {"", "sensor is a sensor's name or \"all\""};
    return {fmt::format("{} {}", command, mask), ""};
}

}  // namespace tactiled::web
