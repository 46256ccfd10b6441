// The client side of the control socket, for programs that do not link the daemon. control.hpp lists the requests.
#pragma once
#include <sys/un.h>

#include <string>

namespace tactiled {

sockaddr_un address_of(const std::string& path);
// True if `fd` can be read within `timeout_ms`.
bool wait_readable(int fd, int timeout_ms);

// Sends one request to the socket at `path`. Returns "" with `why` set if there is no answer within `timeout_ms`.
std::string ask_daemon(const std::string& path, const std::string& request, int timeout_ms, std::string& why);

}  // namespace tactiled
