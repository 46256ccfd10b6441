// One sensor on one UDP port, for up to eight clients of RDT.
#pragma once
#include <sys/socket.h>

#include <string>
#include <vector>

#include "drivers/descriptor.hpp"
#include "node/bridges/bridge.hpp"
#include "node/bridges/rdt_packet.hpp"
#include "node/modbus/allow_list.hpp"

namespace tactiled::bridges::rdt {

struct StreamOptions {
    std::vector<std::string> allow;  // networks of clients; empty: the loopback
    Scale scale;
    double rate_Hz = 0;
    bool good_only = false, bias = false;
};

class Stream {
public:
    // `zero`: see values_of(). setup: throws SetupError where the address cannot be used
    Stream(const StreamOptions& options, std::string sensor, const std::string& listen, std::uint32_t zero);

    [[nodiscard]] int fd() const { return fd_; }
    [[nodiscard]] bool has_clients() const { return !clients_.empty(); }
    [[nodiscard]] const std::string& sensor() const { return sensor_; }

    // All requests that have come. rt: never blocks
    void receive();
    // Sends a sample to every client, unless it has no value. rt: never blocks
    void send(const tactiled_sample& sample, Counts& counts);

private:
    struct Client {
        sockaddr_storage address;
        std::uint32_t left;      // records to send; 0: until it stops
        std::uint32_t sequence;  // number of its next record
        Wrench bias;
        std::uint32_t bias_tare;  // tare_count at the bias, which another tare ends
        Pace pace;
        bool wants_bias;
    };

    void obey(const Request& request, const sockaddr_storage& from);
    void start(const Request& request, const sockaddr_storage& from);
    void make_place(const sockaddr_storage& from);
    bool send_to(Client& client, const tactiled_sample& sample, Wrench values, Counts& counts);
    void drop_gone();

    const StreamOptions& options_;
    std::string sensor_;
    std::uint32_t zero_;
    modbus::AllowList allow_;
    Descriptor fd_;
    bool bias_next_ = false, refused_bias_ = false;
    std::uint64_t lost_places_ = 0, logged_ns_ = 0;
    std::vector<Client> clients_;  // in the order of their last starts
};

}  // namespace tactiled::bridges::rdt
