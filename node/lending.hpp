// Lends an object of one thread to another one, which uses it for a while, repeatedly. One owner, one borrower.
#pragma once
#include <atomic>
#include <cstdint>

#include "node/wake_word.hpp"

namespace tactiled {

class Lending {
public:
    // ---- owner ----

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
    // Woken when the object is returned.
    [[nodiscard]] WakeWord& returned() noexcept { return returned_; }

    // ---- borrower ----

    // Returns true if the object is lent; it is then the borrower's until end(). rt: wait-free
    [[nodiscard]] bool begin() noexcept {
        State expected = State::lent;
        return state_.compare_exchange_strong(expected, State::used, std::memory_order_acquire, std::memory_order_relaxed);
    }
    // `keep`: the borrower may begin() again; else the object is returned. rt: wait-free, but one system call where
    // it is returned
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
