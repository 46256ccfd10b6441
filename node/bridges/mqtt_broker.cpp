#include "node/bridges/mqtt_broker.hpp"

#include <fmt/format.h>
#include <mosquitto.h>
#include <mqtt_protocol.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <chrono>
#include <string_view>
#include <thread>
#include <utility>

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
               const std::string& will_text, std::uint32_t expiry_s)
    : options_(options), expiry_s_(expiry_s), client_id_(client_id), will_topic_(will_topic) {
    mosquitto_lib_init();
    client_ = mosquitto_new(client_id.c_str(), true, this);
    if (client_ == nullptr) throw SetupError("MQTT: the client could not be made");
    require(mosquitto_int_option(client_, MOSQ_OPT_PROTOCOL_VERSION, MQTT_PROTOCOL_V5), "MQTT 5");
    require(mosquitto_property_add_int32(&expiry_, MQTT_PROP_MESSAGE_EXPIRY_INTERVAL, expiry_s), "MQTT 5");
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
    set_callbacks();
    begin();
}

Broker::~Broker() {
    mosquitto_disconnect(client_);
    mosquitto_loop_stop(client_, true);
    mosquitto_destroy(client_);
    mosquitto_property_free_all(&expiry_);
    mosquitto_lib_cleanup();
}

void Broker::set_callbacks() {
    mosquitto_connect_v5_callback_set(client_, [](mosquitto*, void* self, int code, int, const mosquitto_property*) {
        static_cast<Broker*>(self)->on_connection(code);
    });
    mosquitto_disconnect_callback_set(client_, [](mosquitto*, void* self, int code) {
        auto& broker = *static_cast<Broker*>(self);
        const bool connected = broker.connected_.exchange(false, std::memory_order_acq_rel);
        if (connected && code != 0 && !broker.version_5_.load(std::memory_order_relaxed))
            broker.ended_3_1_1_.store(true, std::memory_order_release);
        const std::int64_t waiting = broker.waiting_.exchange(0, std::memory_order_relaxed);
        if (waiting > 0) broker.lost_.fetch_add(std::uint64_t(waiting), std::memory_order_relaxed);
        if (code != 0 && broker.state().rfind("refused", 0) != 0)
            broker.set_state(fmt::format("not connected: {}", mosquitto_strerror(code)));
    });
    mosquitto_message_callback_set(client_, [](mosquitto*, void* self, const mosquitto_message* message) {
        auto& broker = *static_cast<Broker*>(self);
        const std::string_view text(static_cast<const char*>(message->payload), std::size_t(message->payloadlen));
        if (text.empty() || text.find(broker.client_id_) != text.npos) return;  // 3.1.1 sends a client its own messages
        const std::lock_guard lock(broker.mutex_);
        broker.heard_ = text;
    });
    mosquitto_subscribe_callback_set(
        client_, [](mosquitto*, void* self, int, int, const int*) { static_cast<Broker*>(self)->on_subscription(); });
    mosquitto_publish_callback_set(client_, [](mosquitto*, void* self, int) {
        static_cast<Broker*>(self)->waiting_.fetch_sub(1, std::memory_order_relaxed);
    });
}

void Broker::on_connection(int code) {
    const bool version_5 = version_5_.load(std::memory_order_relaxed);
    if (code == 0) {
        // Data that the broker does not acknowledge for this time are never sent: a message expires 2 s after it has come.
        const unsigned unacknowledged_ms = expiry_s_ * 1000;
        ::setsockopt(mosquitto_socket(client_), IPPROTO_TCP, TCP_USER_TIMEOUT, &unacknowledged_ms, sizeof unacknowledged_ms);
        if (version_5)
            mosquitto_subscribe_v5(client_, nullptr, will_topic_.c_str(), 0, MQTT_SUB_OPT_NO_LOCAL, nullptr);
        else
            mosquitto_subscribe(client_, nullptr, will_topic_.c_str(), 0);
        return;
    }
    // 1: the answer of a broker of 3.1.1, in its own form.
    if (version_5 && (code == MQTT_RC_UNSUPPORTED_PROTOCOL_VERSION || code == CONNACK_REFUSED_PROTOCOL_VERSION)) {
        set_state("refused: the broker does not speak MQTT 5");
        refused_5_.store(true, std::memory_order_release);
        return;
    }
    set_state(fmt::format("refused: {}", version_5 ? mosquitto_reason_string(code) : mosquitto_connack_string(code)));
}

// The connection begins for the caller when the broker sends it the messages of others.
void Broker::on_subscription() {
    set_state(version_5_.load(std::memory_order_relaxed) ? "connected" : "connected by MQTT 3.1.1: no state is retained");
    waiting_.store(0, std::memory_order_relaxed);
    connections_.fetch_add(1, std::memory_order_release);
    connected_.store(true, std::memory_order_release);
}

void Broker::begin() {
    const int port = options_.port != 0 ? options_.port : options_.tls ? 8883 : 1883;
    const int result = mosquitto_connect_async(client_, options_.host.c_str(), port, kKeepaliveS);
    if (result == MOSQ_ERR_INVAL) throw SetupError(fmt::format("--broker {}: not a host", options_.host));
    require(mosquitto_loop_start(client_), "MQTT");
}

void Broker::begin_again(bool version_5) {
    mosquitto_disconnect(client_);
    mosquitto_loop_stop(client_, false);
    version_5_.store(version_5, std::memory_order_relaxed);
    require(mosquitto_int_option(client_, MOSQ_OPT_PROTOCOL_VERSION, version_5 ? MQTT_PROTOCOL_V5 : MQTT_PROTOCOL_V311),
            "version of MQTT");
    chosen_ = std::chrono::steady_clock::now();
    begin();
}

bool Broker::choose_version() {
    if (refused_5_.exchange(false, std::memory_order_acquire)) {
        begin_again(false);
        return true;
    }
    // A broker that refuses 5 and drops connections of 3.1.1 is asked no more often than one that is away.
    if (ended_3_1_1_.load(std::memory_order_acquire) && !connected_.load(std::memory_order_acquire) &&
        std::chrono::steady_clock::now() - chosen_ >= std::chrono::seconds(kFirstRetryS)) {
        ended_3_1_1_.store(false, std::memory_order_relaxed);
        begin_again(true);
    }
    return false;
}

void Broker::set_state(const std::string& text) {
    const std::lock_guard lock(mutex_);
    state_ = text;
}

std::string Broker::state() const {
    const std::lock_guard lock(mutex_);
    return state_;
}

std::string Broker::take_heard() {
    const std::lock_guard lock(mutex_);
    return std::exchange(heard_, {});
}

bool Broker::publish(const std::string& topic, const std::string& text, Keep keep) {
    if (!is_connected() || waiting_.load(std::memory_order_relaxed) >= kMaxWaiting) return false;
    const bool version_5 = version_5_.load(std::memory_order_relaxed);
    const bool retained = keep == Keep::kForever || (keep == Keep::kState && version_5);
    const mosquitto_property* const expiry = version_5 && keep != Keep::kForever ? expiry_ : nullptr;
    waiting_.fetch_add(1, std::memory_order_relaxed);
    if (mosquitto_publish_v5(client_, nullptr, topic.c_str(), int(text.size()), text.data(), 0, retained, expiry) ==
        MOSQ_ERR_SUCCESS)
        return true;
    waiting_.fetch_sub(1, std::memory_order_relaxed);
    return false;
}

void Broker::close(const std::string& topic, const std::string& text) {
    publish(topic, text, Keep::kForever);
    for (int i = 0; i < 100 && is_connected() && waiting_.load(std::memory_order_relaxed) > 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

}  // namespace tactiled::bridges::mqtt
