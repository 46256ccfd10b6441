// Sends commands to the daemon, one after the other, in a thread of its own: a tare answers only after it was measured.
#pragma once
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace tactiled::web {

struct Command {
    std::uint64_t id = 0;
    std::string socket, request;  // path of the control socket; "NODE tare 1"
    std::string answer;           // answer of the daemon: "STATE RESULT"; "" with `why`
    std::string why;
};

class Commander {
public:
    static constexpr std::size_t kMaxWaiting = 8;

    // `done_fd`: an eventfd that is written when a command has ended.
    explicit Commander(int done_fd);
    // Waits for the command that runs, at most as long as a tare may take.
    ~Commander();
    Commander(const Commander&) = delete;
    Commander& operator=(const Commander&) = delete;

    // False where too many wait already.
    bool begin(Command command);
    // Returns the commands that have ended since the last call.
    std::vector<Command> take_done();
    [[nodiscard]] bool is_busy();

private:
    void work();

    int done_fd_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<Command> waiting_;
    std::vector<Command> done_;
    bool running_ = false, stop_ = false;
    std::thread thread_;
};

}  // namespace tactiled::web
