// The control socket takes requests of local users: AF_UNIX, with one packet for a request and one for its answer. The mode
// of its file, 0660, decides who may connect.
//
//     request   NODE tare MASK | NODE untare MASK | NODE clear    MASK: bit n = sensor n, decimal or 0x...
//               NODE weigh start | NODE weigh stop | NODE weigh zero
//               NODE weigh KILOGRAMS | NODE weigh forget   the known mass on the jaws sets the scale; forgets the scale
//               NODE teach NAME       the weight on the jaws is one more grasp of that object
//               NODE load-objects     reads the file of taught objects again; nothing changes if the file has an error
//     answer    STATE RESULT          enum tactiled_command_state and _result, decimal; a tare answers when it has ended
//               STATE RESULT REASON   of a rejected teach or load-objects
//     request   NODE objects-file
//     answer    its path, "-" = no [grasp]
//     request   NODE config-file
//     answer    the path of the daemon's configuration, "-" = not known
//     request   NODE wake | NODE events
//     answer    "ok" with a descriptor (SCM_RIGHTS): the page of struct tactiled_wake, or one for epoll that counts
//               node records for as long as the connection stays open (tactiled_ask_descriptor() in tactiled/reader.h)
#pragma once
#include <sys/types.h>

#include <atomic>
#include <string>
#include <vector>

#include "drivers/descriptor.hpp"
#include "node/control_client.hpp"
#include "node/pipeline.hpp"
#include "node/realtime.hpp"
#include "node/shm/events.hpp"
#include "node/shm/lock_file.hpp"

namespace tactiled {

class ControlSocket {
public:
    // Replaces the socket of a dead daemon. A daemon that lives holds the lock PATH.lock, even if it is stopped and cannot
    // answer. setup: throws SetupError where `path` cannot be bound, or belongs to another daemon
    ControlSocket(const std::string& path, const std::string& group, const std::string& node_name,
                  const SegmentWriter& segment, const std::string& objects_path, CommandRing& commands,
                  std::string config_path = "");
    ~ControlSocket();
    ControlSocket(const ControlSocket&) = delete;
    ControlSocket& operator=(const ControlSocket&) = delete;

private:
    // Places of clients that have not sent their request. A client sends it at once, so that 64 programs that start together
    // do not wait for each other; all places cost 64 descriptors and one poll() of as many. With more silent clients, a
    // newcomer waits for kPatienceMs at most.
    static constexpr std::size_t kPlaces = 64;
    struct Silent {
        Descriptor client;
        std::uint64_t since_ns;
    };

    void serve() noexcept;
    [[nodiscard]] int room_in_ms() const noexcept;
    void accept() noexcept;
    void take(Descriptor client);
    void begin(Descriptor client, Command command);
    void teach(Descriptor client, const std::string& name);
    void load_objects(Descriptor client);
    void follow();
    void log_refused_tares();

    std::string path_;
    LockFile lock_;
    dev_t device_ = 0;  // with inode_: identifies the socket's file, so that the end removes no other one
    ino_t inode_ = 0;
    std::string node_name_;
    std::string objects_path_;           // "" = there is no [grasp]
    std::string config_path_;            // "" = unknown
    std::vector<TaughtObject> objects_;  // lent to the pipeline until it acknowledges objects_number_
    std::uint32_t objects_number_ = 0;
    const SegmentWriter& writer_;
    CommandRing& commands_;
    EventFanOut events_;
    std::uint32_t number_ = 0;
    Descriptor listener_;
    std::vector<Silent> silent_;  // in the order of their connections
    Descriptor asker_;            // client that waits for the running command, -1 = none
    std::uint64_t give_up_ns_ = 0;
    // acknowledged number of each commander's last refusal
    std::array<std::uint32_t, TACTILED_COMMANDERS> refusal_seen_{};
    std::uint64_t silent_until_ns_ = 0;  // for the log
    unsigned refused_tares_ = 0;
    Segment segment_;
    std::atomic<bool> stop_{false};
    RtThread thread_;
};

}  // namespace tactiled
