// One connection to an MQTT broker, by libmosquitto, which has a thread for it. Connects again by itself.
#pragma once
#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>

struct mosquitto;

namespace tactiled::bridges::mqtt {

struct BrokerOptions {
    std::string host = "127.0.0.1", user, password, ca_file, certificate_file, key_file;
    int port = 0;  // 0: 1883, with TLS 8883
    bool tls = false;
};

class Broker {
public:
    // `will_topic` becomes `will_text`, retained, when this connection is lost. setup: throws SetupError
    Broker(const BrokerOptions& options, const std::string& client_id, const std::string& will_topic,
           const std::string& will_text);
    ~Broker();
    Broker(const Broker&) = delete;
    Broker& operator=(const Broker&) = delete;

    [[nodiscard]] bool is_connected() const { return connected_.load(std::memory_order_acquire); }
    // Counts connections: another number, and retained messages are due again.
    [[nodiscard]] std::uint32_t connections() const { return connections_.load(std::memory_order_acquire); }
    // For a person.
    [[nodiscard]] std::string state() const;
    // False: dropped, because there is no connection, or the broker takes nothing. Never blocks for the network.
    bool publish(const std::string& topic, const std::string& text, bool retained);
    // Messages that were handed over and lost with a connection, since the last call.
    std::uint64_t take_lost() { return lost_.exchange(0, std::memory_order_relaxed); }
    // Sends `text` as the last message of will_topic, and waits for at most a second.
    void close(const std::string& topic, const std::string& text);

private:
    void set_state(const std::string& text);

    // 2,000 messages of 0.4 kB: a broker that hangs must not fill the memory.
    static constexpr std::int64_t kMaxWaiting = 2000;
    mosquitto* client_ = nullptr;
    std::atomic<bool> connected_{false};
    std::atomic<std::uint32_t> connections_{0};
    std::atomic<std::int64_t> waiting_{0};
    std::atomic<std::uint64_t> lost_{0};
    mutable std::mutex mutex_;  // of state_
    std::string state_ = "not connected";
};

}  // namespace tactiled::bridges::mqtt
