#include "node/lab/listen.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>

#include "config/text_file.hpp"
#include "drivers/tcp.hpp"
#include "drivers/tty.hpp"
#include "node/ctl/verb.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

// The usual baud rates of devices, the most frequent ones first.
constexpr unsigned kRates[] = {115'200, 921'600, 9600, 57'600, 1'000'000, 460'800, 230'400, 38'400, 19'200};
constexpr unsigned kTcpPort = 1000;
constexpr int kConnectMs = 800;
constexpr std::size_t kMaxBytes = 1u << 20;
constexpr double kText = 0.95;  // share of printable bytes in a text; random bytes have 0.38

std::vector<std::uint8_t> read_for(int fd, double seconds) {
    std::vector<std::uint8_t> bytes;
    std::array<std::uint8_t, 4096> piece;
    const std::uint64_t until_ns = monotonic_ns() + std::uint64_t(seconds * 1e9);
    for (std::uint64_t now_ns = 0; interrupted == 0 && bytes.size() < kMaxBytes && (now_ns = monotonic_ns()) < until_ns;) {
        pollfd waiting{fd, POLLIN, 0};
        if (::poll(&waiting, 1, int((until_ns - now_ns) / 1'000'000 + 1)) <= 0) continue;
        const ssize_t n = ::read(fd, piece.data(), piece.size());
        if (n < 0 && (errno == EAGAIN || errno == EINTR)) continue;
        if (n <= 0) break;  // a hang-up: the bytes so far are evaluated
        bytes.insert(bytes.end(), piece.begin(), piece.begin() + n);
    }
    return bytes;
}

double text_share(const std::vector<std::uint8_t>& bytes) {
    const auto text = std::count_if(bytes.begin(), bytes.end(), [](std::uint8_t byte) {
        return (byte >= ' ' && byte <= '~') || byte == '\r' || byte == '\n' || byte == '\t';
    });
    return bytes.empty() ? 0 : double(text) / double(bytes.size());
}

std::optional<StreamGuess> guess_of(const std::vector<std::uint8_t>& bytes, double seconds) {
    std::optional<StreamGuess> best;
    for (const std::string& name : StreamFormats::names()) {
        const StreamFormat* const format = StreamFormats::find(name);
        if (format == nullptr || format->recognise == nullptr) continue;
        auto guess = format->recognise(bytes, seconds);
        if (guess && (!best || guess->good > best->good)) best = std::move(guess);
    }
    return best;
}

}  // namespace

std::string Heard::keys() const {
    if (!guess) return "";
    if (network) return fmt::format("driver = \"tcp\"\naddress = {}\n{}", toml_text(device), guess->keys);
    // From the root: a daemon sees a relative path from the folder of its own start.
    const std::string path = std::filesystem::absolute(device).lexically_normal().string();
    return fmt::format("driver = \"uart\"\ndevice = {}\nbaud = {}\n{}", toml_text(path), baud, guess->keys);
}

std::string device_of(const std::string& word) {
    if (word.find_first_of("/:") != word.npos) return word;
    for (const char* folder : {"./", "/dev/"}) {
        struct stat file {};
        if (const std::string path = folder + word; ::stat(path.c_str(), &file) == 0 && S_ISCHR(file.st_mode)) return path;
    }
    return "";
}

Heard listen(const std::string& device, unsigned baud, double seconds) {
    Heard heard{.device = device, .bytes = {}, .guess = {}};
    heard.network = device.find('/') == device.npos;
    std::string why;
    const auto hear = [&](int fd) {
        const std::uint64_t began_ns = monotonic_ns();
        heard.bytes = read_for(fd, seconds);
        heard.seconds = double(monotonic_ns() - began_ns) / 1e9;
        ::close(fd);
        heard.guess = guess_of(heard.bytes, heard.seconds);
    };
    if (heard.network) {
        const TcpAddress address = tcp_address(device, kTcpPort);
        if (!address.fault.empty()) throw SetupError(fmt::format("{} {}", in_quotes(device), address.fault));
        const int fd = open_tcp(address, device, kConnectMs, why);
        if (fd < 0) throw SetupError(why);
        hear(fd);
        return heard;
    }
    const bool has_a_rate = is_local_tty(device);  // a pseudo terminal accepts any rate
    Heard best = heard;                            // at the rate at which most of the bytes are text
    for (const unsigned rate : kRates) {
        heard.baud = baud != 0 ? baud : rate;
        const int fd = open_tty(device, {.baud = heard.baud}, why);
        if (fd < 0) throw SetupError(why);
        hear(fd);
        if (heard.guess || baud != 0 || !has_a_rate || interrupted != 0) return heard;
        if (best.baud == 0 || text_share(heard.bytes) > text_share(best.bytes)) best = heard;
    }
    return best;
}

std::string why_no_format(const std::vector<std::uint8_t>& bytes) {
    const std::string shown = printable(bytes, 60);
    const bool has_digits = shown.find_first_of("0123456789") != shown.npos;
    if (text_share(bytes) < kText || !has_digits)
        return fmt::format(
            "of no known format: \"{}\"; send lines of numbers (drivers/wire/ascii_line.md), or try another "
            "--baud",
            shown);
    if (std::none_of(bytes.begin(), bytes.end(), [](std::uint8_t byte) { return byte == '\n' || byte == '\r'; }))
        return fmt::format("no end of a line in \"{}\"; end each frame with one, as Serial.println() does", shown);
    std::string numbers;  // from the second line, because the first one may have lost its beginning
    bool in_number = false;
    int line = 0;
    for (const std::uint8_t byte : bytes) {
        if (byte == '\n' && ++line == 2) break;
        const char c = char(byte);
        const bool part = (c >= '0' && c <= '9') || c == '.' || c == '-';
        if (line == 1 && part) numbers += (in_number || numbers.empty() ? "" : ",") + std::string(1, c);
        in_number = part;
    }
    return fmt::format("numbers with words: \"{}\"; let the device send the numbers alone{} (drivers/wire/ascii_line.md)",
                       shown, numbers.empty() ? "" : fmt::format(", such as \"{}\"", numbers));
}

std::string link_text(const std::string& name, const std::string& keys) {
    return fmt::format("[[link]]\nname = {}\n{}", toml_text(name), keys);
}

NamedDevice device_of_link(const std::string& config, const std::string& link) {
    if (::access(config.c_str(), F_OK) != 0)
        throw SetupError(
            fmt::format("{} is no port in this folder or in /dev, and there is no {} with a [[link]] of this name: give the "
                        "path of a port, such as /dev/ttyACM0, or --config",
                        in_quotes(link), config));
    Problems problems;
    Options root = Options::parse_file(config, problems);
    if (!problems.empty())
        throw SetupError(
            fmt::format("{}\n{} is no port in this folder or in /dev, and its [[link]] cannot be read: give the "
                        "path of a port, such as /dev/ttyACM0, or --config",
                        fmt::join(problems.lines(), "\n"), in_quotes(link)));
    std::vector<std::string> names;
    for (Options& table : root.tables("link")) {
        names.push_back(table.text("name", ""));
        if (names.back() != link) continue;
        const std::string device = table.text(table.has("address") ? "address" : "device", "");
        const auto baud = table.integer("baud", {0, 12'000'000}, 0);
        problems.throw_if_any();
        if (device.empty())
            throw SetupError(
                fmt::format("{}: link {} is no serial port and no TCP device", table.where("name"), in_quotes(link)));
        return {device, unsigned(baud)};
    }
    throw SetupError(fmt::format("{}: link {} {}", config, in_quotes(link), is_unknown(link, names)));
}

std::string printable(const std::vector<std::uint8_t>& bytes, std::size_t max) {
    std::string text;
    for (std::size_t i = 0; i < bytes.size() && i < max; ++i)
        text += bytes[i] >= ' ' && bytes[i] <= '~' ? char(bytes[i]) : '.';
    return text;
}

}  // namespace tactiled::ctl
