// The ring through which one commander sends its commands to the pipeline.
#pragma once
#include <cstddef>

#include "node/command.hpp"
#include "node/ring.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

class CommandRing : public Ring<Command> {
public:
    // `wake`: wakes the pipeline's thread; nullptr: the consumer polls the ring. setup
    explicit CommandRing(std::size_t capacity, WakeWord* wake = nullptr) : Ring(capacity), wake_(wake) {}

    // Publishes all pushed commands to the pipeline and wakes its thread. rt: one system call
    void commit() noexcept {
        Ring::commit();
        if (wake_ != nullptr) wake_->wake();
    }
    // Publishes one command. Returns false if there is no room: the pipeline hangs. rt: one system call
    [[nodiscard]] bool send(const Command& command) noexcept {
        Command* const slot = claim();
        if (slot == nullptr) return false;
        *slot = command;
        push();
        commit();
        return true;
    }

private:
    WakeWord* wake_;
};

}  // namespace tactiled
