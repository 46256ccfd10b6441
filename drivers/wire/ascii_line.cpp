#include "drivers/wire/ascii_line.hpp"

#include <algorithm>
#include <boost/crc.hpp>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

constexpr std::string_view kBlanks = " \t";

std::string_view trimmed(std::string_view text) noexcept {
    while (!text.empty() && kBlanks.find(text.front()) != std::string_view::npos) text.remove_prefix(1);
    while (!text.empty() && kBlanks.find(text.back()) != std::string_view::npos) text.remove_suffix(1);
    return text;
}

// Returns the text up to the next separator; `line` keeps the rest, `more` is true if there was a separator.
std::string_view cut_cell(std::string_view& line, char separator, bool& more) noexcept {
    std::size_t end = line.find(separator);
    more = end != std::string_view::npos;
    const std::string_view cell = trimmed(line.substr(0, end));
    line.remove_prefix(more ? end + 1 : line.size());
    if (separator == ' ')  // consecutive blanks are one separator
        while (!line.empty() && line.front() == ' ') line.remove_prefix(1);
    return cell;
}

// Chooses commas, else semicolons, else tabs, else blanks.
char separator_of(std::string_view line) noexcept {
    for (const char c : {',', ';', '\t'})
        if (line.find(c) != std::string_view::npos) return c;
    return ' ';
}

template <class T>
bool read_number(std::string_view cell, T& value) noexcept {
    if (cell.size() > 1 && cell.front() == '+' && cell[1] != '-') cell.remove_prefix(1);
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    return error == std::errc{} && end == cell.data() + cell.size();
}

int hex_digit(char c) noexcept {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return -1;
}

constexpr std::size_t kXorDigits = 2, kCrcDigits = 4;

// Computes the checksum with that number of digits.
unsigned checksum_of(std::string_view text, std::size_t digits) noexcept {
    if (digits == kCrcDigits) {
        boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false> crc;  // CRC-16/CCITT-FALSE, as in the binary frames
        crc.process_bytes(text.data(), text.size());
        return crc.checksum();
    }
    std::uint8_t sum = 0;
    for (const char c : text) sum = std::uint8_t(sum ^ std::uint8_t(c));
    return sum;
}

// Returns true if `text` ends with "*" and the checksum of the text before it.
bool has_checksum(std::string_view text, std::size_t star) noexcept {
    const std::size_t digits = text.size() - star - 1;
    if (digits != kXorDigits && digits != kCrcDigits) return false;
    unsigned sum = 0;
    for (const char c : text.substr(star + 1)) {
        const int digit = hex_digit(c);
        if (digit < 0) return false;
        sum = sum << 4 | unsigned(digit);
    }
    return sum == checksum_of(text.substr(0, star), digits);
}

}  // namespace

void AsciiDecoder::reset() noexcept {
    LineDecoder::reset();
    time_seen_ = false;
    sequence_.reset();
}

std::string AsciiDecoder::freshness() const {
    if (format_.time_us) return "clock (time_us)";
    if (format_.sequence) return "sequence (a pause of the device looks like a delay, unless time_us = true)";
    return LineDecoder::freshness();
}

std::string AsciiDecoder::advice() const {
    const std::string no_sequence =
        format_.sequence ? "" : "no sequence: a lost line is not detected; send a counter (sequence = true)";
    if (format_.crc16) return no_sequence;
    const std::string weak =
        format_.checksum
            ? "checksum = \"xor\": of the lines that lost two bytes, one in 14 passes with wrong numbers; send a CRC "
              "(checksum = \"crc16\", drivers/wire/ascii_line.md)"
            : "no checksum: a byte lost from 12.5 reads as 1.5; send a CRC (checksum = \"crc16\", "
              "drivers/wire/ascii_line.md)";
    return no_sequence.empty() ? weak : weak + "; " + no_sequence;
}

bool AsciiDecoder::read_line(std::string_view line, Frame& frame) noexcept {
    const std::string_view text = trimmed(line);
    if (text.empty()) return false;
    if (text.front() == '#') return skip();  // a comment
    const std::size_t star = line.rfind('*');
    if (star == std::string_view::npos) {
        if (format_.checksum || format_.crc16) return reject(TACTILED_LINK_BAD_CHECKSUM);
    } else {
        if (!has_checksum(line, star)) return reject(TACTILED_LINK_BAD_CHECKSUM);
        const std::size_t digits = line.size() - star - 1;
        if (format_.crc16 ? digits != kCrcDigits : format_.checksum && digits != kXorDigits)
            return reject(TACTILED_LINK_BAD_CHECKSUM);
        line = line.substr(0, star);
    }
    if (text.front() == '!') return read_echo(trimmed(line).substr(1));
    // A first line without a checksum may have lost its beginning and still look complete.
    if (!is_synchronised() && star == std::string_view::npos) return reject(TACTILED_LINK_BAD_LENGTH);
    return read_cells(line, frame);
}

// !number,time: the answer to ?number
bool AsciiDecoder::read_echo(std::string_view line) noexcept {
    Echo echo;
    std::uint64_t time_us = 0;
    bool more = true;
    if (!read_number(cut_cell(line, ',', more), echo.number) || !more) return reject(TACTILED_LINK_BAD_VALUE);
    if (!read_number(cut_cell(line, ',', more), time_us) || more) return reject(TACTILED_LINK_BAD_VALUE);
    echo.time_us = std::uint32_t(time_us);
    echo_ = echo;
    return false;
}

bool AsciiDecoder::read_cells(std::string_view line, Frame& frame) noexcept {
    const auto content = std::uint32_t(std::hash<std::string_view>{}(line));
    const char separator = separator_of(line);
    if (separator == ' ') line = trimmed(line);  // else a blank or a tab at an end may bound an empty cell
    std::uint32_t sequence = 0;
    std::uint64_t clock_us = 0;  // the format is modulo 2^32, but devices that print larger times do not wrap there
    bool more = true;
    if (format_.sequence && !read_number(cut_cell(line, separator, more), sequence)) return reject(TACTILED_LINK_BAD_VALUE);
    if (format_.time_us && (!more || !read_number(cut_cell(line, separator, more), clock_us)))
        return reject(TACTILED_LINK_BAD_VALUE);
    const auto time_us = std::uint32_t(clock_us);
    frame = Frame{};
    for (; more; ++frame.n_channels) {
        if (frame.n_channels == format_.channels) return reject(TACTILED_LINK_BAD_LENGTH);
        const std::string_view cell = cut_cell(line, separator, more);
        double& value = frame.channel[frame.n_channels];
        value = std::numeric_limits<double>::quiet_NaN();
        if (!cell.empty() && (!read_number(cell, value) || std::isinf(value))) return reject(TACTILED_LINK_BAD_VALUE);
        if (std::isnan(value)) frame.missing |= 1u << frame.n_channels;
    }
    if (frame.n_channels != format_.channels) return reject(TACTILED_LINK_BAD_LENGTH);

    const auto elapsed_us = std::int32_t(time_us - std::uint32_t(time_us_));
    const bool clock_went_back = format_.time_us && time_seen_ && elapsed_us < 0;
    if (format_.sequence) {
        const unsigned bits = width_.of(sequence);
        const auto verdict = sequence_.next(sequence, bits, content, clock_went_back);
        if (!verdict.accept) {
            ++counts_[TACTILED_LINK_REPEATED];
            return false;
        }
        counts_[TACTILED_LINK_LOST] += verdict.lost;
        frame.lost = verdict.lost;
        put_number(frame, sequence, bits, verdict);
    }
    if (format_.time_us) {
        time_us_ = time_seen_ && !clock_went_back ? time_us_ + std::uint32_t(elapsed_us) : time_us;
        time_seen_ = true;
        frame.device_time_us = time_us_;
    }
    return true;
}

namespace {

// Appends the checksum of the text between `line` and `at`, and the end of the line. Returns the new end.
char* finish_line(const char* line, char* at, const AsciiFormat& format) noexcept {
    if (format.checksum || format.crc16) {
        const std::size_t digits = format.crc16 ? kCrcDigits : kXorDigits;
        const unsigned sum = checksum_of({line, std::size_t(at - line)}, digits);
        *at++ = '*';
        for (std::size_t k = digits; k-- > 0;) *at++ = "0123456789ABCDEF"[sum >> 4 * k & 15];
    }
    *at++ = '\n';
    return at;
}

}  // namespace

std::size_t encode_ascii(const Frame& frame, const AsciiFormat& format, std::span<char, kAsciiMaxBytes * 2> out) noexcept {
    char* at = out.data();
    char* const end = out.data() + out.size() - 8;  // room for "*HHHH\n"
    const auto separate = [&] {
        if (at != out.data()) *at++ = ',';
    };
    if (format.sequence) at = std::to_chars(at, end, frame.sequence).ptr;
    if (format.time_us) {
        separate();
        at = std::to_chars(at, end, std::uint32_t(frame.device_time_us)).ptr;
    }
    for (unsigned k = 0; k < frame.n_channels; ++k) {
        if (k != 0 || at != out.data()) *at++ = ',';
        if ((frame.missing >> k & 1u) == 0) at = std::to_chars(at, end, frame.channel[k]).ptr;
    }
    return std::size_t(finish_line(out.data(), at, format) - out.data());
}

namespace {

std::unique_ptr<StreamDecoder> make(Options& options, LinkCounts& counts) {
    AsciiFormat format;
    format.channels = unsigned(options.integer("channels", {1, double(kMaxChannels)}));
    if (options.holds_text("checksum")) {
        const std::string kind = options.one_of("checksum", {"crc16", "xor"}, "xor");
        format.checksum = true;
        format.crc16 = kind == "crc16";
    } else {
        format.checksum = options.flag("checksum", false);
    }
    format.sequence = options.flag("sequence", false);
    format.time_us = options.flag("time_us", false);
    return std::make_unique<AsciiDecoder>(format, counts);
}

AsciiFormat format_of(const StreamSettings& settings, unsigned channels) {
    return {channels, settings.checksum, settings.sequence, settings.time_us, settings.crc16};
}

std::vector<std::uint8_t> encode(const Frame& frame, const StreamSettings& settings) {
    std::array<char, kAsciiMaxBytes * 2> line;
    const std::size_t n = encode_ascii(frame, format_of(settings, frame.n_channels), line);
    return {line.begin(), line.begin() + std::ptrdiff_t(n)};
}

std::vector<std::uint8_t> answer(std::string_view request, std::uint32_t time_us, const StreamSettings& settings) {
    std::uint32_t number = 0;
    if (!request.starts_with('?') || !read_number(request.substr(1), number)) return {};
    std::array<char, 32> line{'!'};
    char* at = std::to_chars(line.data() + 1, line.data() + 11, number).ptr;
    *at++ = ',';
    at = std::to_chars(at, at + 10, time_us).ptr;
    return {line.data(), finish_line(line.data(), at, format_of(settings, 0))};
}

// Returns the whole lines of a stream, without comments and answers.
std::vector<std::string_view> whole_lines(std::string_view text) {
    std::vector<std::string_view> lines;
    std::size_t at = text.find('\n');
    for (std::size_t end = 0; at != text.npos && (end = text.find('\n', at + 1)) != text.npos; at = end) {
        std::string_view line = text.substr(at + 1, end - at - 1);
        if (line.ends_with('\r')) line.remove_suffix(1);
        line = trimmed(line);
        if (!line.empty() && line.front() != '#' && line.front() != '!') lines.push_back(line);
    }
    return lines;
}

// Returns the cells of a line as numbers, NaN if a cell is empty; empty if a cell is not a number.
std::vector<double> cells_of(std::string_view line) {
    std::vector<double> cells;
    const char separator = separator_of(line);
    for (bool more = true; more;) {
        const std::string_view cell = cut_cell(line, separator, more);
        double value = std::numeric_limits<double>::quiet_NaN();
        if (!cell.empty() && (!read_number(cell, value) || std::isinf(value))) return {};
        cells.push_back(value);
    }
    return cells;
}

// Returns true if column `k` is an integer that increases by one from line to line, except in a tenth of the lines.
bool is_counter(const std::vector<std::vector<double>>& rows, std::size_t k) {
    std::size_t right = 1;
    for (std::size_t i = 1; i < rows.size(); ++i) right += rows[i][k] == rows[i - 1][k] + 1 ? 1 : 0;
    return rows.size() >= 5 && right * 10 >= rows.size() * 9;
}

// Returns true if column `k` is an integer that grows by `units` over all lines, within a factor of two, and
// decreases at most once (it may wrap). Single steps are not evaluated, because a busy device prints in bursts.
bool is_clock(const std::vector<std::vector<double>>& rows, std::size_t k, double units) {
    double grown = 0;
    std::size_t back = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (rows[i][k] != std::floor(rows[i][k])) return false;  // NaN, too
        const double step = i == 0 ? 0 : rows[i][k] - rows[i - 1][k];
        grown += std::max(0.0, step);
        back += step < 0 ? 1 : 0;
    }
    return rows.size() >= 5 && back <= 1 && grown > units / 2 && grown < units * 2;
}

std::optional<StreamGuess> recognise(std::span<const std::uint8_t> bytes, double seconds) {
    constexpr std::size_t kMinLines = 3, kLongestShown = 80;
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const auto lines = whole_lines(text);
    if (lines.size() < kMinLines) return std::nullopt;
    std::size_t of_digits[kCrcDigits + 1] = {};
    for (const auto line : lines)
        if (const std::size_t star = line.rfind('*'); star != line.npos && has_checksum(line, star))
            ++of_digits[line.size() - star - 1];
    const std::size_t digits = of_digits[kCrcDigits] * 2 > lines.size()   ? kCrcDigits
                               : of_digits[kXorDigits] * 2 > lines.size() ? kXorDigits
                                                                          : 0;
    std::map<std::size_t, std::vector<std::vector<double>>> rows_of_width;
    std::map<std::size_t, std::string_view> shown;
    StreamGuess guess;
    const auto refuse = [&](std::string_view line) {
        ++guess.bad;
        guess.last_bad.clear();
        for (const char c : line.substr(0, kLongestShown)) guess.last_bad += c >= ' ' && c <= '~' ? c : '?';
    };
    for (const auto line : lines) {
        const std::size_t star = line.rfind('*');
        const bool right = digits == 0 ? star == line.npos
                                       : star != line.npos && line.size() - star - 1 == digits && has_checksum(line, star);
        const auto cells = right ? cells_of(line.substr(0, star)) : std::vector<double>();
        if (cells.empty())
            refuse(line);
        else
            rows_of_width[cells.size()].push_back(cells), shown[cells.size()] = line;
    }
    const auto widest = std::max_element(rows_of_width.begin(), rows_of_width.end(),
                                         [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
    if (widest == rows_of_width.end() || widest->second.size() * 2 <= lines.size()) return std::nullopt;
    for (const auto& [width, rows] : rows_of_width)
        if (width != widest->first) {
            guess.bad += rows.size() - 1;
            refuse(shown[width]);
        }
    const auto& rows = widest->second;
    std::size_t left = widest->first;
    const bool sequence = left > 1 && is_counter(rows, 0);
    left -= sequence ? 1 : 0;
    const bool time_us = left > 1 && is_clock(rows, sequence ? 1 : 0, 1e6 * seconds);
    left -= time_us ? 1 : 0;
    if (left == 0 || left > kMaxChannels) return std::nullopt;
    guess.good = rows.size();
    guess.keys = "format = \"lines\"\nchannels = " + std::to_string(left) + "\n";
    if (sequence) guess.keys += "sequence = true\n";
    if (time_us) guess.keys += "time_us = true\n";
    if (digits != 0) guess.keys += digits == kCrcDigits ? "checksum = \"crc16\"\n" : "checksum = \"xor\"\n";
    if (!sequence) guess.notes.emplace_back("it sends no counter: a lost line is not detected");
    if (const std::size_t k = sequence ? 1 : 0; !time_us && left > 1 && is_clock(rows, k, 1e3 * seconds))
        guess.notes.emplace_back("column " + std::to_string(k + 1) +
                                 " looks like a clock in milliseconds and would count as a channel: send micros(), or write "
                                 "\"-\" for it in `channels` of the [[sensor]]");
    if (!time_us) guess.notes.emplace_back("it sends no time in microseconds: a delay is not detected");
    if (digits != kCrcDigits) guess.notes.emplace_back("it sends no CRC: a lost byte gives a wrong number");
    return guess;
}

const StreamFormat entry{.name = "lines", .make = make, .encode = encode, .answer = answer, .recognise = recognise};

}  // namespace
}  // namespace tactiled
