// A device with an array of taxels, and a reader of it: the time from sending a frame to reading it in shared memory, of the
// daemon or of a plain program that receives, multiplies and copies. Written from drivers/wire/array_frame.md.
//
//   array_feeder udp|whole|tcp PORT TAXELS VALUES RATE SECONDS [NODE]    PORT: of the device; over UDP it sends to PORT + 1.
//                                                                  Without NODE it only sends. whole: in one datagram
//   array_feeder plain PORT TAXELS VALUES RATE SECONDS             the plain program in the daemon's place, over UDP
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/tcp.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstring>
#include <ctime>
#include <optional>
#include <string>
#include <vector>

#include "tactiled/reader.hpp"

namespace {

using namespace tactiled;

constexpr std::size_t kDatagram = 1472, kWholeDatagram = 40'000;
constexpr std::uint64_t kPatience_ns = 100'000'000;

sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

int udp_socket(int own, int other) {
    const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
    const sockaddr_in here = loopback(own), there = loopback(other);
    if (::bind(fd, reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0 ||
        ::connect(fd, reinterpret_cast<const sockaddr*>(&there), sizeof there) != 0)
        throw std::runtime_error("no socket");
    return fd;
}

int tcp_socket(int port) {
    const int listener = ::socket(AF_INET, SOCK_STREAM, 0), on = 1;
    const sockaddr_in here = loopback(port);
    ::setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (::bind(listener, reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0 || ::listen(listener, 1) != 0)
        throw std::runtime_error("no socket");
    const int fd = ::accept(listener, nullptr, nullptr);
    ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return fd;
}

struct Shape {
    std::size_t taxels, values;
};

template <class T>
void put(std::vector<unsigned char>& out, T value) {
    const auto* const bytes = reinterpret_cast<const unsigned char*>(&value);
    out.insert(out.end(), bytes, bytes + sizeof value);
}

// The pieces of frame `sequence`, i16, each at most `datagram` bytes.
std::vector<std::vector<unsigned char>> pieces(Shape shape, std::size_t datagram, std::uint32_t sequence,
                                               std::uint32_t time_us) {
    const std::size_t most = (datagram - 24) / (2 * shape.values);
    std::vector<std::vector<unsigned char>> all;
    for (std::size_t first = 0; first < shape.taxels; first += most) {
        const std::size_t count = std::min(most, shape.taxels - first);
        std::vector<unsigned char>& out = all.emplace_back(std::vector<unsigned char>{3, 0, 2, 2});
        put(out, sequence), put(out, time_us), put(out, std::uint16_t(shape.taxels));
        out.insert(out.end(), {(unsigned char)shape.values, 0});
        put(out, std::uint16_t(first)), put(out, std::uint16_t(count));
        for (std::size_t k = 0; k < count * shape.values; ++k)
            put(out, std::int16_t((first + k / shape.values) % 64 == 20 ? 500 : (sequence * 7 + k * 13) % 11));
        put(out, std::uint32_t(::crc32(0, out.data(), unsigned(out.size()))));
    }
    return all;
}

std::vector<unsigned char> cobs(const std::vector<unsigned char>& plain) {
    std::vector<unsigned char> out{0};
    std::size_t code = 0;
    for (const unsigned char byte : plain) {
        if (byte != 0) out.push_back(byte);
        if (byte == 0 || out.size() - code == 255) {
            out[code] = (unsigned char)(out.size() - code);
            code = out.size();
            out.push_back(0);
        }
    }
    out[code] = (unsigned char)(out.size() - code);
    out.push_back(0);
    return out;
}

// The shared memory of the plain program.
struct Plain {
    std::atomic<std::uint32_t> lock, sequence;
    float value[std::size_t(4096) * 3];
};

// Receives the pieces, multiplies and copies.
[[noreturn]] void run_plain(int fd, Shape shape, Plain& out) {
    std::vector<unsigned char> in(65536);
    std::vector<float> frame(shape.taxels * shape.values);
    std::size_t have = 0;
    for (;;) {
        const ssize_t size = ::recv(fd, in.data(), in.size(), 0);
        if (size < 24) continue;
        std::uint16_t first = 0, count = 0;
        std::uint32_t sequence = 0;
        std::memcpy(&sequence, &in[4], 4), std::memcpy(&first, &in[16], 2), std::memcpy(&count, &in[18], 2);
        for (std::size_t k = 0; k < count * shape.values; ++k) {
            std::int16_t raw = 0;
            std::memcpy(&raw, &in[20 + 2 * k], 2);
            frame[first * shape.values + k] = 0.001f * float(raw);
        }
        if ((have += count) < shape.taxels) continue;
        have = 0;
        out.lock.fetch_add(1);
        std::copy(frame.begin(), frame.end(), out.value);
        out.sequence.store(sequence);
        out.lock.fetch_add(1);
    }
}

double quantile_us(std::vector<double>& ns, double q) {
    if (ns.empty()) return -1;
    std::sort(ns.begin(), ns.end());
    return ns[std::size_t(q * double(ns.size() - 1))] / 1e3;
}

int run(int argc, char** argv) {
    if (argc < 7) return 2;
    const std::string way = argv[1];
    const int port = std::stoi(argv[2]);
    const Shape shape{std::stoul(argv[3]), std::stoul(argv[4])};
    const double rate = std::stod(argv[5]), seconds = std::stod(argv[6]);
    Plain* plain = nullptr;
    pid_t child = 0;
    if (way == "plain") {
        plain =
            static_cast<Plain*>(::mmap(nullptr, sizeof(Plain), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
        const int fd = udp_socket(port + 1, port);
        if ((child = ::fork()) == 0) run_plain(fd, shape, *plain);
        ::close(fd);
    }
    const int fd = way == "tcp" ? tcp_socket(port) : udp_socket(port, port + 1);
    const bool is_reading = argc > 7 || plain != nullptr;
    std::optional<Reader> reader;
    if (argc > 7) reader.emplace(argv[7], "skin");
    Array array;
    std::vector<double> took_ns;
    std::vector<float> copy(shape.taxels * shape.values);
    unsigned unread = 0;
    timespec due{};
    ::clock_gettime(CLOCK_MONOTONIC, &due);
    for (std::uint32_t k = 1; k <= rate * seconds; ++k) {
        due.tv_nsec += long(1e9 / rate);
        if (due.tv_nsec >= 1'000'000'000) due.tv_nsec -= 1'000'000'000, ++due.tv_sec;
        ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr);
        const auto all = pieces(shape, way == "whole" ? kWholeDatagram : kDatagram, k, std::uint32_t(monotonic_ns() / 1000));
        const std::uint64_t begun_ns = monotonic_ns();
        std::vector<unsigned char> stream;
        for (const auto& piece : all) {
            if (way != "tcp") (void)::send(fd, piece.data(), piece.size(), 0);
            const auto coded = way == "tcp" ? cobs(piece) : piece;
            stream.insert(stream.end(), coded.begin(), coded.end());
        }
        if (way == "tcp" && ::send(fd, stream.data(), stream.size(), MSG_NOSIGNAL) < 0) return 1;
        if (!is_reading) continue;
        bool is_read = false;
        while (!is_read && monotonic_ns() - begun_ns < kPatience_ns) {
            if (plain != nullptr) {
                is_read = plain->sequence.load() == k && plain->lock.load() % 2 == 0;
                if (is_read) std::copy_n(plain->value, copy.size(), copy.begin());
            } else {
                tactiled_sample sample = reader->latest();
                is_read = sample.device_sequence == k && reader->latest(array) && array.head().sample.device_sequence == k;
            }
        }
        if (is_read)
            took_ns.push_back(double(monotonic_ns() - begun_ns));
        else
            ++unread;
    }
    if (is_reading)
        fmt::print("{}: p50 {:.1f} us, p99 {:.1f} us, p99.9 {:.1f} us, {} not read\n", way, quantile_us(took_ns, 0.5),
                   quantile_us(took_ns, 0.99), quantile_us(took_ns, 0.999), unread);
    if (child > 0) ::kill(child, SIGTERM), ::waitpid(child, nullptr, 0);
    return 0;
}

}  // namespace

int main(int argc, char** argv) try { return run(argc, argv); } catch (const std::exception& error) {
    fmt::print(stderr, "array_feeder: {}\n", error.what());
    return 1;
}
