// Judgements about requests, without I/O: who may read, who may change something.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tactiled::web {

struct Access {
    std::vector<std::string> host_names;  // names by which a browser may call this server, beside localhost and addresses
    std::string token;                    // "": no commands
};

// Header fields of a request; "" where it has none.
struct Fields {
    std::string_view host, origin, fetch_site, fetch_mode, authorization, content_type;
};

// An HTTP status and a sentence for the person who reads it; 0: the request may go on.
struct Refusal {
    int status = 0;
    std::string why;
};

// The name without its port; nullopt where it is no host and port.
std::optional<std::string> host_of(std::string_view host);
// Every request. The name in Host must be localhost, an address or of `host_names`: under another name the page of a
// stranger, whose name was bound to this machine (DNS rebinding), could read. Requests that a page of another origin makes
// are refused.
Refusal judge_read(const Access& access, const Fields& fields);
// A request that changes something: as judge_read(), and Origin must be this server's own, the token must be right, the body
// JSON.
Refusal judge_change(const Access& access, const Fields& fields);
// Compares in a time that does not depend on where the texts differ.
bool is_same_secret(std::string_view given, std::string_view right);

// A command of the page as words of the control socket, without the node's name: {"command": "tare", "sensor": "left"}.
struct Order {
    std::string words;
    std::string fault;  // or why there are none
};
Order order_of(std::string_view body, const std::vector<std::string>& sensors);

}  // namespace tactiled::web
