// One connection to an MQTT broker, by libmosquitto, which has a thread for it. Connects again by itself. It speaks MQTT 5,
// and 3.1.1 with a broker that refuses 5.
#pragma once
#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

struct mosquitto;
struct mqtt5__property;

namespace tactiled::bridges::mqtt {

struct BrokerOptions {
    std::string host = "127.0.0.1", user, password, ca_file, certificate_file, key_file;
    int port = 0;  // 0: 1883, with TLS 8883
    bool tls = false;
};

// The time for which the broker keeps a message.
enum class Keep {
    kValue,   // for the subscribers of the moment; MQTT 5: a subscriber that is late gets it within `expiry_s`
    kState,   // retained with MQTT 5, for `expiry_s`; 3.1.1 has no expiry, so there it is not retained
    kForever  // retained: what never looks healthy, such as the end of the bridge and the names of topics
};

class Broker {
public:
    // `will_topic` becomes `will_text`, retained, when this connection is lost. setup: throws SetupError
    Broker(const BrokerOptions& options, const std::string& client_id, const std::string& will_topic,
           const std::string& will_text, std::uint32_t expiry_s);
    ~Broker();
    Broker(const Broker&) = delete;
    Broker& operator=(const Broker&) = delete;

    // Returns the number of the newest connection. Messages are sent over a connection only after this call, so that the
    // caller knows each connection before it sends.
    std::uint32_t connection() { return known_ = connections_.load(std::memory_order_acquire); }
    [[nodiscard]] bool is_connected() const {
        return connected_.load(std::memory_order_acquire) && connections_.load(std::memory_order_relaxed) == known_;
    }
    // For a person.
    [[nodiscard]] std::string state() const;
    // Changes to MQTT 3.1.1 where the broker has refused 5, and back to 5 where a connection of 3.1.1 has ended: another
    // broker may answer now. Call it in each round. True: it has changed to 3.1.1.
    bool choose_version();
    // False: dropped, because there is no connection, or the broker takes nothing. Never blocks for the network.
    bool publish(const std::string& topic, const std::string& text, Keep keep);
    // The newest message without the id of this client that came to will_topic since the last call, a retained one, too;
    // "": none.
    std::string take_heard();
    // Messages that were handed over and lost with a connection, since the last call.
    std::uint64_t take_lost() { return lost_.exchange(0, std::memory_order_relaxed); }
    // Sends `text` as the last message of will_topic, and waits for at most a second.
    void close(const std::string& topic, const std::string& text);

private:
    void set_state(const std::string& text);
    void set_callbacks();
    void on_connection(int code);
    void on_subscription();
    void begin();
    void begin_again(bool version_5);

    // 2,000 messages of 0.4 kB: a broker that hangs must not fill the memory.
    static constexpr std::int64_t kMaxWaiting = 2000;
    const BrokerOptions options_;
    mosquitto* client_ = nullptr;
    std::uint32_t expiry_s_;
    mqtt5__property* expiry_ = nullptr;  // the property of each message that is not kept for ever
    std::atomic<bool> version_5_{true}, refused_5_{false}, ended_3_1_1_{false};
    std::chrono::steady_clock::time_point chosen_;  // when a version was last changed to
    std::atomic<bool> connected_{false};
    std::atomic<std::uint32_t> connections_{0};
    std::atomic<std::int64_t> waiting_{0};
    std::atomic<std::uint64_t> lost_{0};
    std::uint32_t known_ = 0;  // the connection that the caller knows
    const std::string client_id_, will_topic_;
    mutable std::mutex mutex_;  // guards the following
    std::string state_ = "not connected", heard_;
};

}  // namespace tactiled::bridges::mqtt
