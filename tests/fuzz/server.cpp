// Bytes of several Modbus TCP clients, in any pieces, with time that passes and clients that take their answers late.
// Oracle, against a model that cuts each client's whole stream at leisure: a client gets the answers to its own requests, in
// order, each once, and all of them, unless it asked one by one until its socket was full; where its stream stops being
// Modbus, those before that; no call answers more than it may.
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "node/modbus/connection.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::modbus;
using fuzz::check;
using fuzz::Input;

using Bytes = std::vector<std::uint8_t>;

// An answer that names its request, as long as a real one can be.
std::size_t answer(std::span<const std::uint8_t> adu, std::span<std::uint8_t, kMaxAdu> out) {
    std::uint8_t sum = 0;
    for (const std::uint8_t byte : adu) sum = std::uint8_t(sum * 31 + byte);
    const std::size_t size = 9 + sum % (kMaxAdu - 8);
    std::fill(out.begin(), out.end(), sum);
    std::copy_n(adu.begin(), 8, out.begin());
    return size;
}

constexpr std::size_t kSurelyTaken = 32;  // answers, by an empty socket of kSendBuffer

struct Client {
    std::unique_ptr<Connection> connection;
    int fd = -1, server = -1;
    Bytes said, heard;
    std::string closed;
    std::size_t answered = 0;  // bytes
    std::size_t unheard = 0;   // answers since hear() was last called

    explicit Client(int max_per_s) {
        int pair[2];
        check(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair) == 0);
        const int send_buffer = Connection::kSendBuffer;
        ::setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &send_buffer, sizeof send_buffer);
        server = pair[0];
        connection = std::make_unique<Connection>(pair[0], 1, max_per_s);
        fd = pair[1];
    }
    ~Client() { ::close(fd); }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    void say(std::span<const std::uint8_t> bytes) {
        const ssize_t n = ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        if (n > 0) said.insert(said.end(), bytes.begin(), bytes.begin() + n);
    }
    void hear() {
        unheard = 0;
        std::array<std::uint8_t, 65536> bytes;
        for (ssize_t n; (n = ::recv(fd, bytes.data(), bytes.size(), 0)) > 0;)
            heard.insert(heard.end(), bytes.begin(), bytes.begin() + n);
    }
    void serve(std::uint64_t now_ns) {
        if (!closed.empty()) return;
        const bool has_backlog = connection->backlog_ns() != 0 || connection->interest() == EPOLLOUT;
        int n = 0;
        closed = connection->serve(
            [&](std::span<const std::uint8_t> request) {
                ++n;
                std::array<std::uint8_t, kMaxAdu> out;
                const std::size_t length = answer(request, out);
                const ssize_t sent = ::send(server, out.data(), length, MSG_NOSIGNAL);
                if (sent != ssize_t(length)) return std::size_t(0);
                answered += length;
                ++unheard;
                return length;
            },
            now_ns);
        check(n <= 16);
        if (closed == "takes no answers") check(!has_backlog);  // else it waits for room
        if (closed.empty()) (void)connection->overdue(now_ns);
    }
    // The answers that its requests require; false if it has sent bytes that are not Modbus.
    bool owed(Bytes& all) const {
        for (std::size_t used = 0; used < said.size();) {
            std::size_t size = 0;
            const Cut cut = cut_adu(std::span(said).subspan(used), size);
            if (cut == Cut::close) return false;
            if (cut == Cut::more) return true;
            std::array<std::uint8_t, kMaxAdu> out;
            const std::size_t length = answer(std::span(said).subspan(used, size), out);
            all.insert(all.end(), out.begin(), out.begin() + long(length));
            used += size;
        }
        return true;
    }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(data, size);
    const int max_per_s = input.byte() % 2 == 0 ? 0 : 1000;
    std::array<Client, 3> clients{Client(max_per_s), Client(max_per_s), Client(max_per_s)};
    std::uint64_t now_ns = 1;
    while (!input.is_empty()) {
        const unsigned what = input.byte();
        Client& client = clients[what % 3];
        switch (what / 3 % 5) {
            case 0: client.say(input.take(input.byte())); break;
            case 1: {  // a whole request, many times
                const std::uint8_t request[12] = {input.byte(), 0, 0, 0, 0, 6, 1, 4, 0, input.byte(), 0, 2};
                for (unsigned n = input.byte() % 64; n > 0; --n) client.say(request);
                break;
            }
            case 2: client.hear(); break;
            case 3: client.serve(now_ns); break;
            case 4: now_ns += std::uint64_t(input.byte()) * 1'000'000; break;
        }
    }
    for (Client& client : clients) {
        std::size_t before = 0;
        for (int idle = 0; idle < 3 && client.closed.empty(); idle = client.heard.size() == before ? idle + 1 : 0) {
            before = client.heard.size();
            now_ns += 1'000'000'000;
            client.serve(now_ns);
            client.hear();
        }
        client.hear();
        Bytes owed;
        const bool is_modbus = client.owed(owed);
        check(client.heard.size() == client.answered && client.answered <= owed.size() &&
              std::equal(client.heard.begin(), client.heard.end(), owed.begin()));
        if (client.closed == "takes no answers") {
            check(client.unheard > kSurelyTaken);
            continue;
        }
        check(client.answered == owed.size() && client.closed == (is_modbus ? "" : "not Modbus/TCP"));
    }
    return 0;
}
