// Serves one page by HTTP, by libmicrohttpd, in the caller's thread.
#pragma once
#include <microhttpd.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "node/modbus/allow_list.hpp"

namespace tactiled::bridges::rdt {

class Page {
public:
    // `xml` makes /netftapi2.xml for each request. `allow`: networks of clients; empty: the loopback.
    // setup: throws SetupError where `listen` ("ADDRESS:PORT") cannot be used
    Page(const std::string& listen, const std::vector<std::string>& allow, std::function<std::string()> xml);
    ~Page();
    Page(const Page&) = delete;
    Page& operator=(const Page&) = delete;

    // Answers what has come. rt: never blocks
    void answer();

private:
    static void on_connection(void* self, MHD_Connection* connection, void** context, MHD_ConnectionNotificationCode code);

    modbus::AllowList allow_;
    std::function<std::string()> xml_;
    std::vector<std::pair<int, std::uint64_t>> opened_;  // descriptor of each connection, and when it was opened
    MHD_Daemon* daemon_ = nullptr;
};

}  // namespace tactiled::bridges::rdt
