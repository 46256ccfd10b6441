#include "node/web/commander.hpp"

#include <unistd.h>

#include <utility>

#include "node/control_client.hpp"

namespace tactiled::web {
namespace {

constexpr int kAnswerMs = 16'000;  // the daemon itself gives up after 15 s

}  // namespace

Commander::Commander(int done_fd) : done_fd_(done_fd), thread_([this] { work(); }) {}

Commander::~Commander() {
    {
        const std::lock_guard guard(mutex_);
        stop_ = true;
    }
    wake_.notify_one();
    thread_.join();
}

bool Commander::begin(Command command) {
    const std::lock_guard guard(mutex_);
    if (waiting_.size() >= kMaxWaiting) return false;
    waiting_.push_back(std::move(command));
    wake_.notify_one();
    return true;
}

std::vector<Command> Commander::take_done() {
    const std::lock_guard guard(mutex_);
    return std::exchange(done_, {});
}

bool Commander::is_busy() {
    const std::lock_guard guard(mutex_);
    return running_ || !waiting_.empty();
}

void Commander::work() {
    std::unique_lock lock(mutex_);
    for (;;) {
        wake_.wait(lock, [this] { return stop_ || !waiting_.empty(); });
        if (stop_) return;
        Command command = std::move(waiting_.front());
        waiting_.pop_front();
        running_ = true;
        lock.unlock();
        if (command.socket.empty())
            command.why = "the daemon runs without a control socket; its log has the reason";
        else
            command.answer = ask_daemon(command.socket, command.request, kAnswerMs, command.why);
        lock.lock();
        running_ = false;
        done_.push_back(std::move(command));
        const std::uint64_t one = 1;
        [[maybe_unused]] const auto written = ::write(done_fd_, &one, sizeof one);
    }
}

}  // namespace tactiled::web
