#include "node/modbus/command_clients.hpp"

#include <algorithm>
#include <utility>

namespace tactiled::modbus {

bool CommandClient::take_number() noexcept {
    if (!has_number) {
        has_number = true;
        taken = block;
        settle({TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_ADOPTED});
        return false;
    }
    if (block[4] != taken[4]) {
        taken = block;
        repeats = 0;
        return true;
    }
    ++repeats;
    if (outcome.result == TACTILED_COMMAND_ADOPTED) return false;
    if (block != taken)  // another command under the number of the last one
        settle({TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_REPEATED});
    else if (!outcome.is_running() && outcome_was_read)  // not before: a PLC may write its block in every cycle
        outcome.result = TACTILED_COMMAND_REPEATED;
    return false;
}

CommandClient* CommandClients::find(const HostAddress& host) noexcept {
    const auto found =
        std::find_if(clients_.begin(), clients_.end(), [&](const auto& c) { return c.wrote_ns != 0 && c.host == host; });
    return found != clients_.end() ? &*found : nullptr;
}

const CommandClient& CommandClients::at(const HostAddress& host) const noexcept {
    const CommandClient* const found = const_cast<CommandClients*>(this)->find(host);
    return found != nullptr ? *found : unknown_;
}

CommandClient& CommandClients::of_writer(const HostAddress& host, std::uint64_t now_ns) noexcept {
    CommandClient* client = find(host);
    if (client == nullptr) {
        const auto worth = [](const CommandClient& c) {
            return std::pair(c.outcome.is_running() || c.direct.is_running(), c.wrote_ns);
        };
        client = &*std::min_element(clients_.begin(), clients_.end(),
                                    [&](const auto& a, const auto& b) { return worth(a) < worth(b); });
        *client = unknown_;
        client->host = host;
    }
    client->wrote_ns = std::max<std::uint64_t>(now_ns, 1);
    return *client;
}

void CommandClients::note_read(const HostAddress& host) noexcept {
    CommandClient* const client = find(host);
    if (client != nullptr && !client->outcome.is_running()) client->outcome_was_read = true;
}

}  // namespace tactiled::modbus
