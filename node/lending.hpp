// Lends an object of one thread to another thread, which may use the object repeatedly. One owner, one borrower.
#pragma once
#include <atomic>
#include <cstdint>

#include "node/wake_word.hpp"

namespace tactiled {

class Lending {
public:
    // Lends the object to the borrower until is_returned() or take_back(). rt: wait-free
    void lend() noexcept { state_.store(State::lent, std::memory_order_release); }  // pairs with begin()
    // rt: wait-free
    [[nodiscard]] bool is_returned() const noexcept {
        return state_.load(std::memory_order_acquire) == State::owned;  // pairs with end()
    }
    // Returns false if the borrower is using the object or has returned it. rt: wait-free
    [[nodiscard]] bool take_back() noexcept {
        State expected = State::lent;
        return state_.compare_exchange_strong(expected, State::owned, std::memory_order_acquire,  // pairs with end()
                                              std::memory_order_relaxed);
    }
    // The word on which the owner sleeps; end() wakes it when the object is returned.
    [[nodiscard]] WakeWord& returned() noexcept { return returned_; }

    // Returns true if the object is lent; the borrower may then use the object until end(). rt: wait-free
    [[nodiscard]] bool begin() noexcept {
        State expected = State::lent;
        return state_.compare_exchange_strong(expected, State::used, std::memory_order_acquire, std::memory_order_relaxed);
    }
    // `keep`: the borrower may begin() again; otherwise the object is returned. rt: wait-free, plus one system call if the
    // object is returned
    void end(bool keep) noexcept {
        state_.store(keep ? State::lent : State::owned, std::memory_order_release);
        if (!keep) returned_.wake();
    }

private:
    enum class State : std::uint32_t { owned, lent, used };
    std::atomic<State> state_{State::owned};
    WakeWord returned_;
};

}  // namespace tactiled
