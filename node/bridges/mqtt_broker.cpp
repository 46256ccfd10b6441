#include "node/bridges/mqtt_broker.hpp"

#include <fmt/format.h>
#include <mosquitto.h>

#include <chrono>
#include <thread>

#include "config/options.hpp"

namespace tactiled::bridges::mqtt {
namespace {

constexpr int kKeepaliveS = 10;  // a broker that vanished is noticed after 15 s
constexpr unsigned kFirstRetryS = 1, kLastRetryS = 5;

void require(int result, const char* what) {
    if (result != MOSQ_ERR_SUCCESS) throw SetupError(fmt::format("{}: {}", what, mosquitto_strerror(result)));
}

}  // namespace

Broker::Broker(const BrokerOptions& options, const std::string& client_id, const std::string& will_topic,
               const std::string& will_text) {
    mosquitto_lib_init();
    client_ = mosquitto_new(client_id.c_str(), true, this);
    if (client_ == nullptr) throw SetupError("MQTT: the client could not be made");
    require(mosquitto_will_set(client_, will_topic.c_str(), int(will_text.size()), will_text.data(), 1, true), "last will");
    if (!options.user.empty())
        require(mosquitto_username_pw_set(client_, options.user.c_str(),
                                          options.password.empty() ? nullptr : options.password.c_str()),
                "--user");
    if (options.tls) {
        const auto text = [](const std::string& s) { return s.empty() ? nullptr : s.c_str(); };
        require(mosquitto_tls_set(client_, text(options.ca_file), options.ca_file.empty() ? "/etc/ssl/certs" : nullptr,
                                  text(options.certificate_file), text(options.key_file), nullptr),
                "--tls");
    }
    mosquitto_reconnect_delay_set(client_, kFirstRetryS, kLastRetryS, true);
    mosquitto_connect_callback_set(client_, [](mosquitto*, void* self, int code) {
        auto& broker = *static_cast<Broker*>(self);
        broker.set_state(code == 0 ? "connected" : fmt::format("refused: {}", mosquitto_connack_string(code)));
        if (code != 0) return;
        broker.waiting_.store(0, std::memory_order_relaxed);
        broker.connections_.fetch_add(1, std::memory_order_release);
        broker.connected_.store(true, std::memory_order_release);
    });
    mosquitto_disconnect_callback_set(client_, [](mosquitto*, void* self, int code) {
        auto& broker = *static_cast<Broker*>(self);
        broker.connected_.store(false, std::memory_order_release);
        const std::int64_t waiting = broker.waiting_.exchange(0, std::memory_order_relaxed);
        if (waiting > 0) broker.lost_.fetch_add(std::uint64_t(waiting), std::memory_order_relaxed);
        if (code != 0 && broker.state().rfind("refused", 0) != 0)
            broker.set_state(fmt::format("not connected: {}", mosquitto_strerror(code)));
    });
    mosquitto_publish_callback_set(client_, [](mosquitto*, void* self, int) {
        static_cast<Broker*>(self)->waiting_.fetch_sub(1, std::memory_order_relaxed);
    });
    const int port = options.port != 0 ? options.port : options.tls ? 8883 : 1883;
    const int result = mosquitto_connect_async(client_, options.host.c_str(), port, kKeepaliveS);
    if (result == MOSQ_ERR_INVAL) throw SetupError(fmt::format("--broker {}: not a host", options.host));
    require(mosquitto_loop_start(client_), "MQTT");
}

Broker::~Broker() {
    mosquitto_disconnect(client_);
    mosquitto_loop_stop(client_, true);
    mosquitto_destroy(client_);
    mosquitto_lib_cleanup();
}

void Broker::set_state(const std::string& text) {
    const std::lock_guard lock(mutex_);
    state_ = text;
}

std::string Broker::state() const {
    const std::lock_guard lock(mutex_);
    return state_;
}

bool Broker::publish(const std::string& topic, const std::string& text, bool retained) {
    if (!is_connected() || waiting_.load(std::memory_order_relaxed) >= kMaxWaiting) return false;
    waiting_.fetch_add(1, std::memory_order_relaxed);
    if (mosquitto_publish(client_, nullptr, topic.c_str(), int(text.size()), text.data(), 0, retained) == MOSQ_ERR_SUCCESS)
        return true;
    waiting_.fetch_sub(1, std::memory_order_relaxed);
    return false;
}

void Broker::close(const std::string& topic, const std::string& text) {
    publish(topic, text, true);
    for (int i = 0; i < 100 && is_connected() && waiting_.load(std::memory_order_relaxed) > 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

}  // namespace tactiled::bridges::mqtt
