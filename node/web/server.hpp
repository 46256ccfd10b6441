// HTTP, by libmicrohttpd in the thread of the caller: no connection has a thread, so that slow clients delay no other
// client.
#pragma once
#include <microhttpd.h>

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "node/web/commander.hpp"
#include "node/web/request.hpp"

namespace tactiled::web {

struct Limits {
    unsigned connections = 1800;  // fewer where the process may open fewer files
    unsigned streams = 16;        // pages that are open at once
    unsigned request_s = 10;      // for a request to be complete
    unsigned silent_s = 10;       // a client that takes nothing for so long is closed
};

// Content of the server, made when it is asked for; called in the server's thread alone.
struct Content {
    std::function<std::string()> greeting;  // for a page that has just been opened
    // The newest revision of the time-line; changes() appends those after `revision`.
    std::function<std::uint64_t()> revision;
    std::function<void(std::uint64_t revision, std::string& out)> changes;
    std::function<std::string()> status, events, metrics;
    std::function<std::vector<std::string>()> sensors;
    std::function<std::string()> control, node;  // path of the control socket; name in requests
    // Index of the sensor with taxels of that name, or -1; its newest array, and the places of its taxels.
    std::function<int(const std::string& sensor)> find_array;
    std::function<std::string(std::uint32_t sensor)> array, places;
};

class Server {
public:
    // Takes over `listener`, a bound socket. setup: throws SetupError where the library refuses
    Server(int listener, Access access, Content content, const Limits& limits = {});
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    // For poll(): readable when run() has work; ms until run() must be called at the latest, -1 = never.
    [[nodiscard]] std::vector<int> descriptors() const;
    [[nodiscard]] int timeout_ms() const;
    // All work that there is. Never blocks.
    void run();
    // Gives `frame` to every page. A page that has not taken the one before gets only the newest.
    void publish(std::shared_ptr<const std::string> frame);
    // Begins a tick: each text of Content is made anew when it is next asked for, and then serves all until the next tick.
    void begin_tick() { ++tick_; }
    // Greets every page anew: names have changed.
    void greet_again();
    // Closes connections whose request is not complete in time. Call it once a second.
    void sweep();
    [[nodiscard]] std::size_t streams() const { return streams_.size(); }

private:
    struct Connection;
    struct Stream;
    // Closes the oldest connections where few places are left.
    void make_room();
    struct Exchange;
    static MHD_Result on_request(void* self, MHD_Connection* connection, const char* url, const char* method,
                                 const char* version, const char* data, std::size_t* size, void** exchange);
    static void on_completed(void* self, MHD_Connection* connection, void** exchange, MHD_RequestTerminationCode why);
    static void on_connection(void* self, MHD_Connection* connection, void** of_socket, MHD_ConnectionNotificationCode code);
    static ssize_t read_stream(void* stream, std::uint64_t position, char* to, std::size_t size);
    static void end_stream(void* stream);

    MHD_Result answer(MHD_Connection* connection, const std::string& path, const std::string& method, Exchange& exchange);
    MHD_Result send_array(MHD_Connection* connection, const std::string& path,
                          const std::function<std::string(std::uint32_t sensor)>& make);
    MHD_Result send_made(MHD_Connection* connection, const std::string& path, const std::function<std::string()>& make,
                         const char* type);
    // Streams whose client is still there. One that has left keeps its entry until the next frame cannot be sent.
    std::size_t count_open_streams() const;
    MHD_Result open_stream(MHD_Connection* connection);
    MHD_Result command(MHD_Connection* connection, Exchange& exchange);
    MHD_Result answer_command(MHD_Connection* connection, const Exchange& exchange);

    Access access_;
    Content content_;
    Limits limits_;
    struct EventFd {
        int fd;
        ~EventFd();
    };
    EventFd done_;  // outlives the thread that writes it
    Commander commander_;
    std::list<Stream> streams_;
    std::map<int, Connection*> connections_;
    std::map<std::uint64_t, Exchange*> waiting_;  // for the daemon's answer, by the number of the command
    std::uint64_t next_command_ = 1;
    bool closing_ = false;
    struct Made {
        std::uint64_t tick = 0;
        std::shared_ptr<MHD_Response> response;
    };
    std::map<std::string, Made> made_;  // by path, and for arrays the sensor's index
    std::uint64_t tick_ = 1, greeting_tick_ = 0;
    std::shared_ptr<const std::string> greeting_;
    std::shared_ptr<const std::string> frame_;
    std::uint64_t frame_number_ = 0;
    MHD_Daemon* daemon_ = nullptr;
};

}  // namespace tactiled::web
